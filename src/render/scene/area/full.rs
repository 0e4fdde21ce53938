//! Regions in which the sum of all area light fills all pixels. Light beyond the full well is lost
//! there and need not be evaluated. The criterion:
//!
//! ```text
//! min_response * sum over sources of N_xy > 2 (2 full well + 100)
//! ```
//!
//! at all corners of a cell and of those around it, as far as light is spread and moves during the
//! exposure.

use super::blur::Blur;
use super::motion::AREA_EVALUATION_NS;
use super::plane::{Plane, received};
use super::radiance::Area;
use crate::camera::Blooming;
use crate::fidelity::Fidelity;
use crate::scene::blooming::flooding_e;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::transfer_smear;
use crate::scene::view::View;
use rayon::prelude::*;

/// Side of a cell, px.
const CELL_PX: usize = 16;
/// Greatest side in the test of a whole frame, and number of cells along the path of the light.
const LARGEST_PX: usize = 256;
const CELLS_A_PATH: usize = 32;
/// Margin of the criterion.
const MARGIN: f64 = 2.0;
/// Below this tolerance (1) full pixels are evaluated too: such frames are references.
const MIN_PART: f64 = 1e-5;

/// Cells of the detector, and of the pixels around it that give light to it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Full {
    /// Side of a cell, px.
    side: usize,
    /// Columns and rows of cells before the detector's first.
    before: usize,
    across: usize,
    /// Whether each is full, row by row; empty where none is.
    cells: Vec<bool>,
}

impl Full {
    /// The cells that `areas` fill in a frame with those effects. None with blooming or frame
    /// transfer: they move the excess of full pixels to other pixels.
    pub(crate) fn of<'a>(
        view: &View,
        areas: impl Iterator<Item = &'a Area>,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Full {
        let is_lost = view.camera.detector.blooming != Blooming::Column
            && !(simulated.has(EffectId::FrameTransfer) && transfer_smear::part(view) > 0.0);
        if !is_lost {
            return Full::default();
        }
        Full::by_cells(view, areas, simulated, fidelity, |_| CELL_PX)
    }

    /// Whether a view's areas fill all pixels of a frame with those effects. Cells are larger the
    /// further light moves. The result also holds with blooming and frame transfer.
    pub(crate) fn is_all(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> bool {
        let side = |moved_px: usize| (moved_px / CELLS_A_PATH).clamp(CELL_PX, LARGEST_PX);
        let full = Full::by_cells(view, view.areas.iter(), simulated, fidelity, side);
        let detector = &view.camera.detector;
        let last = [detector.width, detector.height].map(|pixels| pixels - 1);
        let step = full.side.max(1);
        let places = |last: usize| (0..last).step_by(step).chain([last]);
        places(last[1]).all(|y| places(last[0]).all(|x| full.has([x as i64, y as i64], 1)))
    }

    /// [`Full::of`], by cells whose side (px) is a function of how far light moves (px).
    fn by_cells<'a>(
        view: &View,
        areas: impl Iterator<Item = &'a Area>,
        simulated: &EffectSet,
        fidelity: &Fidelity,
        side: impl Fn(usize) -> usize,
    ) -> Full {
        let detector = &view.camera.detector;
        let areas: Vec<&Area> = areas.filter(|area| simulated.has(area.effect)).collect();
        let min_response = 1.0 - detector.pattern.worst_response();
        let enough_e = MARGIN * flooding_e(detector) / min_response.max(f64::MIN_POSITIVE);
        let peak_e: f64 = areas.iter().map(|area| area.peak_e).sum();
        if !simulated.has(EffectId::FullWell) || peak_e < enough_e || fidelity.area_part < MIN_PART
        {
            return Full::default();
        }
        let sky = Sky::new(view, &areas, simulated);
        let margins = areas
            .iter()
            .map(|area| Blur::new(&view.camera, area.peak_e, area.has_edges(), fidelity).margin());
        let margin = margins.max().unwrap_or(0);
        let moved_px = sky.moved_px() as usize;
        let side = side(moved_px);
        let reach = (margin + moved_px + 1).div_ceil(side);
        let before = margin.div_ceil(side) + reach;
        let cells = |pixels: usize| pixels.div_ceil(side) + 2 * before;
        let [across, down] = [detector.width, detector.height].map(cells);
        let evaluations = (across + 1) as f64 * (down + 1) as f64 * sky.sources.len() as f64;
        view.limit.spend(evaluations * AREA_EVALUATION_NS);
        if view.limit.is_over() {
            return Full::default();
        }
        let position = |i: usize| i as f64 * side as f64 - (before * side) as f64;
        let lit = (0..(across + 1) * (down + 1)).into_par_iter().map(|i| {
            let at = [i % (across + 1), i / (across + 1)].map(position);
            // Not used once the frame is cancelled.
            !view.limit.is_cancelled() && sky.e(at) >= enough_e
        });
        let lit: Vec<bool> = lit.collect();
        // Number of dark corners left of a column and above a row (summed-area table).
        let wide = across + 2;
        let mut dark = vec![0u32; wide * (down + 2)];
        for (row, lit) in lit.chunks_exact(across + 1).enumerate() {
            let mut row_dark = 0;
            for (column, lit) in lit.iter().enumerate() {
                row_dark += u32::from(!lit);
                dark[(row + 1) * wide + column + 1] = dark[row * wide + column + 1] + row_dark;
            }
        }
        // Whether no corner of a cell or of those around it is dark, by four sums.
        let is_full = |x: usize, y: usize| {
            let around =
                |i: usize, all: usize| [i.saturating_sub(reach), (i + reach + 2).min(all + 1)];
            let ([left, right], [top, bottom]) = (around(x, across), around(y, down));
            let before = |x: usize, y: usize| dark[y * wide + x];
            before(right, bottom) + before(left, top) == before(left, bottom) + before(right, top)
        };
        let cells: Vec<bool> = (0..across * down)
            .map(|i| is_full(i % across, i / across))
            .collect();
        Full {
            side,
            before,
            across,
            cells: if cells.contains(&true) {
                cells
            } else {
                Vec::new()
            },
        }
    }

    /// Whether all pixels of a square are full; false far outside the detector.
    pub(crate) fn has(&self, [x, y]: [i64; 2], side: usize) -> bool {
        if self.cells.is_empty() {
            return false;
        }
        let cell = |at: i64| (at.div_euclid(self.side as i64) + self.before as i64).max(0) as usize;
        let [left, top] = [x, y].map(cell);
        let [right, bottom] = [x, y].map(|at| cell(at + side as i64 - 1));
        right < self.across
            && (top..=bottom).all(|row| {
                let row = self.cells.get(row * self.across..(row + 1) * self.across);
                row.is_some_and(|row| row[left..=right].iter().all(|full| *full))
            })
    }
}

/// All sources together.
struct Sky<'a, 'v> {
    sources: Vec<(&'a Area, Plane<'v>, f64)>,
}

impl<'a, 'v> Sky<'a, 'v> {
    fn new(view: &'v View, areas: &[&'a Area], simulated: &EffectSet) -> Sky<'a, 'v> {
        let source = |area: &&'a Area| {
            let radiance = area.radiance.as_ref().ok()?;
            let plane = Plane::new(view, simulated, radiance.turning());
            let scale_e = plane.scale_e(radiance.as_ref());
            Some((*area, plane, scale_e))
        };
        Sky {
            sources: areas.iter().filter_map(source).collect(),
        }
    }

    /// How far light moves while a pixel is open, px.
    fn moved_px(&self) -> f64 {
        let moved = self.sources.iter();
        let moved = moved.map(|(_, plane, _)| plane.motion() * plane.scale_px());
        moved.fold(0.0, f64::max)
    }

    /// The light of the pixel around a place in the middle of its exposure, e-.
    fn e(&self, at: [f64; 2]) -> f64 {
        let light = self.sources.iter().filter_map(|(area, plane, scale_e)| {
            let radiance = area.radiance.as_ref().ok()?;
            let (seen, solid_angle_sr) = plane.solid_angle_sr(at)?;
            let sky = plane.to_sky(plane.open_s(at[1])[0]);
            Some(received(radiance.as_ref(), &(sky * seen), solid_angle_sr) * scale_e)
        });
        light.sum()
    }
}
