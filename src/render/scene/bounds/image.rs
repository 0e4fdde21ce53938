//! Bounds of the change of one image without an effect that shapes it.
//!
//! A source's light on a pixel changes by at most its value with or without the effect. If the
//! image moves by d or widens slightly, the steepest slope and the strongest bend of a Gaussian of
//! width s and height N bound the change:
//!
//! ```text
//! slope <= 0.61 N / s (0.86 N / s across and along a streak),   bend <= N / s^2
//! ```
//!
//! Spreads given as images have their own peak, slope and kinks (`Gradient`). An image centred r
//! outside the detector has the slope `N r / s^2` and the bend `N r^2 / s^4` at its edge. Wings end
//! at whole pixels, so the light at their edge may appear or vanish; so may sources that touch the
//! detector only with the effect, or only without it. `compared` adds the changes up where images
//! overlap; `points` and `wells` apply pixel response and full wells.

use super::cells::greatest_share;
use crate::camera::{Detector, LocalPsf, Stamp, Vignetting};
use crate::footprint::Wings;
use crate::scene::content::Scene;
use crate::scene::effect_set::EffectId;
use crate::scene::source::{Body, Source};
use nalgebra::Vector3;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// The steepest slope of the image of a point at rest, in heights per core width.
pub const STEEPEST: f64 = 0.61;
/// The same of a streak, along and across it combined.
pub const STEEPEST_STREAK: f64 = 0.86;

/// Number of bright sources. A source is faint if its whole light is below this fraction of their
/// greatest change.
const BRIGHT: usize = 16;
const FAINT: f64 = 0.02;

/// Quantities that bound an image's change.
pub struct Image<'a> {
    /// The source.
    pub source: &'a Source,
    /// Bound of its light on a pixel, for any position and motion, e-.
    pub still_e: f64,
    /// Width of its core, px.
    pub core_px: f64,
    /// Length of the path between its ends through its centroid, px.
    pub length_px: f64,
    /// Its spread at its centroid.
    pub psf: LocalPsf<'a>,
    /// Whether its centroid is off the detector, and how far the whole path stays from it, px.
    is_outside: bool,
    outside_px: f64,
    /// Its share on a pixel, if it is centred on that pixel.
    middle: f64,
    /// Its drawing radius, px.
    drawn_px: f64,
    /// Bound of a pixel's share of the light further out, which is distributed evenly
    /// (`footprint`).
    even: f64,
}

impl Image<'_> {
    /// The peak of its image, e- a pixel.
    pub(crate) fn height_e(&self) -> f64 {
        let source = self.source;
        // The peak may lie between pixels: the ratio of a source in the middle of a pixel to one at
        // a corner.
        let over = match self.psf.gradient() {
            Some(relief) => relief.over_brightest,
            None => self.middle / self.psf.on_pixel([0.5; 2], &mut Stamp::default()),
        };
        let mut height_e = source.electrons * greatest_share(source) * over;
        if self.is_outside {
            // Only its flank may be on the detector. A streak of constant speed is sqrt(2 pi) s /
            // length times as high as the still image; 25 % margin.
            let streak = 1.25 * 2.507 * self.core_px / self.length_px.max(f64::MIN_POSITIVE);
            height_e = height_e.max(self.still_e * streak);
        }
        height_e.min(self.still_e)
    }

    /// Bound of the change of a pixel's light if the image, `e` electrons high, moves by `px`, e-.
    /// Its slope is `steepest` heights a core (a Gaussian's).
    pub(crate) fn moved_e(&self, e: f64, steepest: f64, px: f64) -> f64 {
        let core_px = self.core_px;
        // If it is off the detector, the slope of its flank at that distance.
        let steepest = steepest.max(self.flank());
        let steeper =
            (self.psf.gradient()).map_or(1.0, |of| of.slope * core_px / of.peak / STEEPEST);
        self.inside_e(e, px) * (steepest * steeper.max(1.0) * px / core_px).min(1.0)
            + self.edge_e(px)
    }

    /// Bound of the change of a pixel's light if a still image, `e` electrons high, is spread over
    /// a path of length L = `length_px` with the same centre, e-: `L^2 / 24` of the bend, and `L /
    /// 8` of the jump of the slope where cells of images end. 20 % margin for profiles other than a
    /// Gaussian.
    pub(crate) fn spread_e(&self, e: f64, length_px: f64) -> f64 {
        let smooth = (length_px / self.core_px).powi(2) / 24.0;
        let kinks = (self.psf.gradient()).map_or(0.0, |of| of.kink / of.peak * length_px / 8.0);
        let flank = self.flank().max(1.0).powi(2);
        self.inside_e(e, length_px / 2.0) * (1.2 * (flank * smooth + kinks)).min(1.0)
            + self.edge_e(length_px / 2.0)
    }

    /// The slope of a Gaussian's flank at the detector's edge, in local heights per core width.
    fn flank(&self) -> f64 {
        if self.outside_px > 0.0 {
            1.2 * (self.outside_px + 1.0) / self.core_px
        } else {
            0.0
        }
    }

    /// Bound of the light of a pixel on the detector, of an image `e` electrons high that moves by
    /// at most `off_px`, e-.
    pub(crate) fn inside_e(&self, e: f64, off_px: f64) -> f64 {
        let from_px = self.outside_px + 0.5 - off_px;
        if self.outside_px == 0.0 || from_px <= 0.0 {
            return e;
        }
        if self.psf.gradient().is_some() {
            return if from_px > self.drawn_px + 1.0 {
                0.0
            } else {
                e
            };
        }
        let mut stamp = Stamp::default();
        let mut at = |px: f64| self.psf.on_pixel([px, 0.0], &mut stamp);
        // A diffraction ring may lie further out.
        let rings = [0.0, 0.5, 1.0, 2.0].map(|further| at(from_px + further));
        let max = rings.into_iter().fold(0.0, f64::max);
        e * (max / at(0.0)).min(1.0)
    }

    /// Light at the edge of the wings, which end at whole pixels: it appears or vanishes if an
    /// image moves by `px`, e-.
    fn edge_e(&self, px: f64) -> f64 {
        if px == 0.0 {
            return 0.0;
        }
        let crosses = self.source.centroid.iter().any(|at| {
            [-1.0, 1.0].iter().any(|side| {
                let edge = at + side * self.drawn_px + 0.5;
                (edge - edge.round()).abs() <= px + self.length_px / 2.0
            })
        });
        let even_e = self.source.arriving_e * self.even * px.min(1.0);
        if !crosses {
            return even_e;
        }
        let mut stamp = Stamp::default();
        // A diffraction ring may lie at the edge.
        let edges = [0.0, 0.5, 1.0];
        let edges =
            edges.map(|inside| self.psf.on_pixel([self.drawn_px - inside, 0.0], &mut stamp));
        let edge = edges.into_iter().fold(0.0, f64::max);
        self.source.arriving_e * (edge + self.even)
    }

    /// Distance of the centroid from the middle of its ends, px. For constant acceleration it
    /// exceeds the centroid's distance from the position at mid-exposure.
    pub(crate) fn bend_px(&self) -> f64 {
        let Source {
            start,
            end,
            centroid,
            ..
        } = self.source;
        let off = [0, 1].map(|k| (start[k] + end[k]) / 2.0 - centroid[k]);
        libm::hypot(off[0], off[1])
    }
}

/// Bound of the change of an image.
#[derive(Default)]
pub struct BoundChange {
    /// Change of any pixel, e-.
    pub e: f64,
    /// How far from the present image the change reaches, px.
    pub reach_px: f64,
}

/// For each lit image, by `change`: the bound of the change of any pixel, e-, and how far from the
/// image it reaches, px. A source whose whole light is faint compared with the greatest changes is
/// bounded by that light, as far as `faint` states, px (none: not allowed).
pub(crate) fn changes(
    scene: &Scene,
    faint: impl Fn(&Source) -> Option<f64> + Sync,
    change: impl Fn(&Image<'_>) -> BoundChange + Sync,
) -> Vec<(&Source, f64, usize)> {
    let (optics, detector) = (&scene.view.camera.optics, &scene.view.camera.detector);
    let widest = detector.width.max(detector.height) as f64;
    let shining = (scene.sources.iter())
        .filter(|source| source.arriving_e > 0.0 && !source.footprint.shares().is_empty());
    // No profile of that width has a higher peak than a Gaussian. With a rolling shutter rows may
    // be exposed a little longer.
    let core_px = optics.psf.core_px();
    let middle = match optics.psf_at(optics.principal_px, 1.0).gradient() {
        None => (1.0 / (TAU * core_px * core_px)).min(1.0),
        Some(_) => 1.0,
    };
    // Bound of the evenly distributed light on a pixel: at least nine pixels share it.
    let even_e = 8.0 * scene.fidelity.wing_e;
    let all_e = |source: &Source| {
        let e = source.arriving_e.max(source.electrons);
        2.0 * middle * e + even_e.min(0.45 * e)
    };
    let mut shining: Vec<(&Source, f64)> = shining.map(|source| (source, all_e(source))).collect();
    let whole_px = |px: f64| px.min(widest).ceil() as usize;
    let bound = |stamp: &mut Stamp, source| {
        let BoundChange { e, reach_px } = change(&image_of(scene, source, stamp));
        (source, e, whole_px(reach_px))
    };
    let bright = BRIGHT.min(shining.len());
    if bright < shining.len() {
        shining.select_nth_unstable_by(bright, |a, b| b.1.total_cmp(&a.1));
    }
    let (bright, others) = shining.split_at(bright);
    let mut stamp = Stamp::default();
    let bright = bright.iter().take_while(|_| !scene.is_cancelled());
    let bright = bright.map(|(source, _)| bound(&mut stamp, source));
    let mut changes: Vec<(&Source, f64, usize)> = bright.collect();
    // Discs do not count: the pixels that they change are full.
    let points = changes
        .iter()
        .filter(|(source, ..)| source.body.points() == 1);
    let max_e = points.map(|(_, e, _)| *e).fold(0.0, f64::max);
    let others = others
        .par_iter()
        .filter(|_| !scene.is_cancelled())
        .map_init(Stamp::default, |stamp, (source, all_e)| {
            match faint(source).filter(|_| *all_e <= max_e * FAINT) {
                Some(px) => (*source, *all_e, whole_px(px)),
                None => bound(stamp, source),
            }
        });
    changes.par_extend(others);
    changes.retain(|(_, e, _)| *e > 0.0);
    changes
}

fn image_of<'a>(scene: &'a Scene, source: &'a Source, stamp: &mut Stamp) -> Image<'a> {
    let (optics, detector) = (&scene.view.camera.optics, &scene.view.camera.detector);
    let ratio = source.body.wavelength_ratio();
    let psf = optics.psf_at(source.centroid, ratio);
    let middle = match psf.gradient() {
        Some(relief) => relief.peak,
        None => psf.on_pixel([0.0; 2], stamp),
    };
    let length_px = source.length_px();
    // Over a whole pixel no width changes by a twentieth.
    let sharper = if length_px < 0.01 {
        1.001
    } else {
        let ends = [source.start, source.end].map(|at| psf.differs(&optics.psf_at(at, ratio)));
        1.0 + ends[0].max(ends[1])
    };
    let Wings { drawn_px, undrawn } = source.footprint.wings;
    // The distribution may be tilted: up to twice as high along each axis.
    let pixels = (2.0 * drawn_px + 1.0).powi(2);
    let even = 4.0 * undrawn / pixels;
    let outside_px = if detector.contains(source.centroid) {
        0.0
    } else {
        outside_px(source, length_px, detector)
    };
    Image {
        source,
        still_e: source.arriving_e * (middle * sharper + even),
        core_px: psf.core_px(),
        length_px,
        is_outside: !detector.contains(source.centroid),
        middle,
        psf,
        outside_px,
        drawn_px,
        even,
    }
}

/// The line of sight to a body (camera axes, any length) at the start, middle and end of the
/// exposure.
pub fn lines_of_sight(scene: &Scene) -> impl Fn(&Body) -> [Vector3<f64>; 3] {
    let view = &scene.view;
    let times = [-0.5, 0.0, 0.5].map(|part| {
        let dt_s = part * view.exposure.duration_s;
        let turned_s = scene.simulated.only_with(EffectId::Smear, dt_s);
        (
            0.5 + turned_s / view.open_s.max(f64::MIN_POSITIVE),
            view.pointing(turned_s),
        )
    });
    move |body| times.map(|(part, pointing)| pointing.rotate(&body.line(part)))
}

/// Rolling shutter: how far an image moves between the exposures of its rows and of the middle row
/// (px), and the relative change of its exposure time (1). 0 if all rows are exposed together.
pub fn rolled(scene: &Scene, image: &Image<'_>, length_px: f64) -> (f64, f64) {
    let (camera, source) = (&scene.view.camera, image.source);
    let half_rows = (camera.detector.height as f64 - 1.0) / 2.0;
    let row_s = camera.readout_s() / (2.0 * half_rows).max(1.0);
    let from_middle = [source.start, source.end, source.centroid].map(|at| at[1] - half_rows);
    let furthest = from_middle.iter().fold(0.0, |max: f64, y| max.max(y.abs()));
    // Its wings reach further rows.
    let rows = (furthest + 5.0 * image.core_px).min(half_rows);
    // Margin for uneven motion.
    let speed = 1.2 * length_px / scene.view.exposure.duration_s;
    (speed * rows * row_s, (speed * row_s).min(1.0))
}

/// Bound of the relative change of a source's transmission if its image moves by a pixel; 0 without
/// vignetting.
pub fn dimming_px(scene: &Scene) -> f64 {
    let camera = &scene.view.camera;
    let vignetting = &camera.optics.vignetting;
    let field = camera.cone_rad(0.0).min(1.5);
    let by_angle = match vignetting {
        _ if !scene.simulated.has(EffectId::Vignetting) => 0.0,
        Vignetting::None => 0.0,
        Vignetting::Cos4 => 4.0 * libm::tan(field),
        Vignetting::Table(table) => {
            let slopes = table.windows(2).map(|ends| {
                let [[from, a], [to, b]] = [ends[0], ends[1]];
                (b - a).abs() / (to - from)
            });
            let [min, _] = vignetting.range(field);
            slopes.fold(0.0, f64::max) / min.max(f64::MIN_POSITIVE)
        }
    };
    // With distortion a pixel may be wider than 1 / focal length (rad).
    2.0 * by_angle / camera.optics.focal_px
}

/// Least distance between the detector and the line from a source's start through its centroid to
/// its end, px.
fn outside_px(source: &Source, length_px: f64, detector: &Detector) -> f64 {
    const PARTS: usize = 16;
    let sides = [detector.width, detector.height].map(|pixels| pixels as f64 - 0.5);
    let outside = |at: [f64; 2]| {
        let [x, y] = [0, 1].map(|k| (-0.5 - at[k]).max(at[k] - sides[k]).max(0.0));
        libm::hypot(x, y)
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
