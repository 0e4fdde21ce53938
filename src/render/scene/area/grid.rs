//! The grid of pixels on and around the detector on which an area source is evaluated.

use super::full::Full;
use super::motion::{AREA_EVALUATION_NS, mean, panels};
use super::plane::{Plane, received};
use super::radiance::Radiance;
use super::raster_work::RasterWork;
use crate::fidelity::Fidelity;
use nalgebra::Vector3;

/// Side of the grid's largest squares, px.
pub(crate) const LARGEST: usize = 256;
/// Side of the smallest squares, px: if not interpolated, they are sampled.
pub(crate) const SMALLEST: usize = 4;
/// Greatest deviation of the middle of a moving panel from the line between its ends, in tolerances
/// of the interpolation. Simpson's rule then errs by far less.
const BEND: f64 = 12.0;

/// A source, the plane it falls on, and its tolerances.
pub(crate) struct Grid<'a, 'v> {
    pub radiance: &'a dyn Radiance,
    pub plane: &'a Plane<'v>,
    fidelity: &'a Fidelity,
    /// Electrons of a pixel per steradian at a radiance of 1.
    pub scale_e: f64,
    /// Where this and other area light together fill pixels.
    pub full: &'a Full,
    /// How far the pattern moves while a pixel is open, rad.
    pub motion: f64,
    /// Whether light without an edge is constant during that time.
    pub is_still: bool,
    /// Columns and rows of the detector.
    pub detector: [usize; 2],
    /// Pixels that are needed around the detector.
    pub margin: usize,
    /// Columns and rows of the grid before the detector's first. A multiple of the largest square,
    /// so that squares do not depend on the margin.
    pub rim: usize,
}

impl<'a, 'v> Grid<'a, 'v> {
    pub fn new(
        radiance: &'a dyn Radiance,
        plane: &'a Plane<'v>,
        margin: usize,
        full: &'a Full,
        fidelity: &'a Fidelity,
    ) -> Self {
        Grid {
            radiance,
            plane,
            fidelity,
            scale_e: plane.scale_e(radiance),
            full,
            motion: plane.motion(),
            is_still: panels(radiance, plane.motion() * plane.scale_px()) == 0,
            detector: [plane.detector().width, plane.detector().height],
            margin,
            rim: margin.next_multiple_of(LARGEST),
        }
    }

    /// Whether any pixel of a square, given by its first column and row, is needed.
    pub fn is_needed(&self, from: [usize; 2], side: usize) -> bool {
        from.iter().zip(self.detector).all(|(from, pixels)| {
            let needed = self.rim - self.margin..self.rim + pixels + self.margin;
            from + side > needed.start && *from < needed.end
        })
    }

    /// The error that interpolation may have at light `e`, e-.
    pub fn may_miss(&self, e: f64) -> f64 {
        self.fidelity.area_e + self.fidelity.area_part * e.abs()
    }

    /// The light of the pixel around a position, e-: the mean over its time, or the value in the
    /// middle if the pattern hardly moves. None if the position has no direction, or the work limit
    /// is over.
    pub fn at(&self, x: f64, y: f64, work: &mut RasterWork) -> Option<f64> {
        if self.plane.limit().is_over() {
            return None;
        }
        let (seen, solid_angle_sr) = self.plane.solid_angle_sr([x, y])?;
        let [middle_s, duration_s] = self.plane.open_s(y);
        let moved_px = self.motion * self.plane.scale_px();
        let light = |part: f64| {
            let sky = self.plane.to_sky(middle_s + (part - 0.5) * duration_s);
            self.light(&(sky * seen), solid_angle_sr)
        };
        let bent = |value: f64| BEND * self.may_miss(value);
        let (mean, evaluations) = match panels(self.radiance, moved_px) {
            0 => (light(0.5), 1),
            panels => mean(light, panels, bent),
        };
        work.lights += 1;
        work.smeared += evaluations - 1;
        let ns = self.plane.place_ns() + evaluations as f64 * AREA_EVALUATION_NS;
        self.plane.limit().spend(ns);
        Some(mean)
    }

    /// The light from a direction on a pixel of `solid_angle_sr`, e-.
    pub fn light(&self, direction: &Vector3<f64>, solid_angle_sr: f64) -> f64 {
        received(self.radiance, direction, solid_angle_sr) * self.scale_e
    }
}
