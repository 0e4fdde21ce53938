//! The closed loop over the wire, against a small emulator whose stars stand still in the sky. Against the real one:
//! `tests/wire/steering.rs`.

use crate::common::emulator::Emulator;
use crate::common::loops::{by_wall, computer, mission, over_memory};
use nalgebra::{UnitQuaternion, Vector3};
use skyloop_firmware_sim::control::{ControlSettings, ControlTelemetry};
use skyloop_firmware_sim::flight_computer::RunError;
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::port::Port;
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

fn fly(port: impl Port + Send + 'static, mission: Mission) -> Result<Report, RunError> {
    let settings = ControlSettings {
        focal_px: FOCAL_PX,
        drift_rad_s: Vector3::from(DRIFT_DEG_S).map(f64::to_radians),
    };
    crate::common::loops::fly(computer(port, mission).with_control(Some(settings)))
}

fn account(report: &Report) -> &ControlTelemetry {
    report.control.as_ref().expect("a loop was flown")
}

#[test]
fn the_loop_holds_a_drift_and_the_attitudes_are_those_of_the_body() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.focal_px = Some(FOCAL_PX);
    let (port, thread) = over_memory(emulator);
    let report = fly(port, holding(100)).unwrap();
    let emulator = thread.join().unwrap();
    let account = account(&report);
    assert!(account.used >= 60, "too few to tell: {report}");
    assert!(account.rms_rad().unwrap() < 0.1 * account.drifted_rad());
    assert!(account.worst_rad < 0.5 * account.drifted_rad());
    // By what the emulator was told: at rest at first, then never as far as the drift takes it.
    let first = &emulator.attitudes[0].1;
    assert_eq!(first.rates_rad_s, [0.0; 3]);
    let last = emulator.attitudes.last().unwrap().1.q_icrf_to_body;
    let q = hold();
    let dot = (q.i * last[0] + q.j * last[1] + q.k * last[2] + q.w * last[3]).abs();
    let off = 2.0 * dot.min(1.0).acos();
    assert!(off < 0.1 * account.drifted_rad(), "{off}");
}

#[test]
fn frames_without_a_star_are_counted_and_the_body_stays() {
    let mut emulator = Emulator::new(|_, _| {});
    // Of no size for a grid of stars.
    (emulator.field.width, emulator.field.height) = (16, 16);
    let (port, thread) = over_memory(emulator);
    let report = fly(port, holding(5)).unwrap();
    let emulator = thread.join().unwrap();
    let account = account(&report);
    assert_eq!((account.starless, account.used), (5, 0));
    assert!(report.to_string().contains("not begun"), "{report}");
    let stays = |q: [f64; 4]| (q[3] - hold().w).abs() < 1e-12;
    let mut attitudes = emulator.attitudes.iter();
    assert!(attitudes.all(|(_, a)| stays(a.q_icrf_to_body)));
}

#[test]
fn a_loop_that_cannot_be_says_what_to_do() {
    for (mission, says) in [
        (mission(1), "give --wall"),
        (by_wall(20.0, 1), "give it by --hold"),
    ] {
        let (port, thread) = over_memory(Emulator::new(|_, _| {}));
        let error = fly(port, mission).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
        assert_eq!(thread.join().unwrap().resets, 0, "nothing was sent");
    }
}
