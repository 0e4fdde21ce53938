//! By how much images change where an effect that shapes them is left out: what bounds of it are made of.
//!
//! A source's light on any pixel changes by no more than it has there with or without the effect. Where its image is off by d, or its
//! light is spread a little further, the steepest slope and the strongest bend of a Gaussian of width s and height N tell more:
//!
//! ```text
//! slope <= 0.61 N / s (0.86 N / s across and along a streak),   bend <= N / s^2
//! ```
//!
//! What single sources change is added up where their images meet (`brightest`).

use super::brightest::{greatest_share, summed_e};
use super::{Body, Scene, Source};
use crate::camera::{Detector, LocalPsf, Stamp};
use nalgebra::Vector3;

/// The steepest slope, in heights a core, of the image of a point that stands still.
pub const STEEPEST: f64 = 0.61;
/// The same of a streak, in any direction at once.
pub const STEEPEST_STREAK: f64 = 0.86;

/// What a bound of an image's change is made of.
pub struct Image<'a> {
    /// The source.
    pub source: &'a Source,
    /// No pixel gets more of its light, wherever it is and however it moves, e-.
    pub still_e: f64,
    /// The height of its image as it is, e- a pixel.
    pub height_e: f64,
    /// Width of its core, px.
    pub core_px: f64,
    /// The way between its ends through its centroid, px.
    pub length_px: f64,
    /// How far it stays outside of the detector, px.
    outside_px: f64,
    psf: LocalPsf<'a>,
}

impl Image<'_> {
    /// What of `e` electrons of a pixel a pixel of the detector may get, where the image is moved by no more than `off_px`.
    pub fn inside_e(&self, e: f64, off_px: f64) -> f64 {
        let from_px = self.outside_px + 0.5 - off_px;
        if self.outside_px == 0.0 || from_px <= 0.0 {
            return e;
        }
        let mut stamp = Stamp::default();
        let mut at = |px: f64| share(&self.psf, [px, 0.0], &mut stamp);
        // Further out there may be a ring.
        let rings = [0.0, 0.5, 1.0, 2.0].map(|further| at(from_px + further));
        let most = rings.into_iter().fold(0.0, f64::max);
        e * (most / at(0.0)).min(1.0)
    }

    /// How far the centroid is from the middle of its ends (px): more than it is from where the source is in the middle of the
    /// exposure, if it moves evenly faster and along a parabola.
    pub fn bend_px(&self) -> f64 {
        let Source {
            start,
            end,
            centroid,
            ..
        } = self.source;
        let off = [0, 1].map(|k| (start[k] + end[k]) / 2.0 - centroid[k]);
        off[0].hypot(off[1])
    }
}

/// A change of an image: by at most `e` electrons on any pixel, up to `beside_px` from where the image is now.
pub struct Change {
    /// e- of any pixel.
    pub e: f64,
    /// How far from the image it reaches, px.
    pub beside_px: f64,
}

impl Scene {
    /// A bound (e-) of the change of any pixel, where each image changes by what `change` says of it.
    pub fn change_e(&self, change: impl Fn(&Image<'_>) -> Change) -> f64 {
        let detector = &self.view.camera.detector;
        let mut stamp = Stamp::default();
        let lights = (self.sources.iter())
            .filter(|source| source.arriving_e > 0.0 && !source.footprint.shares().is_empty())
            .map(|source| {
                let Change { e, beside_px } = change(&self.image(source, &mut stamp));
                let widest = detector.width.max(detector.height) as f64;
                (source, e, beside_px.min(widest).ceil() as usize)
            });
        summed_e(detector, lights)
    }

    fn image<'a>(&'a self, source: &'a Source, stamp: &mut Stamp) -> Image<'a> {
        let (optics, detector) = (&self.view.camera.optics, &self.view.camera.detector);
        let ratio = match &source.body {
            Body::Star(star) => star.wavelength_ratio,
            Body::Rso(_) => 1.0,
        };
        let psf = optics.psf_at(source.centroid, ratio);
        // Of a source in the middle of a pixel, and of one at its corner.
        let middle = share(&psf, [0.0; 2], stamp);
        let corner = share(&psf, [0.5; 2], stamp);
        let (core_px, still_e) = (psf.core_px(), source.arriving_e * middle);
        let way = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
        let length_px = way(source.start, source.centroid) + way(source.centroid, source.end);
        // Between pixels it may be higher than in the greatest of them.
        let seen_e = source.electrons * greatest_share(source) * middle / corner;
        let (height_e, outside_px) = if detector.contains(source.centroid) {
            (seen_e, 0.0)
        } else {
            // Little may be seen of it: a streak of even speed has the height sqrt(2 pi) s / length; a quarter more.
            let even = 1.25 * 2.507 * core_px / length_px.max(f64::MIN_POSITIVE);
            let outside_px = outside_px(source, length_px, detector);
            (seen_e.max(still_e * even), outside_px)
        };
        Image {
            source,
            still_e,
            height_e: height_e.min(still_e),
            core_px,
            length_px,
            outside_px,
            psf,
        }
    }

    /// Where a source is seen (camera axes, any length) when the exposure begins, in its middle and when it ends.
    pub fn seen(&self, body: &Body, part: f64) -> Vector3<f64> {
        let view = &self.view;
        let dt_s = (part - 0.5) * view.exposure.duration_s;
        let line = match body {
            Body::Star(star) => star.direction,
            Body::Rso(object) => object.line_m(0.5 + dt_s / view.open_s.max(f64::MIN_POSITIVE)),
        };
        let turned_s = if self.simulated.smear { dt_s } else { 0.0 };
        view.pointing(turned_s).rotate(&line)
    }

    /// How far (px) an image's rows are exposed from where the middle row is, and by which part of its time they are
    /// exposed longer or shorter: nothing where all rows are exposed together.
    pub fn rolled(&self, image: &Image<'_>, length_px: f64) -> (f64, f64) {
        let (camera, source) = (&self.view.camera, image.source);
        let half_rows = (camera.detector.height as f64 - 1.0) / 2.0;
        let row_s = camera.readout_s() / (2.0 * half_rows).max(1.0);
        let from_middle = [source.start, source.end, source.centroid].map(|at| at[1] - half_rows);
        let furthest = from_middle
            .iter()
            .fold(0.0, |most: f64, y| most.max(y.abs()));
        // Rows that its wings reach are exposed at other times too.
        let rows = (furthest + 5.0 * image.core_px).min(half_rows);
        // Of what moves unevenly the fastest part.
        let speed = 1.2 * length_px / self.view.exposure.duration_s;
        (speed * rows * row_s, (speed * row_s).min(1.0))
    }
}

/// The share of the light of a point on the pixel that it is `off` from the middle of.
fn share(psf: &LocalPsf<'_>, off: [f64; 2], stamp: &mut Stamp) -> f64 {
    psf.spread(1.0, off, 0..1, 0..1, stamp);
    stamp.light.iter().sum()
}

/// How far (px) the line from a source's start through its centroid to its end stays outside of the detector, at least.
fn outside_px(source: &Source, length_px: f64, detector: &Detector) -> f64 {
    const PARTS: usize = 16;
    let sides = [detector.width, detector.height].map(|pixels| pixels as f64 - 0.5);
    let outside = |at: [f64; 2]| {
        let [x, y] = [0, 1].map(|k| (-0.5 - at[k]).max(at[k] - sides[k]).max(0.0));
        x.hypot(y)
    };
    let between = |a: [f64; 2], b: [f64; 2]| {
        (0..=PARTS).map(move |i| {
            let t = i as f64 / PARTS as f64;
            outside([0, 1].map(|k| a[k] + t * (b[k] - a[k])))
        })
    };
    let Source {
        start,
        end,
        centroid,
        ..
    } = source;
    let all = between(*start, *centroid).chain(between(*centroid, *end));
    let nearest = all.fold(f64::INFINITY, f64::min);
    (nearest - length_px / (2 * PARTS) as f64).max(0.0)
}
