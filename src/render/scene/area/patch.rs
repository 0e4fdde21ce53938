//! A pixel or a part of one, and how an edge crosses it.

use super::plane::Plane;
use super::radiance::Edge;
use nalgebra::{Matrix3, Vector3};

/// The two nodes of Gauss's rule, px from the middle of a pixel: 1 / (2 sqrt 3).
const GAUSS: f64 = 0.288_675_134_594_812_9;
/// A corner lies sqrt 3 times as far from the middle as Gauss's nodes; the rest is a margin for the
/// flattening of limbs.
const CORNER: f64 = 2.0;

/// A square of the plane no larger than a pixel.
pub(crate) struct Patch {
    /// Its middle, px.
    at: [f64; 2],
    /// Its side, px.
    size: f64,
    /// Direction of its middle (unit vector, camera axes) and solid angle, see
    /// [`Plane::solid_angle_sr`].
    pub middle: (Vector3<f64>, f64),
    /// The same of the four nodes of Gauss's rule.
    pub places: [Option<(Vector3<f64>, f64)>; 4],
    /// Bound of the distance of its points from the middle, rad.
    reach: f64,
}

impl Patch {
    /// The patch of `size` px around a position (px); none where the position has no direction.
    pub(crate) fn new(plane: &Plane<'_>, [x, y]: [f64; 2], size: f64) -> Option<Patch> {
        let middle = plane.solid_angle_sr([x, y])?;
        let places = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .map(|off| off.map(|off: f64| off * GAUSS * size))
            .map(|[u, v]| plane.solid_angle_sr([x + u, y + v]));
        let off = places.iter().flatten();
        let off = off.map(|(seen, _)| (seen - middle.0).norm());
        Some(Patch {
            at: [x, y],
            size,
            middle,
            places,
            reach: CORNER * off.fold(0.0, f64::max),
        })
    }

    /// Whether the edge, moving by `motion` rad around its position at attitude `sky`, misses it.
    pub(crate) fn is_clear(
        &self,
        edge: Option<&dyn Edge>,
        sky: &Matrix3<f64>,
        motion: f64,
    ) -> bool {
        let clear = self.reach + motion / 2.0;
        self.places.iter().all(Option::is_some)
            && edge.is_none_or(|edge| edge.angle(&(sky * self.middle.0)).abs() > clear)
    }

    /// How an edge crosses it at an attitude.
    pub(crate) fn crossing(&self, edge: Option<&dyn Edge>, sky: &Matrix3<f64>) -> Crossing {
        let angle =
            |seen: &Vector3<f64>| edge.map_or(f64::INFINITY, |edge| edge.angle(&(sky * seen)));
        let middle = angle(&self.middle.0);
        if middle.abs() > self.reach {
            return Crossing {
                middle,
                places: [middle; 4],
                slope: [0.0; 2],
                evaluations: 1,
            };
        }
        let off = |position: Option<(Vector3<f64>, f64)>| {
            position.map_or(f64::NAN, |(seen, _)| angle(&seen))
        };
        let places = self.places.map(off);
        let [a, b, c, d] = places;
        let slope = [b + d - a - c, c + d - a - b].map(|rise| rise / (4.0 * GAUSS));
        let is_known = slope.iter().all(|slope| slope.is_finite());
        Crossing {
            middle,
            places,
            slope: if is_known { slope } else { [0.0; 2] },
            evaluations: 5,
        }
    }

    /// A position (px) in its corner on one side of an edge.
    pub(crate) fn corner(&self, crossing: &Crossing, side: usize) -> [f64; 2] {
        let off = if side == 1 { 0.45 } else { -0.45 } * self.size;
        [0, 1].map(|k| self.at[k] + off * crossing.slope[k].signum())
    }
}

/// A straight edge across a square: signed distances from it, rad, positive outside.
pub(crate) struct Crossing {
    /// Of the middle.
    middle: f64,
    /// Of the four nodes.
    pub places: [f64; 4],
    /// Their slopes along columns and rows, rad a side.
    slope: [f64; 2],
    /// Number of evaluations of the edge.
    pub evaluations: usize,
}

impl Crossing {
    /// The part of the square that lies inside (0) or outside (1) of the edge. With slopes a >= b
    /// >= 0 and p(x) = max(x, 0)^2,
    ///
    /// ```text
    /// outside = (p(m + (a + b)/2) - p(m + (a - b)/2) - p(m - (a - b)/2) + p(m - (a + b)/2)) / 2ab
    /// ```
    pub fn part(&self, side: usize) -> f64 {
        let [x, y] = self.slope.map(f64::abs);
        let (a, b, m) = (x.max(y), x.min(y), self.middle);
        let outside = if m.abs() >= (a + b) / 2.0 || m.is_nan() {
            f64::from(u8::from(m > 0.0))
        } else if b < 1e-6 * a {
            (m / a + 0.5).clamp(0.0, 1.0)
        } else {
            let p = |x: f64| x.max(0.0) * x.max(0.0);
            let (wide, narrow) = ((a + b) / 2.0, (a - b) / 2.0);
            (p(m + wide) - p(m + narrow) - p(m - narrow) + p(m - wide)) / (2.0 * a * b)
        };
        if side == 1 { outside } else { 1.0 - outside }
    }
}
