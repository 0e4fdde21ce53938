//! Properties of any scene: turning camera and sky together changes nothing, an exposure is the sum
//! of its halves, and light scales.

use super::stage::{
    Light, Lit, behind, emulator, expected as pixels, light, square, starry, vehicle,
};
use nalgebra::{Quaternion, UnitQuaternion};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use skyloop::attitude::Attitude;
use skyloop::camera::Camera;
use skyloop::fidelity::Fidelity;
use std::cell::Cell;
use std::sync::OnceLock;

/// Runs a property on a number of cases, the same ones every time.
pub fn check<S: Strategy>(
    cases: u32,
    strategy: S,
    property: impl Fn(S::Value) -> Result<(), TestCaseError>,
) {
    let config = Config {
        cases,
        failure_persistence: None,
        ..Config::default()
    };
    let rng = TestRng::deterministic_rng(RngAlgorithm::ChaCha);
    let run = TestRunner::new_with_rng(config, rng).run(&strategy, property);
    run.unwrap_or_else(|failed| panic!("{failed}"));
}

pub fn rotations() -> impl Strategy<Value = Attitude> {
    let components = prop::array::uniform4(-1.0..1.0_f64).prop_filter("a direction", |q| {
        (0.1..1.0).contains(&q.iter().map(|c| c * c).sum::<f64>())
    });
    components.prop_map(|[x, y, z, w]| {
        let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Attitude::from_xyzw([q.i, q.j, q.k, q.w]).unwrap()
    })
}

/// Rates up to some degrees a second, in any direction; sometimes none.
fn rates() -> impl Strategy<Value = [f64; 3]> {
    let any = (prop::array::uniform3(-1.0..1.0_f64), -6.0..0.7_f64);
    prop_oneof![
        1 => Just([0.0; 3]),
        6 => any.prop_map(|(axis, power)| axis.map(|c| c * 10f64.powf(power))),
    ]
}

/// Positions on and around a detector of 128 px, and their light.
fn lights() -> impl Strategy<Value = Vec<([f64; 2], f64)>> {
    let one = (prop::array::uniform2(-6.0..134.0_f64), -3.0..5.0_f64);
    prop::collection::vec(one.prop_map(|(at, power)| (at, 10f64.powf(power))), 1..24)
}

/// Cameras of all kinds of optics and shutters, 128 x 128 px.
pub fn cameras() -> &'static [Camera] {
    static CAMERAS: OnceLock<Vec<Camera>> = OnceLock::new();
    let keys = [
        "",
        "optics.psf.sigma_px = 2.5; optics.focal_length_mm = 1.5; optics.aperture_mm = 1.0",
        "optics.psf.sigma_px = 0.5; optics.projection.model = \"brown-conrady\"; \
         optics.projection.k = [-20.0, 100.0]; optics.projection.p = [0.02, -0.01]",
        "optics.psf = { kind = \"moffat\", fwhm_px = 1.6, beta = 3.0 }; \
         optics.vignetting.cos4 = true; optics.focal_length_mm = 2.0; optics.aperture_mm = 1.0",
        "optics.psf = { kind = \"airy\", obscuration = 0.3 }; optics.aperture_mm = 0.8",
        "timing.shutter = \"rolling\"; timing.row_us = 400.0",
        "optics.projection.model = \"fisheye\"; optics.projection.k = [-0.01]; \
         optics.focal_length_mm = 0.8; optics.aperture_mm = 0.5; optics.psf.sigma_px = 1.2",
    ];
    CAMERAS.get_or_init(|| keys.map(|keys| square(128, keys)).into())
}

/// The parameters of one exposure: camera, attitude, rates (deg/s), positions (px) of lights and
/// their electrons.
pub type SceneCase = (usize, Attitude, [f64; 3], Vec<([f64; 2], f64)>);

pub fn scenes() -> impl Strategy<Value = SceneCase> {
    (0..cameras().len(), rotations(), rates(), lights())
}

/// Lights at these positions, each `factor` times as bright.
pub fn place_lights(
    camera: &Camera,
    attitude: &Attitude,
    positions: &[([f64; 2], f64)],
    factor: f64,
) -> Vec<Light> {
    let light = |(at, electrons): &([f64; 2], f64)| {
        Light::new(behind(camera, attitude, *at), electrons * factor)
    };
    positions.iter().map(light).collect()
}

/// The worst value of some cases.
#[derive(Default)]
pub struct Worst(Cell<f64>);

impl Worst {
    /// Stores the maximum and returns the argument.
    pub fn of(&self, found: f64) -> f64 {
        self.0.set(self.0.get().max(found));
        found
    }

    pub fn get(&self) -> f64 {
        self.0.get()
    }
}

impl std::fmt::Display for Worst {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.1e}", self.0.get())
    }
}

/// Turning camera and sky together: light to 1e-9 and positions to 1e-11, relative, signal-to-noise
/// ratios to 1e-9. Each pixel agrees to 1e-6 of its own light: the last digits of shares and sums
/// in f32, with its smallest normal number as the floor.
#[test]
fn turning_camera_and_sky_together_changes_nothing() {
    let [position, ratio, pixel] = [(); 3].map(|()| Worst::default());
    check(
        128,
        (scenes(), rotations()),
        |((which, attitude, rates, positions), turn)| {
            let camera = &cameras()[which];
            let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
            let lights = place_lights(camera, &attitude, &positions, 1.0);
            let original = light(&emulator, &vehicle(&attitude, rates), &lights);
            // The sky turned by R looks the same through q R^-1.
            let turned = lights.iter();
            let turned = turned.map(|one| Light::new(turn.rotate(&one.direction), one.electrons));
            let turned: Vec<Light> = turned.collect();
            let rotated = vehicle(&turn.inverse().then(&attitude), rates);
            let rotated = light(&emulator, &rotated, &turned);
            prop_assert_eq!(original.scene.sources.len(), rotated.scene.sources.len());
            for (a, b) in original.scene.sources.iter().zip(&rotated.scene.sources) {
                prop_assert!((a.electrons / b.electrons - 1.0).abs() < 1e-9);
                for (a, b) in [(a.start, b.start), (a.end, b.end), (a.centroid, b.centroid)] {
                    let miss = (a[0] - b[0]).hypot(a[1] - b[1]) / (1.0 + a[0].hypot(a[1]));
                    prop_assert!(position.of(miss) < 1e-11, "{:e}", miss);
                }
                let miss = (a.snr - b.snr).abs() / a.snr.max(f64::MIN_POSITIVE);
                prop_assert!(ratio.of(miss) <= 1e-9, "{} {}", a.snr, b.snr);
            }
            for (a, b) in original.expected_e.iter().zip(&rotated.expected_e) {
                let miss = (a - b).abs() / a.max(f64::from(f32::MIN_POSITIVE));
                prop_assert!(pixel.of(miss) <= 1e-6, "{:e} {:e}", a, b);
            }
            Ok(())
        },
    );
    println!("positions {position}, ratios {ratio}, pixels {pixel} of their own light");
}

/// The frame of an exposure is the sum of those of its two halves, for all effects of stars
/// (objects and area light: `whole_sky`). `reference`: within 0.02 e- a pixel and 2e-6 of it, the
/// f32 rounding of three frames. `realtime`: within three times the tolerances of a track, a wing
/// and a skipped effect (0.01, 0.02 and 0.05 e-) and three times its 2e-5 of the brightest.
#[test]
fn two_halves_add_up_to_an_exposure() {
    let exposures = -3.0..0.0_f64;
    for (fidelity, cases, most_e, part) in [
        (Fidelity::REFERENCE, 24, 0.02, 2e-6),
        (Fidelity::REALTIME, 40, 0.24, 6e-5),
    ] {
        let [worst, off] = [(); 2].map(|()| Worst::default());
        check(
            cases,
            (0..2_usize, rotations(), rates(), exposures.clone()),
            |(which, attitude, rates, power)| {
                let exposure_s = 10f64.powf(power);
                let psf = [
                    "",
                    "optics.psf = { kind = \"moffat\", fwhm_px = 1.6, beta = 3.0 }",
                ];
                let wide = format!("optics.focal_length_mm = 3.0; {}", psf[which]);
                let mut camera = square(128, &wide);
                let mut expected = |exposure_s: f64, off_s: f64| {
                    camera.exposure_s = exposure_s;
                    let mut emulator = starry(camera.clone(), fidelity);
                    let whole = vehicle(&attitude, rates);
                    let at = whole.epoch + skyloop::orbit::time::seconds(off_s);
                    pixels(emulator.expose(&whole.at(at), 0).unwrap())
                };
                let whole = expected(exposure_s, 0.0);
                let [first, second] =
                    [-0.25, 0.25].map(|part| expected(exposure_s / 2.0, part * exposure_s));
                let brightest = whole.iter().copied().fold(0.0, f64::max);
                for (whole, (a, b)) in whole.iter().zip(first.iter().zip(&second)) {
                    let miss = (whole - a - b).abs();
                    let bound = most_e + part * brightest;
                    off.of(miss);
                    prop_assert!(worst.of(miss / bound) <= 1.0, "{miss} e-, of {brightest}");
                }
                Ok(())
            },
        );
        println!("{off} e-, {worst} of what is allowed");
    }
}

/// All fluxes times a factor give the frame times that factor, when the tolerances in electrons
/// scale with them. Each pixel agrees to 1e-6 of its light, the f32 rounding of shares and sums,
/// for any optics and both fidelities.
#[test]
fn scaling_all_fluxes_scales_the_frame() {
    /// The factor of the reference frame; the tolerances of all other frames stay within their
    /// ranges.
    const BRIGHT: f64 = 100.0;
    let worst = Worst::default();
    check(
        64,
        (scenes(), -2.0..2.6_f64),
        |((which, attitude, rates, positions), power)| {
            let camera = &cameras()[which];
            let factor = 10f64.powf(power);
            for fidelity in [Fidelity::REFERENCE, Fidelity::REALTIME] {
                let by = |factor: f64| {
                    let factor = BRIGHT * factor;
                    let fidelity = Fidelity {
                        wing_e: fidelity.wing_e * factor,
                        loss_e: fidelity.loss_e * factor,
                        track_e: fidelity.track_e * factor,
                        ..fidelity
                    };
                    let mut emulator = emulator(camera.clone(), fidelity, |_| {});
                    emulator.choice.all = true;
                    let lights = place_lights(camera, &attitude, &positions, factor);
                    light(&emulator, &vehicle(&attitude, rates), &lights).expected_e
                };
                for (a, b) in by(1.0).iter().zip(&by(factor)) {
                    let miss = (b / factor - a).abs() / a.max(f64::from(f32::MIN_POSITIVE));
                    prop_assert!(worst.of(miss) <= 1e-6, "camera {which}: {a:e} {b:e}");
                }
            }
            Ok(())
        },
    );
    println!("pixels {worst} of their own light");
}

/// The same with constant tolerances: each source leaves out up to twice `wing_e`, `loss_e` and
/// `track_e`, in both frames. `reference` leaves out nothing of Gaussians.
#[test]
fn scaling_fluxes_alone_stays_within_the_tolerances() {
    let worst = Worst::default();
    check(
        40,
        (scenes(), -2.0..4.0_f64),
        |((which, attitude, rates, positions), power)| {
            let camera = &cameras()[which];
            let factor = 10f64.powf(power);
            for fidelity in [Fidelity::REFERENCE, Fidelity::REALTIME] {
                let mut emulator = emulator(camera.clone(), fidelity, |_| {});
                emulator.choice.all = true;
                let vehicle = vehicle(&attitude, rates);
                let [one, other]: [Lit; 2] = [1.0, factor].map(|factor| {
                    let lights = place_lights(camera, &attitude, &positions, factor);
                    light(&emulator, &vehicle, &lights)
                });
                let gaussian = ![3, 4].contains(&which);
                let leaves_e = match fidelity == Fidelity::REFERENCE && gaussian {
                    true => 0.0,
                    false => 2.0 * fidelity.wing_e + fidelity.loss_e + fidelity.track_e,
                };
                // In electrons of the fainter frame: the brighter one's errors count by the ratio.
                let min = factor.min(1.0);
                let most_e = leaves_e * positions.len() as f64 * (1.0 + factor.min(1.0 / factor));
                for (a, b) in one.expected_e.iter().zip(&other.expected_e) {
                    let miss = (a - b / factor).abs() * min;
                    let bound = most_e + 2e-5 * a * min;
                    worst.of(miss / bound.max(f64::MIN_POSITIVE));
                    prop_assert!(miss <= bound, "{} e- of {}", miss, a);
                }
            }
            Ok(())
        },
    );
    println!("{worst} of what is allowed");
}
