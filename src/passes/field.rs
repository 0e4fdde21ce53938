//! The field of a camera: the directions (unit vectors, camera axes) with images on its detector.

use nalgebra::Vector3;
use skyloop_render::camera::Camera;

/// Number of points along each side of the detector.
const POINTS: usize = 64;

pub(super) struct Field<'a> {
    camera: &'a Camera,
    /// Directions of points of the edge, in order.
    edge: Vec<Vector3<f64>>,
    /// Largest angle from a point of the edge to the nearest of them, rad.
    slack: f64,
}

impl<'a> Field<'a> {
    pub(super) fn new(camera: &'a Camera) -> Self {
        let [width, height] = camera.detector.sides();
        let corners = [
            [-0.5, -0.5],
            [width - 0.5, -0.5],
            [width - 0.5, height - 0.5],
            [-0.5, height - 0.5],
        ];
        let edge: Vec<Vector3<f64>> = (0..4 * POINTS)
            .map(|i| {
                let (from, to) = (corners[i / POINTS], corners[(i / POINTS + 1) % 4]);
                let part = (i % POINTS) as f64 / POINTS as f64;
                let pixel = [0, 1].map(|axis| from[axis] + part * (to[axis] - from[axis]));
                camera.optics.direction(pixel).normalize()
            })
            .collect();
        let next = edge.iter().cycle().skip(1);
        let gaps = edge.iter().zip(next).map(|(a, b)| a.angle(b));
        // Half of the widest gap, and a half more for a curved edge.
        let slack = 0.75 * gaps.fold(0.0, f64::max);
        Self {
            camera,
            edge,
            slack,
        }
    }

    /// The image of a direction on the detector, px; none outside the detector.
    pub(super) fn image_px(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        let image_px = self.camera.optics.project(direction)?;
        let sides = self.camera.detector.sides();
        let on = |axis: usize| (-0.5..=sides[axis] - 0.5).contains(&image_px[axis]);
        (on(0) && on(1)).then_some(image_px)
    }

    /// Lower bound of the angle from a direction to the edge of the field, rad.
    pub(super) fn to_edge(&self, direction: &Vector3<f64>) -> f64 {
        let dots = self.edge.iter().map(|edge| edge.dot(direction));
        let nearest = libm::acos(dots.fold(-1.0, f64::max).min(1.0));
        (nearest - self.slack).max(0.0)
    }
}
