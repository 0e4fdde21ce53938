//! From a pixel to the sky: the direction of its middle and its solid angle.

use super::radiance::Radiance;
use crate::camera::{Camera, Detector, Model, Projection, Vignetting};
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::view::View;
use nalgebra::{Matrix3, Rotation3, Vector3};
use skyloop_base::abort::WorkLimit;

/// The detector's pixels as solid angles, with the effects that shape them.
pub(crate) struct Plane<'a> {
    view: &'a View,
    projection: Projection,
    vignetted: bool,
    smeared: bool,
    rolling: bool,
    turning: Vector3<f64>,
    middle: Matrix3<f64>,
}

impl<'a> Plane<'a> {
    /// For a pattern that turns relative to ICRF by `turning` rad/s.
    pub fn new(view: &'a View, simulated: &EffectSet, turning: Vector3<f64>) -> Plane<'a> {
        let optics = &view.camera.optics;
        Plane {
            view,
            projection: optics.projection_if(simulated.has(EffectId::Distortion)),
            vignetted: simulated.has(EffectId::Vignetting),
            smeared: simulated.has(EffectId::Smear),
            rolling: simulated.has(EffectId::Smear) && simulated.has(EffectId::RollingShutter),
            turning,
            middle: view.pointing(0.0).matrix().transpose(),
        }
    }

    /// The work limit.
    pub fn limit(&self) -> &WorkLimit {
        &self.view.limit
    }

    fn camera(&self) -> &Camera {
        &self.view.camera
    }

    /// The direction of a position on the plane (px): unit vector, camera axes.
    fn seen_at(&self, at: [f64; 2]) -> Option<Vector3<f64>> {
        let optics = &self.camera().optics;
        self.projection
            .direction([0, 1].map(|k| (at[k] - optics.principal_px[k]) / optics.focal_px))
    }

    /// The direction of a position (unit vector, camera axes), and the solid angle of its pixel
    /// times the transmission, sr.
    ///
    /// Clark et al. 2021, Eq. (4), `E = L IFOV^2`, holds on the boresight of a pinhole. In general
    /// the pixel has its own solid angle ([`Projection::solid_angle`]), and vignetting applies as
    /// to stars. `cos^4` is the law of an evenly bright scene and includes the solid angle.
    pub fn solid_angle_sr(&self, at: [f64; 2]) -> Option<(Vector3<f64>, f64)> {
        let seen = self.seen_at(at)?;
        let optics = &self.camera().optics;
        if self.vignetted && optics.vignetting == Vignetting::Cos4 {
            let square = 1.0 / (optics.focal_px * optics.focal_px);
            return Some((seen, square * optics.vignetting.transmission(&seen)));
        }
        let solid_angle = self.projection.solid_angle(&seen) / (optics.focal_px * optics.focal_px);
        let passes = if self.vignetted {
            optics.vignetting.transmission(&seen)
        } else {
            1.0
        };
        Some((seen, solid_angle * passes))
    }

    /// Time of [`Plane::solid_angle_sr`], ns. It inverts the projection: by Newton's method, except
    /// for a pinhole.
    pub fn place_ns(&self) -> f64 {
        match self.projection.model() {
            Model::Pinhole => 50.0,
            Model::BrownConrady { .. } | Model::Fisheye { .. } => 200.0,
        }
    }

    /// The open time of a row: its middle from mid-exposure, and its duration, s.
    pub fn open_s(&self, row: f64) -> [f64; 2] {
        let exposure_s = self.view.exposure.duration_s;
        let duration_s = if self.smeared { exposure_s } else { 0.0 };
        if !self.rolling {
            return [0.0, duration_s];
        }
        let rows = self.camera().detector.height as f64;
        let part = (row + 0.5) / rows - 0.5;
        [
            part * self.camera().readout_s() * (rows - 1.0) / rows.max(1.0),
            duration_s,
        ]
    }

    /// Camera axes to ICRF `dt_s` after mid-exposure, relative to the pattern at mid-exposure.
    pub fn to_sky(&self, dt_s: f64) -> Matrix3<f64> {
        if dt_s == 0.0 {
            return self.middle;
        }
        let to_icrf = self.view.pointing(dt_s).matrix().transpose();
        if self.turning == Vector3::zeros() {
            return to_icrf;
        }
        Rotation3::new(self.turning * -dt_s).into_inner() * to_icrf
    }

    /// The detector.
    pub fn detector(&self) -> &Detector {
        &self.camera().detector
    }

    /// Electrons of a pixel per steradian at a radiance of 1. Clark et al. 2021, Eq. (5), before
    /// the division by the gain: `N = E QE tau A_app t_int`.
    pub fn scale_e(&self, radiance: &dyn Radiance) -> f64 {
        let (camera, seconds) = (self.camera(), self.view.exposure.duration_s);
        if radiance.is_of_pixels() {
            return seconds;
        }
        let optics = &camera.optics;
        camera.detector.quantum_efficiency
            * optics.transmission
            * optics.aperture_area_m2()
            * seconds
    }

    /// The greatest scale of the plane, px a rad.
    pub fn scale_px(&self) -> f64 {
        self.view.scale_and_corner_px.0
    }

    /// Greatest motion of the pattern while a pixel is open, rad.
    pub fn motion(&self) -> f64 {
        if !self.smeared {
            return 0.0;
        }
        (self.view.vehicle.rates.norm() + self.turning.norm()) * self.view.exposure.duration_s
    }
}

/// The light from a direction on a pixel of `solid_angle_sr`, for a scale of 1.
pub(crate) fn received(
    radiance: &dyn Radiance,
    direction: &Vector3<f64>,
    solid_angle_sr: f64,
) -> f64 {
    let solid_angle_sr = if radiance.is_of_pixels() {
        1.0
    } else {
        solid_angle_sr
    };
    radiance.seen(direction) * solid_angle_sr
}
