//! The sources in the field during one exposure: directions and light, before the optics.

use super::area::radiance::Area;
use super::exposure::Exposure;
use super::observable::Unobservable;
use super::solar_system::SeenSun;
use super::source::{Body, Candidate, Hidden};
use crate::attitude::{Attitude, VehicleState};
use crate::camera::{Camera, Stamp};
use crate::fidelity::Fidelity;
use crate::footprint::Footprint;
use crate::sky::apparent::Observer;
use crate::sky::bodies::LIGHT_M_S;
use crate::sky::field::Excluded;
use crate::sky::photometry::photon_irradiance;
use crate::sky::shadow::Earth;
use crate::track::Window;
use nalgebra::Vector3;
use skyloop_base::abort::WorkLimit;
use skyloop_base::rng::NoiseKey;
use skyloop_orbit::OrbitError;
use skyloop_orbit::sgp4_batch::Level;
use std::sync::Arc;

/// The sources in the field during one exposure.
#[derive(Debug, Clone)]
pub struct View {
    /// The instants of the exposure.
    pub exposure: Exposure,
    /// Time from the first row's opening to the last row's closing, around mid-exposure, s.
    pub open_s: f64,
    /// How far the body turns in `open_s`, rad.
    pub turn: f64,
    /// The observer's velocity at the start and the end of `open_s`, less that at mid-exposure,
    /// m/s; zero without aberration.
    pub velocity_change_m_s: [Vector3<f64>; 2],
    /// The vehicle at mid-exposure.
    pub vehicle: VehicleState,
    /// The camera with its commanded settings.
    pub camera: Arc<Camera>,
    /// Its [`Camera::scale_and_corner_px`].
    pub scale_and_corner_px: (f64, f64),
    /// The key of all noise.
    pub key: NoiseKey,
    /// The vector instructions for streaks; none: pixel by pixel. The result is the same.
    pub level: Option<Level>,
    /// The frame's work limit: once it is over, sources have no image.
    pub limit: WorkLimit,
    /// Whether images are formed without motion: every pixel is full with or without it, and the
    /// frame would exceed its work limit.
    pub still_in_flood: bool,
    /// The observer at mid-exposure; at the Earth's centre without an orbit.
    pub observer: Observer,
    /// Stars in catalogue order, objects in the population's order, planets, the Moon.
    pub candidates: Vec<Candidate>,
    /// The direction of the Moon's centre (unit vector, ICRF), and the cosine of its radius.
    pub(super) moon: (Vector3<f64>, f64),
    /// The Sun.
    pub sun: SeenSun,
    /// Area sources, in the order of their effects.
    pub areas: Vec<Area>,
    /// Number of objects in the scene, in the field or not.
    pub objects: usize,
    /// Objects in the field without an image, by index, with the reason.
    pub unseen: Vec<(usize, Excluded)>,
    /// Objects whose orbit has no position at this time.
    pub unknown: Unknown,
    /// The greatest own motion of a candidate, rad.
    pub(super) own_motion: f64,
    /// Precomputed pointings, by the time from mid-exposure, s.
    pub(super) pointings: Vec<(f64, Attitude)>,
    /// Planes around the directions of stars whose image may touch the detector: inward normals
    /// (ICRF), and the least scalar product of such a direction with each.
    pub(super) sides: Vec<(Vector3<f64>, f64)>,
    /// The lost share of the PSF (1), and the window of light for it.
    pub(super) window: (f64, Window),
}

/// Limits below which a source is too faint for an image. The noise is `floor_e` in each pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Faint {
    /// Least signal-to-noise ratio of objects (1).
    pub snr: f64,
    /// The same of hidden objects, in full light.
    pub unlit_snr: f64,
    /// The same of stars.
    pub star_snr: f64,
    /// Noise of a pixel without charge, e-.
    pub floor_e: f64,
}

/// Objects whose orbit has no position.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Unknown {
    /// Their number.
    pub count: usize,
    /// The reason, once for each object.
    pub notices: Vec<OrbitError>,
}

/// Time of an object in the search of the field, ns; of one in the field; and of one with an image:
/// three positions, its light, bounds and label.
pub const OBJECT_NS: f64 = 700.0;
const IN_FIELD_NS: f64 = 300.0;
const SEEN_NS: f64 = 5000.0;

impl View {
    /// Time of the search for objects in the field, ns.
    pub(crate) fn search_ns(&self) -> f64 {
        let is_rso = |candidate: &&Candidate| matches!(candidate.body, Body::Rso(_));
        let seen = self.candidates.iter().filter(is_rso).count() as f64;
        self.objects as f64 * OBJECT_NS + self.unseen.len() as f64 * IN_FIELD_NS + seen * SEEN_NS
    }

    /// The error of a view over the work limit (s on one core).
    pub(crate) fn too_much(&self, limit_s: Option<f64>) -> Unobservable {
        Unobservable::TooMuchWork {
            sources: self.candidates.len(),
            length_px: self.longest_path_px(),
            exposure_s: self.exposure.duration_s,
            limit_s: limit_s.unwrap_or(f64::INFINITY),
        }
    }

    /// Whether the image of a candidate may touch the detector, by its direction.
    pub(super) fn may_hold(&self, candidate: &Candidate) -> bool {
        let (mut sides, optics) = (self.sides.iter(), &self.camera.optics);
        match &candidate.body {
            Body::Star(star) => {
                sides.all(|(inward, min_product)| star.direction.dot(inward) >= *min_product)
            }
            Body::Rso(_) => true,
            Body::Planet(body) => {
                // The light is off the centre of the disc, and wings are drawn further than those
                // of stars.
                let wings = 2.0 * optics.psf.reach_px(f64::EPSILON) / optics.focal_px;
                let reach = 2.0 * body.angular_radius + candidate.own_motion + wings;
                sides.all(|(inward, min_product)| {
                    libm::asin(body.centre.dot(inward).clamp(-1.0, 1.0)) + reach
                        >= libm::asin(*min_product)
                })
            }
        }
    }

    /// ICRF to camera, `dt_s` after mid-exposure.
    pub fn pointing(&self, dt_s: f64) -> Attitude {
        if let Some((_, known)) = self.pointings.iter().find(|(t, _)| *t == dt_s) {
            return *known;
        }
        self.vehicle
            .attitude
            .turned(&self.vehicle.rates, dt_s)
            .then(&self.camera.mounting)
    }

    /// The displacement of a star by the change of aberration since mid-exposure (rad, ICRF axes),
    /// at a part of the view's time (0: start, 1: end). First order in v / c: `du = (dv - (dv . u)
    /// u) / c`; dv is a parabola through start, mid and end.
    pub(crate) fn aberration_drift(&self, star: &Vector3<f64>, part: f64) -> Vector3<f64> {
        let [start, end] = &self.velocity_change_m_s;
        let dv = start * ((2.0 * part - 1.0) * (part - 1.0)) + end * (part * (2.0 * part - 1.0));
        (dv - star * dv.dot(star)) / LIGHT_M_S
    }

    /// Bound of the path of an image on the detector in `seconds`, px. A turn across the boresight
    /// moves images by its angle times the plate scale, a turn about it by its angle times their
    /// distance from the boresight.
    pub(crate) fn longest_track_px(&self, seconds: f64) -> f64 {
        let turn = self.camera.mounting.rotate(&self.vehicle.rates) * seconds;
        // Own motion that is not uniform is at most all of it, and little more than twice the mean.
        let share = if seconds < self.open_s {
            (2.0 * seconds / self.open_s).min(1.0)
        } else {
            1.0
        };
        let own = self.own_motion * share;
        let (scale, furthest) = self.scale_and_corner_px;
        (libm::hypot(turn.x, turn.y) + own) * scale + turn.z.abs() * furthest
    }

    /// Bound of the brightest pixel's light, e-; `part` is the weight of a direction (camera axes).
    /// A factor of 2 allows for neighbouring sources.
    pub(crate) fn brightest_px_e(&self, part: impl Fn(&Vector3<f64>) -> f64) -> f64 {
        let camera = &self.camera;
        let psf = camera.optics.psf_at(camera.optics.principal_px, 1.0);
        let share = psf.on_pixel([0.0; 2], &mut Stamp::default());
        let pointing = self.pointing(0.0);
        let widest = (camera.cone_rad(psf.core_px() * 5.0) + self.turn).min(std::f64::consts::PI);
        let edge = libm::cos(widest);
        let mut max_e = 0.0f64;
        for candidate in &self.candidates {
            let e = candidate.electrons();
            // Only a few candidates get this far.
            if e > max_e {
                let seen = pointing.rotate(&candidate.body.line(0.5)).normalize();
                if seen.z >= edge - candidate.own_motion {
                    max_e = max_e.max(e * part(&seen));
                }
            }
        }
        2.0 * max_e * share
    }

    /// Bound of the own motion of area light's edges in `seconds`, px.
    pub(crate) fn areas_motion_px(&self, seconds: f64) -> f64 {
        let motions = self.areas.iter().map(|area| area.angular_speed());
        motions.fold(0.0, f64::max) * seconds * self.scale_and_corner_px.0
    }

    /// Bound of the motion of images and of area light's edges in the exposure, px.
    pub(crate) fn longest_path_px(&self) -> f64 {
        let seconds = self.exposure.duration_s;
        self.longest_track_px(seconds) + self.areas_motion_px(seconds)
    }

    /// Estimate of the brightest area light of a pixel, e-.
    pub(crate) fn areas_peak_e(&self) -> f64 {
        self.areas.iter().map(|area| area.peak_e).sum()
    }

    /// The part of the detector plane whose light matters.
    pub(super) fn window(&self, fidelity: &Fidelity) -> Window {
        match self.window {
            (loss, window) if loss == fidelity.psf_loss => window,
            _ => Footprint::window(&self.camera, fidelity),
        }
    }

    /// Clark et al. 2021, Eqs. (2), (11), before the division by the gain:
    /// `N = E_obj QE tau A_app t_int`, with `E_obj = E_zero 10^(-0.4 m)`.
    pub(super) fn electrons(&self, band_mag: f64) -> f64 {
        let per_second = self.camera.electrons_per_second_at_zero();
        photon_irradiance(per_second, band_mag) * self.exposure.duration_s
    }

    /// The body that occults a direction at infinity, if any.
    pub(crate) fn hidden(
        &self,
        direction: &Vector3<f64>,
        earth: &Earth,
        observer: &Observer,
    ) -> Option<Hidden> {
        if earth.occults_direction(observer.position_m, *direction) {
            return Some(Hidden::ByEarth);
        }
        let [toward, reach] = [self.moon.0.dot(direction), self.moon.1];
        (toward > reach).then_some(Hidden::ByMoon)
    }
}
