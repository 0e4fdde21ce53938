//! Skipped effects: images too wide to be rendered twice declare the bound alone.

use std::sync::Arc;

use skyloop::attitude::VehicleState;
use skyloop::camera::{Camera, Model, Projection, Vignetting};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::measure::Bench;
use skyloop::sky::catalog::Selection;

use super::entering::towards_sirius;
use super::{ORBIT, epoch, verdicts};
use crate::plain_camera;

/// Image displacement below which an effect is skipped, px.
const SKIP_PX: f64 = 0.2;
/// No bound exceeds this many times the measured error.
const NEAR: f64 = 3.0;

/// 40,000 px per radian, and images 30 px wide; with these keys.
fn camera(keys: &str) -> Camera {
    plain_camera::camera(&format!(
        "optics.focal_length_mm = 400.0; optics.transmission = 1e-3; optics.band = \"silicon\"; \
         optics.psf.sigma_px = 3.0; detector.width_px = 96; detector.height_px = 96; \
         detector.read_noise_e = 5.0; detector.full_well_e = 1e6; \
         detector.gain_e_per_dn = 20.0; detector.offset_dn = 0.0; timing.exposure_s = 100.0; \
         timing.rate_hz = 0.005; {keys}"
    ))
}

/// A skipped effect and the tolerances: `[skip_e, skip_px]`.
struct Case {
    effect: &'static str,
    camera: Camera,
    tolerance: [Option<f64>; 2],
    /// Position of Sirius, px.
    sirius_px: [f64; 2],
    /// Turning about +Y, rad/s.
    rate: f64,
    in_orbit: bool,
    choice: Choice,
    /// Minimum measured error, e-.
    least_e: f64,
}

/// The effect is skipped. Its bound exceeds the error measured without any tolerance (where the
/// shortest tracks are drawn), but not by much.
fn bound_is_near(case: &Case) {
    let emulator = |[skip_e, skip_px]: [Option<f64>; 2]| {
        let mut config = Config::defaults().unwrap();
        config.camera = case.camera.clone();
        config.sky.selection = Selection::Bsc;
        config.fidelity.skip_e = skip_e.unwrap_or(config.fidelity.skip_e);
        config.fidelity.skip_px = skip_px.unwrap_or(config.fidelity.skip_px);
        Emulator::new(&mut config)
    };
    let exact = case.tolerance.map(|tolerance| tolerance.map(|_| 0.0));
    let [tolerant, exact] = [case.tolerance, exact].map(emulator);
    let camera = exact.camera();
    let attitude = towards_sirius(&camera, case.sirius_px);
    let metres = |km: [f64; 3]| km.map(|x| x * 1e3);
    let orbit = case.in_orbit.then(|| (metres(ORBIT.0), metres(ORBIT.1)));
    let rates = [0.0, case.rate, 0.0];
    let vehicle = VehicleState::new(7, epoch(), attitude, rates, orbit).unwrap();
    let bench = |emulator| Bench {
        emulator,
        camera: Arc::clone(&camera),
        vehicle: vehicle.clone(),
    };
    let name = case.effect;
    let mut verdicts = verdicts(&bench(&tolerant), &case.choice).into_iter();
    let (effect, verdict) = verdicts.find(|(of, _)| of.name == name).unwrap();
    assert!(!verdict.run, "{name} runs: {}", verdict.why);
    let all = Choice {
        all: true,
        ..case.choice.clone()
    };
    let measured = bench(&exact).error_e(effect, &all).unwrap();
    let declared = verdict.error_e.unwrap();
    let what = format!("{name}: declared {declared} e-, measured {measured}");
    println!("{what}");
    assert!(measured > case.least_e, "{what}");
    assert!((measured..NEAR * measured).contains(&declared), "{what}");
}

/// A frame of Sirius, near the last rows. A pixel gets some 9,000 e-, which f32 rounds by a
/// thousandth.
fn of_a_star(effect: &'static str, timing: &str, px_s: f64, in_orbit: bool) -> Case {
    let camera = camera(timing);
    Case {
        effect,
        tolerance: [None, Some(SKIP_PX)],
        sirius_px: [47.5, 75.0],
        rate: px_s / camera.optics.focal_px,
        camera,
        in_orbit,
        choice: Choice {
            noise: false,
            ..Choice::default()
        },
        least_e: 0.3,
    }
}

#[test]
fn bounds_of_moving_images_are_near() {
    // 8 m/s each second (`ORBIT`) make 0.08 px in the 75 s from mid-exposure to the ends; rows are
    // exposed up to 25 s early and late.
    let rolling = "timing.shutter = \"rolling\"; timing.row_us = 526_000.0";
    bound_is_near(&of_a_star("aberration drift", rolling, 0.0, true));
    // Global shutter: only the spread along the path and the path's curvature remain.
    bound_is_near(&of_a_star("aberration drift", "", 0.0, true));
    // Streaks of 2 px; the last row is exposed 2.5 s late, in which they move by 0.05 px.
    let rolling = "timing.shutter = \"rolling\"; timing.row_us = 52_600.0";
    bound_is_near(&of_a_star("rolling shutter", rolling, 0.02, false));
}

/// Frames without stars, through a fisheye with this `k1`; pixels get 5 e-.
#[test]
fn the_bounds_of_area_light_have_the_solid_angle_of_pixels() {
    for (effect, vignetting, k1) in [
        // Images are 2 % further out at the sides, 1.2e-3 rad from the axis. Pixels cover 8 % less
        // of the sky there and 15 % less in the corners, `1 / ((1 + k a^2) (1 + 3 k a^2))`. `cos^4`
        // is skipped in its place and is 1 to 3e-6.
        ("vignetting", Vignetting::Cos4, 14_000.0),
        // Images are 0.4 px further out in the corners: pixels cover 2.5 % less of the sky there.
        ("distortion", Vignetting::None, 2_200.0),
    ] {
        let mut camera = camera("optics.transmission = 1.0");
        camera.optics.vignetting = vignetting;
        let k = [k1, 0.0, 0.0, 0.0];
        camera.optics.projection = Projection::new(Model::Fisheye { k });
        bound_is_near(&Case {
            effect,
            camera,
            tolerance: [Some(5.0), Some(0.5)],
            sirius_px: [47.5, 47.5],
            rate: 0.0,
            in_orbit: false,
            choice: Choice {
                noise: false,
                off: vec!["stars", "planets", "moon"],
                all: false,
            },
            least_e: 0.1,
        });
    }
}
