//! The camera: optics and detector as one validated value, read from a TOML file.

mod band;
mod detector;
mod device;
mod file;
mod frustum;
mod limits;
mod optics;
mod pattern;
mod projection;
pub mod psf;
mod radiation;
mod shutter;
mod stray;
mod vignetting;

pub use band::{Band, SUN_MAGNITUDE};
pub use detector::{Blooming, Detector};
pub use device::Camera;
pub use frustum::Side;
pub use limits::{EXPOSURE_S, GAIN_E_PER_DN, RATE_HZ};
pub use optics::Optics;
pub use pattern::{Pattern, PatternStats};
pub use projection::{Model, Projection};
pub use psf::{LocalPsf, Psf, Stamp};
pub use radiation::{Event, Flux, MAX_WORK_AN_EVENT, Radiation};
pub use shutter::Shutter;
pub use stray::Stray;
pub use vignetting::Vignetting;
