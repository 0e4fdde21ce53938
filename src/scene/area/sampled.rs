//! Pixels of area light that are worked out each for itself: where there is an edge, or detail as small as a few pixels.

use super::Asked;
use super::blur::LANES;
use super::lay::Grid;
use super::lines::{Lines, Square};
use super::patch::Patch;
use super::{Radiance, plane::Plane};
use crate::lanes;
use nalgebra::Matrix3;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;
use std::ops::Range;

/// Rows that are worked out together where pixels are.
const BAND: usize = 32;
/// What moves by less (px) stands still.
const STILL_PX: f64 = 0.02;
/// Steps of the time of a pixel for each pixel that the light moves by, and at most.
pub const STEPS_PX: f64 = 4.0;
const MOST_STEPS: usize = 256;
/// A frame has no more of them than this for all its pixels, but for the least that there are of each.
const ALL_STEPS: usize = 6_000_000;
const LEAST_STEPS: usize = 64;
/// Edges of this radius (px) are straight enough, and more cells than this a side are none the better.
const STRAIGHT: f64 = 8.0;
const MOST_CELLS: f64 = 16.0;

/// How a pixel gets its light.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Sampled {
    /// From lines between places around it.
    #[default]
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

impl Grid<'_, '_> {
    /// Each pixel's light, e-, with [`LANES`] values more, and how each gets it: even light, or means over its area and its time.
    pub fn pixels(
        &self,
        lines: &Lines,
        marked: &[(Square, Sampled)],
        asked: &mut Asked,
    ) -> (Vec<f32>, Vec<Sampled>) {
        let [columns, rows] = self.size;
        let mut e: Vec<f32> = lanes::blank(columns * rows + LANES);
        let mut sampled: Vec<Sampled> = lanes::blank(columns * rows);
        let bands = e[..columns * rows].par_chunks_mut(columns * BAND);
        let bands = bands.zip(sampled.par_chunks_mut(columns * BAND));
        let sums = bands.enumerate().map(|(band, (e, sampled))| {
            let rows = band * BAND..band * BAND + e.len() / columns;
            for (square, how) in marked {
                let here = square.y.max(rows.start)..(square.y + square.side).min(rows.end);
                for row in here {
                    let line = &mut sampled[(row - rows.start) * columns..][..columns];
                    line[square.x..(square.x + square.side).min(columns)].fill(*how);
                }
            }
            lines.add_to(Some(Level::best()), rows.start * columns, e);
            self.sample(rows, e, sampled)
        });
        *asked += sums.reduce(Asked::default, |mut a, b| {
            a += b;
            a
        });
        (e, sampled)
    }

    /// Pixels of some rows that are marked become means over their area and their time.
    fn sample(&self, rows: Range<usize>, e: &mut [f32], sampled: &[Sampled]) -> Asked {
        let (columns, mut asked) = (self.size[0], Asked::default());
        let cells = cells(self.radiance, self.plane);
        let lines = e
            .chunks_exact_mut(columns)
            .zip(sampled.chunks_exact(columns));
        for (row, (e, sampled)) in rows.zip(lines) {
            if !sampled.iter().any(Sampled::is_marked) {
                continue;
            }
            let y = row as f64 - self.margin as f64;
            let skies = self.skies(y);
            for (column, (e, how)) in e.iter_mut().zip(sampled).enumerate() {
                let x = column as f64 - self.margin as f64;
                match how {
                    Sampled::No => {}
                    Sampled::Middle => *e = self.at(x, y, &mut asked).unwrap_or(0.0) as f32,
                    Sampled::All => *e = self.mean(x, y, cells, &skies, &mut asked) as f32,
                }
            }
        }
        asked
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
    fn mean(&self, x: f64, y: f64, cells: usize, skies: &[Matrix3<f64>], asked: &mut Asked) -> f64 {
        let side = 1.0 / cells as f64;
        let middle = |i: usize| (i as f64 + 0.5) * side - 0.5;
        let places = (0..cells * cells).map(|i| [x + middle(i % cells), y + middle(i / cells)]);
        let sum: f64 = places.map(|at| self.mean_of(at, side, skies, asked)).sum();
        sum * side * side
    }

    /// The mean light of a square around a place, its side in px, e- a pixel. Each side of an edge has the mean of those of four places (Gauss)
    /// that are on it, for the part of the square that it takes.
    fn mean_of(&self, at: [f64; 2], size: f64, skies: &[Matrix3<f64>], asked: &mut Asked) -> f64 {
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
            asked.edges += looks / skies.len().max(1);
            asked.lights += 1;
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
        asked.lights += still;
        asked.smeared += looks - still;
        asked.edges += edges / skies.len().max(1);
        sum / count
    }
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
