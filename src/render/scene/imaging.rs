//! The images of point sources: a candidate's track over the detector plane, and where its light falls.

use super::collected::Collected;
use super::view::{Candidate, View};
use super::wanderer::Element;
use super::work::{CROSSING, LOOK_NS, POINT_NS, ROW_NS, WAY_LOOKS};
use super::{Area, Body, EffectId, EffectSet, Full, Source};
use crate::camera::Vignetting;
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::track::{Course, Even, Lit, Place, Rows, Track};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Pieces of a track turn by at most this (rad), 3 degrees: they are nearly straight.
const PIECE: f64 = 0.05;

/// ns of a sample on a track that is already known.
const TRACK_NS: f64 = 30.0;

/// The image of one point, or of what is made of points.
struct Point {
    /// What is collected of its light (1).
    light: f64,
    /// Its centre, px.
    centre: [f64; 2],
    footprint: Footprint,
}

/// Pixels of the elements of a disc that are held at once, where it stands still.
const PIXELS: f64 = 1e8;

impl View {
    /// The image of `candidate`; none if nothing of it can touch the detector.
    pub(super) fn image(
        &self,
        candidate: &Candidate,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Option<Source> {
        if self.limit.is_over() || !self.may_hold(candidate) {
            return None;
        }
        let camera = &self.camera;
        let track = self.track(candidate, &Vector3::zeros(), simulated, fidelity)?;
        let (start, end) = (track.start, track.end);
        let Point {
            light,
            centre,
            footprint,
        } = match (candidate.body.area(), candidate.body.elements()) {
            (Some(area), _) => self.laid(area, track, candidate, simulated, fidelity),
            (None, []) => self.point(track, candidate, simulated, fidelity),
            (None, elements) => self.disc(elements, candidate, simulated, fidelity),
        };
        if footprint.shares().is_empty() && !camera.detector.contains(centre) {
            return None;
        }
        let arriving_e = candidate.electrons();
        let electrons = arriving_e * light;
        Some(Source {
            // For its columns' background all images must be there first.
            snr: 0.0,
            clear_snr: 0.0,
            body: candidate.body.clone(),
            // Labels tell where the light is.
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

    /// The light of a point that runs along a track.
    fn point(
        &self,
        mut track: Track,
        candidate: &Candidate,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Point {
        // Where nothing takes of the light, not even the last digit of a sum does.
        let whole =
            !simulated.has(EffectId::RollingShutter) && !simulated.has(EffectId::Vignetting);
        let sample_ns = match self.even(candidate, simulated) {
            Some(_) if !simulated.has(EffectId::RollingShutter) => TRACK_NS,
            _ => 2.0 * LOOK_NS,
        };
        let track_ns = self.track_ns(&track, sample_ns, candidate, fidelity);
        self.limit.spend(track_ns);
        if self.limit.is_over() {
            return Point {
                light: 0.0,
                centre: track.start,
                footprint: Footprint::default(),
            };
        }
        let shine = candidate.shine();
        let Collected { light, centre } = Collected::of(&track, &self.camera, fidelity, &shine);
        let light = if whole { 1.0 } else { light };
        track.scale(1.0 / light.max(f64::MIN_POSITIVE));
        Point {
            light,
            centre,
            footprint: Footprint::unless(
                &self.limit,
                &track,
                &self.camera,
                fidelity,
                &shine,
                self.level,
            ),
        }
    }

    /// What sampling a track takes, so many ns a sample, and what rows collect of it, ns.
    fn track_ns(
        &self,
        track: &Track,
        sample_ns: f64,
        candidate: &Candidate,
        fidelity: &Fidelity,
    ) -> f64 {
        let detector = &self.camera.detector;
        let reach_px = self
            .camera
            .optics
            .psf
            .drawn_px(fidelity, candidate.shine().electrons);
        let rows = (2.0 * reach_px + 1.0).min(detector.height as f64);
        let cut = track.samples.iter().filter(|s| s.lit != Lit::ALL).count() as f64;
        track.samples.len() as f64 * sample_ns + cut * (POINT_NS + rows * ROW_NS)
    }

    /// The light of a disc that is cut into elements.
    fn disc(
        &self,
        elements: &[Element],
        candidate: &Candidate,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Point {
        // What a share of so much light leaves undrawn would show.
        let loss = (fidelity.wing_e / candidate.clear_e).max(f64::EPSILON);
        let fidelity = &Fidelity {
            psf_loss: fidelity.psf_loss.min(loss),
            ..*fidelity
        };
        // Some at a time: with wide wings each may cover the whole detector.
        let psf = &self.camera.optics.psf;
        let side_px = 2.0 * psf.drawn_px(fidelity, candidate.shine().electrons) + 1.0;
        let pixels = side_px.powi(2).min(self.camera.detector.pixels() as f64);
        let some = (PIXELS / pixels).clamp(2.0, 4096.0) as usize;
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        let mut footprint = Footprint::default();
        for elements in elements.chunks(some) {
            let points = elements.par_iter().filter_map(|element| {
                if self.limit.is_over() {
                    return None;
                }
                let track = self.track(candidate, &element.offset, simulated, fidelity)?;
                let point = self.point(track, candidate, simulated, fidelity);
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
            footprint = Footprint::sum(&parts, &self.limit);
        }
        let whole = light.max(f64::MIN_POSITIVE);
        footprint.scale(1.0 / whole);
        Point {
            light,
            centre: moments.map(|moment| moment / whole),
            footprint,
        }
    }

    /// The light of a disc that is laid on the pixels as areas are. What is collected of all of it, on and off the detector, and where, is
    /// told by its centre.
    fn laid(
        &self,
        area: &Area,
        track: Track,
        candidate: &Candidate,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Point {
        let centre = self.point(track, candidate, simulated, fidelity);
        let lit = self.lit_by(area, simulated, &Full::default(), fidelity);
        let whole_e = candidate.electrons() * centre.light;
        let part = 1.0 / whole_e.max(f64::MIN_POSITIVE);
        let drawn = lit.light().map(|light| (part, light.footprint().clone()));
        let mut footprint = Footprint::sum(drawn.as_slice(), &self.limit);
        footprint.wings = centre.footprint.wings;
        Point {
            footprint,
            ..centre
        }
    }

    /// How many points the tracks of all candidates have.
    pub fn track_all(&self, simulated: &EffectSet, fidelity: &Fidelity) -> usize {
        let tracks = self.candidates.iter();
        let tracks = tracks
            .filter_map(|candidate| self.track(candidate, &Vector3::zeros(), simulated, fidelity));
        tracks.map(|track| track.samples.len()).sum()
    }

    /// The path of its image while its rows are open, with the light that arrives along it; of what is `off` (any length) it.
    fn track(
        &self,
        candidate: &Candidate,
        off: &Vector3<f64>,
        simulated: &EffectSet,
        fidelity: &Fidelity,
    ) -> Option<Track> {
        let (camera, exposure_s) = (&self.camera, self.exposure.duration_s);
        let optics = &camera.optics;
        let projection = optics.projection_if(simulated.has(EffectId::Distortion));
        let place = |dt_s: f64, turned_s: f64, drifts: bool| {
            let part = 0.5 + dt_s / self.open_s.max(f64::MIN_POSITIVE);
            let line = match &candidate.body {
                Body::Star(star) if drifts => {
                    star.direction + self.aberration_drift(&star.direction, part)
                }
                Body::Star(star) => star.direction,
                body => body.line(0.5 + turned_s / self.open_s.max(f64::MIN_POSITIVE)),
            };
            let seen: Vector3<f64> = self.pointing(turned_s).rotate(&(line + off));
            let light = if simulated.has(EffectId::Vignetting) {
                optics.vignetting.transmission(&seen)
            } else {
                1.0
            };
            let at = optics.project_by(&projection, &seen)?;
            Some(Place { at, light })
        };
        let truth = |dt_s: f64| place(dt_s, dt_s, true);
        if !simulated.moves_images() {
            let still = place(0.0, 0.0, false)?;
            let ends = [-0.5, 0.5].map(|part| truth(part * exposure_s).unwrap_or(still).at);
            return Some(Track::still(still).between(ends));
        }
        let (open_s, rows) = if simulated.has(EffectId::RollingShutter) {
            let rows = Rows::in_turn(camera.detector.height, exposure_s, camera.readout_s());
            (self.open_s, rows)
        } else {
            (exposure_s, Rows::together(camera.detector.height))
        };
        let turn = self.vehicle.rates.norm() * open_s + candidate.swing;
        let [step_px, panel_px, point_px] = self.steps_px(candidate, fidelity);
        let course = Course {
            pieces: (turn / PIECE).ceil().clamp(2.0, 1e4) as usize,
            even: self.even(candidate, simulated),
            step_px,
            panel_px,
            point_px,
            // It is asked for where rows open in turn.
            reach_px: match rows.are_together() {
                true => 0.0,
                false => optics.psf.drawn_px(fidelity, candidate.shine().electrons),
            },
            window: self.window(fidelity),
            rows,
        };
        let at = |part: f64| {
            let dt_s = (part - 0.5) * open_s;
            let turned_s = simulated.only_with(EffectId::Smear, dt_s);
            place(dt_s, turned_s, simulated.has(EffectId::AberrationDrift))
        };
        let crossing = if rows.are_together() { 0.0 } else { CROSSING };
        let looks = WAY_LOOKS + course.pieces as f64 + crossing;
        self.limit.spend(looks * LOOK_NS);
        Track::sample(at, &course, fidelity)
    }

    /// The Gaussian that its light is spread by, if it is one that is the same everywhere; none where the light that passes breaks on the way, which
    /// a rule for what is smooth does not see.
    pub(super) fn even(&self, candidate: &Candidate, simulated: &EffectSet) -> Option<Even> {
        let optics = &self.camera.optics;
        let breaks = simulated.has(EffectId::Vignetting)
            && matches!(optics.vignetting, Vignetting::Table(_));
        optics.psf.lines().filter(|_| !breaks)?;
        let (sigma_px, height_e) = self.height(candidate);
        Some(Even { sigma_px, height_e })
    }

    /// How long (px) panels of the candidate's track may be, how long the track for one panel to be all of it, and how long for one point to stand for it.
    pub(super) fn steps_px(&self, candidate: &Candidate, fidelity: &Fidelity) -> [f64; 3] {
        let (core_px, height_e) = self.height(candidate);
        let step_px = core_px * fidelity.step_sigma(height_e);
        match self.camera.optics.psf.at([0.0; 2], 1.0).relief() {
            None => [step_px, step_px, core_px * fidelity.point_sigma(height_e)],
            // Images have kinks, which no rule of few points tells.
            Some(_) => [step_px, 0.0, 0.0],
        }
    }

    /// The width (px) of the candidate's image, and its height (e-) in the middle.
    fn height(&self, candidate: &Candidate) -> (f64, f64) {
        let core_px = self.camera.optics.psf.core_px();
        // No profile of that width is higher in its middle than a Gaussian.
        let middle = (1.0 / (TAU * core_px * core_px)).min(1.0);
        (core_px, candidate.shine().electrons * middle)
    }
}
