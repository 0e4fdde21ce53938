//! The scene of one exposure.

use super::area::area_light::AreaLight;
use super::area::light::Light;
use super::area::together::TotalAreaLight;
use super::blooming::BloomingColumns;
use super::bounds::cells::CELL;
use super::effect_set::{EffectId, EffectSet};
use super::lit::Lit;
use super::observable::Unobservable;
use super::source::Source;
use super::struck::Struck;
use super::view::View;
use super::{signal, transfer_smear};
use crate::camera::Event;
use crate::fidelity::Fidelity;
use crate::reduce;

/// The view of one exposure, with the images and the light of all its sources.
#[derive(Debug)]
pub struct Scene {
    /// The sources in the field, before the optics.
    pub view: View,
    /// The effects of the frame.
    pub simulated: EffectSet,
    /// The images that touch the detector, in the view's order.
    pub sources: Vec<Source>,
    /// The light of area sources, in the order of their effects.
    pub areas: Vec<AreaLight>,
    /// The light of all area sources.
    pub areas_light: TotalAreaLight,
    /// Bound of the light of any pixel, with pixel response, for each column of cells
    /// (`bounds::cells`), e-.
    pub(super) peaks_e: Vec<f64>,
    /// The same of stars alone.
    pub stars_e: Vec<f64>,
    /// Frame-transfer smear of each pixel of a column, e-, one value a column; empty without frame
    /// transfer.
    pub transfer_smear_e: Vec<f64>,
    /// The particles that cross the detector.
    pub events: Vec<Event>,
    /// The charge of all of them.
    pub struck: Struck,
    /// Expected number of further particles, beyond the limit of drawn ones.
    pub particles_left_out: f64,
    /// The columns that may saturate.
    pub blooming: BloomingColumns,
    /// The light on each pixel of `blooming.columns`, by column, e-.
    pub(super) spilling_e: Vec<Vec<f64>>,
    /// The tolerances of its images.
    pub fidelity: Fidelity,
}

impl Scene {
    /// Whether every pixel of a source is full: it then has no signal-to-noise ratio.
    pub(crate) fn fills_all(&self, source: &Source) -> bool {
        let full_e = signal::full_e(&self.view.camera.detector, &self.simulated);
        // The pixels of a disc may be full of other light.
        let fills = || {
            let max_share = reduce::greatest(source.footprint.shares());
            source.body.points() > 1 || source.electrons * f64::from(max_share) >= full_e
        };
        source.electrons > 0.0 && source.clear_snr == 0.0 && fills()
    }

    /// Whether its frame is cancelled: results computed afterwards are incomplete and must not be
    /// used.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.view.limit.is_cancelled()
    }

    /// Fails if its frame is cancelled.
    pub(crate) fn unless_cancelled(self) -> Result<Scene, Unobservable> {
        if self.is_cancelled() {
            Err(self.abandon())
        } else {
            Ok(self)
        }
    }

    /// Frees its memory on another thread, and returns the error of an abandoned frame. Freeing
    /// 10,000 sources takes 50 ms, which would delay the end of the frame.
    pub(crate) fn abandon(self) -> Unobservable {
        let freed = std::thread::Builder::new().name("free".to_string());
        // If no thread starts, the memory is freed here.
        let _ = freed.spawn(move || drop(self));
        Unobservable::Abandoned
    }

    /// The light of all sources in a frame with the effects `parts`.
    pub(crate) fn lights<'a>(&'a self, parts: &'a EffectSet) -> impl Iterator<Item = Lit<'a>> {
        let sources = self.sources.iter();
        let sources = sources.filter(|source| parts.has(source.body.effect()));
        let areas = self.area_lights(parts).into_iter();
        sources.map(Lit::from).chain(areas.map(Lit::from))
    }

    /// The light of the area sources in `parts`: one sum, if `parts` has all of them.
    pub(super) fn area_lights(&self, parts: &EffectSet) -> Vec<&Light> {
        let is_in = |area: &&AreaLight| parts.has(area.effect);
        if self.areas.iter().all(|area| is_in(&area)) {
            return self.areas_light.light().into_iter().collect();
        }
        let areas = self.areas.iter().filter(is_in);
        areas.filter_map(AreaLight::light).collect()
    }

    /// Expected charge of a pixel without stars and objects, averaged over the frame, e-.
    pub fn background_e(&self) -> f64 {
        let areas: f64 = self.areas.iter().map(|area| area.electrons).sum();
        self.dark_e()
            + self.mean_transfer_smear_e()
            + areas / self.view.camera.detector.pixels() as f64
    }

    /// Expected charge (e-) of a pixel (row-major index) without stars and objects: area light,
    /// dark charge, frame-transfer smear.
    pub(crate) fn background_of(&self, pixel: usize) -> f64 {
        let light = self.areas_light.of_pixel(pixel);
        let response = if self.simulated.has(EffectId::PixelResponse) {
            self.view.camera.detector.pattern.response_of(pixel)
        } else {
            1.0
        };
        light * response + self.unlit_of(pixel)
    }

    /// Expected charge (e-) of a pixel without its own light: dark charge, frame-transfer smear.
    pub(super) fn unlit_of(&self, pixel: usize) -> f64 {
        let detector = &self.view.camera.detector;
        let transfer_smear = self.transfer_smear().get(pixel % detector.width);
        self.dark_charge_e(detector.pattern.dark_e_s_of(pixel))
            + transfer_smear.copied().unwrap_or(0.0)
    }

    /// Expected dark charge of a pixel, averaged over the frame, e-.
    pub(crate) fn dark_e(&self) -> f64 {
        self.dark_charge_e(self.view.camera.detector.pattern.dark_mean_e_s())
    }

    /// The charge (e-) of a dark current (e-/s), if it is simulated.
    fn dark_charge_e(&self, dark_e_s: f64) -> f64 {
        let charge_e = dark_e_s * self.view.exposure.duration_s;
        (self.simulated).only_with(EffectId::DarkCurrent, charge_e)
    }

    /// Frame-transfer smear of the columns, if it is simulated, e-.
    pub(super) fn transfer_smear(&self) -> &[f64] {
        (self.simulated).only_with(EffectId::FrameTransfer, &self.transfer_smear_e[..])
    }

    /// Frame-transfer smear of a pixel, averaged over the columns, e-.
    pub(super) fn mean_transfer_smear_e(&self) -> f64 {
        self.transfer_smear().iter().sum::<f64>() / self.transfer_smear().len().max(1) as f64
    }

    /// The share of a column's light that smears onto each of its pixels, if frame transfer is
    /// simulated (1).
    pub(crate) fn transfer_smear_fraction(&self) -> f64 {
        (self.simulated).only_with(EffectId::FrameTransfer, transfer_smear::part(&self.view))
    }

    /// Upper bound of the response of any pixel (1).
    pub(crate) fn max_response(&self) -> f64 {
        if self.simulated.has(EffectId::PixelResponse) {
            1.0 + self.view.camera.detector.pattern.worst_response()
        } else {
            1.0
        }
    }

    /// Bound of the expected charge of any pixel, without particles, e-.
    pub fn brightest_e(&self) -> f64 {
        self.brightest_with(self.peaks_e.iter().copied().fold(0.0, f64::max))
    }

    /// The same of a pixel of a column of cells.
    pub(super) fn brightest_of_cells(&self, column: usize) -> f64 {
        self.brightest_with(self.peaks_e.get(column).copied().unwrap_or(0.0))
    }

    /// The same of a pixel with this light, e-.
    fn brightest_with(&self, light: f64) -> f64 {
        let dark = self.dark_charge_e(self.view.camera.detector.pattern.dark_max_e_s());
        light + dark + self.transfer_smear().iter().copied().fold(0.0, f64::max)
    }

    /// The same of a pixel of a column.
    pub(super) fn brightest_of(&self, column: usize) -> f64 {
        let pattern = &self.view.camera.detector.pattern;
        let dark = self.dark_charge_e(pattern.dark_max_of_column(column));
        let transfer_smear = self.transfer_smear().get(column).copied().unwrap_or(0.0);
        self.peaks_e[column / CELL] + dark + transfer_smear
    }
}
