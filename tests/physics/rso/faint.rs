//! Objects that are too faint for an image must be so at any camera motion.

use crate::fixtures::camera;
use crate::oem;
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Fidelity;
use skyloop::orbit::StateVector;
use skyloop::orbit::time::parse_utc;
use skyloop::sky::photometry::Sphere;
use skyloop::sky::population::Appearance;

/// 1000 km above an observer that moves with it, the Sun to the side (ICRF, +x).
const POSITION_KM: [f64; 3] = [0.0, 7000.0, 0.0];
const VELOCITY_KM_S: [f64; 3] = [-7.5, 0.0, 0.0];
const BEYOND_KM: f64 = 1000.0;
/// Objects with diameters from this one on (m), each larger by a third.
const MIN_M: f64 = 1e-3;
const OBJECTS: i32 = 40;

fn mid() -> Epoch {
    parse_utc("2026-03-20T12:00:00").unwrap()
}

/// The objects listed while the body turns at `rate` (rad/s) around the camera's x axis.
fn listed(fidelity: Fidelity, rate: f64) -> Vec<String> {
    let mut config = Config::defaults().unwrap();
    config.camera = camera("cmos-rolling");
    config.camera.exposure_s = 1e-4;
    config.label_snr = 0.05;
    config.fidelity = fidelity;
    config.choice.off.extend(["stars", "planets", "moon"]);
    let [position, velocity] = [POSITION_KM, VELOCITY_KM_S].map(Vector3::from);
    for i in 0..OBJECTS {
        // Side by side, each in its own columns: 12 deg across in all.
        let aside = (f64::from(i) - f64::from(OBJECTS) / 2.0) * 5.0;
        let target = position + Vector3::new(aside, BEYOND_KM, 0.0);
        let id = format!("OBJECT {i}");
        let objects = oem::oem(&id, mid(), oem::falling(target, velocity));
        config.objects.extend(objects);
        let sphere = Sphere {
            diameter_m: MIN_M * (4.0_f64 / 3.0).powi(i),
            ..Sphere::default()
        };
        config.looks.insert(id, Appearance::Sphere(sphere));
    }
    // The boresight is along ICRF +y, the camera's x axis along ICRF x.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let vehicle = VehicleState {
        epoch: mid(),
        attitude: Attitude::from_xyzw([half, 0.0, 0.0, half]).unwrap(),
        rates: Vector3::new(rate, 0.0, 0.0),
        orbit: Some(StateVector {
            position_m: position * 1e3,
            velocity_m_s: velocity * 1e3,
        }),
        sequence: 0,
    };
    let mut emulator = Emulator::new(&mut config);
    let objects = emulator.expose(&vehicle, 0).unwrap().label.objects;
    objects.iter().map(|object| object.id.clone()).collect()
}

/// An image that moves with the row readout is exposed for much longer than the exposure time.
#[test]
fn an_image_that_runs_with_the_readout_is_not_too_faint() {
    let all = Fidelity {
        skip_snr: 0.0,
        ..Fidelity::REALTIME
    };
    // X-Val: by hand: rows of 10 um at 22 mm, 40 us each: 10e-6 / 22e-3 / 40e-6 rad/s.
    let with_rows = 11.36;
    let mut counts = Vec::new();
    for rate in [0.0, with_rows, -with_rows] {
        let seen = listed(Fidelity::REALTIME, rate);
        assert_eq!(seen, listed(all, rate), "{rate}");
        counts.push(seen.len());
    }
    println!("{counts:?} of {OBJECTS}");
    // One direction shows more objects than at rest, and some stay hidden.
    let (still, max) = (counts[0], counts[1].max(counts[2]));
    assert!(max > still && max < OBJECTS as usize && still > 3);
}
