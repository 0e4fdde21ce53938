//! The charge that pixels expect: bounds of it, and what single pixels and columns expect.

use super::area::Light;
use super::{AreaLight, Body, EffectId, EffectSet, Lit, Scene, Source, brightest, spill, trail};
use crate::camera::Detector;
use rayon::prelude::*;

/// Pixels whose charge is computed together: a cancelled frame ends before the next.
const TOGETHER: usize = 1 << 15;

impl Scene {
    /// What of light the pixels turn into charge, by `lights` alone: a bound (e-) for each column of cells (`brightest`), whether
    /// their response is skipped or not.
    pub fn lit_e<'a>(&self, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
        brightest::greatest_e(&self.view.camera.detector, &self.cells_of(lights))
    }

    fn cells_of<'a>(&self, lights: impl Iterator<Item = Lit<'a>>) -> Vec<Vec<f64>> {
        let detector = &self.view.camera.detector;
        let response = |pixel| detector.pattern.response_of(pixel).max(1.0);
        let weight = !self.turns_all_alike();
        let weight = weight.then_some(&response as brightest::Weight<'_>);
        brightest::cells_of(detector, lights, weight, &self.view.limit)
    }

    /// [`Scene::lit_e`] by the stars, and by all light.
    pub(super) fn stars_and_all_lit_e(&self) -> [Vec<f64>; 2] {
        let detector = &self.view.camera.detector;
        let (stars, others): (Vec<&Source>, _) = self
            .sources
            .iter()
            .partition(|source| matches!(source.body, Body::Star(_)));
        let lit = |sources: Vec<&Source>| self.cells_of(sources.into_iter().map(Lit::from));
        let mut parts = lit(stars);
        let stars = brightest::greatest_e(detector, &parts);
        parts.extend(lit(others));
        let areas = self.areas_light.light();
        if self.turns_all_alike() {
            parts.extend(areas.map(|light| light.most_of_cells(brightest::CELL)));
        } else {
            parts.extend(self.cells_of(areas.into_iter().map(Lit::from)));
        }
        [stars, brightest::greatest_e(detector, &parts)]
    }

    /// [`Scene::lit_e`] by the stars.
    pub fn stars_lit_e(&self) -> &[f64] {
        &self.stars_e
    }

    /// Whether all pixels turn light into charge alike.
    fn turns_all_alike(&self) -> bool {
        !self.simulated.has(EffectId::PixelResponse)
            || self.view.camera.detector.pattern.response().is_none()
    }

    /// [`Scene::lit_e`] by an area's light alone.
    pub fn area_lit_e(&self, area: &AreaLight) -> Vec<f64> {
        if self.turns_all_alike() {
            area.most_of_columns()
        } else {
            self.lit_e(area.light().into_iter().map(Lit::from))
        }
    }

    /// No pixel gets more light than this from all sources together after it is multiplied by its `weight`, e-, for each column of cells.
    pub fn lit_where(&self, weight: impl Fn(usize) -> f64 + Sync) -> Vec<f64> {
        let detector = &self.view.camera.detector;
        brightest::pixels_e(
            detector,
            self.lights(&self.simulated),
            Some(&weight),
            &self.view.limit,
        )
    }

    /// No pixel's expected charge is more than this, particles left out, e-.
    pub fn brightest_e(&self) -> f64 {
        let light = self.peaks_e.iter().copied().fold(0.0, f64::max);
        let dark = self.dark_charge_e(self.view.camera.detector.pattern.dark_max_e_s());
        light + dark + self.trail().iter().copied().fold(0.0, f64::max)
    }

    /// No pixel of a column expects more charge than this, particles left out, e-.
    pub(super) fn brightest_of(&self, column: usize) -> f64 {
        let pattern = &self.view.camera.detector.pattern;
        let dark = self.dark_charge_e(pattern.dark_max_of_column(column));
        let trail = self.trail().get(column).copied().unwrap_or(0.0);
        self.peaks_e[column / brightest::CELL] + dark + trail
    }

    /// The charge (e-) that a pixel (row-major index) expects on which no star and no object shines: area light, dark charge, its
    /// column's trail.
    pub fn background_of(&self, pixel: usize) -> f64 {
        let light = self.areas_light.of_pixel(pixel);
        let response = if self.simulated.has(EffectId::PixelResponse) {
            self.view.camera.detector.pattern.response_of(pixel)
        } else {
            1.0
        };
        light * response + self.unlit_of(pixel)
    }

    /// The charge (e-) that a pixel expects from no light that it is shown: dark charge, its column's trail.
    fn unlit_of(&self, pixel: usize) -> f64 {
        let detector = &self.view.camera.detector;
        let trail = self.trail().get(pixel % detector.width);
        self.dark_charge_e(detector.pattern.dark_e_s_of(pixel)) + trail.copied().unwrap_or(0.0)
    }

    /// The charge (e-) of a dark current (e-/s) that is simulated.
    fn dark_charge_e(&self, dark_e_s: f64) -> f64 {
        let charge_e = dark_e_s * self.view.exposure.duration_s;
        (self.simulated).only_with(EffectId::DarkCurrent, charge_e)
    }

    /// The share of a column's light that each of its pixels gets while it is shifted, if that is
    /// simulated (1).
    pub fn trail_part(&self) -> f64 {
        (self.simulated).only_with(EffectId::FrameTransfer, trail::part(&self.view))
    }

    /// What each pixel of each column gets of the column's light by an area's alone while it is shifted, e-.
    pub fn trail_of(&self, area: &AreaLight) -> Vec<f64> {
        let lights = area.light().into_iter().map(Lit::from);
        let mut columns = spill::columns_e(&self.view, lights);
        let part = self.trail_part();
        columns.iter_mut().for_each(|e| *e *= part);
        columns
    }

    /// The charge (e-) that is expected in `pixels`, sorted by row-major index: light and dark charge; in none once the frame is cancelled.
    pub fn expected_e(&self, pixels: &[u32]) -> Vec<f64> {
        let groups = pixels.par_chunks(TOGETHER).filter(|_| !self.is_cancelled());
        let charge: Vec<Vec<f64>> = groups.map(|pixels| self.expected_of(pixels)).collect();
        match self.is_cancelled() {
            true => Vec::new(),
            false => charge.concat(),
        }
    }

    fn expected_of(&self, pixels: &[u32]) -> Vec<f64> {
        let detector = &self.view.camera.detector;
        let mut charge = vec![0.0; pixels.len()];
        let within = |from: usize, length: usize| {
            let first = pixels.partition_point(|pixel| (*pixel as usize) < from);
            let past = pixels.partition_point(|pixel| (*pixel as usize) < from + length);
            first..past
        };
        for (charge, pixel) in charge.iter_mut().zip(pixels) {
            *charge = self.areas_light.of_pixel(*pixel as usize);
        }
        let row = |pixel: Option<&u32>| pixel.map_or(0, |pixel| *pixel as usize / detector.width);
        let rows = row(pixels.first())..row(pixels.last()) + 1;
        let lights = self.sources.iter().map(Lit::from);
        let lights = lights.take_while(|_| !self.is_cancelled());
        for light in lights.filter(|light| light.electrons > 0.0) {
            for (row, column, shares) in light.footprint.rows(rows.clone()) {
                let from = row * detector.width + column;
                for i in within(from, shares.len()) {
                    charge[i] += light.electrons * f64::from(shares[pixels[i] as usize - from]);
                }
            }
        }
        for (charge, pixel) in charge.iter_mut().zip(pixels) {
            let pixel = *pixel as usize;
            if self.simulated.has(EffectId::PixelResponse) {
                *charge *= detector.pattern.response_of(pixel);
            }
            *charge += self.unlit_of(pixel);
        }
        charge
    }

    /// The charge (e-) that particles leave in `pixels`, sorted by row-major index; no more of them once the frame is cancelled.
    pub fn struck_e(&self, pixels: &[u32]) -> impl Iterator<Item = f64> {
        let mut hits = self.struck.hits().peekable();
        let pixels = pixels.iter().take_while(|_| !self.is_cancelled());
        pixels.map(move |pixel| {
            while hits.next_if(|hit| hit.0 < *pixel).is_some() {}
            let hit = hits.next_if(|hit| hit.0 == *pixel);
            hit.map_or(0.0, |hit| f64::from(hit.1))
        })
    }

    /// No pixel of a column of cells expects more charge than this, particles left out, e-.
    pub fn fullest_e(&self, column: usize) -> f64 {
        let dark = self.dark_charge_e(self.view.camera.detector.pattern.dark_max_e_s());
        let trail = self.trail().iter().copied().fold(0.0, f64::max);
        let light = self.peaks_e.get(column);
        light.copied().unwrap_or(0.0) + dark + trail
    }

    /// The charge (e-) that is expected in `columns`, sorted, one column after the other, of a frame that has only those effects of
    /// this one that `parts` has too: light and dark charge, before wells fill.
    pub fn columns_e(&self, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
        let mut charge = self.light_e(columns, parts);
        self.turn(&mut charge, columns, parts);
        charge
    }

    /// The light (e-) on `columns`, sorted, one column after the other, of a frame that has only those effects that `parts` has.
    pub fn light_e(&self, columns: &[usize], parts: &EffectSet) -> Vec<f64> {
        let spilling = &self.spill.columns;
        let places = columns
            .iter()
            .map(|column| spilling.binary_search(column).ok());
        let Some(places) = places.collect::<Option<Vec<usize>>>() else {
            let sources = self.sources_if(|source| parts.has(source.body.effect()));
            return self.light_of(columns, &sources, &self.area_lights(parts));
        };
        // Asked for again and again, with this and that left out: all was worked out once, and what is left out is taken away.
        let all = &self.spilling_e;
        let height = self.view.camera.detector.height;
        let column = |place: usize| all.get(place).into_iter().flatten().copied();
        let mut light: Vec<f64> = places.into_iter().flat_map(column).collect();
        light.resize(columns.len() * height, 0.0);
        let sources = self.sources_if(|source| !parts.has(source.body.effect()));
        let areas = self.area_lights_without(parts);
        if !sources.is_empty() || !areas.is_empty() {
            let less = self.light_of(columns, &sources, &areas);
            // (Rounding leaves no less than nothing.)
            let both = light.iter_mut().zip(less);
            both.for_each(|(e, less)| *e = (*e - less).max(0.0));
        }
        light
    }

    /// The light on each of the columns that may fill up, e-.
    pub(super) fn spilling_e(&self) -> Vec<Vec<f64>> {
        let sources = self.sources_if(|source| self.simulated.has(source.body.effect()));
        let areas = self.area_lights(&self.simulated);
        let groups = self.in_groups(&self.spill.columns, |columns| {
            let light = self.light_of(columns, &sources, &areas);
            let columns = light.chunks_exact(self.view.camera.detector.height);
            columns.map(<[f64]>::to_vec).collect::<Vec<Vec<f64>>>()
        });
        groups.into_iter().flatten().collect()
    }

    fn sources_if(&self, is_asked: impl Fn(&Source) -> bool) -> Vec<Lit<'_>> {
        let sources = self.sources.iter().filter(|source| is_asked(source));
        sources.map(Lit::from).collect()
    }

    /// The light (e-) of `sources` and of `areas` on `columns`, sorted, one column after the other.
    fn light_of(&self, columns: &[usize], sources: &[Lit<'_>], areas: &[&Light]) -> Vec<f64> {
        let Detector { width, height, .. } = self.view.camera.detector;
        let mut light = vec![0.0; columns.len() * height];
        for lit in sources {
            for (row, first, shares) in lit.footprint.rows(0..height) {
                let from = columns.partition_point(|column| *column < first);
                let here = columns[from..].iter().zip(from..);
                for (column, i) in here.take_while(|(column, _)| **column < first + shares.len()) {
                    let share = f64::from(shares[*column - first]);
                    light[i * height + row] += lit.electrons * share;
                }
            }
        }
        let mut done = 0;
        for run in columns.chunk_by(|a, b| a + 1 == *b) {
            let mut e = vec![0.0; run.len()];
            for (row, area) in (0..height).flat_map(|row| areas.iter().map(move |a| (row, a))) {
                e.fill(0.0);
                area.add_to_row(row * width + run[0], &mut e);
                for (e, i) in e.iter().zip(done..) {
                    light[i * height + row] += f64::from(*e);
                }
            }
            done += run.len();
        }
        light
    }

    /// Turns the light (e-) on `columns` into charge: as pixels respond, with dark charge and the trails of frame transfer, as far as
    /// `parts` has them.
    pub fn turn(&self, light: &mut [f64], columns: &[usize], parts: &EffectSet) {
        let detector = &self.view.camera.detector;
        let trail = trail::part(&self.view);
        let charges = light.par_chunks_exact_mut(detector.height).zip(columns);
        let charges = charges.filter(|_| !self.is_cancelled());
        charges.for_each(|(charge, column)| {
            let trail_e = if parts.has(EffectId::FrameTransfer) {
                trail * charge.iter().sum::<f64>()
            } else {
                0.0
            };
            for (row, e) in charge.iter_mut().enumerate() {
                let pixel = row * detector.width + column;
                if parts.has(EffectId::PixelResponse) {
                    *e *= detector.pattern.response_of(pixel);
                }
                if parts.has(EffectId::DarkCurrent) {
                    *e += detector.pattern.dark_e_s_of(pixel) * self.view.exposure.duration_s;
                }
                *e += trail_e;
            }
        });
    }
}
