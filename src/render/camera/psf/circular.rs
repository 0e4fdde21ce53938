//! A circular spread of any profile, integrated over pixels by its encircled energy.
//!
//! With `E(r)` the share of the light within `r`, the light in the rectangle from the centre to
//! `(a, b)` is `F(a, b) = T(a, b) + T(b, a)`,
//! `T(a, b) = 1/(2 pi) int_0^atan(b/a) E(a / cos phi) dphi`: each half of the rectangle is a fan of
//! sectors. A pixel is a difference of four `F`, so the sum over a rectangle of pixels is the light
//! in it: interpolation moves a little light between neighbours and loses none.
//!
//! `F` is tabulated once, in units of the profile's own width, at equal steps of `u = a / (c + a)`:
//! fine steps in the core, coarse ones in the wings, and the last node is infinity. Other widths
//! scale the same table.

use super::stamp::Stamp;
use crate::kernels::{self, Nodes, Place};
use skyloop_orbit::sgp4_batch::Level;
use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;

/// `F(a, b)` on a grid of both coordinates.
#[derive(Debug, PartialEq)]
pub struct Quadrant {
    /// Coordinate at which the steps begin to grow, in units of the width.
    knee: f64,
    /// Steps from 0 to infinity.
    steps: usize,
    /// `steps + 1` nodes in each direction, row by row; symmetric.
    light: Vec<f64>,
}

/// Points (-1..1) and weights of Gauss's rule with three points.
const GAUSS: [(f64, f64); 3] = [
    (-0.774_596_669_241_483_4, 5.0 / 9.0),
    (0.0, 8.0 / 9.0),
    (0.774_596_669_241_483_4, 5.0 / 9.0),
];

impl Quadrant {
    /// The table of the profile whose encircled energy at radius `r` (in units of its width) is
    /// `energy`.
    pub(crate) fn new(knee: f64, steps: usize, energy: impl Fn(f64) -> f64) -> Quadrant {
        let nodes = steps + 1;
        let radius = |k: usize| knee * k as f64 / (steps - k) as f64;
        let mut fans = vec![0.0; nodes * nodes];
        for i in 1..steps {
            let a = radius(i);
            let (mut from, mut fan) = (0.0, 0.0);
            for j in 1..nodes {
                let to = if j == steps {
                    FRAC_PI_2
                } else {
                    libm::atan(radius(j) / a)
                };
                let (mid, half) = ((from + to) / 2.0, (to - from) / 2.0);
                let sum = GAUSS
                    .iter()
                    .map(|(x, w)| w * energy(a / libm::cos(mid + half * x)));
                fan += half * sum.sum::<f64>() / (2.0 * PI);
                fans[i * nodes + j] = fan;
                from = to;
            }
        }
        let mut light = vec![0.0; nodes * nodes];
        for i in 1..nodes {
            for j in 1..nodes {
                light[i * nodes + j] = fans[i * nodes + j] + fans[j * nodes + i];
            }
        }
        // The fan of an infinite radius has no light off the axis.
        light[nodes * nodes - 1] = 0.25;
        Quadrant { knee, steps, light }
    }

    /// The position of coordinate `a`: four nodes around it, cubic weights (Lagrange).
    pub(crate) fn place(&self, a: f64) -> Place {
        let size = a.abs();
        let at = self.steps as f64 * (size / (self.knee + size));
        let first = (at as usize).saturating_sub(1).min(self.steps - 3);
        let t = at - first as f64;
        let sign = 1f64.copysign(a);
        let (t1, t2, t3) = (t - 1.0, t - 2.0, t - 3.0);
        Place {
            first,
            weights: [
                -sign * t1 * t2 * t3 / 6.0,
                sign * t * t2 * t3 / 2.0,
                -sign * t * t1 * t3 / 2.0,
                sign * t * t1 * t2 / 6.0,
            ],
        }
    }

    /// `F` at each of `across` and one other coordinate.
    fn line(&self, level: Option<Level>, across: &[Place], down: &Place, line: &mut [f64]) {
        let nodes = Nodes {
            values: &self.light,
            side: self.steps + 1,
        };
        kernels::table_line(level, &nodes, across, down, line);
    }

    /// The light in a rectangle, given by its edges in units of the width from the centre.
    pub(crate) fn inside(&self, across: [f64; 2], down: [f64; 2]) -> f64 {
        let across = across.map(|a| self.place(a));
        let [above, below] = down.map(|a| {
            let mut line = [0.0; 2];
            self.line(Some(Level::best()), &across, &self.place(a), &mut line);
            line[1] - line[0]
        });
        below - above
    }

    /// Spreads `light` around `at` (px), of width `width_px`, over the rectangles between the left
    /// edges of the columns `edges` on `rows`, row by row.
    pub(crate) fn spread(
        &self,
        width_px: f64,
        light: f64,
        at: [f64; 2],
        edges: impl Iterator<Item = i64>,
        rows: Range<i64>,
        stamp: &mut Stamp,
    ) {
        let Stamp {
            light: out,
            level,
            across: above,
            down: below,
            places,
        } = stamp;
        let edge = |i: i64, at: f64| self.place((i as f64 - 0.5 - at) / width_px);
        places.clear();
        places.extend(edges.map(|i| edge(i, at[0])));
        above.resize(places.len(), 0.0);
        below.resize(places.len(), 0.0);
        self.line(*level, places, &edge(rows.start, at[1]), above);
        for row in rows {
            self.line(*level, places, &edge(row + 1, at[1]), below);
            let pixel = |(a, b): (&[f64], &[f64])| light * ((b[1] - b[0]) - (a[1] - a[0])).max(0.0);
            out.extend(above.windows(2).zip(below.windows(2)).map(pixel));
            std::mem::swap(above, below);
        }
    }
}
