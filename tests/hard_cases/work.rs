//! The dearest cameras, exposures, rates and settings that files and commands may have, under a limit of work: each frame is made within it, or refused.

use crate::stage::{camera, noon, towards};
use nalgebra::Vector3;
use skyloop::attitude::VehicleState;
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Fidelity;
use skyloop::scene::Unobservable;
use std::time::Instant;

/// What a frame may cost, s on one core.
const LIMIT_S: f64 = 0.3;

/// What is set of the plain camera, how fast the body turns (deg/s, x and y), and whether the frame is made.
type Corner = (
    &'static str,
    &'static [(&'static str, &'static str)],
    f64,
    bool,
);

const SECOND: (&str, &str) = ("timing.exposure_s", "1.0");
const LONGEST: [(&str, &str); 2] = [("timing.exposure_s", "1e4"), ("timing.rate_hz", "1e-4")];
const WIDEST: [(&str, &str); 3] = [
    SECOND,
    ("optics.aperture_mm", "18.0"),
    ("optics.psf.sigma_px", "100.0"),
];
const ROLLING: [(&str, &str); 3] = [
    SECOND,
    ("timing.shutter", "\"rolling\""),
    ("timing.row_us", "3000.0"),
];
const PARTICLES: [(&str, &str); 4] = [
    SECOND,
    ("radiation.flux_cm2_s", "1e5"),
    ("radiation.thickness_um", "50.0"),
    ("radiation.diffusion_um", "30.0"),
];
const DISTORTED: [(&str, &str); 2] = [
    SECOND,
    (
        "optics.projection",
        "{ model = \"brown-conrady\", k = [2.6] }",
    ),
];
const WIDE: [(&str, &str); 2] = [SECOND, ("detector.width_px", "4096")];
const TALL: [(&str, &str); 5] = [
    SECOND,
    ("detector.width_px", "64"),
    ("detector.height_px", "2048"),
    ("timing.shutter", "\"rolling\""),
    ("timing.row_us", "10.0"),
];

/// The ends of the ranges of protocols/docs/icd.md, section 5.3.1. Which of them are refused at this limit follows from the counted work: the values hold it still, so that
/// a change of prices shows.
const CORNERS: &[Corner] = &[
    ("at rest", &[SECOND], 0.0, true),
    ("a slow turn", &[SECOND], 1.0, true),
    ("the furthest turn", &[SECOND], 40.0, true),
    (
        "the fastest turn",
        &[("timing.exposure_s", "1.1e-3")],
        25_000.0,
        true,
    ),
    ("the longest exposure", &LONGEST, 0.0, false),
    ("the longest exposure, turning", &LONGEST, 4e-3, false),
    ("the widest Gaussian", &WIDEST, 0.0, false),
    ("the widest Gaussian, turning", &WIDEST, 2.0, false),
    ("rows in turn, turning", &ROLLING, 1.0, true),
    ("particles", &PARTICLES, 0.0, false),
    ("a distorting lens, turning", &DISTORTED, 20.0, true),
    ("4096 columns, turning", &WIDE, 20.0, false),
    ("2048 rows in turn", &TALL, 1.0, true),
];

/// An emulator of that camera with 256 x 256 pixels and the effects of a run, and a vehicle 630 km above the Earth.
fn stage((_, keys, rate_deg_s, _): &Corner, fidelity: Fidelity) -> (Emulator, VehicleState) {
    let size = [("detector.width_px", "256"), ("detector.height_px", "256")];
    let keys: Vec<(&str, &str)> = size.into_iter().chain(keys.iter().copied()).collect();
    let mut config = Config::builtin().unwrap();
    config.camera = camera(&keys);
    config.fidelity = fidelity;
    let mut emulator = Emulator::new(&mut config);
    emulator.work_limit_s = Some(LIMIT_S);
    let rate = rate_deg_s.to_radians();
    let attitude = towards(&Vector3::new(0.1, 1.0, -0.02)).xyzw();
    let orbit = Some(([0.0, 7.0e6, 0.0], [7.5e3, 0.0, 0.0]));
    let vehicle = VehicleState::new(7, noon(), attitude, [rate, rate, 0.0], orbit);
    (emulator, vehicle.unwrap())
}

/// Whether its frame is made, on so many threads.
fn is_made(corner: &Corner, fidelity: Fidelity, threads: usize) -> bool {
    let (mut emulator, vehicle) = stage(corner, fidelity);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let shot = pool
        .build()
        .unwrap()
        .install(|| emulator.shoot(&vehicle, 0));
    match shot {
        Ok(_) => true,
        Err(Unobservable::TooMuchWork { limit_s, .. }) => {
            assert!((LIMIT_S..1.1 * LIMIT_S).contains(&limit_s));
            false
        }
        Err(other) => panic!("{}: {other}", corner.0),
    }
}

#[test]
fn the_dearest_frames_are_made_within_the_limit_or_refused_on_any_number_of_threads() {
    let expected: Vec<(&str, bool)> = CORNERS.iter().map(|c| (c.0, c.3)).collect();
    for threads in [1, 3] {
        let made = CORNERS.iter();
        let made = made.map(|c| (c.0, is_made(c, Fidelity::REALTIME, threads)));
        assert_eq!(made.collect::<Vec<_>>(), expected, "{threads} threads");
    }
}

/// 0.7 us for each: the search alone costs more than the limit.
#[test]
fn too_many_objects_are_refused_before_the_search() {
    let objects: Vec<_> = skyloop::orbit::synth::population(1600, 1, noon())
        .iter()
        .map(|made| made.object())
        .collect();
    for (count, is_refused) in [(1400, false), (1600, true)] {
        let mut config = Config::builtin().unwrap();
        config.camera = camera(&[]);
        config.objects = objects[..count].to_vec();
        let mut emulator = Emulator::new(&mut config);
        emulator.work_limit_s = Some(1e-3);
        let attitude = towards(&Vector3::new(0.1, 1.0, -0.02)).xyzw();
        let orbit = Some(([0.0, 7.0e6, 0.0], [7.5e3, 0.0, 0.0]));
        let vehicle = VehicleState::new(7, noon(), attitude, [0.0; 3], orbit).unwrap();
        let refused = match emulator.shoot(&vehicle, 0) {
            Err(Unobservable::TooMuchWork { sources, .. }) => sources == count,
            _ => false,
        };
        assert_eq!(refused, is_refused, "{count} objects");
    }
}

/// By each setting, on one thread.
#[test]
#[ignore = "timed: tests/run has it run with nothing beside it; cargo test -- --ignored timed"]
fn timed_no_frame_takes_much_longer_than_the_limit() {
    for fidelity in [Fidelity::FAST, Fidelity::REALTIME, Fidelity::REFERENCE] {
        for corner in CORNERS {
            let (mut emulator, vehicle) = stage(corner, fidelity);
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
            let pool = pool.build().unwrap();
            let began = Instant::now();
            let made = pool.install(|| emulator.shoot(&vehicle, 0)).is_ok();
            let took_s = began.elapsed().as_secs_f64();
            println!("{}: made {made}, {took_s:.3} s", corner.0);
            // The work is counted to a factor of two; what is not counted is the same for all.
            assert!(took_s < 2.0 * LIMIT_S + 0.2, "{}: {took_s} s", corner.0);
        }
    }
}
