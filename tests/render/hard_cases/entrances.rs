//! NaN, infinities and the largest numbers at public entry points: an error or a documented value,
//! no panic, and no frame with non-finite numbers.

use super::functions::corrupted;
use super::stage::{
    LOW_KM, LOW_KM_S, Light, behind, camera, check_numbers, emulator, falling, in_low_orbit, light,
    noon, oem, towards, vehicle,
};
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::{Camera, Model, Projection};
use skyloop::config::Config;
use skyloop::fidelity::{Fidelity, TOLERANCES};
use skyloop::flight::Flight;
use skyloop::load::Folder;
use skyloop::orbit::{StateVector, two_body::propagate_j2};
use skyloop::passes::{Search, passes};
use skyloop::sky::shadow::Earth;
use skyloop_firmware_sim::profile::Profile;
use std::path::Path;
use std::sync::Arc;

const NON_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

/// All paths of numbers in a TOML table.
fn numbers(value: &toml::Value, path: &mut Vec<String>, found: &mut Vec<Vec<String>>) {
    let mut enter = |key: String, value: &toml::Value| {
        path.push(key);
        numbers(value, path, found);
        path.pop();
    };
    match value {
        toml::Value::Table(table) => table
            .iter()
            .for_each(|(key, value)| enter(key.clone(), value)),
        toml::Value::Array(all) => all
            .iter()
            .enumerate()
            .for_each(|(i, value)| enter(i.to_string(), value)),
        toml::Value::Float(_) | toml::Value::Integer(_) => found.push(path.clone()),
        _ => {}
    }
}

fn at<'a>(value: &'a mut toml::Value, path: &[String]) -> &'a mut toml::Value {
    path.iter().fold(value, |value, key| match value {
        toml::Value::Array(all) => &mut all[key.parse::<usize>().unwrap()],
        table => &mut table[key.as_str()],
    })
}

/// A file's text with each of its numbers in turn replaced by each of [`NON_FINITE`]: key and text.
fn corrupted_files(text: &str) -> Vec<(String, String)> {
    let whole = toml::Value::Table(text.parse().unwrap());
    let mut paths = Vec::new();
    numbers(&whole, &mut Vec::new(), &mut paths);
    let corrupt = |path: &Vec<String>| {
        NON_FINITE.map(|bad| {
            let mut copy = whole.clone();
            *at(&mut copy, path) = toml::Value::Float(bad);
            (path.join("."), toml::to_string(&copy).unwrap())
        })
    };
    paths.iter().flat_map(corrupt).collect()
}

/// The last name of a path of names and list indices.
fn last_name(path: &str) -> &str {
    let mut parts = path.rsplit('.');
    parts
        .find(|part| part.parse::<usize>().is_err())
        .unwrap_or(path)
}

fn shipped(path: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

/// Every numeric key of a set of cameras that together have all shipped keys. Reference: an error
/// that names the key.
#[test]
fn camera_keys_refuse_non_finite_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let disk = Folder::Disk(folder.path().to_path_buf());
    let rest = "[mounting]\nq_body_to_camera = [0.0, 0.0, 0.0, 1.0]\nmisalignment_arcsec = [1.0, 2.0, 3.0]\n";
    let mut keys = 0;
    for name in ["fai-nir", "cmos-rolling", "all-sky"] {
        let text = shipped(&format!("configs/cameras/{name}.toml"));
        let mut table: toml::Table = text.parse().unwrap();
        if name == "fai-nir" {
            table.extend(rest.parse::<toml::Table>().unwrap());
        }
        // A smaller detector has the same keys.
        let detector = table["detector"].as_table_mut().unwrap();
        for side in ["width_px", "height_px"] {
            detector.insert(side.to_string(), toml::Value::Integer(32));
        }
        for list in ["dead_px", "stuck_px"] {
            detector.remove(list);
        }
        let optics = table["optics"].as_table_mut().unwrap();
        optics.remove("principal_px");
        for (key, text) in corrupted_files(&table.to_string()) {
            std::fs::write(folder.path().join("camera.toml"), text).unwrap();
            let refused = Camera::load("camera.toml", &disk).err();
            let error = refused.unwrap_or_else(|| panic!("{name}: {key} accepts it"));
            let error = error.to_string();
            assert!(error.contains(last_name(&key)), "{name}: {key}: {error}");
            keys += 1;
        }
    }
    assert!(keys > 200, "{keys}");
}

/// The shipped scene with all keys, including commented ones, except those that name the user's
/// files.
fn scene_of_all_keys() -> String {
    const FILES: [&str; 2] = ["population", "orbit"];
    let bare = |line: &str| -> Option<String> {
        let text = line.strip_prefix("# ")?;
        let (key, value) = text.split_once('=').unwrap_or((text, ""));
        let is_key = !value.is_empty() && !key.trim().contains(' ');
        let names_file = FILES.contains(&key.trim());
        (text.starts_with('[') || is_key && !names_file).then(|| text.to_string())
    };
    let text = shipped("configs/default.toml");
    let lines = text
        .lines()
        .map(|line| bare(line).unwrap_or_else(|| line.to_string()));
    lines.collect::<Vec<_>>().join("\n")
}

/// Every numeric key of a scene and of its run. Reference: an error that names the key.
#[test]
fn scene_keys_refuse_non_finite_numbers() {
    let text = scene_of_all_keys();
    if let Err(error) = Config::parse("scene", &text, &Folder::current()) {
        panic!("{error}");
    }
    let mut keys = Vec::new();
    for (key, text) in corrupted_files(&text) {
        let refused = Config::parse("scene", &text, &Folder::current()).err();
        let error = refused
            .unwrap_or_else(|| panic!("{key} accepts it"))
            .to_string();
        assert!(error.contains(last_name(&key)), "{key}: {error}");
        keys.push(key);
    }
    // Keys of the tolerances, of objects, of a sequence and of a run, and the seed.
    let tolerances = TOLERANCES
        .iter()
        .filter(|tolerance| tolerance.name != "orbits");
    let tolerances = tolerances.map(|tolerance| format!("fidelity.{}", tolerance.name));
    let others = [
        "seed",
        "label_snr",
        "objects.diameter_m",
        "sequence.attitudes.0.q.3",
        "sequence.rates_deg_s.2",
        "run.idle_s",
    ];
    for key in tolerances.chain(others.map(String::from)) {
        assert!(keys.contains(&key), "{key} was not tried");
    }
}

/// Every component of a vehicle state.
#[test]
fn state_components_refuse_non_finite_numbers() {
    let good = [
        0.0, 0.0, 0.0, 1.0, 0.1, 0.2, 0.3, 7e6, 0.0, 0.0, 0.0, 7.5e3, 0.0,
    ];
    let state = |c: [f64; 13]| {
        let [q0, q1, q2, q3, w0, w1, w2, r0, r1, r2, v0, v1, v2] = c;
        let orbit = Some(([r0, r1, r2], [v0, v1, v2]));
        VehicleState::new(0, noon(), [q0, q1, q2, q3], [w0, w1, w2], orbit)
    };
    assert!(state(good).is_ok());
    for i in 0..13 {
        for bad in NON_FINITE.into_iter().chain([1e300, -1e160, f64::MAX]) {
            let mut c = good;
            c[i] = bad;
            let error = state(c).unwrap_err().to_string();
            assert!(error.len() < 300, "{error}");
        }
    }
    // Denormal numbers and negative zero are valid.
    for tiny in [5e-324, -0.0, f64::MIN_POSITIVE] {
        let mut c = good;
        (c[0], c[4], c[8]) = (tiny, tiny, tiny);
        let carried = state(c).unwrap().at(noon() + Unit::Day * 3650);
        assert!(carried.attitude.xyzw().iter().all(|c| c.is_finite()));
    }
}

/// Non-finite directions and positions have no image and no direction, for any lens.
#[test]
fn lenses_refuse_non_finite_directions() {
    let fisheye = Projection::new(Model::Fisheye {
        k: [-0.02, 3e-3, 0.0, 0.0],
    });
    let brown = Projection::new(Model::BrownConrady {
        k: [-0.2, 0.05, 0.0],
        p: [1e-3, 0.0],
    });
    for lens in [Projection::PINHOLE, brown, fisheye] {
        for bad in NON_FINITE {
            for direction in corrupted(Vector3::new(0.1, 0.2, 1.0), bad) {
                let image = lens.image(&direction);
                let finite = image.is_none_or(|at| at.iter().all(|x| x.is_finite()));
                assert!(finite, "{lens:?} {direction:?}: {image:?}");
            }
            for at in [[bad, 0.0], [0.1, bad], [bad, bad]] {
                let seen = lens.direction(at);
                assert!(seen.is_none(), "{lens:?} {at:?}: {seen:?}");
            }
        }
        // The largest numbers are a valid direction, or none.
        for scale in [1e-320, 1e-160, 1e160, 1e300] {
            let image = lens.image(&(Vector3::new(0.1, 0.2, 1.0) * scale));
            let is_near = image.is_none_or(|at| (at[0] - 0.1).abs() < 0.1 && at[1].is_finite());
            assert!(is_near, "{scale:e} {image:?}");
        }
    }
    let direction = camera("").optics.direction([f64::NAN, 1.0]);
    assert!(direction.iter().all(|x| x.is_finite()));
}

/// A light with non-finite direction or electrons adds nothing and does not affect its neighbours.
/// Reference: the frame without it.
#[test]
fn non_finite_lights_add_nothing() {
    let camera = camera("");
    let attitude = Attitude::identity();
    let good = Light::new(behind(&camera, &attitude, [30.2, 31.7]), 1e4);
    for rates in [[0.0; 3], [0.1, 2.0, 0.3]] {
        let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
        let vehicle = vehicle(&attitude, rates);
        let alone = light(&emulator, &vehicle, &[good]);
        for bad in NON_FINITE {
            for direction in corrupted(good.direction, bad) {
                let off = Light::new(direction, good.electrons);
                let both = light(&emulator, &vehicle, &[off, good]);
                assert_eq!(both.expected_e, alone.expected_e, "{off:?}");
                assert_eq!(both.dn, alone.dn);
            }
        }
        let dark = Light::new(good.direction, f64::NAN);
        let both = light(&emulator, &vehicle, &[dark, good]);
        assert_eq!(both.expected_e, alone.expected_e);
    }
}

/// Objects with extreme numbers in their messages are refused when read, unknown, or out of sight.
/// Frames stay finite.
#[test]
fn extreme_objects_keep_frames_finite() {
    for far_km in [1e9, 1e30, 1e77, 1e120] {
        for fast_km_s in [0.0, 1e6, 1e30] {
            for axis in [Vector3::x(), Vector3::new(1.0, 1e-3, 0.0)] {
                let (far, fast) = (axis * far_km, axis * fast_km_s);
                let mut emulator = emulator(camera(""), Fidelity::REALTIME, |config| {
                    config.objects = oem("FAR", noon(), |s| (far + fast * s, fast));
                });
                let exposed = emulator.expose(&in_low_orbit(), 0).unwrap();
                check_numbers(&exposed, &format!("{far_km:e} km, {fast_km_s:e} km/s"));
                assert!(exposed.frame.dn.iter().all(|dn| *dn == 100));
            }
        }
    }
}

/// As documented: a non-finite state or interval gives a non-finite state.
#[test]
fn non_finite_orbits_give_non_finite_states() {
    let state = StateVector {
        position_m: Vector3::new(7e6, 0.0, 0.0),
        velocity_m_s: Vector3::new(0.0, 7.5e3, 0.0),
    };
    for bad in NON_FINITE {
        assert!(!propagate_j2(&state, bad).is_finite());
        let mut corrupted = state;
        corrupted.position_m.x = bad;
        assert!(!propagate_j2(&corrupted, 10.0).is_finite());
    }
}

/// Shadow and occultation of a non-finite position: no light, no occultation and no panic.
#[test]
fn shadows_with_non_finite_positions() {
    let earth = Earth::at(noon());
    let good = Vector3::new(7e6, 0.0, 0.0);
    for bad in [f64::NAN, f64::INFINITY, 1e200, 0.0] {
        for corrupted in corrupted(good, bad) {
            for (object, sun) in [(corrupted, good), (good, corrupted)] {
                let lit = earth.illumination(object, sun * 2e4);
                assert!(lit.is_nan() || (0.0..=1.0).contains(&lit), "{bad} {lit}");
            }
            earth.occults(corrupted, good);
            earth.occults(good, corrupted);
            earth.occults_direction(good, corrupted);
            earth.meets(corrupted, good);
            earth.limb_angle(corrupted, &good);
            earth.outline(corrupted, 1e5);
        }
    }
    for at in [hifitime::Duration::MAX, hifitime::Duration::MIN].map(Epoch::from_tai_duration) {
        assert!((Earth::at(at).pole().norm() - 1.0).abs() < 1e-12);
    }
}

/// A pass search of any minimum duration ends. NaN, zero and negative durations count as a
/// microsecond.
#[test]
fn pass_searches_of_any_duration_end() {
    let position = LOW_KM + Vector3::new(500.0, -2.0, 0.0);
    let path = falling(position, Vector3::new(0.0, 8.5, 0.0));
    let mut config = Config::defaults().unwrap();
    config.objects = oem("PASSER", noon(), path);
    let population = config.take_population();
    let state = StateVector {
        position_m: LOW_KM * 1e3,
        velocity_m_s: LOW_KM_S * 1e3,
    };
    let [x, y, z, w] = towards(&Vector3::x()).xyzw();
    let attitude = nalgebra::Quaternion::new(w, x, y, z);
    let flight = Flight {
        profile: Profile::Hold(nalgebra::UnitQuaternion::from_quaternion(attitude)),
        orbit: Arc::new(move |at| Ok(propagate_j2(&state, (at - noon()).to_seconds()))),
        target: None,
    };
    let search = |shortest_s: f64| {
        let search = Search {
            from: noon() - Unit::Second * 8,
            to: noon() + Unit::Second * 8,
            shortest_s,
        };
        let found = passes(
            &search,
            &flight,
            &camera(""),
            &population,
            &config.sky.corrections,
            |_| {},
        );
        found.map(|found| found.passes.len())
    };
    let usual = search(1e-3).unwrap();
    assert_eq!(usual, 1);
    for shortest_s in [f64::NAN, 0.0, -1.0, f64::NEG_INFINITY, 1e-300] {
        assert_eq!(search(shortest_s).unwrap(), usual, "{shortest_s}");
    }
    // An infinite duration gives an error or a coarse search.
    let _ = search(f64::INFINITY);
}
