//! Pixels of area light that are evaluated one by one: at edges and detail of a few pixels.

use super::grid::{Grid, SMALLEST};
use super::lines::Square;
use super::motion::AREA_EVALUATION_NS;
use super::patch::Patch;
use super::plane::Plane;
use super::radiance::Radiance;
use super::raster_work::RasterWork;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Least number of squares for a task.
const MIN_SQUARES: usize = 8;
/// Motion below this counts as none, px.
const STILL_PX: f64 = 0.02;
/// Time steps per pixel of motion, and their greatest number.
pub(crate) const STEPS_PX: f64 = 4.0;
const MAX_STEPS: usize = 256;
/// Limit of the time steps of a frame, and least limit of one pixel.
const ALL_STEPS: usize = 6_000_000;
const MIN_STEPS: usize = 64;
/// Radius (px) of edges that count as straight, and greatest number of cells a side.
const STRAIGHT: f64 = 8.0;
const MAX_CELLS: f64 = 16.0;

/// Time of an evaluation of the angle from an edge, ns.
pub const EDGE_NS: f64 = 45.0;

/// How the pixels of a square are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sampled {
    /// The middle of the pixel, over its time.
    Middle,
    /// The mean over its area and its time.
    All,
}

/// A square of sampled pixels.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Block {
    /// First column and row of the grid.
    pub at: [usize; 2],
    /// The light of each pixel, row by row, e-.
    pub e: [[f32; SMALLEST]; SMALLEST],
}

/// The light of the squares whose pixels are sampled, by rows of squares; none once the work limit
/// is over.
pub(crate) fn sampled(
    grid: &Grid<'_, '_>,
    mut marked: Vec<(Square, Sampled)>,
    work: &mut RasterWork,
) -> Vec<Vec<Block>> {
    marked.sort_by_key(|(square, _)| (square.y, square.x));
    let rows: Vec<&[(Square, Sampled)]> = marked.chunk_by(|(a, _), (b, _)| a.y == b.y).collect();
    let sampler = Sampler {
        grid,
        cells: cells(grid.radiance, grid.plane),
    };
    let rows = rows.into_par_iter();
    let rows = rows.filter(|_| !grid.plane.limit().is_over());
    let rows = rows.map(|squares| {
        let top = squares[0].0.y as f64 - grid.rim as f64;
        let skies: [Vec<Matrix3<f64>>; SMALLEST] =
            std::array::from_fn(|row| sampler.skies(top + row as f64));
        let squares = squares.par_iter().with_min_len(MIN_SQUARES);
        let blocks = squares.map(|(square, how)| sampler.block(square, *how, &skies));
        let (mut row, mut of_blocks) = (Vec::new(), Vec::new());
        blocks.unzip_into_vecs(&mut row, &mut of_blocks);
        let mut work = RasterWork::default();
        of_blocks.into_iter().for_each(|of_block| work += of_block);
        (row, work)
    });
    let (rows, of_rows): (Vec<Vec<Block>>, Vec<RasterWork>) = rows.unzip();
    of_rows.into_iter().for_each(|of_row| *work += of_row);
    rows
}

/// Samples the pixels of squares.
struct Sampler<'g, 'a, 'v> {
    grid: &'g Grid<'a, 'v>,
    /// Cells along a side of a pixel.
    cells: usize,
}

impl Sampler<'_, '_, '_> {
    /// The light of the pixels of a square that are needed; `skies` are the attitudes during the
    /// time of each row.
    fn block(
        &self,
        square: &Square,
        how: Sampled,
        skies: &[Vec<Matrix3<f64>>; SMALLEST],
    ) -> (Block, RasterWork) {
        let (at, mut work) = ([square.x, square.y], RasterWork::default());
        let mut block = Block {
            at,
            e: Default::default(),
        };
        for (j, (row, skies)) in block.e.iter_mut().zip(skies).enumerate() {
            for (i, e) in row.iter_mut().enumerate() {
                let at = [at[0] + i, at[1] + j];
                if !self.grid.is_needed(at, 1) || self.grid.plane.limit().is_over() {
                    continue;
                }
                let [x, y] = at.map(|from| from as f64 - self.grid.rim as f64);
                *e = match how {
                    Sampled::Middle => self.grid.at(x, y, &mut work).unwrap_or(0.0),
                    Sampled::All => self.mean(x, y, skies, &mut work),
                } as f32;
            }
        }
        let places = work.lights as f64 * self.grid.plane.place_ns();
        let evaluations = places + (work.lights + work.smeared) as f64 * AREA_EVALUATION_NS;
        let edges = (work.edges * skies[0].len()) as f64 * EDGE_NS;
        self.grid.plane.limit().spend(evaluations + edges);
        (block, work)
    }

    /// Attitudes during the time of a row's pixels, at the middles of equal steps.
    fn skies(&self, y: f64) -> Vec<Matrix3<f64>> {
        let [middle_s, duration_s] = self.grid.plane.open_s(y);
        let px = self.grid.motion * self.grid.plane.scale_px();
        let count = if px < STILL_PX {
            1
        } else {
            ((STEPS_PX * px) as usize + 2).min(max_steps(self.grid.plane.detector().pixels()))
        };
        let part = |i: usize| (i as f64 + 0.5) / count as f64 - 0.5;
        (0..count)
            .map(|i| self.grid.plane.to_sky(middle_s + part(i) * duration_s))
            .collect()
    }

    /// The mean light of a pixel, e-. Divided into cells if an edge is curved across it.
    fn mean(&self, x: f64, y: f64, skies: &[Matrix3<f64>], work: &mut RasterWork) -> f64 {
        let cells = self.cells;
        let side = 1.0 / cells as f64;
        let middle = |i: usize| (i as f64 + 0.5) * side - 0.5;
        let places = (0..cells * cells).map(|i| [x + middle(i % cells), y + middle(i / cells)]);
        let sum: f64 = places.map(|at| self.mean_of(at, side, skies, work)).sum();
        sum * side * side
    }

    /// The mean light of a square of `size` px around a position, e- a pixel. On each side of an
    /// edge the mean of its Gauss nodes represents that part of the square.
    fn mean_of(
        &self,
        at: [f64; 2],
        size: f64,
        skies: &[Matrix3<f64>],
        work: &mut RasterWork,
    ) -> f64 {
        let Some(patch) = Patch::new(self.grid.plane, at, size) else {
            return 0.0;
        };
        let crossings = skies
            .iter()
            .map(|sky| (sky, patch.crossing(self.grid.radiance.edge(), sky)));
        let count = skies.len() as f64;
        let middle = self.grid.plane.to_sky(self.grid.plane.open_s(at[1])[0]);
        if self.grid.radiance.is_hidden_inside() {
            let (mut outside, mut evaluations) = (0.0, 0);
            for (_, crossing) in crossings {
                outside += crossing.part(1);
                evaluations += crossing.evaluations;
            }
            work.edges += evaluations / skies.len().max(1);
            work.lights += 1;
            let (seen, solid_angle_sr) = patch.middle;
            let light = self.grid.radiance.toward(&(middle * seen)) * solid_angle_sr;
            return light * self.grid.scale_e * outside / count;
        }
        let (mut sum, mut evaluations, mut edges) = (0.0, 0, 0);
        if self.grid.is_still
            && patch.is_clear(self.grid.radiance.edge(), &middle, self.grid.motion)
        {
            let places = patch.places.iter().flatten();
            let lights = places
                .map(|(seen, solid_angle_sr)| self.grid.light(&(middle * seen), *solid_angle_sr));
            work.lights += 4;
            work.edges += 1;
            return lights.sum::<f64>() / 4.0;
        }
        for (sky, crossing) in crossings {
            let (mut sides, mut counts) = ([0.0; 2], [0.0; 2]);
            for (position, edge) in patch.places.iter().zip(crossing.places) {
                if let Some((seen, solid_angle_sr)) = position {
                    let side = usize::from(edge > 0.0);
                    sides[side] += self.grid.light(&(sky * seen), *solid_angle_sr);
                    counts[side] += 1.0;
                }
            }
            for side in 0..2 {
                let part = crossing.part(side);
                if counts[side] > 0.0 {
                    sum += part * sides[side] / counts[side];
                } else if part > 0.0 {
                    // This side of the edge has no node: its corner represents it.
                    let corner = self
                        .grid
                        .plane
                        .solid_angle_sr(patch.corner(&crossing, side));
                    sum += corner.map_or(0.0, |(seen, solid_angle_sr)| {
                        part * self.grid.light(&(sky * seen), solid_angle_sr)
                    });
                }
            }
            evaluations += 4;
            edges += crossing.evaluations;
        }
        let still = evaluations / skies.len().max(1);
        work.lights += still;
        work.smeared += evaluations - still;
        work.edges += edges / skies.len().max(1);
        sum / count
    }
}

/// Number of cells along a side of a pixel, so that edges are nearly straight across each. An edge
/// of a radius of r sides bends by `1 / 8 r` of a side.
fn cells(radiance: &dyn Radiance, plane: &Plane<'_>) -> usize {
    radiance.edge().map_or(1, |edge| {
        let radius_px = edge.radius() * plane.scale_px();
        (STRAIGHT / radius_px).ceil().clamp(1.0, MAX_CELLS) as usize
    })
}

/// Greatest number of time steps of a pixel in a frame of so many `pixels`.
pub(crate) fn max_steps(pixels: usize) -> usize {
    (ALL_STEPS / pixels.max(1)).clamp(MIN_STEPS, MAX_STEPS)
}
