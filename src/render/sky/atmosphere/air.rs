//! Air: density, columns along lines, and scattering.
//!
//! Density: US Standard Atmosphere 1976, 0 to 700 km, exponential between its nodes. Columns along
//! slant lines: Chapman's function of grazing incidence by Smith & Smith 1972 (J. Geophys. Res. 77,
//! 3592), with the scale height of the column above the point. Rayleigh scattering: Bodhaine et al.
//! 1999 (J. Atmos. Oceanic Technol. 16, 1854) and the phase function of Bucholtz 1995 (Appl. Opt.
//! 34, 2765).
//!
//! The Earth is a sphere of its equatorial radius: lines and altitudes are those of stretched space
//! (see [`Earth`]); altitudes err by up to 0.3 %. Refraction, which bends a grazing line by up to a
//! degree below 10 km, is omitted.
//!
//! [`Earth`]: crate::sky::shadow::Earth

use crate::sky::shadow::EARTH_RADIUS_M;
use std::f64::consts::PI;

/// Upper limit of air and airglow, m.
pub const TOP_M: f64 = 700e3;

/// Molecules per cubic metre, every 5 km from the ground to 120 km, then every 20 km to 700 km
/// (PyPI ussa1976 0.3.4).
const LOW_STEP_M: f64 = 5e3;
const LOW: [f64; 25] = [
    2.547e25, 1.531e25, 8.598e24, 4.049e24, 1.849e24, 8.334e23, 3.828e23, 1.760e23, 8.308e22,
    4.088e22, 2.135e22, 1.181e22, 6.439e21, 3.393e21, 1.722e21, 8.300e20, 3.838e20, 1.709e20,
    7.117e19, 2.922e19, 1.192e19, 5.044e18, 2.160e18, 9.781e17, 5.172e17,
];
const HIGH_STEP_M: f64 = 20e3;
const HIGH: [f64; 30] = [
    5.172e17, 9.517e16, 3.251e16, 1.448e16, 7.471e15, 4.224e15, 2.540e15, 1.597e15, 1.036e15,
    6.896e14, 4.676e14, 3.219e14, 2.244e14, 1.581e14, 1.124e14, 8.063e13, 5.831e13, 4.252e13,
    3.127e13, 2.322e13, 1.741e13, 1.320e13, 1.013e13, 7.876e12, 6.209e12, 4.968e12, 4.034e12,
    3.327e12, 2.784e12, 2.364e12,
];
/// Common altitude of the two tables, m.
const SEAM_M: f64 = LOW_STEP_M * (LOW.len() - 1) as f64;

/// Density of the air, and column above, by altitude.
#[derive(Debug, Clone, PartialEq)]
pub struct Air {
    low: Profile,
    high: Profile,
}

/// Linear pieces per step of the tables: the error is at most 1.2e-4 of the density.
const PARTS: usize = 64;

/// A table of equal steps: the density (1/m^3), and the scale height of the column above (m), at
/// each node.
#[derive(Debug, Clone, PartialEq)]
struct Profile {
    from_m: f64,
    step_m: f64,
    nodes: Vec<[f64; 2]>,
}

/// The air at an altitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Density {
    /// Molecules per cubic metre.
    pub molecules_m3: f64,
    /// Vertical column above (1/m^2) divided by the density, m.
    pub scale_m: f64,
}

impl Air {
    /// The standard atmosphere.
    pub fn standard() -> Air {
        // Above the top the density falls at the rate of the last step.
        let fall = libm::log(HIGH[HIGH.len() - 2] / HIGH[HIGH.len() - 1]);
        let beyond = HIGH[HIGH.len() - 1] * HIGH_STEP_M / fall;
        let (high, column) = Profile::new(SEAM_M, HIGH_STEP_M, &HIGH, beyond);
        let (low, _) = Profile::new(0.0, LOW_STEP_M, &LOW, column);
        Air { low, high }
    }

    /// The air at an altitude (m), limited to the range from the ground to the top.
    pub fn at(&self, altitude_m: f64) -> Density {
        let profile = if altitude_m < SEAM_M {
            &self.low
        } else {
            &self.high
        };
        profile.at(altitude_m)
    }

    /// Molecules per square metre from a point at `altitude_m` to space, along a line whose cosine
    /// to the vertical is `cos`: Chapman's function. A descending line passes its lowest point; if
    /// that is below the ground, a line that grazes the ground replaces it.
    pub fn column(&self, altitude_m: f64, cos: f64) -> f64 {
        self.column_from(EARTH_RADIUS_M + altitude_m, self.at(altitude_m), cos)
    }

    /// [`Air::column`] from a point at `radius` (m) with known `air`.
    pub(crate) fn column_from(&self, radius: f64, air: Density, cos: f64) -> f64 {
        let up = air.molecules_m3 * air.scale_m * chapman(radius / air.scale_m, cos.abs());
        if cos >= 0.0 {
            return up;
        }
        let lowest_m = (radius * ((1.0 - cos) * (1.0 + cos)).sqrt()).max(EARTH_RADIUS_M);
        let low = self.at(lowest_m - EARTH_RADIUS_M);
        let grazing = low.molecules_m3 * low.scale_m * chapman(lowest_m / low.scale_m, 0.0);
        (2.0 * grazing - up).max(grazing)
    }
}

impl Profile {
    /// The profile of `densities`, and the column (1/m^2) above its lower end; `beyond` is the
    /// column above its upper end.
    fn new(from_m: f64, step_m: f64, densities: &[f64], beyond: f64) -> (Profile, f64) {
        let mut column = beyond;
        let mut nodes = Vec::with_capacity(densities.len());
        let mut above: Option<f64> = None;
        for &density in densities.iter().rev() {
            if let Some(above) = above {
                // An exponential from one node to the next: (n1 - n2) h / ln(n1 / n2).
                column += (density - above) * step_m / libm::log(density / above);
            }
            above = Some(density);
            nodes.push([density, column / density]);
        }
        nodes.reverse();
        let profile = Profile {
            from_m,
            step_m: step_m / PARTS as f64,
            nodes: finer(&nodes),
        };
        (profile, column)
    }

    fn at(&self, altitude_m: f64) -> Density {
        let last = self.nodes.len().saturating_sub(2);
        let along = ((altitude_m - self.from_m) / self.step_m).max(0.0);
        let i = (along as usize).min(last);
        let part = (along - i as f64).min(1.0);
        let (Some(a), Some(b)) = (self.nodes.get(i), self.nodes.get(i + 1)) else {
            return Density {
                molecules_m3: 0.0,
                scale_m: 1.0,
            };
        };
        let [molecules_m3, scale_m] = [0, 1].map(|k| a[k] + (b[k] - a[k]) * part);
        Density {
            molecules_m3,
            scale_m: scale_m.max(1.0),
        }
    }
}

/// Nodes of a [`Profile`], [`PARTS`] per given step: exponential in density, linear in scale
/// height.
fn finer(nodes: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let between = nodes.windows(2).flat_map(|pair| {
        let (a, b) = (pair[0], pair[1]);
        let fall = libm::log(b[0] / a[0]);
        (0..PARTS).map(move |k| {
            let part = k as f64 / PARTS as f64;
            [a[0] * libm::exp(fall * part), a[1] + (b[1] - a[1]) * part]
        })
    });
    between.chain(nodes.last().copied()).collect()
}

/// Chapman's function Ch(x, chi) for chi up to 90 deg, `x` the radius in scale heights, `cos` =
/// cos(chi): slant column over vertical column in air whose density falls by e per scale height.
///
/// ```text
/// Ch = sqrt(pi x / 2) exp(y^2) erfc(y),   y = sqrt(x / 2) cos(chi)
/// ```
///
/// (Smith & Smith 1972, with their rational function for exp(y^2) erfc(y), accurate to 0.12 %.)
pub fn chapman(x: f64, cos: f64) -> f64 {
    let y = (x / 2.0).sqrt() * cos;
    let erfcx = if y < 8.0 {
        (1.060_696_3 + 0.556_438_31 * y) / (1.061_989_6 + 1.724_560_9 * y + y * y)
    } else {
        0.564_988_23 / (0.066_518_74 + y)
    };
    (PI * x / 2.0).sqrt() * erfcx
}

/// Rayleigh's cross-section of a molecule of air, m^2, at a wavelength (m): Bodhaine et al. 1999,
/// Eq. (29), for 360 ppm of CO2; within 0.2 % of Bates' from 350 to 1100 nm.
pub fn cross_section_m2(wavelength_m: f64) -> f64 {
    let um2 = wavelength_m * wavelength_m * 1e12;
    1e-32 * (1.045_599_6 - 341.290_61 / um2 - 0.902_308_50 * um2)
        / (1.0 + 0.002_705_988_9 / um2 - 85.968_563 * um2)
}

/// Rayleigh's phase function of the cosine of the scattering angle, with a mean over all directions
/// of 1:
///
/// ```text
/// P = 3 / (4 (1 + 2 g)) [(1 + 3 g) + (1 - g) cos^2],   g = d / (2 - d)
/// ```
///
/// with the depolarisation `d` = 0.0279 of air in visible light (Bucholtz 1995, after
/// Chandrasekhar).
pub fn phase_function(cos: f64) -> f64 {
    const G: f64 = 0.0279 / (2.0 - 0.0279);
    3.0 / (4.0 * (1.0 + 2.0 * G)) * ((1.0 + 3.0 * G) + (1.0 - G) * cos * cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn column_above_the_ground_is_weight_over_gravity() {
        let ground = Air::standard().at(0.0);
        let column = ground.molecules_m3 * ground.scale_m;
        // X-Val: hydrostatics: 101325 Pa / (9.80665 m/s^2 * 28.9644 u * 1.66054e-27 kg) = 2.148e29
        // 1/m^2; gravity decreases with altitude.
        assert!((column / 2.148e29 - 1.0).abs() < 0.01, "{column:e}");
        // X-Val: PyPI ussa1976 0.3.4, n_tot integrated in 10 m steps: 2.1532e29.
        assert!((column / 2.1532e29 - 1.0).abs() < 0.01, "{column:e}");
        // X-Val: 8.7556e21 1/m^3 between two nodes, by the same package.
        assert!((Air::standard().at(57.5e3).molecules_m3 / 8.7556e21 - 1.0).abs() < 0.02);
    }

    #[test]
    fn chapmans_function_matches_the_numerical_column() {
        for x in [800.0, 300.0, 60.0] {
            for cos in [1.0, 0.6, 0.2, 0.05, 0.0] {
                // Numerically, in scale heights: density exp(x - r) along r^2 = x^2 + s^2 + 2 x s
                // cos.
                let h = 1e-3;
                let sum: f64 = (0..200_000)
                    .map(|k| (k as f64 + 0.5) * h)
                    .map(|s| h * (x - (x * x + s * s + 2.0 * x * s * cos).sqrt()).exp())
                    .sum();
                let error = chapman(x, cos) / sum - 1.0;
                // The form is asymptotic in x.
                assert!(error.abs() < 0.003 + 1.0 / x, "{x} {cos}: {error}");
            }
            // Grazing: sqrt(pi x / 2), and straight up 1 to the order 1 / x.
            assert!((chapman(x, 0.0) / (PI * x / 2.0).sqrt() - 1.0).abs() < 2e-3);
            assert!((chapman(x, 1.0) - 1.0).abs() < 3.0 / x);
        }
    }

    #[test]
    fn descending_column_is_twice_the_grazing_one_less_the_rest() {
        let air = Air::standard();
        // The line from 60 km at a slant grazes at its lowest point: from there both halves are
        // equal.
        let (radius, low) = (EARTH_RADIUS_M + 60e3, EARTH_RADIUS_M + 30e3);
        let cos = -(1.0 - (low / radius) * (low / radius)).sqrt();
        let whole = air.column(60e3, cos) + air.column(60e3, -cos);
        assert!((whole / (2.0 * air.column(30e3, 0.0)) - 1.0).abs() < 1e-9);
        // The law of the optically thin limb: sqrt(2 pi R H) n.
        let lowest = air.at(30e3);
        let thin = (2.0 * PI * low * lowest.scale_m).sqrt() * lowest.molecules_m3;
        assert!((whole / thin - 1.0).abs() < 0.01, "{}", whole / thin);
    }

    #[test]
    fn scattering_matches_bates_and_conserves_light() {
        // X-Val: PyPI sasktran2 2026.10.1, rayleigh_cross_section_bates at 350, 550, 800 and 1100
        // nm, m^2.
        for (nm, expected) in [
            (350.0, 2.92865e-30),
            (550.0, 4.51315e-31),
            (800.0, 9.88262e-32),
            (1100.0, 2.74205e-32),
        ] {
            let error = cross_section_m2(nm * 1e-9) / expected - 1.0;
            assert!(error.abs() < 0.003, "{nm}: {error}");
        }
        let n = 10_000;
        let mean: f64 = (0..n)
            .map(|k| phase_function((k as f64 + 0.5) / n as f64 * 2.0 - 1.0) / n as f64)
            .sum();
        assert!((mean - 1.0).abs() < 1e-8);
        // X-Val: by hand, g = 0.014147: 0.75 / 1.028294 * 2.028294 forward, 0.75 / 1.028294 *
        // 1.042441 across.
        assert!((phase_function(1.0) - 1.47936).abs() < 1e-4);
        assert!((phase_function(0.0) - 0.76032).abs() < 1e-4);
    }
}
