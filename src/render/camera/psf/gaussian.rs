//! A circular Gaussian: the product of one Gaussian per coordinate, as is its integral over a
//! pixel.

use crate::kernels::{Lines, Real};
use skyloop_base::range::nearest;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::sync::LazyLock;

/// Nodes of the table per standard deviation, and its range: the light beyond is below 1e-16.
const NODES: f64 = 32.0;
const REACH: f64 = 8.5;

/// Smallest share of lost light, 37 standard deviations out.
const MIN_LOSS: f64 = 1e-300;

/// Taylor's series, from power 0 on.
type Series = [f64; 6];

/// The normal distribution around the nodes v, as Taylor's series with the Hermite polynomials He_n
/// at v:
///
/// ```text
/// P(v + d) = P(v) + p(v) d (1 - He1 d/2! + He2 d^2/3! - He3 d^3/4! + He4 d^4/5!)
/// ```
static TABLE: LazyLock<Vec<Series>> = LazyLock::new(|| {
    let nodes = 0..=(2.0 * REACH * NODES) as usize;
    nodes.map(|i| series(i as f64 / NODES - REACH)).collect()
});

/// The series around `v`.
fn series(v: f64) -> Series {
    let distribution = 0.5 * libm::erfc(-v * FRAC_1_SQRT_2);
    let density = libm::exp(-0.5 * v * v) / TAU.sqrt();
    let v2 = v * v;
    [
        distribution,
        density,
        -density * v / 2.0,
        density * (v2 - 1.0) / 6.0,
        -density * v * (v2 - 3.0) / 24.0,
        density * ((v2 - 6.0) * v2 + 3.0) / 120.0,
    ]
}

/// The light (1) of a Gaussian of standard deviation 1 that lies below `u`, within 1e-13, by the
/// nearest node's series.
fn below(table: &[Series], u: f64) -> f64 {
    let at = (u.clamp(-REACH, REACH) + REACH) * NODES;
    let nearest = (at + 0.5) as usize;
    let Some(series) = table.get(nearest) else {
        return 0.0;
    };
    let d = (at - nearest as f64) * (1.0 / NODES);
    series.iter().rev().fold(0.0, |sum, term| sum * d + term)
}

/// A circular Gaussian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Gaussian {
    /// Standard deviation, px.
    pub sigma_px: f64,
}

impl Gaussian {
    /// Half the side (px) of the square outside of which less than `loss` of the light falls: two
    /// coordinates, two tails each. A tail is below both `exp(-k^2 / 2) / 2` and
    /// `exp(-k^2 / 2) / (k (2 pi)^(1/2))` at k sigma (Abramowitz & Stegun, 7.1.13); by the second
    ///
    /// ```text
    /// k = f(k),   f(k) = (-2 ln(k (2 pi)^(1/2) loss / 4))^(1/2)
    /// ```
    ///
    /// f is decreasing: from a k that is too great, by the first bound, one step gives a k that is
    /// too small, and the next one that is slightly too great.
    pub fn reach_px(&self, loss: f64) -> f64 {
        // Without loss the reach would be infinite.
        let loss = nearest(loss, MIN_LOSS..=1.0);
        let far = (-2.0 * libm::log(loss / 2.0)).sqrt();
        let nearer = |k: f64| (-2.0 * libm::log(k * TAU.sqrt() * loss / 4.0)).sqrt();
        // For losses above 0.01 the second bound does not hold.
        let k = if loss < 0.01 {
            nearer(nearer(far))
        } else {
            far
        };
        self.sigma_px * k
    }

    /// The radius (px) of the circle outside of which `loss` of the light falls,
    /// `exp(-r^2 / (2 sigma^2))`.
    pub fn circle_px(&self, loss: f64) -> f64 {
        self.sigma_px * (-2.0 * libm::log(nearest(loss, MIN_LOSS..=1.0))).sqrt()
    }

    /// The shares of pixels as [`Lines`], within 1e-7; none if the width would make the table too
    /// large. With a source at `f` above the lower edge of its own pixel, the share of the pixel at
    /// distance j is
    ///
    /// ```text
    /// S_j(f) = P((j + 1 - f) / sigma) - P((j - f) / sigma)
    /// d^n S_j / df^n = (-1 / sigma)^n (P^(n)((j + 1 - f) / sigma) - P^(n)((j - f) / sigma))
    /// ```
    pub fn lines<T: Real>(&self) -> Option<Lines<T>> {
        const WIDTHS: std::ops::RangeInclusive<f64> = 0.05..=20.0;
        // Per standard deviation; the truncation error is below (1/32)^4 / 24 times 1.1.
        const NODES: f64 = 16.0;
        if !WIDTHS.contains(&self.sigma_px) {
            return None;
        }
        let nodes = (NODES / self.sigma_px).ceil() as usize;
        let reach = (REACH * self.sigma_px).ceil() as usize + 1;
        let terms = |j: i64, f: f64| {
            let edge = |j: i64| series((j as f64 - f) / self.sigma_px);
            let (below, above) = (edge(j), edge(j + 1));
            let mut factor = 1.0;
            std::array::from_fn(|power| {
                let term = factor * (above[power] - below[power]);
                factor /= -self.sigma_px;
                term
            })
        };
        Some(Lines::new(nodes, reach, terms))
    }

    /// Share of the light between the lower edges of the pixels `edges` along one axis, for a
    /// source at `at` (px), within 2e-13: `(erf((i + 1/2 - x) / (sqrt 2 sigma)) - erf((i - 1/2 - x)
    /// / (sqrt 2 sigma))) / 2`. The share of a pixel is the product over both axes.
    pub fn shares(&self, at: f64, mut edges: impl Iterator<Item = i64>, out: &mut Vec<f64>) {
        out.clear();
        out.reserve(edges.size_hint().0);
        let table = &TABLE[..];
        let edge = |i: i64| below(table, (i as f64 - 0.5 - at) / self.sigma_px);
        let Some(mut below) = edges.next().map(edge) else {
            return;
        };
        out.extend(edges.map(|i| {
            let above = edge(i);
            let share = above - below;
            below = above;
            share
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_conserve_light_and_centroid() {
        for sigma_px in [0.05, 0.3, 0.7, 2.5] {
            for at in [0.0, 0.1, 0.5, -0.31] {
                let psf = Gaussian { sigma_px };
                let mut shares = Vec::new();
                let range = -40..41;
                psf.shares(at, range.start..=range.end, &mut shares);
                let total: f64 = shares.iter().sum();
                assert!((total - 1.0).abs() < 1e-12);
                // The pixel centroid equals the source's for a band-limited PSF only.
                if sigma_px >= 0.7 {
                    let centre: f64 = range.zip(&shares).map(|(i, s)| i as f64 * s).sum();
                    assert!((centre - at).abs() < 1e-4, "{sigma_px} {at} {centre}");
                }
            }
        }
    }

    #[test]
    fn table_matches_the_normal_distribution() {
        for i in -100_000..=100_000 {
            let u = f64::from(i) * 1e-4 + 3.3e-6;
            let exact = 0.5 * libm::erfc(-u * FRAC_1_SQRT_2);
            assert!((below(&TABLE, u) - exact).abs() < 1e-13, "{u}");
        }
        for (u, light) in [(-1e300, 0.0), (1e300, 1.0), (f64::NEG_INFINITY, 0.0)] {
            assert!((below(&TABLE, u) - light).abs() < 1e-16);
        }
    }

    #[test]
    fn light_outside_the_reach_is_below_the_bound() {
        let psf = Gaussian { sigma_px: 0.7 };
        for loss in [9.9e-3, 1e-3, 1e-6, 1e-9] {
            let k = psf.reach_px(loss) / psf.sigma_px;
            let inside = libm::erf(k / std::f64::consts::SQRT_2).powi(2);
            assert!(1.0 - inside < loss && 1.0 - inside > 0.8 * loss);
        }
    }
}
