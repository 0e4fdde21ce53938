//! The detector against theory: photon transfer, dark current by temperature, the fixed pattern,
//! blooming and particles. Artifact labels and their signal-to-noise ratios.

mod snr;

use crate::fixtures::dark;
use std::str::FromStr;

use hifitime::Epoch;
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::label::{ArtifactLabel, MAX_ARTIFACT_PIXELS, MAX_ARTIFACTS};
use skyloop::load::Folder;

/// A camera of 256 x 200 pixels; `lit`: whether light passes its optics.
fn text(lit: bool, detector: &str, tables: &str) -> String {
    format!(
        r#"name = "probe"
serial = 11
[optics]
focal_length_mm = 13.8
aperture_mm = 17.0
transmission = {:?}
band = [650.0, 1100.0]
[optics.psf]
kind = "gaussian"
sigma_px = 0.8
[detector]
width_px = 256
height_px = 200
pixel_um = 26.0
quantum_efficiency = 0.66
adc_bits = 16
{detector}
[timing]
exposure_s = 1.0
rate_hz = 1.0
{tables}
"#,
        if lit { 0.9 } else { 0.0 }
    )
}

fn camera(text: &str) -> Camera {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("probe.toml"), text).unwrap();
    Camera::load("probe.toml", &Folder::Disk(folder.path().to_path_buf())).unwrap()
}

/// The sky is dark, so that the background is the configured one.
fn emulator(text: &str) -> Emulator {
    let mut config = dark(Config::defaults().unwrap());
    config.camera = camera(text);
    config.seed = 5;
    Emulator::new(&mut config)
}

fn expose(emulator: &mut Emulator, sequence: u32) -> ExposedFrame {
    let epoch = Epoch::from_str("2020-02-03T04:05:06 UTC").unwrap();
    // Towards Orion.
    let q = [0.649_519, 0.236_403, 0.247_087, 0.679_01];
    let norm = q.iter().map(|c: &f64| c * c).sum::<f64>().sqrt();
    let vehicle = VehicleState::new(sequence, epoch, q.map(|c| c / norm), [0.0; 3], None).unwrap();
    emulator.expose(&vehicle, 0).unwrap()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    sum / n
}

const PLAIN: &str = "dark_e_s = 4000.0
read_noise_e = 9.0
full_well_e = 150000.0
gain_e_per_dn = 2.5
offset_dn = 200.0";

/// Variance against mean: the slope is 1 / gain. The variance is half that of the difference of two
/// frames, which removes the fixed pattern. The variance at zero charge is read noise plus
/// quantisation. Janesick 2007, Photon Transfer, ch. 5.
#[test]
fn photon_transfer_recovers_gain_and_read_noise() {
    let pattern = "prnu = 0.02\ndark_nonuniformity = 0.3\nhot_fraction = 0.001\nhot_e_s = 2000.0";
    let mut emulator = emulator(&text(false, &format!("{PLAIN}\n{pattern}"), ""));
    let mut level = |exposure_s: f64, sequence: u32| {
        emulator.camera_mut().exposure_s = exposure_s;
        let (mut means, mut variances) = (0.0, 0.0);
        for pair in 0..4 {
            let [a, b] = [0, 1].map(|i| expose(&mut emulator, sequence + 2 * pair + i).frame.dn);
            let pairs = a.iter().zip(&b);
            let both = || pairs.clone().map(|(a, b)| (f64::from(*a), f64::from(*b)));
            means += mean(both().map(|(a, b)| (a + b) / 2.0)) / 4.0;
            variances += mean(both().map(|(a, b)| (a - b) * (a - b) / 2.0)) / 4.0;
        }
        (means - 200.0, variances)
    };
    let (_, floor) = level(1e-9, 0);
    let read = 2.5 * (floor - 1.0 / 12.0).sqrt();
    assert!((read / 9.0 - 1.0).abs() < 0.02, "read noise {read}");
    let exposures = [0.2, 0.5, 1.0, 2.0, 4.0, 7.0].into_iter().zip(1..);
    let points = exposures.map(|(exposure_s, i)| level(exposure_s, 100 * i));
    let points: Vec<(f64, f64)> = points.collect();
    for (m, v) in &points {
        let gain = m / (v - floor);
        assert!((gain / 2.5 - 1.0).abs() < 0.01, "at {m} DN: {gain}");
    }
    // Linear: one straight line fits all points.
    let products = points.iter().map(|(m, v)| m * (v - floor));
    let squares = points.iter().map(|(m, _)| m * m);
    let gain = squares.sum::<f64>() / products.sum::<f64>();
    println!("gain {gain} (2.5), read noise {read} (9)");
    assert!((gain / 2.5 - 1.0).abs() < 0.005, "{gain}");
}

#[test]
fn dark_current_doubles_as_configured_and_keeps_its_pattern() {
    let exposed = |celsius: f64| {
        let keys = format!(
            "{PLAIN}\ndark_reference_c = 20.0\ntemperature_c = {celsius:?}\ndark_doubling_k = 6.0\n\
             dark_nonuniformity = 0.4\nhot_fraction = 0.01\nhot_e_s = 500.0"
        );
        let mut emulator = emulator(&text(false, &keys, ""));
        emulator.keep_expected = true;
        expose(&mut emulator, 1)
    };
    let (warm, cold) = (exposed(20.0), exposed(8.0));
    let all = |exposed: &ExposedFrame| exposed.frame.expected_e.clone().unwrap();
    for (warm, cold) in all(&warm).iter().zip(all(&cold)) {
        assert!((warm / cold / 4.0 - 1.0).abs() < 1e-6, "{warm} {cold}");
    }
    // 4000 e-/s and 1 % of 500, in DN, within the scatter of the pattern and of the frame.
    let dn = mean(warm.frame.dn.iter().map(|dn| f64::from(*dn))) - 200.0;
    let error = 4000.0 * 0.4 / 51_200f64.sqrt();
    assert!((2.5 * dn - 4005.0).abs() < 5.0 * error, "{dn}");
    let background_e = warm.label.background_e_px;
    assert!((background_e - mean(all(&warm).iter().map(|e| f64::from(*e)))).abs() < 0.01);
    assert!((background_e / cold.label.background_e_px - 4.0).abs() < 1e-6);
    // Without the keys: the dark current of the file.
    let mut plain = emulator(&text(false, PLAIN, ""));
    assert_eq!(expose(&mut plain, 1).label.background_e_px, 4000.0);
}

#[test]
fn dead_and_stuck_pixels_have_their_dn() {
    let keys = format!(
        "{PLAIN}\ndead_px = [[3, 4], [255, 199]]\nstuck_px = [[0, 0], [3, 5]]\n\
         stuck_dn = 12345.0\ndead_fraction = 0.01"
    );
    let mut emulator = emulator(&text(false, &keys, ""));
    let exposed = expose(&mut emulator, 3);
    let at = |x: usize, y: usize| exposed.frame.dn[y * 256 + x];
    assert_eq!((at(0, 0), at(3, 5)), (12345, 12345));
    // Offset 200 and read noise of 3.6 DN, against 1800 of their neighbours.
    for (x, y) in [(3, 4), (255, 199)] {
        assert!((180..220).contains(&at(x, y)), "{}", at(x, y));
    }
    let pattern = &exposed.camera.detector.pattern;
    let dark = (0..51_200).filter(|i| exposed.frame.dn[*i as usize] < 1000);
    let dead = pattern.dead();
    assert_eq!(dark.collect::<Vec<u32>>(), dead);
    assert!((400..640).contains(&dead.len()), "{}", dead.len());
    // Every one of them is in the label, and no other.
    let artifacts = &exposed.label.objects.artifacts;
    let named = |name: &str| artifacts.iter().filter(|s| s.id.starts_with(name)).count();
    assert_eq!((named("dead"), named("stuck")), (dead.len(), 2));
    let stuck = artifacts.iter().find(|s| s.id == "stuck 3,5").unwrap();
    // (12345 - 200) 2.5 = 30362.5, to the even or away from zero.
    assert_eq!(stuck.pixels, [[3, 5, 30363]]);
    assert!(stuck.kind == "defect" && stuck.visible && (stuck.x_px, stuck.y_px) == (3.0, 5.0));
}

/// The label lists the artifacts with the highest ratios and counts the rest.
#[test]
fn a_truncated_artifact_list_counts_the_rest() {
    // Of 51,200 pixels some 4,608 are dead and as many are stuck.
    let keys = format!("{PLAIN}\ndead_fraction = 0.09\nstuck_fraction = 0.09");
    let whole = expose(&mut emulator(&text(false, &keys, "")), 3);
    assert!(whole.label.objects.artifacts.len() <= MAX_ARTIFACTS);
    assert!(!whole.json.contains("left_out"));
    let keys = format!("{keys}\nhot_fraction = 0.1\nhot_e_s = 500.0");
    let exposed = expose(&mut emulator(&text(false, &keys, "")), 3);
    let (pattern, label) = (&exposed.camera.detector.pattern, &exposed.label);
    // Dead and stuck pixels hide that they are hot.
    let blind = |pixel: &u32| pattern.dead().contains(pixel) || pattern.stuck().contains(pixel);
    let hot = pattern.hot().iter().filter(|(pixel, _)| !blind(pixel));
    let all = pattern.dead().len() + pattern.stuck().len() + hot.count();
    assert!(all > MAX_ARTIFACTS + 1000, "{all}");
    assert_eq!(label.objects.artifacts.len(), MAX_ARTIFACTS);
    assert_eq!(label.spots_left_out, Some(all - MAX_ARTIFACTS));
    // Only weak hot pixels are left out. All dead and stuck pixels, with their large errors, are
    // listed.
    let artifacts = &label.objects.artifacts;
    let named = |name: &str| artifacts.iter().filter(|s| s.id.starts_with(name)).count();
    let due = (pattern.dead().len(), pattern.stuck().len());
    assert_eq!((named("dead"), named("stuck")), due);
    let min = artifacts.iter().map(|artifact| artifact.snr);
    let min = min.fold(f64::INFINITY, f64::min);
    let beyond = label.spots_left_out_snr.unwrap();
    let is_next = 0.0 < beyond && beyond <= min && min - beyond < 0.1;
    assert!(is_next, "{beyond} {min}");
    let left_out = all - MAX_ARTIFACTS;
    let written = format!("\"spots_left_out\":{left_out},\"spots_left_out_snr\":");
    assert!(exposed.json.contains(&written));
}

/// The total number of listed pixels is limited for particles of many pixels.
#[test]
fn a_list_of_wide_particles_is_cut_by_their_pixels() {
    // Some 1,700 particles, each of some 200 pixels: charge diffuses by 3 px.
    let table = "[radiation]\nflux_cm2_s = 5000.0\nthickness_um = 50.0\ndiffusion_um = 80.0";
    let mut emulator = emulator(&text(false, PLAIN, table));
    emulator.camera_mut().exposure_s = 1.0;
    let label = expose(&mut emulator, 1).label;
    let artifacts = &label.objects.artifacts;
    let sum = artifacts
        .iter()
        .map(|artifact| artifact.pixels.len())
        .sum::<usize>();
    assert!(
        artifacts.len() < MAX_ARTIFACTS && sum <= MAX_ARTIFACT_PIXELS,
        "{sum}"
    );
    assert!(sum > MAX_ARTIFACT_PIXELS * 9 / 10, "{sum}");
    assert!(label.spots_left_out.unwrap() > 100);
    let min = artifacts.iter().map(|artifact| artifact.snr);
    let min = min.fold(f64::INFINITY, f64::min);
    assert!(label.spots_left_out_snr.unwrap() <= min);
}

/// Above the limit of drawn particles the label counts the rest.
#[test]
fn particles_beyond_the_limit_are_counted() {
    let table = "[radiation]\nflux_cm2_s = 1e5\nthickness_um = 1.0";
    let mut emulator = emulator(&text(false, PLAIN, table));
    assert_eq!(expose(&mut emulator, 1).label.particles_left_out, None);
    emulator.camera_mut().exposure_s = 10.0;
    let exposed = expose(&mut emulator, 2);
    // 51,200 pixels of 26 um, 10 s: 1e5 * 0.346112 * 10, of which 1e5 are drawn.
    let left_out = exposed.label.particles_left_out.unwrap();
    assert!((left_out - 246_112.0).abs() < 1.0, "{left_out}");
    // The label lists a tenth of those; some left no whole electron.
    assert_eq!(exposed.label.objects.artifacts.len(), MAX_ARTIFACTS);
    let drawn = exposed.label.spots_left_out.unwrap() + MAX_ARTIFACTS;
    assert!((90_000..101_000).contains(&drawn), "{drawn}");
}

/// Blooming conserves the charge of the noise-free frame.
#[test]
fn blooming_conserves_charge() {
    let charge = |blooming: &str| {
        let keys = format!(
            "dark_e_s = 10.0\nread_noise_e = 0.0\nfull_well_e = 8000.0\ngain_e_per_dn = 1.0\n\
             offset_dn = 0.0\nblooming = {blooming:?}"
        );
        let mut emulator = emulator(&text(true, &keys, ""));
        emulator.keep_expected = true;
        emulator.choice.noise = false;
        emulator.camera_mut().exposure_s = 0.05;
        let frame = expose(&mut emulator, 3).frame;
        (frame.expected_e.unwrap(), frame.charge_e.unwrap())
    };
    let (expected, spilled) = charge("column");
    let (_, clipped) = charge("none");
    let sum = |e: &[f32]| e.iter().map(|e| f64::from(*e)).sum::<f64>();
    assert!(sum(&clipped) < 0.97 * sum(&expected), "no blooming");
    let off = sum(&spilled) - sum(&expected);
    assert!(off.abs() < 1.0, "{off}");
    assert!(spilled.iter().all(|e| *e < 8001.5) && clipped.iter().all(|e| *e <= 8000.0));
    // Charge moves along its column only.
    for x in 0..256 {
        let [spilled, expected] = [&spilled, &expected].map(|e| {
            let column = e[x..].iter().step_by(256);
            column.map(|e| f64::from(*e)).sum::<f64>()
        });
        assert!((spilled - expected).abs() < 0.5, "{x}");
    }
}

fn particles(exposed: &ExposedFrame) -> impl Iterator<Item = &ArtifactLabel> {
    let artifacts = exposed.label.objects.artifacts.iter();
    artifacts.filter(|artifact| artifact.kind == "radiation")
}

#[test]
fn particles_are_in_their_labelled_pixels() {
    let table = "[radiation]\nflux_cm2_s = 30.0\nthickness_um = 20.0\ndiffusion_um = 8.0";
    let [mut exposed, mut sheltered] = [table, ""].map(|table| {
        let mut emulator = emulator(&text(false, PLAIN, table));
        emulator.keep_expected = true;
        emulator
    });
    let mut numbers = Vec::new();
    for sequence in 0..40 {
        let with = expose(&mut exposed, sequence);
        let without = expose(&mut sheltered, sequence);
        let charge = |exposed: &ExposedFrame| exposed.frame.charge_e.clone().unwrap().into_iter();
        // All other noise is the same, so the difference is the particles' charge alone.
        let both = charge(&with).zip(charge(&without));
        let left = both.map(|(with, without)| f64::from(with) - f64::from(without));
        let mut left: Vec<f64> = left.collect();
        for artifact in particles(&with) {
            let mut sum = 0.0;
            for [x, y, e] in &artifact.pixels {
                left[(*y * 256 + *x) as usize] -= *e as f64;
                sum += *e as f64;
            }
            assert_eq!(artifact.electrons, sum);
            assert!(artifact.in_frame && (artifact.snr >= 3.0) == artifact.visible);
        }
        assert!(left.iter().all(|e| e.abs() < 0.01));
        numbers.push(particles(&with).count() as f64);
        assert_eq!(particles(&without).count(), 0);
    }
    // 256 x 200 pixels of 26 um: 0.346 cm^2, 10.4 a second.
    let all: f64 = numbers.iter().sum();
    let expected = 40.0 * 30.0 * 0.6656 * 0.52;
    let is_due = (all - expected).abs() < 4.0 * expected.sqrt();
    assert!(is_due, "{all} of {expected}");
    let differ = numbers.iter().any(|n| *n != numbers[0]);
    assert!(differ, "the same in every frame");
    // The same frame again is identical; without noise there are no particles.
    assert_eq!(expose(&mut exposed, 7).frame, expose(&mut exposed, 7).frame);
    exposed.choice.noise = false;
    let calm = expose(&mut exposed, 7);
    assert_eq!(particles(&calm).count(), 0);
}
