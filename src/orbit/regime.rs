//! Kinds of orbits about the Earth.

use crate::elements::Elements;
use crate::units::REV_PER_DAY;
use std::fmt;

/// Gravitational parameter, km^3/s^2, and radius of the Earth, km, in SGP4 (WGS72).
const MU: f64 = 398_600.8;
const EARTH_RADIUS_KM: f64 = 6_378.135;
/// Lower bound of the eccentricity of an eccentric orbit, whatever its period.
const ECCENTRIC: f64 = 0.25;

/// A kind of orbit, by eccentricity and mean motion: the regimes of Space-Track (LEO, MEO, GEO,
/// HEO), extended so that every orbit has one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Regime {
    /// LEO: more than 11.25 revolutions a day.
    Low,
    /// MEO: between LEO and GEO.
    Medium,
    /// GEO: 0.95 to 1.05 revolutions a day, with any inclination.
    Geosynchronous,
    /// HEO: an eccentricity of 0.25 or more.
    Eccentric,
    /// Fewer than 0.95 revolutions a day.
    High,
}

impl Regime {
    /// All kinds.
    pub const ALL: [Regime; 5] = [
        Regime::Low,
        Regime::Medium,
        Regime::Geosynchronous,
        Regime::Eccentric,
        Regime::High,
    ];
}

impl fmt::Display for Regime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Regime::Low => "LEO",
            Regime::Medium => "MEO",
            Regime::Geosynchronous => "GEO",
            Regime::Eccentric => "HEO",
            Regime::High => "beyond GEO",
        })
    }
}

impl Elements {
    /// The kind of orbit.
    pub fn regime(&self) -> Regime {
        let a_day = self.mean_motion / REV_PER_DAY;
        match a_day {
            _ if self.eccentricity >= ECCENTRIC => Regime::Eccentric,
            _ if a_day > 11.25 => Regime::Low,
            _ if a_day > 1.05 => Regime::Medium,
            _ if a_day >= 0.95 => Regime::Geosynchronous,
            _ => Regime::High,
        }
    }

    /// Period, min.
    pub fn period_min(&self) -> f64 {
        std::f64::consts::TAU / self.mean_motion
    }

    /// Whether it is a deep-space orbit: its period is at least 225 min. SDP4 then adds Sun, Moon
    /// and resonances.
    pub fn is_deep(&self) -> bool {
        self.period_min() >= 225.0
    }

    /// Heights of perigee and apogee above the equatorial radius, km, of the Kepler orbit with this
    /// mean motion; accurate to some 10 km.
    pub fn heights_km(&self) -> [f64; 2] {
        // a = (mu / n^2)^(1/3), Vallado, Fundamentals of Astrodynamics, Eq. (1-27)
        let n = self.mean_motion / 60.0;
        let axis = libm::cbrt(MU / (n * n));
        [1.0 - self.eccentricity, 1.0 + self.eccentricity]
            .map(|ratio| axis * ratio - EARTH_RADIUS_KM)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hifitime::Epoch;

    #[test]
    fn well_known_orbits_have_their_kind() {
        // X-Val: rounded mean elements of well-known orbits: heights of perigee and apogee to 1 %.
        for (rev_per_day, eccentricity, kind, deep, heights) in [
            (15.5, 0.0005, "LEO", false, [411.0, 418.0]),
            (2.00563, 0.01, "MEO", true, [19_916.0, 20_447.0]),
            (1.00273, 0.0002, "GEO", true, [35_778.0, 35_795.0]),
            (2.006, 0.72, "HEO", true, [1_057.0, 39_305.0]),
            (0.25, 0.1, "beyond GEO", true, [89_260.0, 110_510.0]),
        ] {
            let elements = Elements {
                norad: 1,
                epoch: Epoch::from_gregorian_utc_at_midnight(2026, 1, 1),
                inclination: 1.0,
                node: 0.0,
                eccentricity,
                perigee: 0.0,
                mean_anomaly: 0.0,
                mean_motion: rev_per_day * REV_PER_DAY,
                drag: 0.0,
            };
            assert_eq!(elements.regime().to_string(), kind);
            assert_eq!(elements.is_deep(), deep, "{kind}");
            for (found, wanted) in elements.heights_km().into_iter().zip(heights) {
                assert!(
                    (found / wanted - 1.0).abs() < 0.01,
                    "{kind}: {found} {wanted}"
                );
            }
        }
    }
}
