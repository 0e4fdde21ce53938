//! By how much area light changes where an effect that shapes images is left out.

use super::{AreaLight, CELL, Together};
use crate::lanes;
use crate::scene::{Scene, Simulated};

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
            floors.resize(width, 0.0);
            for (floors, e) in floors.chunks_mut(CELL).zip(area.floor_e()) {
                floors.iter_mut().for_each(|floor| *floor += f64::from(e));
            }
        }
        let responds = 2.0 - self.responds();
        floors.iter_mut().for_each(|floor| *floor *= responds);
        floors
    }

    /// No pixel turns less of an area's light into charge, e-.
    pub fn least_e(&self, area: &AreaLight) -> f64 {
        let least = area.floor_e().reduce(f32::min).unwrap_or(0.0);
        f64::from(least) * (2.0 - self.responds())
    }

    /// The light of all area sources with the effects `other`, drawn.
    pub fn areas_with(&self, other: &Simulated) -> Together {
        let view = &self.view;
        let areas = view.areas.iter();
        let areas = areas.filter(|area| (area.kind.is_in)(other));
        let areas: Vec<AreaLight> = areas
            .map(|area| view.lit_by(area, other, &self.fidelity))
            .collect();
        Together::of(&areas, view, view.camera.detector.pixels())
    }

    /// The light of all area sources.
    pub fn areas_together(&self) -> &Together {
        &self.areas_light
    }

    /// A bound of the change of a pixel where area light moves by `px`, by the steepest step between two pixels, e-.
    pub fn areas_moved_e(&self, px: f64) -> f64 {
        let width = self.view.camera.detector.width;
        let steepest = |rows: &[f32], step: usize| match rows.get(step..) {
            Some(next) => lanes::furthest_apart(rows, next),
            None => 0.0,
        };
        let rows = self.areas_light.e().chunks(width);
        let across = rows.map(|row| steepest(row, 1)).fold(0.0, f32::max);
        let down = steepest(self.areas_light.e(), width);
        STEEPER * px * libm::hypot(f64::from(across), f64::from(down)) * self.responds()
    }
}
