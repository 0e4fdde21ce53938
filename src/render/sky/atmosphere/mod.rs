//! The Earth's atmosphere from space: scattered sunlight, and airglow.
//!
//! [`air`] has density, columns and scattering, [`airglow`] the emitting layers. [`Atmosphere`] has
//! both in one band, made once per camera. [`Limb`] is its light for one frame, in every direction:
//! above the limb, and in front of the ground.
//!
//! Sunlight is scattered once between the Sun and the line of sight, and dimmed on both paths. Of
//! multiple scattering only the light from below is included: each point of the line is also lit by
//! the day side, a Lambert surface.
//!
//! ```text
//! L = 1/(4 pi) sum over wavelengths of E s  integral n [direct + from below] dl
//! direct     = P(t) V exp(-s (N_v + N_s))
//! from below = 2 A c (1 - sqrt(1 - (R/r)^2)) V exp(-s N_v)
//! ```
//!
//! with the Sun's photon irradiance `E`, the cross-section `s`, the density `n`, the phase function
//! `P` of the scattering angle `t`, the columns `N_v` to the observer and `N_s` to the Sun, the
//! visible part `V` of the Sun's disc, the albedo `A`, the cosine `c` of the Sun's zenith distance
//! and the radius `r` (Chandrasekhar 1960, Radiative Transfer, for single scattering). In twilight
//! only the air above the Earth's shadow is sunlit.
//!
//! Valid for clear air from 350 to 1100 nm: by day 3 to 25 % below a full calculation from 10 to 80
//! km of tangent altitude (tests/physics/limb.rs). Omitted: clouds and dust (some tens of per cent
//! of the limb below 20 km, more in the red), ozone (the yellow, below 30 km), multiple scattering
//! in twilight, refraction, the day's airglow and aurora.

pub mod air;
pub mod airglow;
mod curve;
mod limb;
mod model;
mod shells;
mod sight;
mod tables;

pub use air::{Air, TOP_M};
pub use airglow::Airglow;
pub use limb::Limb;
pub use model::Atmosphere;
