//! The distortion of a lens as the polynomials of a FITS header (SIP: Shupe et al. 2005, ASP Conf.
//! Ser. 347, 491).
//!
//! With (u, v) a pixel's offset from the principal point, the ideal projection has the image at
//! `(u + f(u, v), v + g(u, v))`, `f = sum A_pq u^p v^q`, `g = sum B_pq u^p v^q`, 2 <= p + q <= the
//! order. The inverse is `AP`, `BP`, from p + q = 1. The fit is least squares over the detector, at
//! the lowest order whose residual is below [`ENOUGH_PX`] everywhere, else at the best order.

use nalgebra::{DMatrix, DVector};
use skyloop_render::camera::{Camera, Optics};

/// Sufficient residual, px: below the accuracy of star positions.
const ENOUGH_PX: f64 = 1e-4;
/// The highest order of the convention.
const MAX: usize = 9;
/// Fitted points per side.
const SIDE: usize = 24;

/// A polynomial's exponents of u and v, and its coefficients for columns and rows.
pub(crate) type Term = ([usize; 2], [f64; 2]);

/// The polynomials of a camera.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Sip {
    /// Order of all four polynomials.
    pub order: usize,
    /// `A` and `B`.
    pub forward: Vec<Term>,
    /// `AP` and `BP`.
    pub back: Vec<Term>,
    /// Greatest correction on the detector, px.
    pub most_px: f64,
    /// Greatest residual of a fitted point in both directions, px.
    pub residual_px: f64,
}

/// Offset from the principal point and its correction, px.
type Point = ([f64; 2], [f64; 2]);

impl Sip {
    /// The polynomials of a camera; none if its projection is ideal.
    pub fn of(camera: &Camera) -> Option<Sip> {
        if camera.optics.projection.is_ideal() {
            return None;
        }
        let forward: Vec<Point> = grid(camera)
            .filter_map(|pixel| correction(&camera.optics, pixel))
            .collect();
        let back: Vec<Point> = forward
            .iter()
            .map(|(at, by)| ([at[0] + by[0], at[1] + by[1]], [-by[0], -by[1]]))
            .collect();
        let most_px = forward
            .iter()
            .map(|(_, by)| libm::hypot(by[0], by[1]))
            .fold(0.0, f64::max);
        let mut best: Option<Sip> = None;
        for order in 2..=MAX {
            let (ahead, behind) = (fit(&forward, 2, order), fit(&back, 1, order));
            let (Some((forward, a)), Some((back, b))) = (ahead, behind) else {
                continue;
            };
            let residual_px = a.max(b);
            if best
                .as_ref()
                .is_none_or(|best| residual_px < best.residual_px)
            {
                best = Some(Sip {
                    order,
                    forward,
                    back,
                    most_px,
                    residual_px,
                });
            }
            if residual_px < ENOUGH_PX {
                break;
            }
        }
        best
    }
}

/// Points from edge to edge, denser towards the edges: the extrema of a Chebyshev polynomial.
fn grid(camera: &Camera) -> impl Iterator<Item = [f64; 2]> {
    let [width, height] = [camera.detector.width, camera.detector.height].map(|n| n as f64);
    let part =
        |i: usize| 0.5 - 0.5 * libm::cos(std::f64::consts::PI * i as f64 / (SIDE - 1) as f64);
    let pixel = move |i, j| [part(i) * width - 0.5, part(j) * height - 0.5];
    (0..SIDE).flat_map(move |j| (0..SIDE).map(move |i| pixel(i, j)))
}

/// A pixel's offset from the principal point, and the correction to its direction's ideal image.
fn correction(optics: &Optics, pixel: [f64; 2]) -> Option<Point> {
    let ideal = optics.projection.ideal().image(&optics.direction(pixel))?;
    let at = [0, 1].map(|k| pixel[k] - optics.principal_px[k]);
    Some((at, [0, 1].map(|k| optics.focal_px * ideal[k] - at[k])))
}

/// The terms of the least-squares fit, and the greatest residual.
fn fit(points: &[Point], lowest: usize, order: usize) -> Option<(Vec<Term>, f64)> {
    let exponents: Vec<[usize; 2]> = (lowest..=order)
        .flat_map(|sum| (0..=sum).map(move |q| [sum - q, q]))
        .collect();
    // Coordinates are relative to the largest one, which keeps powers small.
    let unit = points
        .iter()
        .flat_map(|(at, _)| at.map(f64::abs))
        .fold(1.0, f64::max);
    let power = |at: &[f64; 2], [p, q]: [usize; 2]| {
        (at[0] / unit).powi(p as i32) * (at[1] / unit).powi(q as i32)
    };
    let matrix = DMatrix::from_fn(points.len(), exponents.len(), |i, j| {
        power(&points[i].0, exponents[j])
    });
    let qr = matrix.clone().qr();
    let solve = |k: usize| {
        let mut target = DVector::from_iterator(points.len(), points.iter().map(|(_, by)| by[k]));
        qr.q_tr_mul(&mut target);
        qr.r()
            .solve_upper_triangular(&target.rows(0, exponents.len()).into_owned())
    };
    let (x, y) = (solve(0)?, solve(1)?);
    let (u, v) = (&matrix * &x, &matrix * &y);
    let miss = |(i, (_, by)): (usize, &Point)| libm::hypot(u[i] - by[0], v[i] - by[1]);
    let residual = points.iter().enumerate().map(miss).fold(0.0, f64::max);
    let scaled = |(j, e): (usize, &[usize; 2])| {
        let scale = unit.powi((e[0] + e[1]) as i32);
        (*e, [x[j] / scale, y[j] / scale])
    };
    Some((exponents.iter().enumerate().map(scaled).collect(), residual))
}
