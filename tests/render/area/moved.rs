//! Moving area light with detail: each pixel gets the mean over the exposure.

use super::rasterized::{LEVEL, lit, scale_e, view};
use crate::fixtures::{camera, cropped};
use nalgebra::Vector3;
use skyloop::scene::{EffectId, EffectSet, Radiance};

/// A layer around a direction, such as airglow from afar.
#[derive(Debug)]
struct Layer {
    axis: Vector3<f64>,
    radius: f64,
    width: f64,
}

impl Radiance for Layer {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        let off = (direction.angle(&self.axis) - self.radius) / self.width;
        LEVEL * (-off * off / 2.0).exp()
    }
}

#[test]
fn a_moving_thin_layer_gives_the_time_mean() {
    let mut camera = cropped(camera("rigel-l"), 192);
    camera.exposure_s = 0.1;
    let pixel = 1.0 / camera.optics.focal_px;
    for (moved_px, width_px) in [(0.9, 4.0), (15.0, 4.0), (90.0, 4.0)] {
        // Across the layer and about the boresight.
        let rate = moved_px * pixel / camera.exposure_s;
        let view = view(camera.clone(), [0.6 * rate, 0.8 * rate, rate]);
        let seen = Vector3::new(0.3, -0.4, 1.0).normalize();
        let layer = || Layer {
            axis: view.pointing(0.0).matrix().transpose() * seen,
            radius: seen.angle(&Vector3::z()),
            width: width_px * pixel,
        };
        let smeared = EffectSet::default().with(EffectId::Smear);
        let light = lit(&view, layer(), &smeared);
        let (layer, optics) = (layer(), &view.camera.optics);
        let max = light.max_e;
        const STEPS: usize = 500;
        let turned = (0..STEPS).map(|i| {
            let part = (i as f64 + 0.5) / STEPS as f64 - 0.5;
            let pointing = view.pointing(part * view.exposure.duration_s);
            pointing.matrix().transpose()
        });
        let turned: Vec<_> = turned.collect();
        let mut worst = 0.0f64;
        for (pixel, e) in light.e().iter().enumerate().step_by(7) {
            let at = [(pixel % 192) as f64, (pixel / 192) as f64];
            let plane = [0, 1].map(|k| (at[k] - optics.principal_px[k]) / optics.focal_px);
            let seen = optics.projection.direction(plane).unwrap();
            let sum: f64 = turned.iter().map(|sky| layer.toward(&(sky * seen))).sum();
            let taken = optics.projection.solid_angle(&seen) / (optics.focal_px * optics.focal_px);
            let expected = sum / STEPS as f64 * taken * scale_e(&view) / LEVEL;
            worst = worst.max((f64::from(*e) - expected).abs() / max);
        }
        assert!(worst < 0.01, "{moved_px} px, {width_px} px wide: {worst}");
    }
}
