//! The kind of orbit of an object.

use super::constants::{Method, ModelConstants, Resonance, Resonant};
use crate::elements::{Elements, ModelError};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Lower bound of the mean motion (rad/min) of near-Earth orbits: one revolution in 225 min.
const NEAR: f64 = TAU / 225.0;
/// Range of mean motions in resonance with a day, without its ends.
const ONE_DAY: [f64; 2] = [0.003_490_658_5, 0.005_235_987_7];
/// Range of mean motions in resonance with half a day, and the least eccentricity for it.
const HALF_DAY: (RangeInclusive<f64>, f64) = (8.26e-3..=9.24e-3, 0.5);

/// Kinds of orbits, in the order of their blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OrbitKind {
    Near,
    Deep,
    OneDay,
    HalfDay,
}

impl OrbitKind {
    /// The kind of an orbit, by the bounds of Vallado et al., AIAA 2006-6753.
    ///
    /// # Errors
    ///
    /// The model cannot start from the elements.
    pub fn of(elements: &Elements) -> Result<OrbitKind, ModelError> {
        let orbit = elements.orbit()?;
        let n = orbit.mean_motion;
        let (half_day, eccentric) = HALF_DAY;
        Ok(if n > NEAR {
            OrbitKind::Near
        } else if n > ONE_DAY[0] && n < ONE_DAY[1] {
            OrbitKind::OneDay
        } else if half_day.contains(&n) && orbit.eccentricity >= eccentric {
            OrbitKind::HalfDay
        } else {
            OrbitKind::Deep
        })
    }

    /// The SGP4 constants of an orbit of this kind.
    ///
    /// # Errors
    ///
    /// The model cannot start from the elements, or the `sgp4` crate assigns another kind.
    pub fn constants(self, elements: &Elements) -> Result<ModelConstants, ModelError> {
        let constants = ModelConstants::of(&elements.constants()?)?;
        let theirs = match &constants.method {
            Method::NearEarth { .. } => OrbitKind::Near,
            Method::DeepSpace { resonant, .. } => match resonant {
                Resonant::No { .. } => OrbitKind::Deep,
                Resonant::Yes { resonance, .. } => match resonance {
                    Resonance::OneDay(_) => OrbitKind::OneDay,
                    Resonance::HalfDay(_) => OrbitKind::HalfDay,
                },
            },
        };
        if theirs != self {
            let reason = format!(
                "its mean motion makes it {self:?}, the sgp4 crate {theirs:?}; leave it out, and report its elements"
            );
            return Err(ModelError::new(reason));
        }
        Ok(constants)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hifitime::Epoch;

    fn set(mean_motion: f64, eccentricity: f64) -> Elements {
        Elements {
            norad: 1,
            epoch: Epoch::from_gregorian_utc_at_midnight(2026, 6, 1),
            inclination: 0.7,
            node: 1.0,
            eccentricity,
            perigee: 2.0,
            mean_anomaly: 3.0,
            mean_motion,
            drag: 1e-4,
        }
    }

    /// Bounds of kinds equal those of the `sgp4` crate, to the last digit.
    #[test]
    fn bounds_equal_those_of_the_crate() {
        let (half_day, eccentric) = HALF_DAY;
        let motions = [
            NEAR,
            ONE_DAY[0],
            ONE_DAY[1],
            *half_day.start(),
            *half_day.end(),
        ];
        let below = eccentric.next_down();
        let mut changes = 0;
        for (motion, eccentricity) in motions
            .iter()
            .flat_map(|motion| [0.01, below, eccentric].map(|e| (*motion, e)))
        {
            let site = |n: f64| OrbitKind::of(&set(n, eccentricity)).unwrap();
            // Bisect the Kozai mean motion at which Brouwer's passes the bound.
            let [mut low, mut high] = [0.99 * motion, 1.01 * motion];
            changes += usize::from(site(low) != site(high));
            while high > low.next_up() {
                let middle = 0.5 * (low + high);
                if site(middle) == site(0.99 * motion) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            for n in [low.next_down(), low, high, high.next_up()] {
                let set = set(n, eccentricity);
                assert!(
                    OrbitKind::of(&set).unwrap().constants(&set).is_ok(),
                    "{n} {eccentricity}"
                );
            }
        }
        // Three bounds at each eccentricity, and the two of half a day at the highest.
        assert_eq!(changes, 3 * 3 + 2);
    }

    /// `Elements::orbit` refuses the same elements as the crate's constants.
    #[test]
    fn elements_are_refused_as_by_the_crate() {
        let [nan, infinite] = [f64::NAN, f64::INFINITY];
        let mut refused = 0;
        for n in [
            -0.01, 0.0, 1e-300, 1e-3, 0.06, 0.1, 1e3, 1e300, infinite, nan,
        ] {
            for e in [-1e-300, 0.0, 0.5, 1f64.next_down(), 1.0, 1.5, infinite, nan] {
                let set = set(n, e);
                let crates =
                    sgp4::Orbit::from_kozai_elements(&sgp4::WGS72, 0.7, 1.0, e, 2.0, 3.0, n)
                        .is_ok_and(|orbit| {
                            sgp4::Constants::new(
                                sgp4::WGS72,
                                sgp4::iau_epoch_to_sidereal_time,
                                26.4,
                                1e-4,
                                orbit,
                            )
                            .is_ok()
                        });
                assert_eq!(set.orbit().is_ok(), crates, "{n} {e}");
                refused += usize::from(!crates);
            }
        }
        assert!(refused > 0);
    }
}
