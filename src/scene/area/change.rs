//! By how much area light changes where an effect that shapes images is left out.

use super::AreaLight;
use crate::scene::lit::Lit;
use crate::scene::{Scene, Simulated, spill};

/// What a slope between neighbouring pixels may be less than that between them.
const STEEPER: f64 = 1.5;

impl Scene {
    /// No pixel of a column gets less than this of the area light that a frame with the effects `parts` has too, e-, as much as the least
    /// response leaves of it; empty where there is none.
    pub fn areas_floor_e(&self, parts: &Simulated) -> Vec<f64> {
        let width = self.view.camera.detector.width;
        let mut floors = Vec::new();
        let both = self.areas.iter().filter(|area| (area.kind.is_in)(parts));
        for area in both.filter(|area| area.electrons > 0.0) {
            let mut least = vec![f32::INFINITY; width];
            for row in area.footprint.shares().chunks_exact(width) {
                for (least, share) in least.iter_mut().zip(row) {
                    *least = least.min(*share);
                }
            }
            floors.resize(width, 0.0);
            for (floor, share) in floors.iter_mut().zip(least) {
                *floor += area.electrons * f64::from(share);
            }
        }
        let responds = 2.0 - self.responds();
        floors.iter_mut().for_each(|floor| *floor *= responds);
        floors
    }

    /// A bound (e-) of the change of what area light makes of any pixel with the effects `other`: where they leave out one of the scene's the
    /// light is laid anew and compared, else it moves by no more than `px`.
    pub fn areas_change_e(&self, other: &Simulated, px: f64) -> f64 {
        if self.areas_e.is_empty() {
            return 0.0;
        }
        let both = self.simulated.and_shapes(other);
        let e = if both == self.simulated {
            self.areas_apart_e(other)
        } else {
            self.areas_moved_e(px)
        };
        e.min(self.spill.most_e)
    }

    /// The greatest change of a pixel where all area light is laid anew, e-.
    fn areas_apart_e(&self, other: &Simulated) -> f64 {
        let view = &self.view;
        let areas = view.areas.iter();
        let areas = areas.filter(|area| (area.kind.is_in)(other));
        let areas: Vec<AreaLight> = areas
            .map(|area| view.lit_by(area, other, &self.fidelity))
            .collect();
        let others_e = super::together(&areas);
        let other_e = |pixel: usize| others_e.get(pixel).copied().unwrap_or(0.0);
        let apart = self.areas_e.iter().enumerate();
        let apart = apart.map(|(pixel, e)| f64::from((e - other_e(pixel)).abs()));
        let most = apart.fold(0.0, f64::max);
        if !self.simulated.frame_transfer {
            return most * self.responds();
        }
        let columns = |areas: &[AreaLight]| {
            spill::columns_e(&view.camera.detector, areas.iter().map(Lit::from))
        };
        let columns = columns(&self.areas).into_iter().zip(columns(&areas));
        let trail = columns.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        most * self.responds() + trail * self.trail_part()
    }

    /// A bound of the change of a pixel where area light moves by `px`, by the steepest step between two pixels, e-.
    fn areas_moved_e(&self, px: f64) -> f64 {
        let width = self.view.camera.detector.width;
        let steepest = |rows: &[f32], step: usize| {
            let pairs = rows.iter().zip(rows.iter().skip(step));
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let rows = self.areas_e.chunks(width);
        let across = rows.map(|row| steepest(row, 1)).fold(0.0, f32::max);
        let down = steepest(&self.areas_e, width);
        STEEPER * px * f64::from(across).hypot(f64::from(down)) * self.responds()
    }
}
