//! Points and weights that integrate the light a Gaussian collects from a piece of a streak: a
//! Gauss rule for a short piece, equally spaced points for a long one.

use skyloop_base::range::nearest;
use std::f64::consts::{PI, TAU};
use std::sync::LazyLock;

/// Points and weights at an end of equally spaced points, in units of their spacing: Alpert's
/// hybrid rule of order 12 (SIAM J. Sci. Comput. 20, 1551, 1999), computed to 18 digits. The
/// first equally spaced point is [`SPAN`] from the end.
const ENDS: [(f64, f64); 6] = [
    (0.089_640_921_263_043_65, 0.231_101_078_610_988_87),
    (0.476_296_816_736_763_44, 0.539_779_386_952_550_8),
    (1.151_199_608_113_363, 0.794_936_536_801_552_7),
    (2.029_342_202_272_004, 0.942_119_501_946_174_8),
    (3.002_547_652_381_297_4, 0.992_324_266_142_971_3),
    (4.000_050_720_807_214, 0.999_739_229_545_761_6),
];
const SPAN: f64 = 5.0;
/// The error of a spacing of h standard deviations is below `SPACED h^12`, relative to the light of
/// an endless streak, up to [`WIDEST`].
const SPACED: f64 = 4.5e-6;
const WIDEST: f64 = 1.5;
/// Greatest number of equally spaced points: longer pieces are halved before.
const MAX_SPACED: f64 = 1e6;
/// Most points of a Gauss rule; beyond, equally spaced points are cheaper.
const MAX: usize = 11;

struct Gauss {
    points: Vec<(f64, f64)>,
    /// Its error is below this times the length^(2 n + 1), in standard deviations.
    error: f64,
}

/// The Gauss rules of 2 to [`MAX`] points. With n points the error on a length L is (Abramowitz &
/// Stegun, 25.4.30), for a Gaussian:
///
/// ```text
/// L^(2n+1) (n!)^4 / ((2n + 1) ((2n)!)^3) max |f^(2n)|
/// max |f^(2n)| = (2n - 1)!! / (2 pi)^(1/2)
/// ```
static GAUSS: LazyLock<Vec<Gauss>> = LazyLock::new(|| {
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    let gauss = |n: usize| {
        let odd: f64 = (1..=n).map(|i| (2 * i - 1) as f64).product();
        let halves = factorial(n) / factorial(2 * n);
        Gauss {
            points: (0..n).map(|i| node(n, i)).collect(),
            error: factorial(n) * halves.powi(3) * odd / ((2 * n + 1) as f64 * TAU.sqrt()),
        }
    };
    (2..=MAX).map(gauss).collect()
});

/// The point `i` of Gauss's rule of `n` and its weight, on 0..1: a zero of Legendre's polynomial by
/// Newton's method.
fn node(n: usize, i: usize) -> (f64, f64) {
    let mut x = -libm::cos(PI * (i as f64 + 0.75) / (n as f64 + 0.5));
    let mut slope = 0.0;
    for _ in 0..8 {
        let (mut before, mut value) = (1.0, x);
        for k in 2..=n {
            let k = k as f64;
            (before, value) = (
                value,
                ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k,
            );
        }
        slope = n as f64 * (x * value - before) / (x * x - 1.0);
        x -= value / slope;
    }
    ((x + 1.0) / 2.0, 1.0 / ((1.0 - x * x) * slope * slope))
}

impl Gauss {
    /// Whether its error is at most `error` on a piece of `length` standard deviations.
    fn suffices(&self, length: f64, error: f64) -> bool {
        self.error * length.powi(self.points.len() as i32 * 2 + 1) <= error.max(f64::EPSILON)
    }
}

/// Positions (0..1) of the points of the smallest rule, which most pieces use.
pub(crate) fn fewest_points() -> impl Iterator<Item = f64> {
    GAUSS[0].points.iter().map(|(at, _)| *at)
}

/// Whether [`points`] gives at most `few` points (2 to 11).
pub(crate) fn are_few(length: f64, error: f64, few: usize) -> bool {
    let mut rules = GAUSS.iter().take(few.saturating_sub(1));
    rules.any(|gauss| gauss.suffices(length, error))
}

/// The smallest sufficient Gauss rule.
fn gauss(length: f64, error: f64) -> Option<&'static Gauss> {
    GAUSS.iter().find(|gauss| gauss.suffices(length, error))
}

/// Length of a piece in units of the spacing of equally spaced points.
fn steps(length: f64, error: f64) -> f64 {
    let widest = libm::pow(error.max(f64::EPSILON) / SPACED, 1.0 / 12.0).min(WIDEST);
    nearest((length / widest).ceil(), 2.0 * SPAN..=MAX_SPACED)
}

/// Calls `point` with each point (0..1) of a piece of `length` standard deviations and its weight;
/// weights sum to 1. The light that a Gaussian collects then errs by less than `error`, relative to
/// an endless streak. Light, centroid and width are exact for any error.
pub(crate) fn points(length: f64, error: f64, mut point: impl FnMut(f64, f64)) {
    if let Some(gauss) = gauss(length, error) {
        gauss
            .points
            .iter()
            .for_each(|(at, weight)| point(*at, *weight));
        return;
    }
    let steps = steps(length, error);
    let step = 1.0 / steps;
    for (at, weight) in ENDS {
        point(at * step, weight * step);
    }
    for i in 0..=(steps - 2.0 * SPAN) as usize {
        point((SPAN + i as f64) * step, step);
    }
    for (at, weight) in ENDS.into_iter().rev() {
        point(1.0 - at * step, weight * step);
    }
}

/// Approximate number of points that [`points`] gives for errors near 1e-5.
pub(crate) fn expected_count(length: f64) -> usize {
    MAX + length.clamp(0.0, 1e3) as usize
}

/// Number of points that [`points`] gives.
pub(crate) fn count(length: f64, error: f64) -> usize {
    match gauss(length, error) {
        Some(gauss) => gauss.points.len(),
        // The equally spaced points begin and end SPAN from the ends.
        None => 2 * ENDS.len() + (steps(length, error) - 2.0 * SPAN) as usize + 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(length: f64, error: f64) -> Vec<(f64, f64)> {
        let mut rule = Vec::new();
        points(length, error, |at, weight| rule.push((at, weight)));
        rule
    }

    #[test]
    fn gaussian_light_is_within_the_requested_error() {
        let below = |u: f64| 0.5 * libm::erfc(-u / std::f64::consts::SQRT_2);
        for error in [5e-4, 3e-5, 1e-6, 3e-8, 1e-10] {
            let mut greatest = 0.0f64;
            for length in [0.3, 1.0, 2.1, 4.0, 6.5, 9.0, 13.0, 17.4, 71.0] {
                let rule = rule(length, error);
                assert!(rule.len() as f64 <= 13.0 + length / widest(error));
                for i in -60..=(20.0 * length) as i32 + 60 {
                    let at = f64::from(i) / 20.0;
                    let density = |s: f64| libm::exp(-0.5 * (s - at) * (s - at)) / TAU.sqrt();
                    let collected = rule
                        .iter()
                        .map(|(part, weight)| weight * length * density(part * length));
                    let off = (collected.sum::<f64>() - (below(length - at) - below(-at))).abs();
                    assert!(off <= error, "{length} {error} {at} {off}");
                    greatest = greatest.max(off);
                }
            }
            assert!(greatest > error / 4.0, "{error} {greatest}");
        }
    }

    /// The points are bounded, as many as [`count`] states, and their weights sum to 1.
    #[test]
    fn invalid_and_extreme_lengths_have_points() {
        let lengths = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0];
        for length in lengths.into_iter().chain([1e300, 1e-300, 40.0]) {
            for error in [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e-5] {
                let rule = rule(length, error);
                assert_eq!(rule.len(), count(length, error), "{length} {error}");
                let light: f64 = rule.iter().map(|(_, weight)| weight).sum();
                // A million weights round to a few 1e-11.
                assert!((light - 1.0).abs() < 1e-10, "{length} {error} {light}");
            }
            for few in [0, 1] {
                assert!(!are_few(length, 1e-5, few));
            }
        }
    }

    fn widest(error: f64) -> f64 {
        libm::pow(error / SPACED, 1.0 / 12.0)
    }

    #[test]
    fn powers_up_to_the_rules_order_are_integrated() {
        for (length, error, order) in [
            (0.3, 1e-3, 3),
            (3.0, 1e-7, 11),
            (20.0, 1e-3, 11),
            (70.0, 1e-6, 11),
        ] {
            for power in 0..=order {
                let sum: f64 = rule(length, error)
                    .iter()
                    .map(|(at, weight)| weight * at.powi(power))
                    .sum();
                // X-Val: the integral of x^n from 0 to 1 is 1 / (n + 1).
                assert!(
                    (sum - 1.0 / f64::from(power + 1)).abs() < 3e-15,
                    "{length} {power} {sum}"
                );
            }
        }
    }
}
