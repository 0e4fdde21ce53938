//! Flux of charged particles through the detector, by position: galactic cosmic rays, reduced by
//! the Earth's magnetic field, and the South Atlantic Anomaly. A simple model of mean rates.
//!
//! Galactic cosmic rays and their secondaries from the spacecraft, by the cutoff rigidity R (GV) of
//! the field:
//!
//! ```text
//! f = f_0 (1 - exp(-10.275 R^-0.9615))
//! R = 15.062 cos^4(L) - 0.363
//! cos^2(L) = cos^2(geomagnetic latitude) r_E / r
//! ```
//!
//! The first is the latitude curve of neutron monitors (Dorman et al. 2000, JGR 105, 21047), the
//! second the cutoff by invariant latitude L up to 64 deg (Ogliore et al. 2001, Proc. ICRC 27,
//! 4112), the third a dipole with its pole at 80.7 N, 72.7 W (IGRF-13, 2020).
//!
//! Assumed: detectors in orbit follow this curve, which was measured at sea level. `f_0` = 1.8
//! /cm^2/s gives 1.2 at the mean cutoff of the Hubble's orbit, 9 to 10 GV: WF/PC-1 counted 1.7
//! events per second on 1.44 cm^2 (HST Data Handbook, section 46.5). Independent counts, all in the
//! test below: NICMOS 1.1 to 1.5 /cm^2/s in that orbit; WFC3's infrared array, which detects
//! fainter events, 3.3; far outside the Earth's field JWST's NIRSpec 4.3 to 2.3 from 2022 to 2025,
//! by the solar cycle, which is omitted here. Error: a factor 1.5 for CCDs at the Hubble's orbit, 3
//! elsewhere (too few).
//!
//! The anomaly, a Gaussian in longitude and latitude over an altitude law:
//!
//! ```text
//! f = 1100 exp(-(dlon / 16)^2 / 2 - (dlat / 9)^2 / 2) exp((h - 538) / 100)
//! ```
//!
//! in /cm^2/s, deg and km, with h limited to 750.
//!
//! - 1100 /cm^2/s at the Hubble's 538 km: Miles et al. 2021, ApJ 918, 86.
//! - Centre 30 S, 40 W in 1974: Knoll, Holzer and Schmidtke 1977, JGR 82, 5281, at 700 to 800 km;
//!   westward drift of 0.3 deg per year: Fuerst et al. 2009, Earth Planet. Sci. Lett. 281, 125, at
//!   540 km.
//! - Widths (assumed): with them the anomaly falls below the cosmic rays 58 deg east and west and
//!   33 deg north and south of its centre, and the Hubble's orbit is inside for 16 % of its time
//!   (see the test).
//! - Altitude law (assumed): air absorbs trapped protons, so their flux grows by a factor e with
//!   each scale height of air, 50 to 100 km there, up to some 10^4 /cm^2/s, the order of the inner
//!   belt's greatest flux; from 3,000 km on it falls by e per 3,000 km, down to 0 at the end of the
//!   proton belt.
//!
//! Error: a factor 2 at 538 km at the centre, 3 across the anomaly, 10 at other altitudes up to
//! 1,000 km. Omitted: the belts themselves, which higher orbits cross at all longitudes, electrons
//! of the polar horns, solar particle events.

use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop_orbit::time::utc_days_since_j2000;
use std::f64::consts::TAU;

/// Particles per second and square centimetre (both directions) where the Earth's field has no
/// effect.
pub const FREE_SPACE: f64 = 1.8;

/// Mean radius of the Earth, m.
const EARTH_M: f64 = 6_371_200.0;

/// Particles per second and square centimetre of a detector, both directions, at a GCRF position
/// (m); [`FREE_SPACE`] for a position that is not finite.
pub fn flux(position_m: &Vector3<f64>, epoch: Epoch) -> f64 {
    let position = Place::of(position_m, epoch);
    // At the Earth's centre the direction is undefined: the anomaly is NaN, and counts as 0.
    cosmic_rays(position.cutoff_gv()) + anomaly(&position).max(0.0)
}

/// Position of an observer over the rotating Earth. The GCRF's pole replaces that of date (0.14 deg
/// in 25 years), and latitudes are geocentric (at most 0.19 deg from geodetic ones): far below the
/// model's errors.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Geocentric latitude, rad.
    latitude: f64,
    /// Longitude, east, rad.
    longitude: f64,
    /// From the Earth's centre, m.
    radius_m: f64,
    /// Julian year.
    year: f64,
}

impl Place {
    fn of(position_m: &Vector3<f64>, epoch: Epoch) -> Place {
        // Earth rotation angle (IERS Conventions 2010, Eq. 5.15), UT1 taken equal to UTC.
        let days = utc_days_since_j2000(epoch);
        let era = TAU * (0.779_057_273_264 + 1.002_737_811_911_354_5 * days);
        let radius_m = position_m.norm();
        Place {
            latitude: libm::asin((position_m.z / radius_m).clamp(-1.0, 1.0)),
            longitude: libm::atan2(position_m.y, position_m.x) - era,
            radius_m,
            year: 2000.0 + epoch.to_tt_since_j2k().to_unit(Unit::Day) / 365.25,
        }
    }

    /// Cutoff rigidity, GV: no particle of a lower rigidity arrives.
    fn cutoff_gv(&self) -> f64 {
        let (pole_lat, pole_lon) = (80.7f64.to_radians(), -72.7f64.to_radians());
        let sin = libm::sin(self.latitude) * libm::sin(pole_lat)
            + libm::cos(self.latitude) * libm::cos(pole_lat) * libm::cos(self.longitude - pole_lon);
        let cos2 = (1.0 - sin * sin) * EARTH_M / self.radius_m;
        (15.062 * cos2 * cos2 - 0.363).max(0.0)
    }
}

/// Cosmic rays above a cutoff (GV), 1/cm^2/s.
fn cosmic_rays(cutoff_gv: f64) -> f64 {
    if cutoff_gv <= 0.0 {
        return FREE_SPACE;
    }
    FREE_SPACE * (1.0 - libm::exp(-10.275 * libm::pow(cutoff_gv, -0.9615)))
}

/// Trapped protons of the South Atlantic Anomaly, 1/cm^2/s.
fn anomaly(position: &Place) -> f64 {
    let degrees_east = -40.0 - 0.3 * (position.year - 1974.0);
    let off = |angle: f64, centre_deg: f64, sigma_deg: f64| {
        let degrees = angle.to_degrees() - centre_deg;
        let turned = degrees - 360.0 * libm::round(degrees / 360.0);
        turned / sigma_deg
    };
    let (x, y) = (
        off(position.longitude, degrees_east, 16.0),
        off(position.latitude, -30.0, 9.0),
    );
    let altitude_km = (position.radius_m - EARTH_M) * 1e-3;
    let grown = (altitude_km.min(750.0) - 538.0) / 100.0;
    let faded = (altitude_km - 3000.0).max(0.0) / 3000.0;
    1100.0 * libm::exp(grown - faded - (x * x + y * y) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::str::FromStr;

    /// GCRF position over `latitude`, `longitude` (deg) at `altitude_km` at J2000, when the Earth's
    /// rotation angle was 280.46 deg.
    fn over(latitude: f64, longitude: f64, altitude_km: f64) -> (Vector3<f64>, Epoch) {
        // X-Val: IERS Conventions 2010, Eq. 5.15 at its origin, 0.7790572732640 of a turn.
        let (lat, lon) = (
            latitude.to_radians(),
            (longitude + 280.460_618).to_radians(),
        );
        let r = EARTH_M + altitude_km * 1e3;
        let unit = Vector3::new(lat.cos() * lon.cos(), lat.cos() * lon.sin(), lat.sin());
        (
            unit * r,
            Epoch::from_str("2000-01-01T12:00:00 UTC").unwrap(),
        )
    }

    fn at(latitude: f64, longitude: f64, altitude_km: f64) -> f64 {
        let (position, epoch) = over(latitude, longitude, altitude_km);
        flux(&position, epoch)
    }

    #[test]
    fn anomaly_peaks_at_its_measured_position() {
        // 40 W in 1974 and 0.3 deg per year: 47.8 W in 2000.
        let peak = at(-30.0, -47.8, 538.0);
        // X-Val: Miles et al. 2021: 1100 particles/s/cm^2, with the cosmic rays.
        assert!((peak - 1100.0).abs() < 2.0, "{peak}");
        for (latitude, longitude) in [
            (-26.0, -47.8),
            (-34.0, -47.8),
            (-30.0, -41.0),
            (-30.0, -54.0),
        ] {
            assert!(at(latitude, longitude, 538.0) < 0.95 * peak);
        }
        assert!((at(-30.0, -47.8, 438.0) / peak * std::f64::consts::E - 1.0).abs() < 0.01);
        // The inner belt's order of magnitude, and no anomaly far above it, at the anomaly's own
        // longitude.
        assert!((5e3..2e4).contains(&at(-30.0, -47.8, 1000.0)));
        assert!(at(-30.0, -47.8, 35_786.0) < FREE_SPACE + 0.5);
        assert!(at(-30.0, -47.8, 384_000.0) < FREE_SPACE + 1e-3);
        // No step at 180 deg, and no anomaly on the opposite side.
        assert!((at(-30.0, 179.9, 538.0) - at(-30.0, -179.9, 538.0)).abs() < 1e-2);
        assert!(at(-30.0, 132.0, 538.0) < 3.0);
    }

    #[test]
    fn anomaly_is_as_wide_as_for_the_hubble() {
        let (mut inside, mut all) = (0.0, 0.0);
        for step in 0..360 {
            let u = f64::from(step).to_radians();
            let latitude = (28.5f64.to_radians().sin() * u.sin()).asin().to_degrees();
            for longitude in (-180..180).step_by(4) {
                let (position, epoch) = over(latitude, longitude.into(), 590.0);
                let position = Place::of(&position, epoch);
                all += 1.0;
                if anomaly(&position) > cosmic_rays(position.cutoff_gv()) {
                    inside += 1.0;
                }
            }
        }
        // X-Val: NASA, IMAGE mission, Ask the Space Scientist, answer 525: the Hubble spends nearly
        // 15 % of its time there.
        let share: f64 = inside / all;
        assert!((share - 0.15).abs() < 0.02, "{share}");
    }

    #[test]
    fn cosmic_rays_match_the_rates_of_imagers() {
        // Averaged over the Hubble's orbit.
        let orbit: Vec<f64> = (0..360)
            .map(|step| {
                let u = f64::from(step).to_radians();
                let latitude = (28.5f64.to_radians().sin() * u.sin()).asin().to_degrees();
                // All longitudes except the anomaly's, where instruments pause.
                at(latitude, 60.0 + f64::from(step % 180), 600.0)
            })
            .collect();
        let mean = orbit.iter().sum::<f64>() / 360.0;
        // X-Val: NICMOS Instrument Handbook 2003: 1.2 to 1.6 events/s on 256 x 256 pixels of 40 um,
        // 1.049 cm^2.
        assert!((1.2 / 1.049..1.6 / 1.049).contains(&mean), "{mean}");
        // X-Val: WFC3 Instrument Handbook, section 7.9.2: 11 events/s on 1014 x 1014 pixels of 18
        // um, 3.33 cm^2.
        assert!((11.0 / 3.33 / 3.0..11.0 / 3.33).contains(&mean));
        // X-Val: JWST's NIRSpec at L2 (Rauscher and Fixsen 2025, PASP 137, 095003): 4.3 /cm^2/s in
        // 2022, 2.3 in 2025.
        assert!((4.3 / 3.0..2.3).contains(&FREE_SPACE));
        // More towards the poles, where the field has no effect; there and far outside, the value
        // of free space.
        assert!((at(80.7, -72.7, 538.0) - FREE_SPACE).abs() < 1e-9);
        assert!(at(0.0, 100.0, 538.0) < 0.7 * FREE_SPACE);
        assert!((at(10.0, 100.0, 300_000.0) - FREE_SPACE).abs() < 1e-3);
    }
}
