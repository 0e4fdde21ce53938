//! The planets as points of light: apparent directions and magnitudes for an observer near the
//! Earth.
//!
//! **Directions**: SOFA's `plan94` (Simon et al. 1994, A&A 282, 663): mean orbits with the largest
//! perturbations. Over 1991 to 2060 they differ from JPL DE440 by at most (arcsec; rms in brackets)
//! Mercury 1.9 (0.3), Venus 10 (1.7), Mars 51 (8.9), Jupiter 54 (17), Saturn 89 (31), Uranus 73
//! (33), Neptune 10 (4.8). Deflection by the Sun is omitted.
//!
//! **Magnitudes**: V by Mallama & Hilton 2018 (Astronomy and Computing 25, 10), with their
//! polynomials for the phase angles `a` (deg) that occur near the Earth, and `r` and `d` the
//! distances from the Sun and from the observer in au:
//!
//! ```text
//! V = 5 log10(r d) + V(a)
//! ```
//!
//! Saturn with its rings (Eq. 10), Uranus with its bright poles, Neptune with its rise from 1980 to
//! 2000 (Eq. 16). Omitted are the seasons and the rotation of Mars (0.1 mag each). Coefficients as
//! in PyPI `skyfield` 1.55, `magnitudelib`.

use nalgebra::Vector3;

use super::apparent::{Corrections, Observer};
use super::bodies::aberrate;
use super::constants::{AU_M, DAY_S, J2000_JD, LIGHT_M_S, tt_days_since_j2000};
use super::photometry::phase_angle;

/// A planet's name, its number in `plan94`, its equatorial radius (km; IAU WGCCRE 2015: Archinal et
/// al. 2018, Table 4), and its law of brightness.
type Row = (&'static str, i32, f64, fn(&Circumstances) -> f64);

const PLANETS: [Row; 7] = [
    ("Mercury", 1, 2_440.53, mercury),
    ("Venus", 2, 6_051.8, venus),
    ("Mars", 4, 3_396.19, mars),
    ("Jupiter", 5, 71_492.0, jupiter),
    ("Saturn", 6, 60_268.0, saturn),
    ("Uranus", 7, 25_559.0, uranus),
    ("Neptune", 8, 24_764.0, neptune),
];

/// North poles of Saturn and Uranus, unit vectors, ICRF (IAU WGCCRE, as in `magnitudelib`).
const SATURN_POLE: Vector3<f64> = Vector3::new(0.085_478_83, 0.073_235_76, 0.993_644_75);
const URANUS_POLE: Vector3<f64> = Vector3::new(-0.211_999_58, -0.941_559_16, -0.261_768_09);

/// A planet for one observer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Planet {
    /// English name.
    pub name: &'static str,
    /// Apparent direction: unit vector, ICRF.
    pub direction: Vector3<f64>,
    /// Observer to planet at the observer's epoch, without light time: m, ICRF.
    pub geometric_m: Vector3<f64>,
    /// From the planet when the light left it to the observer, m.
    pub distance_m: f64,
    /// From the planet at that time to the Sun, m.
    pub sun_distance_m: f64,
    /// Apparent angular radius of its equator, rad.
    pub angular_radius: f64,
    /// Phase angle Sun - planet - observer when the light left, rad.
    pub phase: f64,
    /// V magnitude.
    pub magnitude: f64,
}

/// Inputs of a planet's brightness.
struct Circumstances {
    /// Phase angle, deg.
    a: f64,
    /// From the planet to the Sun and to the observer: unit vectors, ICRF.
    to_sun: Vector3<f64>,
    to_observer: Vector3<f64>,
    /// Julian year.
    year: f64,
}

/// English names of the planets.
pub fn names() -> impl Iterator<Item = &'static str> {
    PLANETS.iter().map(|(name, ..)| *name)
}

/// The seven planets for `observer`, from Mercury to Neptune. Takes some 10 microseconds.
pub fn seen_by(observer: &Observer, corrections: &Corrections) -> Vec<Planet> {
    let seen = |(name, number, radius_km, law): &Row| -> Option<Planet> {
        let days = tt_days_since_j2000(observer.epoch);
        let ([position, velocity], _) = sofars::eph::plan94(J2000_JD, days, *number).ok()?;
        let mut from_sun = Vector3::from(position) * AU_M;
        let to_sun = observer.bodies.sun_geocentric_m - observer.position_m;
        let geometric_m = to_sun + from_sun;
        if corrections.light_time {
            // The planet when the light left it; in hours the Sun moves 200 km at most.
            let velocity = Vector3::from(velocity) * (AU_M / DAY_S);
            let start = from_sun;
            for _ in 0..2 {
                from_sun = start - velocity * ((to_sun + from_sun).norm() / LIGHT_M_S);
            }
        }
        let line = to_sun + from_sun;
        let (distance_m, sun_distance_m) = (line.norm(), from_sun.norm());
        let mut direction = line / distance_m;
        let (to_sun, to_observer) = (from_sun / -sun_distance_m, -direction);
        let phase = phase_angle(&to_sun, &to_observer);
        if corrections.aberration {
            direction = aberrate(direction, observer.barycentric_velocity_m_s());
        }
        let circumstances = Circumstances {
            a: phase.to_degrees(),
            to_sun,
            to_observer,
            year: 2000.0 + days / 365.25,
        };
        let distances = sun_distance_m / AU_M * (distance_m / AU_M);
        Some(Planet {
            name,
            direction,
            geometric_m,
            distance_m,
            sun_distance_m,
            angular_radius: libm::asin((radius_km * 1e3 / distance_m).min(1.0)),
            phase,
            magnitude: 5.0 * libm::log10(distances) + law(&circumstances),
        })
    };
    PLANETS.iter().filter_map(seen).collect()
}

/// `c0 + c1 a + c2 a^2 + ...`
fn polynomial(a: f64, coefficients: &[f64]) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * a + c)
}

fn mercury(at: &Circumstances) -> f64 {
    const C: [f64; 7] = [
        -0.613,
        6.3280e-2,
        -1.6336e-3,
        3.3644e-5,
        -3.4265e-7,
        1.6893e-9,
        -3.0334e-12,
    ];
    polynomial(at.a, &C)
}

/// From 163.7 degrees on forward scattering of the atmosphere dominates.
fn venus(at: &Circumstances) -> f64 {
    const C: [f64; 5] = [-4.384, -1.044e-3, 3.687e-4, -2.814e-6, 8.938e-9];
    const FORWARD: [f64; 3] = [236.058_28, -2.819_14, 8.390_34e-3];
    polynomial(at.a, if at.a < 163.7 { &C } else { &FORWARD })
}

/// Valid up to a phase angle of 50 degrees.
fn mars(at: &Circumstances) -> f64 {
    polynomial(at.a, &[-1.601, 2.267e-2, -1.302e-4])
}

/// Valid up to a phase angle of 12 degrees.
fn jupiter(at: &Circumstances) -> f64 {
    polynomial(at.a, &[-9.395, -3.7e-4, 6.16e-4])
}

/// Eq. (10), valid up to a phase angle of 6.5 degrees:
/// `-8.914 - 1.825 sin B + 0.026 a - 0.378 sin B e^(-2.25 a)`, with B the geometric mean of the
/// Sun's and the observer's latitudes over the rings, 0 if they are on different sides.
fn saturn(at: &Circumstances) -> f64 {
    let product = latitude(&SATURN_POLE, &at.to_sun) * latitude(&SATURN_POLE, &at.to_observer);
    let sin_b = libm::sin(product.max(0.0).sqrt());
    -8.914 - 1.825 * sin_b + 0.026 * at.a - 0.378 * sin_b * libm::exp(-2.25 * at.a)
}

/// Valid up to a phase angle of 3.1 degrees (3.2 is the greatest from the Earth):
/// `-7.110 - 0.00084 f`, f the mean of the Sun's and the observer's latitudes (deg, unsigned).
fn uranus(at: &Circumstances) -> f64 {
    let [sun, observer] =
        [&at.to_sun, &at.to_observer].map(|v| latitude(&URANUS_POLE, v).abs().to_degrees());
    -7.110 - 0.000_84 * (sun + observer) / 2.0
}

/// Eq. (16).
fn neptune(at: &Circumstances) -> f64 {
    (-6.89 - 0.0054 * (at.year - 1980.0)).clamp(-7.00, -6.89)
}

/// Latitude (rad) of the point below direction `to` on a planet with this `pole`.
fn latitude(pole: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    libm::asin(pole.dot(to).clamp(-1.0, 1.0))
}
