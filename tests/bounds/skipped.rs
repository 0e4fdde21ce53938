//! Effects that are skipped: of wide images, too large to be made once more, the bound alone is declared.

use std::sync::Arc;

use skyloop::attitude::VehicleState;
use skyloop::camera::{Camera, Model, Projection, Vignetting};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::load::Folder;
use skyloop::measure::Bench;
use skyloop::sky::catalog::Selection;

use super::entering::towards_sirius;
use super::{ORBIT, epoch, verdicts};

/// Images may be off by so much before anything is called for, px.
const SKIP_PX: f64 = 0.2;
/// No bound is this many times what is measured.
const NEAR: f64 = 3.0;

/// 40,000 px to the radian, and images 30 px wide.
fn camera(timing: &str) -> Camera {
    let folder = tempfile::tempdir().unwrap();
    let text = format!(
        r#"name = "wide images"
[optics]
focal_length_mm = 400.0
aperture_mm = 10.0
transmission = 1e-3
band = "silicon"
psf = {{ kind = "gaussian", sigma_px = 3.0 }}
[detector]
width_px = 96
height_px = 96
pixel_um = 10.0
quantum_efficiency = 0.5
read_noise_e = 5.0
full_well_e = 1e6
gain_e_per_dn = 20.0
adc_bits = 16
dark_e_s = 0.0
offset_dn = 0.0
[timing]
exposure_s = 100.0
rate_hz = 0.005
{timing}
"#
    );
    std::fs::write(folder.path().join("wide.toml"), text).unwrap();
    Camera::load("wide.toml", &Folder::Disk(folder.path().to_path_buf())).unwrap()
}

/// Leaves `name` out of a frame of Sirius, near the last rows, with so many px/s along them, seen from an orbit or not.
fn bound_is_near(name: &str, timing: &str, px_s: f64, in_orbit: bool) {
    let emulator = |skip_px: f64| {
        let mut config = Config::defaults().unwrap();
        config.camera = camera(timing);
        config.sky.selection = Selection::Bsc;
        config.fidelity.skip_px = skip_px;
        Emulator::new(&mut config)
    };
    // Measured where the shortest tracks are drawn.
    let [tolerant, exact] = [SKIP_PX, 0.0].map(emulator);
    let camera = exact.camera();
    let attitude = towards_sirius(&camera, [47.5, 75.0]);
    let rates = [0.0, px_s / camera.optics.focal_px, 0.0];
    let metres = |km: [f64; 3]| km.map(|x| x * 1e3);
    let orbit = in_orbit.then(|| (metres(ORBIT.0), metres(ORBIT.1)));
    let vehicle = VehicleState::new(7, epoch(), attitude, rates, orbit).unwrap();
    let bench = |emulator| Bench {
        emulator,
        camera: Arc::clone(&camera),
        vehicle: vehicle.clone(),
    };
    let quiet = Choice {
        noise: false,
        ..Choice::default()
    };
    let mut verdicts = verdicts(&bench(&tolerant), &quiet).into_iter();
    let (effect, verdict) = verdicts.find(|(of, _)| of.name == name).unwrap();
    assert!(!verdict.run, "{name} runs: {}", verdict.why);
    let all = Choice { all: true, ..quiet };
    let measured = bench(&exact).error_e(effect, &all).unwrap();
    let declared = verdict.error_e.unwrap();
    println!("{name}: declared {declared} e-, measured {measured}");
    // Of Sirius a pixel gets some 9,000 e-, which f32 round by a thousandth.
    assert!(measured > 0.3, "{name}: {measured} e-");
    assert!(
        (measured..NEAR * measured).contains(&declared),
        "{name}: declared {declared} e-, measured {measured}"
    );
}

/// 8 m/s each second (`ORBIT`) make 0.08 px in the 75 s from mid-exposure to the ends; rows are exposed up to 25 s early and late.
#[test]
fn the_bound_of_drift_that_rows_see_at_other_times_is_near() {
    let rolling = "shutter = \"rolling\"\nrow_us = 526_000.0";
    bound_is_near("aberration drift", rolling, 0.0, true);
}

/// Rows together: only the spread along the way is left, and its bend.
#[test]
fn the_bound_of_drift_during_an_exposure_is_near() {
    bound_is_near("aberration drift", "", 0.0, true);
}

/// Streaks of 2 px; the last row is exposed 2.5 s late, for which they move by 0.05 px.
#[test]
fn the_bound_of_rows_exposed_in_turn_is_near() {
    let rolling = "shutter = \"rolling\"\nrow_us = 52_600.0";
    bound_is_near("rolling shutter", rolling, 0.02, false);
}

/// Leaves `name` out of a frame in which no star shines, of a fisheye with this `k1` and vignetting; pixels get 5 e-. All that it changes is tolerated.
fn bound_of_area_light_is_near(name: &str, vignetting: &Vignetting, k1: f64) {
    let camera = || {
        let mut camera = camera("");
        let optics = &mut camera.optics;
        optics.transmission = 1.0;
        optics.vignetting = vignetting.clone();
        optics.projection = Projection::new(Model::Fisheye {
            k: [k1, 0.0, 0.0, 0.0],
        });
        camera
    };
    let emulator = |skip_e: f64, skip_px: f64| {
        let mut config = Config::defaults().unwrap();
        config.camera = camera();
        config.sky.selection = Selection::Bsc;
        config.fidelity.skip_e = skip_e;
        config.fidelity.skip_px = skip_px;
        Emulator::new(&mut config)
    };
    let (tolerant, exact) = (emulator(5.0, 0.5), emulator(0.0, 0.0));
    let camera = exact.camera();
    let attitude = towards_sirius(&camera, [47.5, 47.5]);
    let vehicle = VehicleState::new(7, epoch(), attitude, [0.0; 3], None).unwrap();
    let bench = |emulator| Bench {
        emulator,
        camera: Arc::clone(&camera),
        vehicle: vehicle.clone(),
    };
    let choice = Choice {
        noise: false,
        off: vec!["stars", "planets", "moon"],
        all: false,
    };
    let mut verdicts = verdicts(&bench(&tolerant), &choice).into_iter();
    let (effect, verdict) = verdicts.find(|(of, _)| of.name == name).unwrap();
    assert!(!verdict.run, "{name} runs: {}", verdict.why);
    let measured = bench(&exact).error_e(effect, &choice).unwrap();
    let declared = verdict.error_e.unwrap();
    println!("{name}: declared {declared} e-, measured {measured}");
    assert!(measured > 0.1, "{name}: {measured} e-");
    assert!(
        (measured..NEAR * measured).contains(&declared),
        "{name}: declared {declared} e-, measured {measured}"
    );
}

/// Images are 2 % further out at the sides, 1.2e-3 rad from the axis: pixels take 8 % less of the sky there and 15 % less in the
/// corners, `1 / ((1 + k a^2) (1 + 3 k a^2))`, but for `cos^4`, which stands for it and is 1 to 3e-6.
#[test]
fn the_bound_of_vignetting_has_the_solid_angle_that_it_stands_for() {
    bound_of_area_light_is_near("vignetting", &Vignetting::Cos4, 14_000.0);
}

/// Images are 0.4 px further out in the corners: pixels take 2.5 % less of the sky there.
#[test]
fn the_bound_of_distortion_has_the_solid_angle_of_pixels() {
    bound_of_area_light_is_near("distortion", &Vignetting::None, 2_200.0);
}
