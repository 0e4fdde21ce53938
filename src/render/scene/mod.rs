//! The scene of one exposure: computed once, read-only afterwards.
//!
//! First the [`View`]: sources in the field, before the optics ([`build_view`], [`add_areas`]).
//! Then the [`Scene`]: the image of every source on the detector, with the frame's effects
//! ([`EffectSet`], [`build_scene`]). [`bounds`] computes the error without an effect.

mod area;
mod blooming;
pub mod bounds;
mod charge;
mod collected;
mod content;
mod disc;
mod effect_set;
mod exposure;
mod flood;
mod imaging;
mod lit;
mod moonlight;
mod observable;
mod observe;
mod planets;
mod signal;
mod solar_system;
mod source;
mod stages;
mod struck;
mod transfer_smear;
mod view;
mod work;
mod world;

pub use area::{
    Area, AreaLight, BLURRED_NS, EDGE_NS, Edge, Found, Full, Horizon, Kind, Light, NO_ORBIT,
    Radiance, RasterWork, SPREAD_NS, Surroundings, TotalAreaLight, is_flooded, lit_by,
    not_in_field,
};
pub use blooming::{BloomingColumns, drawn_e};
pub use bounds::cells::CELL;
pub use charge::{columns_e, expected_e, in_groups, struck_e};
pub use content::Scene;
pub use effect_set::{EffectId, EffectSet};
pub use exposure::Exposure;
pub use flood::{flooded_by, full_part};
pub use imaging::track_all;
pub use lit::Lit;
pub use moonlight::moons_light;
pub(crate) use observable::two_figures;
pub use observable::{MAX_TURN, Unobservable, above_the_moon, shutter, turn_at};
pub use observe::{add_areas, build_view};
pub use solar_system::{MOON, SeenSun, VisiblePlanet};
pub use source::{Body, Candidate, Hidden, Source};
pub use stages::build_scene;
pub use struck::Struck;
pub use view::{Faint, OBJECT_NS, Unknown, View};
pub use work::{Work, areas_smear_ms, still_evaluations, still_ms, work};
pub use world::World;
