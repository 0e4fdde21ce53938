//! A set of mean elements, and its propagation by SGP4/SDP4 (Vallado et al., AIAA 2006-6753) with
//! the constants of WGS72. Error against that paper's vectors: at most 4.3 mm and 1.9e-6 m/s
//! (`tests/sgp4_verification.rs`).

use crate::{StateVector, time};
use hifitime::Epoch;
use nalgebra::Vector3;

/// Largest propagation time, days: a century. It bounds the work of the deep-space integrator.
pub const MAX_ELAPSED_DAYS: f64 = 100.0 * 365.25;

/// Radius of the Earth in the model, m (WGS72).
pub(crate) const EARTH_RADIUS_M: f64 = 6_378_135.0;

/// A set of mean elements from a TLE or OMM: rad, rad/min. 80 bytes, to keep large catalogues
/// small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elements {
    /// Catalogue number, of up to nine digits; Alpha-5 numbers are decoded (`A0000` is 100000).
    pub norad: u32,
    /// Epoch of the elements.
    pub epoch: Epoch,
    /// Inclination, rad.
    pub inclination: f64,
    /// Right ascension of the ascending node, rad.
    pub node: f64,
    /// Eccentricity, 0 to 1.
    pub eccentricity: f64,
    /// Argument of perigee, rad.
    pub perigee: f64,
    /// Mean anomaly, rad.
    pub mean_anomaly: f64,
    /// Kozai mean motion, rad/min.
    pub mean_motion: f64,
    /// Drag term B*, 1/Earth radii.
    pub drag: f64,
}

/// Why SGP4 cannot start from a set of elements.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("SGP4 cannot start from these elements: {0}")]
pub struct ModelError(String);

impl ModelError {
    pub(crate) fn new(reason: String) -> Self {
        Self(reason)
    }
}

/// Why SGP4 has no state at an epoch. [`PropagationError::code`] gives the code of the reference
/// implementation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PropagationError {
    /// The mean eccentricity left its range.
    #[error("the mean eccentricity {eccentricity} is not in -0.001 to 1")]
    Eccentricity {
        /// That eccentricity.
        eccentricity: f64,
    },
    /// The mean motion is not above 0.
    #[error("the mean motion is not above 0")]
    MeanMotion,
    /// The eccentricity, perturbed by Sun and Moon, left its range.
    #[error("the eccentricity, perturbed by Sun and Moon, is {eccentricity}, not in 0 to 1")]
    PerturbedEccentricity {
        /// That eccentricity.
        eccentricity: f64,
    },
    /// The semi-latus rectum is below 0.
    #[error("the semi-latus rectum is below 0")]
    SemiLatusRectum,
    /// The position is inside the Earth. Where J2 makes the radius negative, the `sgp4` crate gives
    /// a point on the other side of the centre. [`sgp4_batch`](crate::sgp4_batch) reports this case
    /// as decayed, as the reference does (1 of 392,157 states of public catalogues).
    #[error("the object has decayed: SGP4 puts it {depth_km:.1} km inside the Earth")]
    Decayed {
        /// Depth below the equatorial radius, km.
        depth_km: f64,
    },
    /// The model gave numbers that are not finite.
    #[error("SGP4 gave numbers that are not finite")]
    NotFinite,
    /// The epoch is farther from the elements than [`MAX_ELAPSED_DAYS`].
    #[error("it is {days:.0} days from the epoch of the elements, more than {MAX_ELAPSED_DAYS:.0}")]
    TooFar {
        /// Days from the epoch of the elements.
        days: f64,
    },
    /// SGP4 cannot start from the elements.
    #[error(transparent)]
    Model(#[from] ModelError),
}

impl PropagationError {
    /// The code of the reference implementation (Vallado et al., and PyPI sgp4), or 0.
    pub fn code(&self) -> u8 {
        match self {
            Self::Eccentricity { .. } => 1,
            Self::MeanMotion => 2,
            Self::PerturbedEccentricity { .. } => 3,
            Self::SemiLatusRectum => 4,
            Self::Decayed { .. } => 6,
            Self::NotFinite | Self::TooFar { .. } | Self::Model(_) => 0,
        }
    }
}

impl From<sgp4::Error> for PropagationError {
    fn from(error: sgp4::Error) -> Self {
        match error {
            sgp4::Error::OutOfRangeEccentricity { eccentricity, .. } => {
                Self::Eccentricity { eccentricity }
            }
            sgp4::Error::OutOfRangePerturbedEccentricity { eccentricity, .. } => {
                Self::PerturbedEccentricity { eccentricity }
            }
            sgp4::Error::NegativeSemiLatusRectum { .. } => Self::SemiLatusRectum,
        }
    }
}

impl Elements {
    /// Brouwer's mean elements. Fails where [`Elements::constants`] fails, at a tenth of the cost.
    pub fn orbit(&self) -> Result<sgp4::Orbit, ModelError> {
        let orbit = sgp4::Orbit::from_kozai_elements(
            &sgp4::WGS72,
            self.inclination,
            self.node,
            self.eccentricity,
            self.perigee,
            self.mean_anomaly,
            self.mean_motion,
        )
        .map_err(|error| ModelError(error.to_string()))?;
        if orbit.eccentricity < 0.0 || orbit.eccentricity >= 1.0 {
            let error = sgp4::OutOfRangeEpochEccentricity(orbit.eccentricity);
            return Err(ModelError(error.to_string()));
        }
        Ok(orbit)
    }

    /// The model's constants: WGS72 and the IAU sidereal time, as the published vectors need.
    pub fn constants(&self) -> Result<sgp4::Constants, ModelError> {
        sgp4::Constants::new(
            sgp4::WGS72,
            sgp4::iau_epoch_to_sidereal_time,
            // UTC years of 365.25 days since J2000
            time::utc_days_since_j2000(self.epoch) / 365.25,
            self.drag,
            self.orbit()?,
        )
        .map_err(|error| ModelError(error.to_string()))
    }

    /// Minutes of atomic time from the epoch of the elements to `t`.
    pub fn minutes_to(&self, t: Epoch) -> f64 {
        // TAI differences include the leap seconds.
        let elapsed = t.to_tai_duration() - self.epoch.to_tai_duration();
        elapsed.total_nanoseconds() as f64 / 60e9
    }

    /// The state at `t` in TEME of date, m and m/s.
    pub fn state_teme(&self, t: Epoch) -> Result<StateVector, PropagationError> {
        self.state_teme_after(self.minutes_to(t))
    }

    /// The state a number of minutes after the epoch of the elements, in TEME of date, m and m/s.
    pub fn state_teme_after(&self, minutes: f64) -> Result<StateVector, PropagationError> {
        let days = minutes.abs() / 1440.0;
        if days.is_nan() || days > MAX_ELAPSED_DAYS {
            return Err(PropagationError::TooFar { days });
        }
        let prediction = self
            .constants()?
            .propagate(sgp4::MinutesSinceEpoch(minutes))?;
        let state = StateVector {
            position_m: Vector3::from(prediction.position) * 1e3,
            velocity_m_s: Vector3::from(prediction.velocity) * 1e3,
        };
        if !state.is_finite() {
            return Err(PropagationError::NotFinite);
        }
        let depth_m = EARTH_RADIUS_M - state.position_m.norm();
        if depth_m > 0.0 {
            return Err(PropagationError::Decayed {
                depth_km: depth_m / 1e3,
            });
        }
        Ok(state)
    }
}
