//! The closed loop against a small emulator with fixed stars. `tests/wire/steering.rs` runs it
//! against the real emulator.

use crate::common::emulator::Emulator;
use crate::common::loops::{by_wall, computer, mission, over_memory};
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::control::{ControlSettings, ControlTelemetry};
use skyloop_firmware_sim::flight_computer::RunError;
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::report::Report;

const FOCAL_PX: f64 = 5000.0;
const DRIFT_DEG_S: [f64; 3] = [0.02, -0.03, 0.05];

fn hold() -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(0.4, -0.2, 1.0)
}

fn holding(frames: u32) -> Mission {
    Mission {
        profile: Profile::Hold(hold()),
        ..by_wall(20.0, frames)
    }
}

fn run(emulator: Emulator, mission: Mission) -> (Result<Report, RunError>, Emulator) {
    let (port, thread) = over_memory(emulator);
    let settings = ControlSettings {
        focal_px: FOCAL_PX,
        drift_rad_s: Vector3::from(DRIFT_DEG_S).map(f64::to_radians),
    };
    let computer = computer(port, mission).with_control(Some(settings));
    let result = crate::common::loops::run_and_print(computer);
    (result, thread.join().unwrap())
}

fn telemetry(report: &Report) -> &ControlTelemetry {
    report.control.as_ref().expect("the loop was closed")
}

#[test]
fn the_loop_corrects_a_drift() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.focal_px = Some(FOCAL_PX);
    let (report, emulator) = run(emulator, holding(100));
    let report = report.unwrap();
    let telemetry = telemetry(&report);
    assert!(telemetry.used >= 60, "too few frames: {report}");
    assert!(telemetry.rms_rad().unwrap() < 0.1 * telemetry.drifted_rad());
    assert!(telemetry.worst_rad < 0.5 * telemetry.drifted_rad());
    // The received attitudes: at rest at first, then always closer than the uncorrected drift.
    let first = &emulator.attitudes[0].1;
    assert_eq!(first.rates_rad_s, [0.0; 3]);
    let last = emulator.attitudes.last().unwrap().1.q_icrf_to_body;
    let q = hold();
    let dot = (q.i * last[0] + q.j * last[1] + q.k * last[2] + q.w * last[3]).abs();
    let off = 2.0 * dot.min(1.0).acos();
    assert!(off < 0.1 * telemetry.drifted_rad(), "{off}");
}

#[test]
fn starless_frames_are_counted_and_the_body_rests() {
    let mut emulator = Emulator::new(|_, _| {});
    // Too small for a grid of stars.
    (emulator.field.width, emulator.field.height) = (16, 16);
    let (report, emulator) = run(emulator, holding(5));
    let report = report.unwrap();
    let telemetry = telemetry(&report);
    assert_eq!((telemetry.starless, telemetry.used), (5, 0));
    assert!(report.to_string().contains("not begun"), "{report}");
    let stays = |q: [f64; 4]| (q[3] - hold().w).abs() < 1e-12;
    let mut attitudes = emulator.attitudes.iter();
    assert!(attitudes.all(|(_, a)| stays(a.q_icrf_to_body)));
}

#[test]
fn impossible_loops_name_a_remedy() {
    for (mission, part) in [
        (mission(1), "give --wall"),
        (by_wall(20.0, 1), "give it by --hold"),
    ] {
        let (result, emulator) = run(Emulator::new(|_, _| {}), mission);
        let error = result.unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        assert_eq!(emulator.resets, 0, "nothing was sent");
    }
}
