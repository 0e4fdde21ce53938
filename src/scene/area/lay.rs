//! Area light on the pixels.
//!
//! Where it is even, its value is worked out on a grid that is as fine as it asks for, and runs in straight lines between; where there is
//! an edge, or detail as small as a few pixels, each pixel is the mean over its area and its time, and the point spread function blurs
//! them (`blur`).

use super::Radiance;
use super::blur::Blur;
use super::plane::Plane;
use crate::fidelity::Fidelity;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

/// Side of the grid's largest squares, px.
const SQUARE: usize = 32;
/// Squares of this side that straight lines do not fill are sampled.
const SMALLEST: usize = 4;
/// What moves by less (px) stands still.
const STILL_PX: f64 = 0.02;
/// Steps of the time of a pixel for each pixel that the light moves by, and at most.
pub const STEPS_PX: f64 = 4.0;
const MOST_STEPS: usize = 256;
/// A frame has no more of them than this for all its pixels, but for the least that there are of each.
const ALL_STEPS: usize = 6_000_000;
const LEAST_STEPS: usize = 16;
/// Edges of this radius (px) are straight enough, and more cells than this a side are none the better.
const STRAIGHT: f64 = 8.0;
const MOST_CELLS: f64 = 16.0;
/// The two points of Gauss's rule, px from the middle of a pixel: 1 / (2 sqrt 3).
const GAUSS: f64 = 0.288_675_134_594_812_9;

/// Light on pixels: of the detector and of a margin around it.
pub struct Laid {
    /// e- of each pixel of the detector, row by row.
    pub e: Vec<f32>,
    /// How many times the radiance was asked for.
    pub asked: usize,
}

/// One square of the grid, with the light at its corners and between them.
struct Square {
    x: i64,
    y: i64,
    side: usize,
    corners: [Option<f64>; 4],
}

/// What lays one band of squares.
struct Band<'a, 'v> {
    radiance: &'a dyn Radiance,
    plane: &'a Plane<'v>,
    fidelity: &'a Fidelity,
    scale_e: f64,
    /// First column and row, columns.
    from: [i64; 2],
    columns: usize,
    motion: f64,
    /// Along a side of a pixel.
    cells: usize,
    e: &'a mut [f32],
    sampled: &'a mut [bool],
    asked: usize,
}

/// Lays `radiance`, of which a pixel takes `scale_e` electrons a steradian.
pub fn lay(
    radiance: &dyn Radiance,
    plane: &Plane<'_>,
    blur: &Blur<'_>,
    scale_e: f64,
    fidelity: &Fidelity,
) -> Laid {
    let [width, height] = blur.size();
    let margin = blur.margin();
    let (columns, rows) = (width + 2 * margin, height + 2 * margin);
    let from = [-(margin as i64); 2];
    let mut e = vec![0.0f32; columns * rows];
    let mut sampled = vec![false; columns * rows];
    let bands = e
        .par_chunks_mut(columns * SQUARE)
        .zip(sampled.par_chunks_mut(columns * SQUARE));
    let asked = bands.enumerate().map(|(i, (e, sampled))| {
        let mut band = Band {
            radiance,
            plane,
            fidelity,
            scale_e,
            from: [from[0], from[1] + (i * SQUARE) as i64],
            columns,
            motion: plane.motion(),
            cells: cells(radiance, plane),
            e,
            sampled,
            asked: 0,
        };
        band.lay();
        band.asked
    });
    let asked = asked.sum();
    Laid {
        e: blur.blurred(e, &sampled),
        asked,
    }
}

impl Band<'_, '_> {
    fn lay(&mut self) {
        let y = self.from[1];
        for column in (0..self.columns).step_by(SQUARE) {
            let x = self.from[0] + column as i64;
            let (a, b) = (x + SQUARE as i64, y + SQUARE as i64);
            let corners =
                [[x, y], [a, y], [x, b], [a, b]].map(|[x, y]| self.at(x as f64, y as f64));
            self.refine(Square {
                x,
                y,
                side: SQUARE,
                corners,
            });
        }
        self.sample();
    }

    /// The light (e-) of a pixel around a place, as it is in the middle of its time; none where the plane has no direction.
    fn at(&mut self, x: f64, y: f64) -> Option<f64> {
        let (seen, taken) = self.plane.taken([x, y])?;
        self.asked += 1;
        let sky = self.plane.to_sky(self.plane.open_s(y)[0]);
        Some(self.light(&(sky * seen), taken))
    }

    fn light(&self, direction: &Vector3<f64>, taken: f64) -> f64 {
        let taken = if self.radiance.is_of_pixels() {
            1.0
        } else {
            taken
        };
        self.radiance.toward(direction) * taken * self.scale_e
    }

    /// Whether an edge may run through a square, while it moves.
    fn has_edge(&self, square: &Square) -> bool {
        if !self.radiance.has_edges() {
            return false;
        }
        let half = square.side as f64 / 2.0;
        let middle = [square.x as f64 + half, square.y as f64 + half];
        let Some((seen, _)) = self.plane.taken(middle) else {
            return true;
        };
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        let radius = corners.iter().map(|[x, y]| {
            let corner = self
                .plane
                .taken([middle[0] + x * (half + 1.0), middle[1] + y * (half + 1.0)]);
            corner.map_or(f64::INFINITY, |(corner, _)| seen.angle(&corner))
        });
        let radius = radius.fold(0.0, f64::max) + self.motion / 2.0;
        let sky = self.plane.to_sky(self.plane.open_s(middle[1])[0]);
        let nearest = self.radiance.edge(&(sky * seen)).abs();
        nearest <= radius || nearest.is_nan()
    }

    fn refine(&mut self, square: Square) {
        let Square {
            x,
            y,
            side,
            corners,
        } = square;
        let (dx, dy) = (x - self.from[0], y - self.from[1]);
        if dx >= self.columns as i64 || dy * self.columns as i64 >= self.e.len() as i64 {
            return;
        }
        let half = side / 2;
        let (fx, fy, h) = (x as f64, y as f64, half as f64);
        let between = [[h, 0.0], [0.0, h], [h, h], [2.0 * h, h], [h, 2.0 * h]];
        let between = between.map(|[dx, dy]| self.at(fx + dx, fy + dy));
        let [a, b, c, d] = corners;
        let [top, left, middle, right, bottom] = between;
        let nodes = [a, top, b, left, middle, right, c, bottom, d];
        // Beyond the projection's end there is no light; on it there is an edge.
        if nodes.iter().all(Option::is_none) {
            return;
        }
        let value = |node: Option<f64>| node.unwrap_or(0.0);
        let ends = [value(a), value(b), value(c), value(d)];
        let lines = [
            (ends[0] + ends[1]) / 2.0,
            (ends[0] + ends[2]) / 2.0,
            ends.iter().sum::<f64>() / 4.0,
            (ends[1] + ends[3]) / 2.0,
            (ends[2] + ends[3]) / 2.0,
        ];
        let Fidelity {
            area_e, area_part, ..
        } = self.fidelity;
        let even = between.iter().zip(lines).all(|(node, line)| {
            // Between nine nodes lines miss a quarter of what they miss between four, across and down together up to half.
            node.is_some_and(|node| (node - line).abs() <= 2.0 * (area_e + area_part * node.abs()))
        }) && nodes.iter().all(Option::is_some);
        if even && !self.has_edge(&square) {
            self.fill(&square, &nodes.map(value));
        } else if side <= SMALLEST {
            self.mark(&square);
        } else {
            let quarters = [
                (0, 0, [a, top, left, middle]),
                (half, 0, [top, b, middle, right]),
                (0, half, [left, middle, c, bottom]),
                (half, half, [middle, right, bottom, d]),
            ];
            for (dx, dy, corners) in quarters {
                self.refine(Square {
                    x: x + dx as i64,
                    y: y + dy as i64,
                    side: half,
                    corners,
                });
            }
        }
    }

    /// The pixels of a square that are in this band, each with its place in the square.
    fn pixels(&self, square: &Square) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
        let columns = self.columns;
        let rows = self.e.len() / columns;
        let (dx, dy) = (
            (square.x - self.from[0]) as usize,
            (square.y - self.from[1]) as usize,
        );
        let side = square.side;
        (0..side.min(rows.saturating_sub(dy))).flat_map(move |j| {
            (0..side.min(columns.saturating_sub(dx)))
                .map(move |i| ((dy + j) * columns + dx + i, i, j))
        })
    }

    /// Straight lines between nine nodes.
    fn fill(&mut self, square: &Square, nodes: &[f64; 9]) {
        let half = square.side / 2;
        for (pixel, i, j) in self.pixels(square) {
            let (cell, down) = (3 * (j / half) + i / half, (j % half) as f64 / half as f64);
            let part = (i % half) as f64 / half as f64;
            let line = |from: usize| nodes[from] + (nodes[from + 1] - nodes[from]) * part;
            let (above, below) = (line(cell), line(cell + 3));
            self.e[pixel] = (above + (below - above) * down) as f32;
        }
    }

    fn mark(&mut self, square: &Square) {
        for (pixel, ..) in self.pixels(square) {
            self.sampled[pixel] = true;
        }
    }

    /// Pixels that are marked become means over their area and their time.
    fn sample(&mut self) {
        let columns = self.columns;
        let rows = self.e.len() / columns;
        for row in 0..rows {
            let marked = row * columns..(row + 1) * columns;
            if !self.sampled[marked.clone()].contains(&true) {
                continue;
            }
            let y = (self.from[1] + row as i64) as f64;
            let skies = self.skies(y);
            for pixel in marked {
                if self.sampled[pixel] {
                    let x = (self.from[0] + (pixel % columns) as i64) as f64;
                    self.e[pixel] = self.mean(x, y, &skies) as f32;
                }
            }
        }
    }

    /// Attitudes during the time of a row's pixels: midpoints of even steps.
    fn skies(&self, y: f64) -> Vec<Matrix3<f64>> {
        let [middle_s, duration_s] = self.plane.open_s(y);
        let px = self.motion * self.plane.scale_px();
        let count = if px < STILL_PX {
            1
        } else {
            ((STEPS_PX * px) as usize + 2).min(most_steps(self.plane.pixels()))
        };
        let part = |i: usize| (i as f64 + 0.5) / count as f64 - 0.5;
        (0..count)
            .map(|i| self.plane.to_sky(middle_s + part(i) * duration_s))
            .collect()
    }

    /// The mean light of a pixel, e-: of its cells, if an edge is so strongly curved that it is not straight across a pixel.
    fn mean(&mut self, x: f64, y: f64, skies: &[Matrix3<f64>]) -> f64 {
        let cells = self.cells;
        let side = 1.0 / cells as f64;
        let middle = |i: usize| (i as f64 + 0.5) * side - 0.5;
        let places = (0..cells * cells).map(|i| [x + middle(i % cells), y + middle(i / cells)]);
        let sum: f64 = places.map(|at| self.mean_of(at, side, skies)).sum();
        self.asked += 4 * skies.len() * cells * cells;
        sum * side * side
    }

    /// The mean light of a square around a place, its side in px, e- a pixel. Each side of an edge has the mean of those of four places (Gauss)
    /// that are on it, for the part of the square that it takes.
    fn mean_of(&self, [x, y]: [f64; 2], size: f64, skies: &[Matrix3<f64>]) -> f64 {
        let plane = self.plane;
        let gauss = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .map(|off| off.map(|off: f64| off * GAUSS * size))
            .map(|[u, v]| plane.taken([x + u, y + v]));
        let Some((centre, taken)) = plane.taken([x, y]) else {
            return 0.0;
        };
        let mut sum = 0.0;
        for sky in skies {
            let at = sky * centre;
            let offs = gauss.map(|place| place.map(|(seen, taken)| (sky * seen, taken)));
            let edges = offs.map(|place| place.map(|(at, _)| self.radiance.edge(&at)));
            let crossing = Crossing::of(self.radiance.edge(&at), edges);
            let (mut sides, mut counts) = ([0.0; 2], [0.0; 2]);
            for ((at, taken), edge) in offs.iter().flatten().zip(edges.iter().flatten()) {
                let side = usize::from(*edge > 0.0);
                sides[side] += self.light(at, *taken);
                counts[side] += 1.0;
            }
            for side in 0..2 {
                let part = crossing.part(side);
                if counts[side] > 0.0 {
                    sum += part * sides[side] / counts[side];
                } else if part > 0.0 {
                    // The corner that no place is in.
                    let [u, v] = crossing.inside(side);
                    if let Some((seen, _)) = plane.taken([x + u * size, y + v * size]) {
                        sum += part * self.light(&(sky * seen), taken);
                    }
                }
            }
        }
        sum / skies.len() as f64
    }
}

/// Into how many cells a pixel is cut on a side, so that edges are nearly straight across each: they bow out of it by `1 / 8 r` of it
/// where their radius is r of it.
fn cells(radiance: &dyn Radiance, plane: &Plane<'_>) -> usize {
    let radius_px = radiance.edge_radius() * plane.scale_px();
    (STRAIGHT / radius_px).ceil().clamp(1.0, MOST_CELLS) as usize
}

/// In how many steps the time of a pixel is taken at most, in a frame of so many pixels.
pub fn most_steps(pixels: usize) -> usize {
    (ALL_STEPS / pixels.max(1)).clamp(LEAST_STEPS, MOST_STEPS)
}

/// A straight edge across a pixel: its signed distance (rad) from the middle, positive outside, and how that grows along
/// columns and rows (rad/px).
struct Crossing {
    middle: f64,
    slope: [f64; 2],
}

impl Crossing {
    fn of(middle: f64, [a, b, c, d]: [Option<f64>; 4]) -> Crossing {
        let slope = match (a, b, c, d) {
            (Some(a), Some(b), Some(c), Some(d)) if middle.is_finite() => [
                (b + d - a - c) / (4.0 * GAUSS),
                (c + d - a - b) / (4.0 * GAUSS),
            ],
            _ => [0.0; 2],
        };
        Crossing { middle, slope }
    }

    /// The part of the pixel that lies inside (0) or outside (1) of the edge. With slopes a >= b >= 0 and p(x) = max(x, 0)^2,
    ///
    /// ```text
    /// outside = (p(m + (a + b)/2) - p(m + (a - b)/2) - p(m - (a - b)/2) + p(m - (a + b)/2)) / 2ab
    /// ```
    fn part(&self, side: usize) -> f64 {
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

    /// A place (px from the middle) on that side of the edge, towards its corner.
    fn inside(&self, side: usize) -> [f64; 2] {
        let sign = if side == 1 { 0.45 } else { -0.45 };
        self.slope.map(|slope| sign * slope.signum())
    }
}
