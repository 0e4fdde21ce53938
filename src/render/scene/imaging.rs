//! The images of point sources: a candidate's track over the detector plane, and its footprint.

use super::area::full::Full;
use super::area::image::lit_by;
use super::area::radiance::Area;
use super::collected::Collected;
use super::effect_set::{EffectId, EffectSet};
use super::solar_system::Element;
use super::source::{Body, Candidate, Source};
use super::view::View;
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::track::{Even, Lit, Place, Rows, Track, TrackSpec};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Greatest turn of a piece of a track, rad (3 degrees): pieces are nearly straight.
const PIECE: f64 = 0.05;

/// Initial evaluations of a track; and those that find the opening and closing times of an image's
/// own row.
pub(crate) const PATH_EVALUATIONS: f64 = 7.0;
pub(crate) const CROSSING_EVALUATIONS: f64 = 100.0;
/// Time of an evaluation, ns: the pointing, the source's direction and its projection.
pub(crate) const EVALUATION_NS: f64 = 90.0;
/// Time of a sample of a panel in which rows open or close, and of each row there, ns: weights,
/// parts of light and centre.
pub(crate) const POINT_NS: f64 = 800.0;
pub(crate) const ROW_NS: f64 = 70.0;

/// Time of a sample of an interpolated track, ns.
const TRACK_NS: f64 = 30.0;

/// The image of a point, or of a disc.
struct Point {
    /// The part of its light that is collected (1).
    light: f64,
    /// Its centre, px.
    centre: [f64; 2],
    footprint: Footprint,
}

/// Greatest number of pixels of disc elements in memory at once.
const MAX_ELEMENT_PIXELS: f64 = 1e8;

/// Inputs of image formation.
#[derive(Clone, Copy)]
pub(crate) struct Imaging<'a> {
    pub view: &'a View,
    pub simulated: &'a EffectSet,
    pub fidelity: &'a Fidelity,
}

/// Number of points of the tracks of all candidates.
pub fn track_all(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> usize {
    let imaging = Imaging {
        view,
        simulated,
        fidelity,
    };
    let tracks = view.candidates.iter();
    let tracks = tracks.filter_map(|candidate| imaging.track(candidate, &Vector3::zeros()));
    tracks.map(|track| track.samples.len()).sum()
}

impl Imaging<'_> {
    /// The image of `candidate`; none if it cannot touch the detector.
    pub fn image(&self, candidate: &Candidate) -> Option<Source> {
        let view = self.view;
        if view.limit.is_over() || !view.may_hold(candidate) {
            return None;
        }
        let camera = &view.camera;
        let track = self.track(candidate, &Vector3::zeros())?;
        let (start, end) = (track.start, track.end);
        let Point {
            light,
            centre,
            footprint,
        } = match (candidate.body.area(), candidate.body.elements()) {
            (Some(area), _) => self.large_disc(area, track, candidate),
            (None, []) => self.point(track, candidate),
            (None, elements) => self.disc(elements, candidate),
        };
        if footprint.shares().is_empty() && !camera.detector.contains(centre) {
            return None;
        }
        let arriving_e = candidate.electrons();
        let electrons = arriving_e * light;
        Some(Source {
            // Computed later: it depends on the light of all images.
            snr: 0.0,
            clear_snr: 0.0,
            body: candidate.body.clone(),
            // Labels give the centroid of the light.
            start: camera.optics.lit(start),
            end: camera.optics.lit(end),
            centroid: centre,
            footprint,
            arriving_e,
            electrons,
            clear_e: candidate.clear_e * light,
            hidden: candidate.hidden,
        })
    }

    /// The light of a point that moves along a track.
    fn point(&self, mut track: Track, candidate: &Candidate) -> Point {
        let Imaging {
            view,
            simulated,
            fidelity,
        } = *self;
        // Without losses, rounding of the sum must not lose light.
        let whole =
            !simulated.has(EffectId::RollingShutter) && !simulated.has(EffectId::Vignetting);
        let sample_ns = match self.even(candidate) {
            Some(_) if !simulated.has(EffectId::RollingShutter) => TRACK_NS,
            _ => 2.0 * EVALUATION_NS,
        };
        let track_ns = self.track_ns(&track, sample_ns, candidate);
        view.limit.spend(track_ns);
        if view.limit.is_over() {
            return Point {
                light: 0.0,
                centre: track.start,
                footprint: Footprint::default(),
            };
        }
        let source_light = candidate.light();
        let Collected { light, centre } =
            Collected::of(&track, &view.camera, fidelity, &source_light);
        let light = if whole { 1.0 } else { light };
        track.scale(1.0 / light.max(f64::MIN_POSITIVE));
        let footprint = Footprint::of(
            &view.limit,
            &track,
            &view.camera,
            fidelity,
            &source_light,
            view.level,
        );
        track.recycle();
        Point {
            light,
            centre,
            footprint,
        }
    }

    /// Time of sampling a track, at `sample_ns` a sample, with its partial rows, ns.
    fn track_ns(&self, track: &Track, sample_ns: f64, candidate: &Candidate) -> f64 {
        let (psf, detector) = (&self.view.camera.optics.psf, &self.view.camera.detector);
        let reach_px = psf.drawn_px(self.fidelity, candidate.light().electrons);
        let rows = (2.0 * reach_px + 1.0).min(detector.height as f64);
        let cut = track.samples.iter().filter(|s| s.lit != Lit::ALL).count() as f64;
        track.samples.len() as f64 * sample_ns + cut * (POINT_NS + rows * ROW_NS)
    }

    /// The light of a disc of elements.
    fn disc(&self, elements: &[Element], candidate: &Candidate) -> Point {
        let view = self.view;
        // The part of the PSF that is not drawn would be visible for such a bright source.
        let loss = (self.fidelity.wing_e / candidate.clear_e).max(f64::EPSILON);
        let fidelity = &Fidelity {
            psf_loss: self.fidelity.psf_loss.min(loss),
            ..*self.fidelity
        };
        let imaging = Imaging { fidelity, ..*self };
        // In chunks: with wide wings each element may cover the whole detector.
        let psf = &view.camera.optics.psf;
        let side_px = 2.0 * psf.drawn_px(fidelity, candidate.light().electrons) + 1.0;
        let pixels = side_px.powi(2).min(view.camera.detector.pixels() as f64);
        let chunk = (MAX_ELEMENT_PIXELS / pixels).clamp(2.0, 4096.0) as usize;
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        let mut footprint = Footprint::default();
        for elements in elements.chunks(chunk) {
            let points = elements.par_iter().filter_map(|element| {
                if view.limit.is_over() {
                    return None;
                }
                let track = imaging.track(candidate, &element.offset)?;
                let point = imaging.point(track, candidate);
                Some((element.share * point.light, point))
            });
            let points: Vec<(f64, Point)> = points.collect();
            for (part, point) in &points {
                light += part;
                moments = [0, 1].map(|k| moments[k] + part * point.centre[k]);
            }
            let points = points.into_iter();
            let parts = points.map(|(part, point)| (part, point.footprint));
            let parts: Vec<(f64, Footprint)> =
                [(1.0, footprint)].into_iter().chain(parts).collect();
            footprint = Footprint::sum(&parts, &view.limit);
        }
        let whole = light.max(f64::MIN_POSITIVE);
        footprint.scale(1.0 / whole);
        Point {
            light,
            centre: moments.map(|moment| moment / whole),
            footprint,
        }
    }

    /// The light of a disc that is rasterized like an area source. Its centre gives the collected
    /// fraction and the centroid.
    fn large_disc(&self, area: &Area, track: Track, candidate: &Candidate) -> Point {
        let view = self.view;
        let centre = self.point(track, candidate);
        let lit = lit_by(view, area, self.simulated, &Full::default(), self.fidelity);
        let whole_e = candidate.electrons() * centre.light;
        let part = 1.0 / whole_e.max(f64::MIN_POSITIVE);
        let drawn = lit.light().map(|light| (part, light.footprint().clone()));
        let mut footprint = Footprint::sum(drawn.as_slice(), &view.limit);
        footprint.wings = centre.footprint.wings;
        Point {
            footprint,
            ..centre
        }
    }

    /// The track of the image during the exposure of its rows, for a point of the source at the
    /// offset `off` from its centre (any length).
    fn track(&self, candidate: &Candidate, off: &Vector3<f64>) -> Option<Track> {
        let Imaging {
            view,
            simulated,
            fidelity,
        } = *self;
        let (camera, exposure_s) = (&view.camera, view.exposure.duration_s);
        let optics = &camera.optics;
        let projection = optics.projection_if(simulated.has(EffectId::Distortion));
        let position = |dt_s: f64, turned_s: f64, drifts: bool| {
            let part = 0.5 + dt_s / view.open_s.max(f64::MIN_POSITIVE);
            let line = match &candidate.body {
                Body::Star(star) if drifts => {
                    star.direction + view.aberration_drift(&star.direction, part)
                }
                Body::Star(star) => star.direction,
                body => body.line(0.5 + turned_s / view.open_s.max(f64::MIN_POSITIVE)),
            };
            let seen: Vector3<f64> = view.pointing(turned_s).rotate(&(line + off));
            let light = if simulated.has(EffectId::Vignetting) {
                optics.vignetting.transmission(&seen)
            } else {
                1.0
            };
            let at = optics.project_by(&projection, &seen)?;
            Some(Place { at, light })
        };
        let truth = |dt_s: f64| position(dt_s, dt_s, true);
        if !simulated.moves_images() {
            let still = position(0.0, 0.0, false)?;
            let ends = [-0.5, 0.5].map(|part| truth(part * exposure_s).unwrap_or(still).at);
            return Some(Track::still(still).between(ends));
        }
        let (open_s, rows) = if simulated.has(EffectId::RollingShutter) {
            let rows = Rows::in_turn(camera.detector.height, exposure_s, camera.readout_s());
            (view.open_s, rows)
        } else {
            (exposure_s, Rows::together(camera.detector.height))
        };
        let turn = view.vehicle.rates.norm() * open_s + candidate.own_motion;
        let [step_px, panel_px, point_px] = self.steps_px(candidate);
        let track_spec = TrackSpec {
            pieces: (turn / PIECE).ceil().clamp(2.0, 1e4) as usize,
            even: self.even(candidate),
            step_px,
            panel_px,
            point_px,
            // Used only with a rolling shutter.
            reach_px: if rows.are_together() {
                0.0
            } else {
                optics.psf.drawn_px(fidelity, candidate.light().electrons)
            },
            window: view.window(fidelity),
            rows,
        };
        let at = |part: f64| {
            let dt_s = (part - 0.5) * open_s;
            let turned_s = simulated.only_with(EffectId::Smear, dt_s);
            position(dt_s, turned_s, simulated.has(EffectId::AberrationDrift))
        };
        let crossing = if rows.are_together() {
            0.0
        } else {
            CROSSING_EVALUATIONS
        };
        let evaluations = PATH_EVALUATIONS + track_spec.pieces as f64 + crossing;
        view.limit.spend(evaluations * EVALUATION_NS);
        Track::sample(at, &track_spec, fidelity)
    }

    /// The Gaussian spread of its light, if constant along the track. None if the transmission may
    /// have kinks along the path, which the quadrature misses.
    pub fn even(&self, candidate: &Candidate) -> Option<Even> {
        let optics = &self.view.camera.optics;
        let breaks = self.simulated.has(EffectId::Vignetting)
            && matches!(optics.vignetting, Vignetting::Table(_));
        optics.psf.lines().filter(|_| !breaks)?;
        let (sigma_px, height_e) = self.height(candidate);
        Some(Even { sigma_px, height_e })
    }

    /// Greatest length (px) of a panel of the track, of a track of one panel, and of a track of one
    /// point.
    pub fn steps_px(&self, candidate: &Candidate) -> [f64; 3] {
        let (core_px, height_e) = self.height(candidate);
        let (psf, fidelity) = (&self.view.camera.optics.psf, self.fidelity);
        let step_px = core_px * fidelity.step_sigma(height_e);
        match psf.at([0.0; 2], 1.0).gradient() {
            None => [step_px, step_px, core_px * fidelity.point_sigma(height_e)],
            // PSFs given as images have kinks, which too few points would miss.
            Some(_) => [step_px, 0.0, 0.0],
        }
    }

    /// The width (px) and the height (e-) of the candidate's image.
    fn height(&self, candidate: &Candidate) -> (f64, f64) {
        let core_px = self.view.camera.optics.psf.core_px();
        // No profile of that width has a higher peak than a Gaussian.
        let middle = (1.0 / (TAU * core_px * core_px)).min(1.0);
        (core_px, candidate.light().electrons * middle)
    }
}
