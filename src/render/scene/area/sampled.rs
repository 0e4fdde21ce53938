//! Pixels of area light that are evaluated one by one: at edges and detail of a few pixels.

use super::asked::Requested;
use super::grid::{Grid, SMALLEST};
use super::lines::Square;
use super::motion::AREA_LOOK_NS;
use super::patch::Patch;
use super::plane::Plane;
use super::radiance::Radiance;
use nalgebra::Matrix3;
use rayon::prelude::*;

/// Least number of squares for a thread of its own.
const FEW: usize = 8;
/// Motion below this counts as none, px.
const STILL_PX: f64 = 0.02;
/// Time steps for each pixel that the light moves by, and at most.
pub const STEPS_PX: f64 = 4.0;
const MAX_STEPS: usize = 256;
/// Most time steps of all pixels of a frame, and least of one pixel.
const ALL_STEPS: usize = 6_000_000;
const MIN_STEPS: usize = 64;
/// Edges of this radius (px) are straight enough; more cells a side than this do not help.
const STRAIGHT: f64 = 8.0;
const MAX_CELLS: f64 = 16.0;

/// ns of an evaluation of the angle from an edge.
pub const EDGE_NS: f64 = 45.0;

/// How the pixels of a square are evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sampled {
    /// The middle of the pixel, over its time.
    Middle,
    /// The mean over its area and its time.
    All,
}

/// A square of sampled pixels.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// First column and row of the grid.
    pub at: [usize; 2],
    /// The light of each pixel, row by row, e-.
    pub e: [[f32; SMALLEST]; SMALLEST],
}

/// The light of the squares whose pixels are sampled, by rows of squares; none once the work limit
/// is over.
pub fn sampled(
    grid: &Grid<'_, '_>,
    mut marked: Vec<(Square, Sampled)>,
    requested: &mut Requested,
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
        let squares = squares.par_iter().with_min_len(FEW);
        let blocks = squares.map(|(square, how)| sampler.block(square, *how, &skies));
        let (mut row, mut of_blocks) = (Vec::new(), Vec::new());
        blocks.unzip_into_vecs(&mut row, &mut of_blocks);
        let mut requested = Requested::default();
        of_blocks
            .into_iter()
            .for_each(|of_block| requested += of_block);
        (row, requested)
    });
    let (rows, of_rows): (Vec<Vec<Block>>, Vec<Requested>) = rows.unzip();
    of_rows.into_iter().for_each(|of_row| *requested += of_row);
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
    ) -> (Block, Requested) {
        let (at, mut requested) = ([square.x, square.y], Requested::default());
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
                    Sampled::Middle => self.grid.at(x, y, &mut requested).unwrap_or(0.0),
                    Sampled::All => self.mean(x, y, skies, &mut requested),
                } as f32;
            }
        }
        let places = requested.lights as f64 * self.grid.plane.place_ns();
        let looks = places + (requested.lights + requested.smeared) as f64 * AREA_LOOK_NS;
        let edges = (requested.edges * skies[0].len()) as f64 * EDGE_NS;
        self.grid.plane.limit().spend(looks + edges);
        (block, requested)
    }

    /// Attitudes during the time of a row's pixels, at the middles of equal steps.
    fn skies(&self, y: f64) -> Vec<Matrix3<f64>> {
        let [middle_s, duration_s] = self.grid.plane.open_s(y);
        let px = self.grid.motion * self.grid.plane.scale_px();
        let count = if px < STILL_PX {
            1
        } else {
            ((STEPS_PX * px) as usize + 2).min(most_steps(self.grid.plane.detector().pixels()))
        };
        let part = |i: usize| (i as f64 + 0.5) / count as f64 - 0.5;
        (0..count)
            .map(|i| self.grid.plane.to_sky(middle_s + part(i) * duration_s))
            .collect()
    }

    /// The mean light of a pixel, e-. It is divided into cells if an edge is not straight across
    /// it.
    fn mean(&self, x: f64, y: f64, skies: &[Matrix3<f64>], requested: &mut Requested) -> f64 {
        let cells = self.cells;
        let side = 1.0 / cells as f64;
        let middle = |i: usize| (i as f64 + 0.5) * side - 0.5;
        let places = (0..cells * cells).map(|i| [x + middle(i % cells), y + middle(i / cells)]);
        let sum: f64 = places
            .map(|at| self.mean_of(at, side, skies, requested))
            .sum();
        sum * side * side
    }

    /// The mean light of a square of `size` px around a place, e- a pixel. On each side of an edge
    /// the mean of the Gauss nodes there stands for the part of the square that the side takes.
    fn mean_of(
        &self,
        at: [f64; 2],
        size: f64,
        skies: &[Matrix3<f64>],
        requested: &mut Requested,
    ) -> f64 {
        let Some(patch) = Patch::new(self.grid.plane, at, size) else {
            return 0.0;
        };
        let crossings = skies
            .iter()
            .map(|sky| (sky, patch.crossing(self.grid.radiance.edge(), sky)));
        let count = skies.len() as f64;
        if self.grid.radiance.is_hidden_inside() {
            let (outside, looks) = crossings.fold((0.0, 0), |(outside, looks), (_, crossing)| {
                (outside + crossing.part(1), looks + crossing.looks)
            });
            requested.edges += looks / skies.len().max(1);
            requested.lights += 1;
            let sky = self.grid.plane.to_sky(self.grid.plane.open_s(at[1])[0]);
            let (middle, taken) = patch.middle;
            return self.grid.radiance.toward(&(sky * middle))
                * taken
                * self.grid.scale_e
                * outside
                / count;
        }
        let (mut sum, mut looks, mut edges) = (0.0, 0, 0);
        let middle = self.grid.plane.to_sky(self.grid.plane.open_s(at[1])[0]);
        if self.grid.is_still
            && patch.is_clear(self.grid.radiance.edge(), &middle, self.grid.motion)
        {
            let places = patch.places.iter().flatten();
            let lights = places.map(|(seen, taken)| self.grid.light(&(middle * seen), *taken));
            requested.lights += 4;
            requested.edges += 1;
            return lights.sum::<f64>() / 4.0;
        }
        for (sky, crossing) in crossings {
            let (mut sides, mut counts) = ([0.0; 2], [0.0; 2]);
            for (position, edge) in patch.places.iter().zip(crossing.places) {
                if let Some((seen, taken)) = position {
                    let side = usize::from(edge > 0.0);
                    sides[side] += self.grid.light(&(sky * seen), *taken);
                    counts[side] += 1.0;
                }
            }
            for side in 0..2 {
                let part = crossing.part(side);
                if counts[side] > 0.0 {
                    sum += part * sides[side] / counts[side];
                } else if part > 0.0 {
                    // The corner without a node.
                    let corner = self.grid.plane.taken(patch.corner(&crossing, side));
                    sum += corner.map_or(0.0, |(seen, taken)| {
                        part * self.grid.light(&(sky * seen), taken)
                    });
                }
            }
            looks += 4;
            edges += crossing.looks;
        }
        let still = looks / skies.len().max(1);
        requested.lights += still;
        requested.smeared += looks - still;
        requested.edges += edges / skies.len().max(1);
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

/// Most time steps of a pixel in a frame of so many `pixels`.
pub fn most_steps(pixels: usize) -> usize {
    (ALL_STEPS / pixels.max(1)).clamp(MIN_STEPS, MAX_STEPS)
}
