//! Whole frames under non-finite settings, which files and commands refuse but callers of the
//! library can make: no panic, a bounded time, and a finite frame or an error.

use super::functions::{EDGES, Permitted, fault};
use super::stage::{camera, check_numbers, emulator, expected, starry, towards};
use skyloop::attitude::VehicleState;
use skyloop::camera::psf::{Psf, Shape, Variation};
use skyloop::camera::{Camera, Flux, Radiation, Shutter, Stray, Vignetting};
use skyloop::config::Clock;
use skyloop::engine::Emulator;
use skyloop::fidelity::{Allowed, Fidelity, TOLERANCES, Value};
use skyloop::serve::Server;
use skyloop_protocols::Output;
use skyloop_protocols::personality::NATIVE;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// One frame of 64 x 64 px takes milliseconds.
const BOUND: Duration = Duration::from_secs(20);

/// Towards Orion, turning by 2 deg/s.
fn vehicle() -> VehicleState {
    let attitude = towards(&nalgebra::Vector3::new(0.1, 1.0, -0.02));
    super::stage::vehicle(&attitude, [0.0, 2.0, 0.0])
}

fn stage() -> Emulator {
    let wide = "optics.focal_length_mm = 2.0; optics.aperture_mm = 1.0; \
         detector.dark_e_s = 5.0; detector.read_noise_e = 2.0; \
         detector.nonlinearity = 0.01; detector.prnu = 0.01";
    let mut emulator = starry(camera(wide), Fidelity::REALTIME);
    emulator.choice.noise = true;
    emulator.choice.off.retain(|name| *name != "shot noise");
    emulator
}

#[test]
fn frames_with_tolerances_out_of_range() {
    let mut emulator = stage();
    for tolerance in TOLERANCES {
        let Allowed::Numbers([min, max]) = tolerance.allowed else {
            continue;
        };
        for bad in EDGES {
            let mut fidelity = Fidelity::REALTIME;
            (tolerance.set)(&mut fidelity, Value::Number(bad));
            emulator.set_fidelity(fidelity);
            let Value::Number(set) = (tolerance.get)(emulator.fidelity()) else {
                unreachable!()
            };
            assert!((min..=max).contains(&set), "{} = {bad}", tolerance.name);
            let started = Instant::now();
            let exposed = emulator.expose(&vehicle(), 0).unwrap();
            assert!(started.elapsed() < BOUND, "{} = {bad}", tolerance.name);
            check_numbers(&exposed, &format!("{} = {bad}", tolerance.name));
            assert!(exposed.json.contains("\"objects\":[{"), "no star is seen");
        }
    }
    // Minimum steps, all at once: the work does not grow without bound.
    emulator.set_fidelity(Fidelity {
        psf_loss: 0.0,
        loss_e: 0.0,
        wing_e: 0.0,
        track_step_sigma: 0.0,
        track_e: 0.0,
        area_e: 0.0,
        area_part: 0.0,
        skip_px: 0.0,
        ..Fidelity::REFERENCE
    });
    let exposed = emulator.expose(&vehicle(), 0).unwrap();
    check_numbers(&exposed, "all of them 0");
}

/// Every real number of a camera that `camera_mut` exposes.
#[test]
fn frames_of_cameras_with_non_finite_numbers() {
    type Field = (&'static str, fn(&mut Camera, f64));
    const FIELDS: [Field; 20] = [
        ("exposure_s", |c, bad| c.exposure_s = bad),
        ("rate_hz", |c, bad| c.rate_hz = bad),
        ("shutter, rolling", |c, bad| {
            c.shutter = Shutter::Rolling { row_s: bad };
        }),
        ("shutter, frame transfer", |c, bad| {
            c.shutter = Shutter::FrameTransfer { row_s: bad };
        }),
        ("aperture_m", |c, bad| c.optics.aperture_m = bad),
        ("focal_px", |c, bad| c.optics.focal_px = bad),
        ("principal_px", |c, bad| c.optics.principal_px[0] = bad),
        ("transmission", |c, bad| c.optics.transmission = bad),
        ("vignetting", |c, bad| {
            c.optics.vignetting = Vignetting::Table(vec![[0.0, 1.0], [0.5, bad]]);
        }),
        ("stray", |c, bad| {
            c.optics.stray = Stray::new(&[[0.1, 1e-3], [2.0, bad]], bad);
        }),
        ("psf", |c, bad| {
            c.optics.psf = Psf::new(Shape::Gaussian(bad), Variation::default());
        }),
        ("pitch_m", |c, bad| c.detector.pitch_m = bad),
        ("quantum_efficiency", |c, bad| {
            c.detector.quantum_efficiency = bad;
        }),
        ("dark_e_s", |c, bad| c.detector.dark_e_s = bad),
        ("read_noise_e", |c, bad| c.detector.read_noise_e = bad),
        ("full_well_e", |c, bad| c.detector.full_well_e = bad),
        ("nonlinearity", |c, bad| c.detector.nonlinearity = bad),
        ("gain_e_per_dn", |c, bad| c.detector.gain_e_per_dn = bad),
        ("offset_dn", |c, bad| c.detector.offset_dn = bad),
        ("radiation", |c, bad| {
            c.radiation = Some(Radiation {
                flux: Flux::Fixed(bad),
                thickness_um: bad,
                energy_mev: 500.0,
                diffusion_um: bad,
                readout_s: 0.1,
            });
        }),
    ];
    let wrong = FIELDS.into_iter().filter_map(|(name, field)| {
        let emulator = stage();
        let (configured, emulator) = (emulator.camera(), Mutex::new(emulator));
        fault(name, Permitted::Light, move |bad| {
            let mut emulator = emulator.lock().unwrap();
            emulator.camera_mut().clone_from(&configured);
            field(emulator.camera_mut(), bad);
            let exposed = emulator.expose(&vehicle(), 0);
            let dn = exposed.map_or(0, |exposed| exposed.frame.dn.len());
            assert!(dn == 0 || dn == 64 * 64);
            // Later frames are unaffected.
            emulator.camera_mut().clone_from(&configured);
            expected(emulator.expose(&vehicle(), 0).unwrap())
        })
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// As documented, labels then list all objects.
#[test]
fn a_label_without_a_minimum_snr_lists_all() {
    let listed = |label_snr: f64| {
        let camera = stage().camera().as_ref().clone();
        let mut emulator = emulator(camera, Fidelity::REALTIME, |config| {
            config.choice.off.retain(|name| *name != "stars");
            config.label_snr = label_snr;
        });
        let exposed = emulator.expose(&vehicle(), 0).unwrap();
        check_numbers(&exposed, "label_snr");
        let label: serde_json::Value = serde_json::from_str(&exposed.json).unwrap();
        label["objects"].as_array().unwrap().len()
    };
    let all = listed(0.0);
    assert!(all > 5, "{all}");
    for bad in [f64::NAN, f64::NEG_INFINITY, -1.0] {
        assert_eq!(listed(bad), all, "{bad}");
    }
    assert_eq!(listed(f64::INFINITY), 0);
}

#[test]
fn servers_of_cameras_with_a_non_finite_rate() {
    for bad in EDGES {
        let mut emulator = stage();
        emulator.camera_mut().rate_hz = bad;
        let output = Output::default();
        let server = Server::new(emulator, [], output, Clock::Wall, &NATIVE);
        assert!(server.fits().is_ok() && server.levels().is_empty(), "{bad}");
    }
}
