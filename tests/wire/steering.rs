//! The closed loop of the mock flight computer against the emulator, in wall-clock mode.

use crate::support::{Q, Running, options, scene};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use skyloop::config::Clock;
use skyloop::link;
use skyloop_firmware_sim::control::ControlSettings;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_orbit::time::parse_utc;
use skyloop_protocols::{LabelLevel, Output, PixelLevel};
use std::ops::ControlFlow;
use std::time::Duration;

#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_the_closed_loop_holds_the_attitude() {
    /// With fewer frames the machine is too slow for a result.
    const MIN: u32 = 40;
    let mut config = scene();
    config.camera.exposure_s = 0.05;
    config.camera.rate_hz = 10.0;
    config.objects.clear();
    let (wire, port) = link::loopback("memory", &options(5.0)).unwrap();
    let emulator = Running::start(config, Clock::Wall, wire);
    let start = parse_utc("2019-06-15T23:35:50").unwrap();
    let [x, y, z, w] = Q;
    let mission = Mission {
        start,
        period_s: 1.0,
        frames: 80,
        profile: Profile::Hold(UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))),
        orbit: None,
        timeout: Duration::from_secs(10),
        pace: Pace::Wall { rate_hz: 20.0 },
        output: Some(Output {
            pixels: PixelLevel::Frame,
            labels: LabelLevel::None,
            ..Output::default()
        }),
        positions: None,
    };
    let settings = ControlSettings {
        // X-Val: configs/cameras/fai-nir.toml: 13.8 mm over 26 um.
        focal_px: 13.8e3 / 26.0,
        drift_rad_s: Vector3::new(0.05, -0.1, 0.075).map(f64::to_radians),
    };
    let computer = FlightComputer::new(port, mission).with_control(Some(settings));
    let report = computer.run(|_| ControlFlow::Continue(())).unwrap();
    println!("{report}");
    let telemetry = report.control.as_ref().expect("the loop was closed");
    assert!(
        telemetry.used >= MIN,
        "{} of 80 frames were complete and {} used for steering: at least {MIN} are needed",
        report.frames,
        telemetry.used
    );
    let (rms, drifted) = (telemetry.rms_rad().unwrap(), telemetry.drifted_rad());
    assert!(rms < 0.1 * drifted, "{rms} rad of {drifted}");
    // A tenth of a pixel (X-Val: 1 / 530.8 rad): the estimate is the attitude at mid-exposure.
    let off = telemetry.estimate_rms_rad().unwrap();
    assert!(off < 0.2 / 530.8, "{off} rad");
    emulator.end();
}
