//! Sampled pixels of a patch of the detector, and nearby pixels that receive their light by the
//! point spread function.

use super::blur::{BLURRED_NS, Blur, LANES, PATCH, SPREAD_NS};
use super::grid::SMALLEST;
use super::lines::{Lines, Places};
use super::raster_work::RasterWork;
use super::runs::Run;
use super::sampled::Block;
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use std::ops::Range;

/// The pixels of a patch: a word of bits for each row.
type Bits = [u64; PATCH];

/// Pixels of a patch on and near sampled blocks.
pub(crate) struct Near<'a> {
    blur: &'a Blur<'a>,
    /// The patch's first column and row, of the detector.
    at: [usize; 2],
    /// Columns and rows of the grid before the detector's.
    rim: usize,
    blocks: &'a [&'a Block],
    on: Bits,
    near: Bits,
}

impl<'a> Near<'a> {
    /// The pixels of the patch that begins at `at`.
    pub fn new(blur: &'a Blur<'a>, at: [usize; 2], blocks: &'a [&'a Block], rim: usize) -> Self {
        let (mut on, mut near) = ([0; PATCH], [0; PATCH]);
        let margin = blur.margin() as i64;
        let inside = [0, 1].map(|k| PATCH.min(blur.size()[k] - at[k]) as i64);
        for block in blocks {
            let [x, y] = [0, 1].map(|k| block.at[k] as i64 - (rim + at[k]) as i64);
            for (bits, margin) in [(&mut on, 0), (&mut near, margin)] {
                let around =
                    |from: i64, past| from - margin..(from + SMALLEST as i64 + margin).min(past);
                let columns = bits_of(around(x, inside[0]));
                let rows = around(y, inside[1]);
                for row in rows.start.max(0)..rows.end {
                    bits[row as usize] |= columns;
                }
            }
        }
        Near {
            blur,
            at,
            rim,
            blocks,
            on,
            near,
        }
    }

    /// Number of pixels.
    pub fn count(&self) -> usize {
        let counts = self.near.iter().map(|bits| bits.count_ones() as usize);
        counts.sum()
    }

    /// The differences of their light from the interpolation.
    pub fn runs(&self, lines: &Lines, places: &Places) -> Vec<Run> {
        let all = self.near.iter().fold(0, |all, bits| all | bits);
        let lit = |bits: &u64| *bits != 0;
        let (Some(first), Some(last)) = (
            self.near.iter().position(lit),
            self.near.iter().rposition(lit),
        ) else {
            return Vec::new();
        };
        let left = all.trailing_zeros() as usize;
        let past = PATCH - all.leading_zeros() as usize;
        let margin = self.blur.margin();
        let wide = past - left + 2 * margin;
        let from = [self.at[0] + left, self.at[1] + first].map(|from| self.rim + from - margin);
        let e = self.drawn(lines, places, from, [wide, last + 1 - first + 2 * margin]);
        let kernel = (margin > 0).then(|| self.blur.kernel(self.at));
        let more = |row: usize, column: usize| {
            let pixel = (row - first + margin) * wide + column - left + margin;
            let kernel = kernel.as_deref();
            let is = kernel.map_or(e[pixel], |kernel| self.blur.spread(&e, pixel, wide, kernel));
            let is_on = self.on[row] >> column & 1 == 1;
            // Sampled blocks are not interpolated.
            is - if is_on { 0.0 } else { e[pixel] }
        };
        let mut runs = Vec::new();
        for row in first..=last {
            let mut bits = self.near[row];
            while bits != 0 {
                let from = bits.trailing_zeros() as usize;
                let count = (!(bits >> from)).trailing_zeros() as usize;
                bits &= !bits_of(from as i64..(from + count) as i64);
                runs.push(Run {
                    row: self.at[1] + row,
                    column: self.at[0] + from,
                    e: (from..from + count).map(|at| more(row, at)).collect(),
                });
            }
        }
        runs
    }

    /// The light of `wide` columns and `high` rows of the grid before blurring, and [`LANES`]
    /// further values.
    fn drawn(
        &self,
        lines: &Lines,
        places: &Places,
        from: [usize; 2],
        [wide, high]: [usize; 2],
    ) -> Vec<f32> {
        let mut e = vec![0.0; wide * high + LANES];
        for (row, e) in (from[1]..).zip(e.chunks_exact_mut(wide).take(high)) {
            lines.add_to_row(places, row * lines.size()[0] + from[0], e);
        }
        for block in self.blocks {
            for (j, light) in block.e.iter().enumerate() {
                for (i, light) in light.iter().enumerate() {
                    let column = (block.at[0] + i).wrapping_sub(from[0]);
                    let row = (block.at[1] + j).wrapping_sub(from[1]);
                    if column < wide && row < high {
                        e[row * wide + column] = *light;
                    }
                }
            }
        }
        e
    }
}

/// The differences of pixels on and near sampled `blocks` (by rows) from `lines`, whose grid begins
/// `rim` columns and rows before the detector. None once the work limit is over.
pub(crate) fn runs(
    blur: &Blur<'_>,
    limit: &WorkLimit,
    lines: &Lines,
    rim: usize,
    blocks: &[Vec<Block>],
    work: &mut RasterWork,
) -> Vec<Run> {
    if limit.is_over() {
        return Vec::new();
    }
    let places = lines.places();
    let patches = patches(blur, rim, blocks).into_par_iter();
    let patches = patches.filter(|_| !limit.is_over());
    let side = 2 * blur.reach() + 1;
    let near = patches.map(|(at, blocks)| {
        let near = Near::new(blur, at, &blocks, rim);
        let spread_ns = (side as f64).powi(2) * SPREAD_NS;
        limit.spend(near.count() as f64 * (BLURRED_NS + spread_ns));
        (near.runs(lines, &places), near.count())
    });
    let near: Vec<(Vec<Run>, usize)> = near.collect();
    if blur.margin() > 0 {
        let pixels = near.iter().map(|(_, pixels)| pixels);
        work.spreads += pixels.sum::<usize>() * side.pow(2);
    }
    near.into_iter().flat_map(|(runs, _)| runs).collect()
}

/// The patches of the detector that have pixels on or near blocks, each with those.
fn patches<'b>(
    blur: &Blur<'_>,
    rim: usize,
    sampled: &'b [Vec<Block>],
) -> Vec<([usize; 2], Vec<&'b Block>)> {
    let [across, down] = blur.size().map(|pixels| pixels.div_ceil(PATCH));
    let mut blocks = vec![Vec::new(); across * down];
    for block in sampled.iter().flatten() {
        let near = |k: usize, patches: usize| {
            let past = block.at[k] + SMALLEST + blur.margin();
            let from = (block.at[k] - blur.margin()).max(rim) - rim;
            from / PATCH..past.saturating_sub(rim).div_ceil(PATCH).min(patches)
        };
        for row in near(1, down) {
            for column in near(0, across) {
                blocks[row * across + column].push(block);
            }
        }
    }
    let patches = blocks.into_iter().enumerate();
    let patches = patches.filter(|(_, blocks)| !blocks.is_empty());
    patches
        .map(|(i, blocks)| ([i % across, i / across].map(|i| i * PATCH), blocks))
        .collect()
}

/// The bits of a word in a range.
fn bits_of(range: Range<i64>) -> u64 {
    let [from, past] = [range.start, range.end].map(|at| at.clamp(0, PATCH as i64) as u32);
    if from < past {
        u64::MAX << from & u64::MAX >> (PATCH as u32 - past)
    } else {
        0
    }
}
