//! The pyramid that the directions of a camera's pixels lie in.

use super::device::Camera;
use nalgebra::Vector3;

/// One side of it: a plane through the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Side {
    /// Its normal, to the inside: unit vector.
    pub inward: Vector3<f64>,
    /// How far beyond it directions of pixels may be, for edges that bend, rad.
    pub beyond: f64,
}

/// Cosine of the angle from the boresight beyond which no pyramid holds a field, 80 degrees.
const WIDEST: f64 = 0.17;

impl Camera {
    /// The planes (camera axes) within which every pixel, widened by `margin_px`, lies, distortion
    /// left out or not; none of a field that is too wide for them.
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
            // An edge has its furthest place between the points, some thousandth of that further.
            let beyond = 1.01 * furthest + 1e-9;
            Some(Side { inward, beyond })
        };
        (0..4).filter_map(side).collect()
    }
}
