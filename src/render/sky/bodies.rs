//! Positions of the Earth, the Sun and the Moon.
//!
//! Frames: axes of the ICRF throughout. Positions are geometric (no light time) and in metres,
//! velocities in metres per second. The series are SOFA's `epv00` and, for the Moon,
//! [`series`](super::moon). `epv00` is in TDB; TT is used instead: it differs by less than 2 ms, in
//! which the Earth moves 60 m.

pub use super::constants::{AU_M, LIGHT_M_S, SUN_RADIUS_M};

use super::constants::{DAY_S, J2000_JD, tt_days_since_j2000};
use super::moon::series;
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::time::utc_text;
use thiserror::Error;

/// The epoch is outside the years of the series for the Earth's motion.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error(
    "no Earth and Sun positions for {}: the series hold from 1900 to 2100; choose an epoch inside",
    utc_text(*epoch)
)]
pub struct EpochOutOfRange {
    /// The requested epoch.
    pub epoch: Epoch,
}

/// The Earth, the Sun and the Moon at one instant.
///
/// Errors over 1991 to 2060 against JPL DE440: Earth against Sun 12 km (0.017 arcsec in the Sun's
/// direction), velocity 4 mm/s (3 microarcsec of aberration). The barycentre is 125 km from
/// DE440's, which includes the Kuiper belt: 1 microarcsec at 1 arcsec of parallax. The Moon: 7.9
/// arcsec (rms 1.6) in direction, 13 km in distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bodies {
    /// Solar-system barycentre to the Earth's centre, m.
    pub earth_barycentric_m: Vector3<f64>,
    /// Velocity of the Earth's centre against the solar-system barycentre, m/s.
    pub earth_barycentric_velocity_m_s: Vector3<f64>,
    /// Earth's centre to the Sun's centre, m, geometric.
    pub sun_geocentric_m: Vector3<f64>,
    /// Earth's centre to the Moon's centre, m, geometric.
    pub moon_geocentric_m: Vector3<f64>,
    /// Velocity of the Moon's centre against the Earth's, m/s.
    pub moon_geocentric_velocity_m_s: Vector3<f64>,
}

impl Bodies {
    /// Positions at `t`. Takes tens of microseconds: compute them once per frame.
    pub fn at(t: Epoch) -> Result<Self, EpochOutOfRange> {
        let days = tt_days_since_j2000(t);
        let (heliocentric, barycentric) =
            sofars::eph::epv00(J2000_JD, days).ok_or(EpochOutOfRange { epoch: t })?;
        let (moon_geocentric_m, moon_geocentric_velocity_m_s) = series::state(t);
        Ok(Self {
            earth_barycentric_m: Vector3::from(barycentric[0]) * AU_M,
            earth_barycentric_velocity_m_s: Vector3::from(barycentric[1]) * (AU_M / DAY_S),
            sun_geocentric_m: Vector3::from(heliocentric[0]) * -AU_M,
            moon_geocentric_m,
            moon_geocentric_velocity_m_s,
        })
    }

    /// `dt_s` seconds later, by linear extrapolation. Over 5 minutes the Sun is 4 km off and the
    /// Moon 0.2 km, over 5000 s 130 km and 40 km: 0.1 and 0.5 arcsec from the Earth's centre.
    pub fn after(&self, dt_s: f64) -> Self {
        // The Sun's own motion, 13 m/s, is omitted.
        let path_m = self.earth_barycentric_velocity_m_s * dt_s;
        Self {
            earth_barycentric_m: self.earth_barycentric_m + path_m,
            sun_geocentric_m: self.sun_geocentric_m - path_m,
            moon_geocentric_m: self.moon_geocentric_m + self.moon_geocentric_velocity_m_s * dt_s,
            ..*self
        }
    }

    /// Earth's centre to the apparent Sun near the Earth, m: the geometric Sun aberrated by the
    /// Earth's velocity, some 20.5 arcsec from it.
    ///
    /// Use this Sun with geocentric positions for shadows and phase angles: in the frame that moves
    /// with the Earth, sunlight arrives from the aberrated direction. (The Sun itself moves 13 m/s:
    /// its light time adds 0.01 arcsec.)
    pub fn sun_apparent_m(&self) -> Vector3<f64> {
        let distance = self.sun_geocentric_m.norm();
        aberrate(
            self.sun_geocentric_m / distance,
            self.earth_barycentric_velocity_m_s,
        ) * distance
    }
}

/// The apparent direction, for an observer with the velocity `velocity_m_s`, of light that an
/// observer at rest sees along the unit vector `u`. Unit vector.
pub fn aberrate(u: Vector3<f64>, velocity_m_s: Vector3<f64>) -> Vector3<f64> {
    Aberration::by(velocity_m_s).of(u)
}

/// The aberration for a moving observer.
///
/// With b = v/c and 1/g = sqrt(1 - b^2), special relativity gives
///
/// ```text
/// u' = (u / g + b + (u . b) b / (1 + 1/g)) / (1 + u . b)
/// ```
///
/// (Explanatory Supplement to the Astronomical Almanac, 3rd ed., 2013, Eq. 7.40.)
#[derive(Debug, Clone, Copy)]
pub(super) struct Aberration {
    beta: Vector3<f64>,
    inverse_gamma: f64,
}

impl Aberration {
    pub(super) fn by(velocity_m_s: Vector3<f64>) -> Aberration {
        let beta = velocity_m_s / LIGHT_M_S;
        Aberration {
            beta,
            inverse_gamma: (1.0 - beta.norm_squared()).sqrt(),
        }
    }

    pub(super) fn of(&self, u: Vector3<f64>) -> Vector3<f64> {
        let Aberration {
            beta,
            inverse_gamma,
        } = *self;
        let along = u.dot(&beta);
        let seen = u * inverse_gamma + beta * (1.0 + along / (1.0 + inverse_gamma));
        seen.normalize()
    }
}
