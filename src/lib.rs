//! skyloop: a hardware-in-the-loop star-tracker emulator.
//!
//! One straight corridor; each value is made once, by one room, and only read afterwards:
//!
//! ```text
//! bytes -> Command -> VehicleState -> View -> Scene -> Plan -> Frame + Label -> Reply -> bytes
//! ```
//!
//! In reading order: [`attitude`] holds the conventions; [`config`] and [`camera`] what a user writes;
//! [`sky`] and [`skyloop_orbit`] what is up there; [`scene`] what one exposure sees of it; [`effect`],
//! [`plan`] and [`render`] turn that into a [`frame`]; [`label`] says what is in it; [`engine`] drives
//! them; [`kernels`] are the loops that take the time; [`light_curve`] follows one object without a frame, [`passes`] says which cross the field; [`link`] and [`serve`] connect them to a wire; [`output`] writes files.
//! Around a run that must keep time: [`realtime`] asks the system for help, [`timing`] holds what was measured, [`metrics`] and [`stats`] show it,
//! [`host`] says what the machine did meanwhile, [`soak`] judges.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod abort;
pub mod attitude;
pub mod camera;
pub mod config;
mod crew;
pub mod effect;
pub mod engine;
pub mod fidelity;
pub mod flight;
pub mod footprint;
pub mod frame;
pub mod host;
pub mod kernels;
pub mod label;
mod lanes;
pub mod light_curve;
pub mod link;
pub mod load;
pub mod measure;
pub mod metrics;
pub mod output;
pub mod passes;
pub mod plan;
mod range;
pub mod realtime;
pub mod render;
pub mod rng;
pub mod scene;
pub mod sensitivity;
pub mod serve;
pub mod sky;
pub mod soak;
pub mod stats;
pub mod timing;
pub mod track;

pub use skyloop_orbit as orbit;
