//! Labels' centroids are those of the light.

use super::properties::{Worst, cameras, check, place_lights, scenes};
use super::stage::{
    alone, behind, camera, emulator, expected, light, moments, square, starry, still, towards,
    unit, vehicle,
};
use nalgebra::Vector3;
use proptest::prelude::*;
use skyloop::attitude::Attitude;
use skyloop::fidelity::Fidelity;
use skyloop::scene::Source;
use std::cell::Cell;
use std::f64::consts::{PI, TAU};

/// Light and its centre (px) of a source's own image on the detector.
fn image(source: &Source) -> (f64, [f64; 2]) {
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (row, column, shares) in source.footprint.rows(0..usize::MAX) {
        for (column, share) in (column..).zip(shares) {
            let share = f64::from(*share);
            sum += share;
            x += share * column as f64;
            y += share * row as f64;
        }
    }
    (sum, [x / sum, y / sum])
}

/// Labelled centroids match the noise-free image to 0.005 px, for any optics, shutter and rate,
/// when all but a ten-thousandth of the light is on the detector. Exceptions: pixel sampling shifts
/// cores with a sigma below half a pixel (next test). Wide Moffat images of less than 0.1 e- match
/// to 0.1 px, because their wings are spread over too few pixels.
#[test]
fn labels_centroids_are_those_of_the_light() {
    let [faintest, worst] = [(); 2].map(|()| Worst::default());
    let compared = Cell::new(0);
    check(160, scenes(), |(which, attitude, rates, positions)| {
        let camera = &cameras()[which];
        let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
        let lit = light(
            &emulator,
            &vehicle(&attitude, rates),
            &place_lights(camera, &attitude, &positions, 1.0),
        );
        for source in &lit.scene.sources {
            let (sum, centre) = image(source);
            if sum < 0.9999 {
                continue;
            }
            let miss = (centre[0] - source.centroid[0]).hypot(centre[1] - source.centroid[1]);
            if source.electrons < 0.1 && which == 3 {
                faintest.of(miss);
                continue;
            }
            prop_assert!(worst.of(miss) < 0.005, "camera {which}: {miss} px");
            compared.set(compared.get() + 1);
        }
        Ok(())
    });
    let faintest_px = faintest.get();
    let compared = compared.get();
    println!("{compared} images, at most {worst} px; of the faintest {faintest} px");
    assert!(faintest_px < 0.1, "{faintest_px}");
    assert!(compared > 500, "{compared}");
}

/// Pixel sampling shifts the centre of a narrow core, for a camera as for an image.
///
/// Reference: Poisson's summation of the Gaussian over a pixel. At whole k only its slope remains,
/// per coordinate:
///
/// ```text
/// P(k) = exp(-2 pi^2 sigma^2 k^2) sin(pi k) / (pi k)
/// sum (n - x) p(n - x) = sum over k > 0 of (-1)^k exp(-2 pi^2 sigma^2 k^2) sin(2 pi k x) / (pi k)
/// ```
///
/// The first term is stated in docs/explanation/labels.md.
#[test]
fn centroids_of_narrow_cores_have_the_sampling_error() {
    let attitude = Attitude::identity();
    for sigma in [0.1, 0.2, 0.3, 0.4, 0.5, 0.6] {
        let camera = camera(&format!("optics.psf.sigma_px = {sigma}"));
        let emulator = emulator(camera.clone(), Fidelity::REFERENCE, |_| {});
        let of = |k: f64, x: f64| {
            let sign = if k % 2.0 == 0.0 { 1.0 } else { -1.0 };
            sign * (-2.0 * (PI * sigma * k).powi(2)).exp() * (TAU * k * x).sin() / (PI * k)
        };
        let series = |x: f64| (1..40).map(|k| of(f64::from(k), x)).sum::<f64>();
        let mut max = 0.0_f64;
        for i in 0..24 {
            let off = [
                f64::from(i) / 24.0 - 0.5,
                f64::from(7 * i % 24) / 24.0 - 0.5,
            ];
            let at = off.map(|off| 30.0 + off);
            let direction = behind(&camera, &attitude, at);
            let lit = alone(&emulator, &still(&attitude), direction, 1e5);
            let (_, centre) = moments(&lit.expected_e, 64);
            let label = lit.scene.sources[0].centroid;
            for axis in 0..2 {
                let miss = centre[axis] - label[axis];
                assert!(
                    (miss - series(off[axis])).abs() < 1e-6,
                    "{sigma} {off:?}: {miss}"
                );
                max = max.max(miss.abs());
            }
        }
        let first_term = (-2.0 * (PI * sigma).powi(2)).exp() / PI;
        println!("{sigma} px: {max:.4} px, {first_term:.4} by the first term");
        assert!(
            sigma < 0.2 || (max / first_term - 1.0).abs() < 0.02,
            "{sigma}: {max} {first_term}"
        );
    }
}

/// The same through the emulator: stars of the catalogue in the frame's own pixels, one at a time.
#[test]
fn a_stars_label_is_the_centroid_of_its_frame() {
    let camera = square(128, "optics.focal_length_mm = 60.0");
    let mut emulator = starry(camera, Fidelity::REALTIME);
    let stars = emulator.world().stars.catalog().stars().iter().step_by(400);
    let stars: Vec<Vector3<f64>> = stars.map(|star| unit(star.ra_rad, star.dec_rad)).collect();
    let mut compared = 0;
    for star in stars {
        let attitude = towards(&star);
        let exposed = emulator
            .expose(&vehicle(&attitude, [0.2, -0.3, 1.0]), 0)
            .unwrap();
        let [only] = &exposed.label.objects[..] else {
            continue;
        };
        let only = only.clone();
        let (sum, [x, y]) = moments(&expected(exposed), 128);
        if sum < 0.9999 * only.electrons || only.electrons < 10.0 {
            continue;
        }
        let miss = (x - only.x_px).hypot(y - only.y_px);
        assert!(miss < 0.005, "{}: {x} {y}", only.id);
        compared += 1;
    }
    assert!(compared > 10, "{compared}");
}
