//! Area sources: a radiance by direction over the whole field, rasterized.
//!
//! In reading order: a source is a [`Radiance`], created by its [`Kind`] (`surroundings`,
//! `horizon`). `plane` gives the direction and the solid angle of each pixel. `rasterize` evaluates
//! the radiance on an adaptive `grid` and interpolates (`lines`); pixels at edges and fine detail
//! are `sampled` and blurred (`blur`, `near`), and stored as `runs`. The result is a [`Light`]: of
//! one source an [`AreaLight`], of all the [`TotalAreaLight`] (`together`).

pub mod area_light;
pub mod blur;
pub mod full;
mod grid;
pub mod horizon;
pub mod image;
pub mod kind;
mod known;
pub mod light;
mod lines;
pub mod motion;
mod near;
mod patch;
pub mod plane;
pub mod radiance;
pub mod raster_work;
mod rasterize;
mod runs;
pub mod sampled;
pub mod surroundings;
pub mod together;

pub use area_light::AreaLight;
pub use blur::{BLURRED_NS, SPREAD_NS};
pub use full::Full;
pub use horizon::Horizon;
pub use image::{is_flooded, lit_by};
pub use kind::Kind;
pub use light::Light;
pub use radiance::{Area, Edge, Found, Radiance};
pub use raster_work::RasterWork;
pub use sampled::EDGE_NS;
pub use surroundings::{NO_ORBIT, Surroundings, not_in_field};
pub use together::TotalAreaLight;
