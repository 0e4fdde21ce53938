//! The renderer: from a vehicle state to a labelled frame. It uses no links, and no files except
//! camera files and its own tables.
//!
//! ```text
//! VehicleState -> View -> Scene -> Plan -> Frame + Label
//! ```
//!
//! In reading order: [`attitude`] has the conventions, [`camera`] the instrument, [`sky`] the
//! stars, bodies and objects, [`scene`] the images of one exposure. [`effect`], [`plan`] and
//! [`render`] compute the [`frame`], [`label`] its description. [`engine`] runs all of them.
//! [`kernels`] has the pixel loops.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod attitude;
pub mod camera;
pub mod effect;
pub mod engine;
pub mod fidelity;
pub mod footprint;
pub mod frame;
pub mod kernels;
pub mod label;
pub mod light_curve;
pub mod plan;
mod reduce;
pub mod render;
pub mod render_pool;
pub mod scene;
pub mod sensitivity;
pub mod sky;
pub mod track;
