//! The lit part of the Moon's disc, cut into cells along the terminator.
//!
//! On the unit sphere with the poles at the horns of the crescent, by latitude `v` and longitude
//! `u` from the point below the observer, positive toward the Sun, a surface element has the
//! projection
//!
//! ```text
//! x = cos v sin u     toward the Sun          dx dy = cos^2 v cos u du dv
//! y = sin v           across
//! mu = cos v cos u    mu0 = cos v cos(u - g)
//! ```
//!
//! The lit part is `g - 90 deg < u < 90 deg` at every latitude: cells in `u` and `v` meet the limb
//! and the terminator exactly at every phase angle `g`, and Lommel and Seeliger's
//! `mu0 / (mu0 + mu)` depends on `u` alone.

use super::disc::{MoonDisc, NEW_MOON, lommel_seeliger};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// A cell of the disc.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Centroid of its light: unit vector, ICRF.
    pub direction: Vector3<f64>,
    /// Its share of all the light.
    pub share: f64,
}

/// Gauss-Legendre nodes of three points, in half widths from the middle, and their weights relative
/// to the whole width.
const NODES: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 18.0),
    (0.0, 8.0 / 18.0),
    (0.774_596_669_241_483_4, 5.0 / 18.0),
];

/// One of the two factors of a cell's light and of its centroid: the factor of its row (latitude)
/// or of its column (longitude).
struct Factor {
    light: f64,
    /// Contribution to `x`.
    sunward: f64,
    /// `y` of a row.
    across: f64,
}

impl MoonDisc {
    /// The lit part in full sunlight as cells of at most `1 / count` of the disc's diameter. Shares
    /// sum to 1; empty at new Moon.
    pub(crate) fn cells(&self, count: usize) -> Vec<Cell> {
        if PI - self.phase <= NEW_MOON {
            return Vec::new();
        }
        let axes = self
            .axes()
            .map(|axis| axis * libm::sin(self.angular_radius));
        let sun = [libm::sin(self.phase), libm::cos(self.phase)];
        // sin u at the terminator.
        let terminator = -sun[1];
        let mut cells = Vec::new();
        for v in intervals(-1.0, count) {
            let row = row(v);
            let widest = libm::cos(f64::max(0.0, v[0].max(-v[1])));
            let columns = (count as f64 * widest * (1.0 - terminator) / 2.0).ceil();
            for u in intervals(terminator, columns.max(1.0) as usize) {
                let column = column(u, sun);
                let [x, y] = [row.sunward * column.sunward, row.across];
                let across = axes[0] * x + axes[1] * y;
                let along = (1.0 - across.norm_squared()).max(0.0).sqrt();
                cells.push(Cell {
                    direction: self.direction * along + across,
                    share: row.light * column.light,
                });
            }
        }
        // At the terminator rounding may leave a cell without light, which has no centroid.
        cells.retain(|cell| cell.share > 0.0);
        let all: f64 = cells.iter().map(|cell| cell.share).sum();
        cells.iter_mut().for_each(|cell| cell.share /= all);
        cells
    }

    /// Toward the Sun on the disc, and across that: unit vectors. Arbitrary at full Moon.
    fn axes(&self) -> [Vector3<f64>; 2] {
        let sunward = self.to_sun - self.direction * self.to_sun.dot(&self.direction);
        let other = || {
            let [x, z] = [Vector3::x(), Vector3::z()];
            let far = if self.direction.x.abs() < 0.7 { x } else { z };
            self.direction.cross(&far).normalize()
        };
        let x = sunward.try_normalize(1e-12).unwrap_or_else(other);
        [x, self.direction.cross(&x)]
    }
}

/// `count` intervals (rad) of equal width in the sine, from `from` to 1.
fn intervals(from: f64, count: usize) -> impl Iterator<Item = [f64; 2]> {
    let edge = move |k: usize| {
        let sine = from + (1.0 - from) * k as f64 / count as f64;
        libm::asin(sine.clamp(-1.0, 1.0))
    };
    (0..count).map(move |k| [edge(k), edge(k + 1)])
}

/// Sine and cosine at the nodes between two angles, and weight.
fn nodes([from, to]: [f64; 2]) -> [(f64, f64, f64); 3] {
    NODES.map(|(node, weight)| {
        let (sin, cos) = libm::sincos(0.5 * ((from + to) + (to - from) * node));
        (sin, cos, weight * (to - from))
    })
}

/// The integrals of `cos^2 v`, `cos^3 v` and `cos^2 v sin v`, the latter two divided by the first.
fn row(v: [f64; 2]) -> Factor {
    let [mut light, mut sunward, mut across] = [0.0; 3];
    for (sin, cos, weight) in nodes(v) {
        let part = weight * cos * cos;
        light += part;
        sunward += part * cos;
        across += part * sin;
    }
    Factor {
        light,
        sunward: sunward / light,
        across: across / light,
    }
}

/// The integrals of `cos u mu0 / (mu0 + mu)`, and of that times `sin u`, divided by the first.
/// `sun`: sine and cosine of the phase angle.
fn column(u: [f64; 2], sun: [f64; 2]) -> Factor {
    let [mut light, mut sunward] = [0.0; 2];
    for (sin, cos, weight) in nodes(u) {
        let part = weight * cos * lommel_seeliger(cos * sun[1] + sin * sun[0], cos);
        light += part;
        sunward += part * sin;
    }
    Factor {
        light,
        sunward: sunward / light,
        across: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sky::constants::AU_M;
    use crate::sky::moon::RADIUS_M;
    use std::f64::consts::FRAC_PI_2;

    /// The centroid of a crescent, in disc radii toward the Sun, by the closed integrals over
    /// latitude (`8 / (3 pi)`) and Simpson's rule over longitude.
    fn by_integral(phase: f64) -> f64 {
        let from = phase - FRAC_PI_2;
        let step = (PI - phase) / 20_000.0;
        let [mut light, mut sunward] = [0.0; 2];
        for k in 0..=20_000u32 {
            let u = from + step * f64::from(k);
            let weight = [2.0, 4.0][k as usize % 2] / [1.0, 2.0][usize::from(k % 20_000 == 0)];
            let [mu, mu0] = [u.cos(), (u - phase).cos().max(0.0)];
            let part = weight * mu * mu0 / (mu0 + mu).max(f64::MIN_POSITIVE);
            light += part;
            sunward += part * u.sin();
        }
        sunward / light * 8.0 / (3.0 * PI)
    }

    #[test]
    fn centroid_is_independent_of_the_number_of_cells() {
        let toward = Vector3::new(0.6, -0.64, 0.48);
        let east = toward.cross(&Vector3::z()).normalize();
        for phase_deg in [
            0.0, 1e-7, 1.0, 30.0, 90.0, 150.0, 165.0, 175.0, 179.0, 179.99,
        ] {
            let phase = f64::to_radians(phase_deg);
            let moon_m = toward * 384_400e3;
            let sun_m = moon_m + (east * phase.sin() - toward * phase.cos()) * AU_M;
            let disc = MoonDisc::new(moon_m, sun_m);
            let expected = by_integral(disc.phase) * RADIUS_M / 384_400e3;
            for count in [12, 24, 101, 600] {
                let cells = disc.cells(count);
                let light: f64 = cells.iter().map(|cell| cell.share).sum();
                let centre: Vector3<f64> = cells.iter().map(|c| c.direction * c.share).sum();
                let off = [
                    centre.dot(&east) - expected,
                    centre.dot(&toward.cross(&east)),
                ];
                let off_arcsec = off.map(|off| off.to_degrees() * 3600.0);
                println!(
                    "{phase_deg} deg, {count}: {} cells, {off_arcsec:?}",
                    cells.len()
                );
                assert!((light - 1.0).abs() < 1e-12, "{phase_deg}, {count}: {light}");
                assert!(
                    off_arcsec.iter().all(|off| off.abs() < 0.03),
                    "{phase_deg}, {count}"
                );
            }
        }
    }
}
