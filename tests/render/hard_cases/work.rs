//! The costliest cameras, exposures, rates and settings that files and commands may have, under a
//! work limit. Each frame is rendered within it, or refused.

use super::stage::{camera, noon, square, towards};
use nalgebra::Vector3;
use skyloop::abort::Abort;
use skyloop::attitude::VehicleState;
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Fidelity;
use skyloop::scene::Unobservable;
use std::time::{Duration, Instant};

/// The work limit of a frame, s on one core.
const LIMIT_S: f64 = 0.3;

/// Keys set in the plain camera with an exposure of one second, its pointing (ICRF) and body rates
/// (deg/s, x and y).
type Corner = (&'static str, &'static [&'static str], [f64; 3], f64);

/// Directions: stars, zodiacal light and the Milky Way; the Moon; the Earth's day limb.
const SKY: [f64; 3] = [0.1, 1.0, -0.02];
const MOON: [f64; 3] = [-0.7231, 0.6150, 0.3145];
const LIMB: [f64; 3] = [0.9140, -0.4057, 0.0];

const SHORT: &str = "timing.exposure_s = 1.1e-3";
const LONGEST: &str = "timing.exposure_s = 1e4; timing.rate_hz = 1e-4";
/// 1.5e6 e- a pixel, twenty times the full well.
const DARK: &str = "detector.dark_e_s = 150.0";
/// Zodiacal light of some 3e4 e- a pixel saturates all pixels.
const BRIGHT: &str = "timing.exposure_s = 1e3; timing.rate_hz = 1e-3; \
    optics.focal_length_mm = 100.0; optics.aperture_mm = 200.0; optics.psf.sigma_px = 25.0; \
    detector.full_well_e = 1000.0";
const BLOOMING: &str = "detector.blooming = \"column\"";
const LONG_ROWS: &str = "detector.width_px = 4096";
const WIDEST: &str = "optics.aperture_mm = 18.0; optics.psf.sigma_px = 100.0";
const ROLLING: &str = "timing.shutter = \"rolling\"; timing.row_us = 3000.0";
const PARTICLES: &str = "radiation.flux_cm2_s = 1e5; radiation.thickness_um = 50.0; \
    radiation.diffusion_um = 30.0";
const DISTORTED: &str = "optics.projection = { model = \"brown-conrady\", k = [2.6] }";
const TALL: &str = "detector.width_px = 64; detector.height_px = 8192; \
    timing.shutter = \"rolling\"; timing.row_us = 10.0";
const MOFFAT: &str = "optics.psf = { kind = \"moffat\", fwhm_px = 20.0, beta = 1.5 }";
const AIRY: &str = "optics.psf = { kind = \"airy\" }";
const SHIFTED: &str = "timing.rate_hz = 0.5; timing.shutter = \"frame-transfer\"; \
    timing.row_us = 1.0";
const STRAY: &str = "optics.stray = { pst = [[1.0, 1e-1], [90.0, 1e-6], [180.0, 1e-9]] }";

/// The ends of the ranges of protocols/docs/icd.md, section 5.3.1, with frames rendered at this
/// limit. The counted work decides: a change of prices shows here.
const RENDERED: &[Corner] = &[
    ("at rest", &[], SKY, 0.0),
    ("a slow turn", &[], SKY, 1.0),
    ("the furthest turn", &[], SKY, 40.0),
    ("the fastest turn", &[SHORT], SKY, 25_000.0),
    ("dark current fills all", &[LONGEST, DARK], SKY, 4e-3),
    ("light fills all", &[BRIGHT], SKY, 0.02),
    (
        "saturated by light, with blooming",
        &[BRIGHT, BLOOMING],
        SKY,
        0.02,
    ),
    ("rows in turn, turning", &[ROLLING], SKY, 1.0),
    ("a distorting lens, turning", &[DISTORTED], SKY, 20.0),
    ("8192 rows in turn", &[TALL], SKY, 1.0),
    ("columns with blooming", &[BLOOMING], MOON, 0.0),
    ("frame transfer, turning", &[SHIFTED], SKY, 5.0),
    ("stray light", &[STRAY], MOON, 1.0),
    ("the Moon, turning", &[], MOON, 5.0),
    ("the Moon by rows in turn", &[ROLLING], MOON, 1.0),
    ("the limb", &[], LIMB, 0.0),
    ("the limb, turning", &[], LIMB, 5.0),
];

/// Cases with refused frames.
const REFUSED: &[Corner] = &[
    ("the longest exposure", &[LONGEST], SKY, 0.0),
    ("the longest exposure, turning", &[LONGEST], SKY, 4e-3),
    ("the widest Gaussian", &[WIDEST], SKY, 0.0),
    ("the widest Gaussian, turning", &[WIDEST], SKY, 2.0),
    ("particles", &[PARTICLES], SKY, 0.0),
    ("4096 columns, turning", &[LONG_ROWS], SKY, 40.0),
    ("Moffat's wings, turning", &[MOFFAT], SKY, 5.0),
    ("Airy's rings, turning", &[AIRY], SKY, 5.0),
];

/// An emulator of that camera with 256 x 256 pixels and the effects of a run, and a vehicle 630 km
/// above the Earth.
fn stage(corner: &Corner, fidelity: Fidelity) -> (Emulator, VehicleState) {
    let (_, keys, direction, rate_deg_s) = corner;
    let mut config = Config::builtin().unwrap();
    let keys = format!("timing.exposure_s = 1.0; {}", keys.join("; "));
    config.camera = square(256, &keys);
    config.fidelity = fidelity;
    let mut emulator = Emulator::new(&mut config);
    emulator.work_limit_s = Some(LIMIT_S);
    (emulator, vehicle(*direction, rate_deg_s.to_radians()))
}

fn vehicle(direction: [f64; 3], rate: f64) -> VehicleState {
    let attitude = towards(&Vector3::from(direction)).xyzw();
    let orbit = Some(([0.0, 7.0e6, 0.0], [7.5e3, 0.0, 0.0]));
    VehicleState::new(7, noon(), attitude, [rate, rate, 0.0], orbit).unwrap()
}

/// Whether the frame is rendered, on this number of threads.
fn is_rendered(corner: &Corner, fidelity: Fidelity, threads: usize) -> bool {
    let (mut emulator, vehicle) = stage(corner, fidelity);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
    let exposed = pool
        .build()
        .unwrap()
        .install(|| emulator.expose(&vehicle, 0));
    match exposed {
        Ok(_) => true,
        Err(Unobservable::TooMuchWork { limit_s, .. }) => {
            assert!((LIMIT_S..1.1 * LIMIT_S).contains(&limit_s));
            false
        }
        Err(other) => panic!("{}: {other}", corner.0),
    }
}

#[test]
fn costly_frames_are_rendered_or_refused_on_any_threads() {
    for threads in [1, 3] {
        for (corners, due) in [(RENDERED, true), (REFUSED, false)] {
            for corner in corners {
                let made = is_rendered(corner, Fidelity::REALTIME, threads);
                assert_eq!(made, due, "{}, {threads} threads", corner.0);
            }
        }
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
        config.camera = camera("");
        config.objects = objects[..count].to_vec();
        let mut emulator = Emulator::new(&mut config);
        emulator.work_limit_s = Some(1e-3);
        let refused = match emulator.expose(&vehicle(SKY, 0.0), 0) {
            Err(Unobservable::TooMuchWork { sources, .. }) => sources == count,
            _ => false,
        };
        assert_eq!(refused, is_refused, "{count} objects");
    }
}

/// With each setting, on one thread.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_no_frame_takes_much_longer_than_the_limit() {
    for fidelity in [Fidelity::FAST, Fidelity::REALTIME, Fidelity::REFERENCE] {
        for corner in RENDERED.iter().chain(REFUSED) {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
            let pool = pool.build().unwrap();
            // The work is counted to a factor of two; the uncounted part is the same for all.
            // Another process may delay a frame: one of three is in time.
            let is_in_time = |_| {
                let (mut emulator, vehicle) = stage(corner, fidelity);
                let began = Instant::now();
                let made = pool.install(|| emulator.expose(&vehicle, 0)).is_ok();
                let took_s = began.elapsed().as_secs_f64();
                println!("{}: made {made}, {took_s:.3} s", corner.0);
                took_s < 2.0 * LIMIT_S + 0.2
            };
            assert!((0..3).any(is_in_time), "{}", corner.0);
        }
    }
}

/// Cameras of more pixels, with long frame times, and their pointing.
const LARGE: &[Corner] = &[
    ("4 Mpx, the limb by day", &[FOUR_MPX], LIMB, 0.0),
    ("16 Mpx, the limb by day", &[SENSITIVE], LIMB, 0.0),
    ("16 Mpx, the limb by night", &[SENSITIVE], NIGHT, 0.0),
    ("16 Mpx, 10,000 labels", &[SENSITIVE], SKY, 0.0),
    ("16 Mpx with blooming", &[UNEVEN], SKY, 0.0),
];

const NIGHT: [f64; 3] = [-0.9140, -0.4057, 0.0];
const FOUR_MPX: &str = "timing.exposure_s = 1e-4; detector.width_px = 2048; \
    detector.height_px = 2048";

/// All columns saturate, with maps of response and dark current.
const UNEVEN: &str = "timing.exposure_s = 0.3; timing.rate_hz = 0.5; \
    timing.shutter = \"frame-transfer\"; timing.row_us = 5.0; \
    detector.width_px = 4096; detector.height_px = 4096; detector.blooming = \"column\"; \
    detector.full_well_e = 5000.0; detector.dark_e_s = 150.0; detector.prnu = 0.01; \
    detector.dark_nonuniformity = 0.3; detector.hot_fraction = 0.05; detector.hot_e_s = 5000.0; \
    optics.stray = { pst = [[15.0, 1e-3], [105.0, 1e-12]], sun_exclusion_deg = 60.0 }";

/// 77 deg wide.
const SENSITIVE: &str = "timing.exposure_s = 1.0; \
    detector.width_px = 4096; detector.height_px = 4096; detector.dark_e_s = 150.0; \
    detector.full_well_e = 90000.0; optics.focal_length_mm = 25.5; optics.aperture_mm = 18.0; \
    optics.transmission = 1.0; detector.quantum_efficiency = 1.0; \
    optics.stray = { pst = [[15.0, 1e-3], [30.0, 1e-7], [60.0, 1e-9], [105.0, 1e-12]], \
    sun_exclusion_deg = 60.0 }";

/// A frame may be cancelled at any stage of its work. The end of a run waits for it, and must come
/// within 100 ms of a signal.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_a_cancelled_frame_ends_soon() {
    const PARTS: u32 = 12;
    for corner in LARGE {
        let name = corner.0;
        let (mut emulator, vehicle) = stage(corner, Fidelity::REALTIME);
        emulator.work_limit_s = None;
        expose(&mut emulator, &vehicle, None);
        let (is_rendered, whole) = expose(&mut emulator, &vehicle, None);
        assert!(is_rendered, "{name}");
        let late = (1..PARTS).map(|part| {
            let after = whole * part / PARTS;
            let (_, took) = expose(&mut emulator, &vehicle, Some(after));
            took.saturating_sub(after)
        });
        let late: Vec<Duration> = late.collect();
        println!("{name}: {whole:?}; late {late:.0?}");
        let is_soon = |late: &Duration| *late < Duration::from_millis(80);
        assert!(late.iter().all(is_soon), "{name}: {whole:?}; late {late:?}");
    }
}

/// Whether a frame is rendered, and its duration; it may be cancelled after some time.
fn expose(
    emulator: &mut Emulator,
    vehicle: &VehicleState,
    cancelled_after: Option<Duration>,
) -> (bool, Duration) {
    let abort = Abort::default();
    emulator.abort = abort.clone();
    std::thread::scope(|scope| {
        let began = Instant::now();
        if let Some(after) = cancelled_after {
            scope.spawn(move || {
                std::thread::sleep(after);
                abort.set();
            });
        }
        let is_rendered = emulator.expose(vehicle, 0).is_ok();
        (is_rendered, began.elapsed())
    })
}
