//! Area light on the pixels.
//!
//! Where it is even, its value is worked out on a grid that is as fine as it asks for, and runs in straight lines between; where there is
//! an edge, or detail as small as a few pixels, each pixel is the mean over its area and its time, and the point spread function blurs
//! them (`blur`).

use super::blur::Blur;
use super::patch::Patch;
use super::plane::Plane;
use super::{Asked, Radiance};
use crate::fidelity::Fidelity;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::ops::Range;

/// Side of the grid's largest squares, px.
const SQUARE: usize = 32;
/// Squares of this side that straight lines do not fill are sampled.
const SMALLEST: usize = 4;
/// Where lines miss no more than this many times what they may, the middle of a pixel stands for all of it: of a bend b (e-/px^2) lines
/// across [`SMALLEST`] miss 2 b, and the middle b / 24, of two bends together.
const MIDDLE: f64 = 24.0;
/// Of an even bend lines across a quarter of a square miss a quarter of what they miss across it. Where they seem to miss less than that, a kink or a thin layer lies between
/// the places at which it is looked: what they miss is believed where it was no more than so many times what it may be before.
const QUARTERED: f64 = 4.0;
const LUCK: f64 = 1.5 * QUARTERED;
/// What moves by less (px) stands still.
const STILL_PX: f64 = 0.02;
/// Steps of the time of a pixel for each pixel that the light moves by, and at most.
pub const STEPS_PX: f64 = 4.0;
const MOST_STEPS: usize = 256;
/// A frame has no more of them than this for all its pixels, but for the least that there are of each.
const ALL_STEPS: usize = 6_000_000;
const LEAST_STEPS: usize = 64;
/// Longest part (px) of the way of what moves that three places are looked at on, and how much its middle may be off the line between its
/// ends, in units of what lines may miss: what Simpson's rule then errs by is far less.
const PANEL_PX: f64 = 4.0;
const BEND: f64 = 12.0;
/// How often a part is halved at most.
const HALVINGS: u32 = 5;
/// Edges of this radius (px) are straight enough, and more cells than this a side are none the better.
const STRAIGHT: f64 = 8.0;
const MOST_CELLS: f64 = 16.0;

/// How a pixel gets its light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampled {
    /// From lines between places around it.
    No,
    /// It is that of its middle, over its time.
    Middle,
    /// It is the mean over its area and its time.
    All,
}

impl Sampled {
    /// Whether it is worked out for the pixel itself.
    pub fn is_marked(&self) -> bool {
        *self != Sampled::No
    }
}

/// Light on pixels: of the detector and of a margin around it.
pub struct Laid {
    /// e- of each pixel of the detector, row by row.
    pub e: Vec<f32>,
    /// What was asked for it.
    pub asked: Asked,
}

/// One square of the grid, with the light at its corners and between them.
struct Square {
    x: i64,
    y: i64,
    side: usize,
    corners: [Option<f64>; 4],
    /// How often lines across the square that it is a quarter of missed what they may; 0 of the largest.
    missed: f64,
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
    sampled: &'a mut [Sampled],
    asked: Asked,
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
    let mut sampled = vec![Sampled::No; columns * rows];
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
            asked: Asked::default(),
        };
        band.lay();
        band.asked
    });
    let mut asked = asked.reduce(Asked::default, |mut a, b| {
        a += b;
        a
    });
    let e = blur.blurred(e, &sampled, &mut asked);
    Laid { e, asked }
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
                missed: 0.0,
            });
        }
        self.sample();
    }

    /// The light (e-) of a pixel around a place: the mean over its time, or where the pattern moves by little, that in its
    /// middle; none where the plane has no direction.
    fn at(&mut self, x: f64, y: f64) -> Option<f64> {
        let (seen, taken) = self.plane.taken([x, y])?;
        let [middle_s, duration_s] = self.plane.open_s(y);
        let moved_px = self.motion * self.plane.scale_px();
        let light = |part: f64| {
            let sky = self.plane.to_sky(middle_s + (part - 0.5) * duration_s);
            self.light(&(sky * seen), taken)
        };
        let Fidelity {
            area_e, area_part, ..
        } = *self.fidelity;
        let bent = |value: f64| BEND * (area_e + area_part * value.abs());
        let (mean, looks) = match panels(self.radiance, moved_px) {
            0 => (light(0.5), 1),
            panels => mean(light, panels, bent),
        };
        self.asked.lights += 1;
        self.asked.smeared += looks - 1;
        Some(mean)
    }

    fn light(&self, direction: &Vector3<f64>, taken: f64) -> f64 {
        let taken = if self.radiance.is_of_pixels() {
            1.0
        } else {
            taken
        };
        self.radiance.seen(direction) * taken * self.scale_e
    }

    /// Whether an edge may run through a square, while it moves.
    fn has_edge(&mut self, square: &Square) -> bool {
        let Some(edge) = self.radiance.edge() else {
            return false;
        };
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
            corner.map_or(f64::INFINITY, |(corner, _)| (corner - seen).norm())
        });
        let radius = radius.fold(0.0, f64::max) + self.motion / 2.0;
        let sky = self.plane.to_sky(self.plane.open_s(middle[1])[0]);
        self.asked.edges += 1;
        let nearest = edge.angle(&(sky * seen)).abs();
        nearest <= radius || nearest.is_nan()
    }

    fn refine(&mut self, square: Square) {
        let Square {
            x,
            y,
            side,
            corners,
            missed: before,
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
        let missed = between.iter().zip(lines).map(|(node, line)| {
            // Between nine nodes lines miss a quarter of what they miss between four, across and down together up to half.
            node.map_or(f64::INFINITY, |node| {
                (node - line).abs() / (2.0 * (area_e + area_part * node.abs()))
            })
        });
        let missed = missed.fold(0.0, f64::max);
        let is_whole = nodes.iter().all(Option::is_some) && !self.has_edge(&square);
        if is_whole && missed <= 1.0 && before <= LUCK {
            self.fill(&square, &nodes.map(value));
        } else if side <= SMALLEST {
            let bent = !is_whole || missed.max(before / QUARTERED) > MIDDLE;
            self.mark(&square, if bent { Sampled::All } else { Sampled::Middle });
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
                    missed,
                });
            }
        }
    }

    /// The rows of a square, as far as they are in this band.
    fn rows(&self, square: &Square) -> impl Iterator<Item = Range<usize>> + use<> {
        let columns = self.columns;
        let rows = self.e.len() / columns;
        let x = (square.x - self.from[0]) as usize;
        let y = (square.y - self.from[1]) as usize;
        let past = (x + square.side).min(columns);
        (y..(y + square.side).min(rows)).map(move |row| row * columns + x..row * columns + past)
    }

    /// Straight lines between nine nodes.
    fn fill(&mut self, square: &Square, nodes: &[f64; 9]) {
        let half = square.side / 2;
        let step = 1.0 / half as f64;
        for (j, row) in self.rows(square).enumerate() {
            let (above, down) = (3 * (j / half), (j % half) as f64 * step);
            let line = [0, 1, 2].map(|i| {
                let (from, to) = (nodes[above + i], nodes[above + i + 3]);
                from + (to - from) * down
            });
            let halves = self.e[row].chunks_mut(half).zip([[0, 1], [1, 2]]);
            for (pixels, [a, b]) in halves {
                let (from, rise) = (line[a], (line[b] - line[a]) * step);
                for (i, pixel) in pixels.iter_mut().enumerate() {
                    *pixel = (from + rise * i as f64) as f32;
                }
            }
        }
    }

    fn mark(&mut self, square: &Square, how: Sampled) {
        for row in self.rows(square) {
            self.sampled[row].fill(how);
        }
    }

    /// Pixels that are marked become means over their area and their time.
    fn sample(&mut self) {
        let columns = self.columns;
        let rows = self.e.len() / columns;
        for row in 0..rows {
            let marked = row * columns..(row + 1) * columns;
            if !self.sampled[marked.clone()].iter().any(Sampled::is_marked) {
                continue;
            }
            let y = (self.from[1] + row as i64) as f64;
            let skies = self.skies(y);
            for pixel in marked {
                let x = (self.from[0] + (pixel % columns) as i64) as f64;
                match self.sampled[pixel] {
                    Sampled::No => {}
                    Sampled::Middle => self.e[pixel] = self.at(x, y).unwrap_or(0.0) as f32,
                    Sampled::All => self.e[pixel] = self.mean(x, y, &skies) as f32,
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
        sum * side * side
    }

    /// The mean light of a square around a place, its side in px, e- a pixel. Each side of an edge has the mean of those of four places (Gauss)
    /// that are on it, for the part of the square that it takes.
    fn mean_of(&mut self, at: [f64; 2], size: f64, skies: &[Matrix3<f64>]) -> f64 {
        let Some(patch) = Patch::new(self.plane, at, size) else {
            return 0.0;
        };
        let crossings = skies
            .iter()
            .map(|sky| (sky, patch.crossing(self.radiance.edge(), sky)));
        let count = skies.len() as f64;
        if self.radiance.is_hidden_inside() {
            let (outside, looks) = crossings.fold((0.0, 0), |(outside, looks), (_, crossing)| {
                (outside + crossing.part(1), looks + crossing.looks)
            });
            self.asked.edges += looks / skies.len().max(1);
            self.asked.lights += 1;
            let sky = self.plane.to_sky(self.plane.open_s(at[1])[0]);
            let (middle, taken) = patch.middle;
            return self.radiance.toward(&(sky * middle)) * taken * self.scale_e * outside / count;
        }
        let (mut sum, mut looks, mut edges) = (0.0, 0, 0);
        for (sky, crossing) in crossings {
            let (mut sides, mut counts) = ([0.0; 2], [0.0; 2]);
            for (place, edge) in patch.places.iter().zip(crossing.places) {
                if let Some((seen, taken)) = place {
                    let side = usize::from(edge > 0.0);
                    sides[side] += self.light(&(sky * seen), *taken);
                    counts[side] += 1.0;
                }
            }
            for side in 0..2 {
                let part = crossing.part(side);
                if counts[side] > 0.0 {
                    sum += part * sides[side] / counts[side];
                } else if part > 0.0 {
                    // The corner that no place is in.
                    let corner = self.plane.taken(patch.corner(&crossing, side));
                    sum +=
                        corner.map_or(0.0, |(seen, taken)| part * self.light(&(sky * seen), taken));
                }
            }
            looks += 4;
            edges += crossing.looks;
        }
        let still = looks / skies.len().max(1);
        self.asked.lights += still;
        self.asked.smeared += looks - still;
        self.asked.edges += edges / skies.len().max(1);
        sum / count
    }
}

/// Into how many parts a way of so many px is divided at first: none where all of it is as good as straight, as it is where the way is no longer
/// than squares which tell that light is.
pub fn panels(radiance: &dyn Radiance, moved_px: f64) -> usize {
    let (still_px, panel_px) = if radiance.is_of_pixels() {
        return 0;
    } else if radiance.is_hidden_inside() {
        (SQUARE as f64, SQUARE as f64)
    } else {
        (1.0, PANEL_PX)
    };
    if moved_px <= still_px {
        0
    } else {
        (moved_px / panel_px).ceil() as usize
    }
}

/// The mean of `value` from 0 to 1 by Simpson's rule on `panels` even panels, each halved until its middle is no further off the line between its
/// ends than `bent` tells of its value; and how often it was asked for.
fn mean(value: impl Fn(f64) -> f64, panels: usize, bent: impl Fn(f64) -> f64) -> (f64, usize) {
    let side = 1.0 / panels as f64;
    let (mut sum, mut looks) = (0.0, 1);
    let mut open: Vec<([f64; 3], f64, f64, u32)> = Vec::new();
    let mut before = value(0.0);
    for panel in 0..panels {
        let from = panel as f64 * side;
        let after = value(from + side);
        open.push(([before, value(from + side / 2.0), after], from, side, 0));
        before = after;
        looks += 2;
        while let Some(([a, b, c], from, side, halved)) = open.pop() {
            let off = (a + c) / 2.0 - b;
            if halved == HALVINGS || off.abs() <= bent(b) {
                sum += side * (a + 4.0 * b + c) / 6.0;
                continue;
            }
            let [left, right] = [0.25, 0.75].map(|part| value(from + part * side));
            looks += 2;
            let half = side / 2.0;
            open.push(([b, right, c], from + half, half, halved + 1));
            open.push(([a, left, b], from, half, halved + 1));
        }
    }
    (sum, looks)
}

/// Into how many cells a pixel is cut on a side, so that edges are nearly straight across each: they bow out of it by `1 / 8 r` of it
/// where their radius is r of it.
fn cells(radiance: &dyn Radiance, plane: &Plane<'_>) -> usize {
    radiance.edge().map_or(1, |edge| {
        let radius_px = edge.radius() * plane.scale_px();
        (STRAIGHT / radius_px).ceil().clamp(1.0, MOST_CELLS) as usize
    })
}

/// In how many steps the time of a pixel is taken at most, in a frame of so many pixels.
pub fn most_steps(pixels: usize) -> usize {
    (ALL_STEPS / pixels.max(1)).clamp(LEAST_STEPS, MOST_STEPS)
}
