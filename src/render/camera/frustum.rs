//! The pyramid of the directions of a camera's pixels.

use super::device::Camera;
use nalgebra::Vector3;

/// One side of the pyramid: a plane through the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// Its normal, to the inside: unit vector.
    pub inward: Vector3<f64>,
    /// Greatest angle of a pixel's direction beyond the plane, for curved edges, rad.
    pub beyond: f64,
}

/// Cosine of the greatest angle from the boresight for a pyramid, 80 degrees.
const WIDEST: f64 = 0.17;

impl Camera {
    /// The planes (camera axes) that enclose every pixel, widened by `margin_px`, with or without
    /// distortion. Empty for a field that is too wide for a pyramid.
    pub fn sides(&self, margin_px: f64) -> Vec<Side> {
        let optics = &self.optics;
        let ideal = optics.projection.ideal();
        let seen: Vec<Vector3<f64>> = self
            .detector
            .edge(margin_px)
            .flat_map(|pixel| {
                let plane = optics.offset(pixel).map(|px| px / optics.focal_px);
                [Some(optics.direction(pixel)), ideal.direction(plane)]
            })
            .flatten()
            .collect();
        if seen.iter().any(|direction| direction.z < WIDEST) {
            return Vec::new();
        }
        let (low, [width, height]) = (-0.5 - margin_px, self.detector.sides());
        let (right, bottom) = (width - 0.5 + margin_px, height - 0.5 + margin_px);
        let corners = [[low, low], [right, low], [right, bottom], [low, bottom]];
        let corners = corners.map(|pixel| optics.direction(pixel));
        let middle: Vector3<f64> = corners.iter().sum();
        let side = |k: usize| {
            let normal = corners[k].cross(&corners[(k + 1) % 4]).try_normalize(0.0)?;
            let inward = normal * 1f64.copysign(normal.dot(&middle));
            let beyond = |direction: &Vector3<f64>| libm::asin(-direction.dot(&inward));
            let furthest = seen.iter().map(beyond).fold(0.0, f64::max);
            // The maximum may lie between the points: it is greater by some thousandth.
            let beyond = 1.01 * furthest + 1e-9;
            Some(Side { inward, beyond })
        };
        (0..4).filter_map(side).collect()
    }
}
