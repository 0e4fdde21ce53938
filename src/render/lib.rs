//! The renderer: a vehicle state goes in, a labelled frame comes out. It knows no wire and opens no
//! files but its own tables.
//!
//! ```text
//! VehicleState -> View -> Scene -> Plan -> Frame + Label
//! ```
//!
//! In reading order: [`attitude`] holds the conventions; [`camera`] is the instrument; [`sky`] is what
//! is up there; [`scene`] is what one exposure sees of it; [`effect`], [`plan`] and [`render`] turn it
//! into a [`frame`]; [`label`] says what is in it; [`engine`] drives them. [`kernels`] holds the loops
//! that take the time.

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
