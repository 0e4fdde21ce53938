//! The camera: optics and detector on a vehicle.

use super::detector::Detector;
use super::optics::Optics;
use super::projection::Model;
use super::radiation::Radiation;
use super::shutter::Shutter;
use crate::attitude::{Attitude, angle_between};

/// A camera on its vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    /// Name in labels and FITS headers.
    pub name: String,
    /// Serial number, the key of its fixed pattern.
    pub serial: u64,
    /// Body to camera.
    pub mounting: Attitude,
    /// Aperture, projection, transmission, band and point spread function.
    pub optics: Optics,
    /// Pixels, noise and conversion.
    pub detector: Detector,
    /// Charged particles; none without this table in the file.
    pub radiation: Option<Radiation>,
    /// Default exposure time, s.
    pub exposure_s: f64,
    /// The camera's frame rate, Hz.
    pub rate_hz: f64,
    /// Timing of the rows.
    pub shutter: Shutter,
}

impl Camera {
    /// Electrons per second from a source of band magnitude 0 on the whole detector:
    /// `E_zero QE tau A_app` of Clark et al. 2021, Eq. (2).
    pub fn electrons_per_second_at_zero(&self) -> f64 {
        self.optics.band.zero_point()
            * self.detector.quantum_efficiency
            * self.optics.transmission
            * self.optics.aperture_area_m2()
    }

    /// Time from the opening of the first row to that of the last row, s.
    pub fn readout_s(&self) -> f64 {
        self.shutter.readout_s(self.detector.height)
    }

    /// The shortest time (s) from one exposure of `exposure_s` to the next.
    pub fn period_s(&self, exposure_s: f64) -> f64 {
        self.shutter.period_s(self.detector.height, exposure_s)
    }

    /// The greatest scale (px/rad) at the corners and the principal point, and the greatest
    /// distance of a corner from that point (px).
    pub fn scale_and_corner_px(&self) -> (f64, f64) {
        const STEP_PX: f64 = 0.1;
        let optics = &self.optics;
        let (mut scale, mut furthest) = (0.0f64, 0.0f64);
        for position in std::iter::once(optics.principal_px).chain(self.detector.corners()) {
            let from = optics.offset(position);
            let distance = libm::hypot(from[0], from[1]);
            furthest = furthest.max(distance);
            // Along the radius and across it.
            let radius = if distance > 0.0 {
                from.map(|px| px / distance)
            } else {
                [1.0, 0.0]
            };
            for step in [radius, [-radius[1], radius[0]]] {
                let moved = [0, 1].map(|i| position[i] + STEP_PX * step[i]);
                let angle = angle_between(&optics.direction(position), &optics.direction(moved));
                scale = scale.max(STEP_PX / angle);
            }
        }
        (scale, furthest)
    }

    /// The angle from the boresight (rad) that contains every pixel, widened by `margin_px`.
    pub fn cone_rad(&self, margin_px: f64) -> f64 {
        match self.optics.projection.model() {
            Model::Pinhole => self.pinhole_cone_rad(margin_px),
            // The distortion may be switched off.
            Model::BrownConrady { .. } => {
                let ideal = self.pinhole_cone_rad(margin_px);
                self.distorted_cone_rad(margin_px).max(ideal)
            }
            Model::Fisheye { .. } => {
                let (_, furthest) = self.scale_and_corner_px();
                let ideal = (furthest + margin_px) / self.optics.focal_px;
                let max = std::f64::consts::PI;
                self.distorted_cone_rad(margin_px).max(ideal).min(max)
            }
        }
    }

    fn pinhole_cone_rad(&self, margin_px: f64) -> f64 {
        let angles = self.detector.corners().map(|corner| {
            let [dx, dy] = self.optics.offset(corner);
            libm::atan((libm::hypot(dx, dy) + margin_px) / self.optics.focal_px)
        });
        angles.into_iter().fold(0.0, f64::max)
    }

    fn distorted_cone_rad(&self, margin_px: f64) -> f64 {
        let optics = &self.optics;
        let angle = |pixel: [f64; 2]| {
            let direction = optics.direction(pixel);
            libm::atan2(libm::hypot(direction.x, direction.y), direction.z)
        };
        let widest = self.detector.edge(margin_px).map(angle).fold(0.0, f64::max);
        // With tangential distortion the widest angle may lie between the points, by some
        // thousandth of a side.
        (1.01 * widest).min(std::f64::consts::PI)
    }
}
