//! By how much area light changes where an effect that shapes images is left out.

use super::plane::Plane;
use super::{AreaLight, CELL, Full, Together};
use crate::camera::Detector;
use crate::lanes;
use crate::scene::{EffectSet, Scene, View};
use nalgebra::Vector3;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;

/// What a slope between neighbouring pixels may be less than that between them.
const STEEPER: f64 = 1.5;
/// Places along a side of the detector at which it is looked what pixels take, and how much more that may change by between them.
const PLACES: usize = 7;
const BETWEEN: f64 = 1.1;
/// Rows that are drawn at once.
const BAND: usize = 16;

impl Scene {
    /// No pixel of a column gets less than this of the area light that a frame with the effects `parts` has too, e-, as much as the least
    /// response leaves of it; empty where there is none.
    pub fn areas_floor_e(&self, parts: &EffectSet) -> Vec<f64> {
        let width = self.view.camera.detector.width;
        let mut floors = Vec::new();
        let both = self.areas.iter().filter(|area| parts.has(area.kind.effect));
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
    pub fn areas_with(&self, other: &EffectSet) -> Together {
        let view = &self.view;
        let full = Full::of(view, view.areas.iter(), other, &self.fidelity);
        let areas = view.areas.iter();
        let areas = areas.filter(|area| other.has(area.kind.effect));
        let areas: Vec<AreaLight> = areas
            .map(|area| view.lit_by(area, other, &full, &self.fidelity))
            .collect();
        Together::of(&areas, view, view.camera.detector.pixels())
    }

    /// What full pixels' light is off by most from what it is with the effects `other`, which have no full wells, e-.
    pub fn straightened_e(&self, other: &EffectSet) -> f64 {
        let others = self.areas_with(other);
        if self.is_cancelled() {
            return 0.0;
        }
        let [is_e, others_e] = [self.areas_light.e(), others.e()];
        f64::from(lanes::furthest_apart(is_e, others_e)) * self.responds()
    }

    /// The light of all area sources.
    pub fn areas_together(&self) -> &Together {
        &self.areas_light
    }

    /// A bound of the change of a pixel where area light moves by `px`, by the steepest step between two pixels, e-.
    pub fn areas_moved_e(&self, px: f64) -> f64 {
        let steepest = |rows: &[f32], step: usize| match rows.get(step..) {
            Some(next) => lanes::furthest_apart(rows, next),
            None => 0.0,
        };
        let Detector { width, height, .. } = self.view.camera.detector;
        let Some(light) = self.areas_light.light() else {
            return 0.0;
        };
        let bands = (0..height.div_ceil(BAND)).into_par_iter();
        let bands = bands.filter(|_| !self.is_cancelled());
        // Each with the first row of the next.
        let slopes = bands.map_init(Vec::new, |e, band| {
            let rows = band * BAND..(band * BAND + BAND + 1).min(height);
            e.clear();
            e.resize(rows.len() * width, 0.0);
            light.add_to(Some(Level::best()), rows.start * width, e);
            let across = e.chunks(width).map(|row| steepest(row, 1));
            [across.fold(0.0, f32::max), steepest(e, width)]
        });
        let greater = |a: [f32; 2], b: [f32; 2]| [a[0].max(b[0]), a[1].max(b[1])];
        let [across, down] = slopes.reduce(|| [0.0; 2], greater).map(f64::from);
        STEEPER * px * libm::hypot(across, down) * self.responds()
    }
}

impl View {
    /// About the most (e-) that a pixel's area light changes by where pixels take other parts of it with the effects `a` than with `b`, by
    /// their solid angle and by what passes. Those parts are told in what an ideal pixel takes, of which each area's peak is.
    pub fn areas_taken_e(&self, a: &EffectSet, b: &EffectSet) -> f64 {
        let of_sky = self.areas.iter().filter(|area| {
            let radiance = area.radiance.as_ref();
            radiance.is_ok_and(|radiance| !radiance.is_of_pixels())
        });
        let peak_e: f64 = of_sky.map(|area| area.peak_e).sum();
        if peak_e == 0.0 {
            return 0.0;
        }
        let planes = [&EffectSet::default(), a, b];
        let planes = planes.map(|of| Plane::new(self, of, Vector3::zeros()));
        let place = |i: usize, side: f64| i as f64 / (PLACES - 1) as f64 * side - 0.5;
        let [columns, rows] = self.camera.detector.sides();
        let parts = (0..PLACES * PLACES).filter_map(|i| {
            let at = [place(i % PLACES, columns), place(i / PLACES, rows)];
            let taken = |plane: &Plane<'_>| Some(plane.taken(at)?.1);
            let [ideal, a, b] = [&planes[0], &planes[1], &planes[2]].map(taken);
            let apart = (a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs();
            Some(apart / ideal.filter(|ideal| *ideal > 0.0)?)
        });
        BETWEEN * peak_e * parts.fold(0.0, f64::max)
    }
}
