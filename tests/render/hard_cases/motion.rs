//! Rates from 0 to 100 deg/s, where the still and the smeared image must agree, and exposures from
//! 0 to hours.

use super::stage::{
    alone, behind, camera, check_numbers, emulator, epoch, expected, noon, orbiter, share_along,
    square, starry, still, towards, vehicle,
};
use crate::truth::brute::simpson;
use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::Camera;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::fidelity::{Choice, Fidelity};
use skyloop::orbit::Object;
use skyloop::plan::simulated;
use skyloop::scene::{Exposure, Unobservable, track_all};
use std::f64::consts::TAU;

/// The image (128 x 128 px) of a light that moves along its row by a turn about the column axis:
/// the closed form of every pixel, integrated over the exposure by Simpson's rule. Steps of an
/// eightieth of a pixel have an error of 1e-9.
fn streak(camera: &Camera, at: [f64; 2], rate_rad_s: f64, electrons: f64) -> Vec<f64> {
    let f = camera.optics.focal_px;
    let [cx, _] = camera.optics.principal_px;
    let (x0, y0) = ((at[0] - cx) / f, (at[1] - 63.5) / f);
    let turn = rate_rad_s * camera.exposure_s;
    let steps = 2 * ((40.0 * turn * f).ceil() as usize).max(8);
    let mut image = vec![0.0; 128 * 128];
    for k in 0..=steps {
        let weight = simpson(k, steps) / steps as f64;
        // Rates about +Y turn the sky about -Y: v' = v cos - (w x v) sin.
        let angle = turn * (k as f64 / steps as f64 - 0.5);
        let (sin, cos) = angle.sin_cos();
        let z = cos + x0 * sin;
        let (x, y) = (cx + f * (x0 * cos - sin) / z, 63.5 + f * y0 / z);
        if !(-16.0..144.0).contains(&x) {
            continue;
        }
        let down: Vec<f64> = (0..128)
            .map(|i| share_along(f64::from(i) - y, 0.8))
            .collect();
        let across: Vec<f64> = (0..128)
            .map(|i| share_along(f64::from(i) - x, 0.8))
            .collect();
        for (row, down) in down.iter().enumerate().filter(|(_, down)| **down > 1e-9) {
            let part = electrons * weight * down;
            let pixels = image[row * 128..][..128].iter_mut();
            pixels
                .zip(&across)
                .for_each(|(e, across)| *e += part * across);
        }
    }
    image
}

/// Frames are continuous in the rate: each is within the tolerances of its closed form. `realtime`:
/// 0.05 e-, and 3e-5 of the peak. `reference`: a hundredth of an electron, f32's last digits of a
/// peak of 24,000 e-.
#[test]
fn every_rate_from_nothing_to_100_deg_s_gives_the_closed_form() {
    let camera = square(128, "");
    let at = [63.2, 64.7];
    let attitude = Attitude::towards(0.4, 0.3, 0.2);
    let direction = behind(&camera, &attitude, at);
    for (fidelity, most_e) in [(Fidelity::REALTIME, 0.05), (Fidelity::REFERENCE, 0.01)] {
        let emulator = emulator(camera.clone(), fidelity, |_| {});
        for rate in [
            0.0, 1e-12, 1e-9, 1e-6, 1e-5, 1e-4, 2.8e-4, 2.9e-4, 1e-3, 2.8e-3, 2.9e-3, 1e-2, 0.1,
            0.2, 0.4, 1.0, 10.0, 100.0,
        ] {
            let vehicle = vehicle(&attitude, [0.0, rate, 0.0]);
            let lit = alone(&emulator, &vehicle, direction, 1e5);
            let truth = streak(&camera, at, f64::to_radians(rate), 1e5);
            let peak = truth.iter().copied().fold(0.0, f64::max);
            let pairs = lit.expected_e.iter().zip(&truth);
            let miss = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{rate:e} deg/s: {miss:.1e} e- of {peak:.0}");
            let part = if most_e > 0.01 { 3e-5 } else { 0.0 };
            assert!(
                miss < most_e + part * peak,
                "{rate:e} deg/s: {miss} e- of {peak}"
            );
        }
    }
}

/// Motion below 1e-9 px is rounding and costs no more than rest. Reference: two points a star.
#[test]
fn tracks_near_rest_have_no_more_points_than_at_rest() {
    let camera = camera("optics.focal_length_mm = 5.0");
    let emulator = starry(camera, Fidelity::REFERENCE);
    let attitude = Attitude::towards(1.4, -0.1, 0.0);
    for rate in [1e-300, 1e-14, 1e-12, 1e-10, 1e-8] {
        let vehicle = vehicle(&attitude, [0.0, rate, 0.0]);
        let scene = emulator.scene(&emulator.camera(), &vehicle, 0, &emulator.choice);
        let view = scene.unwrap().view;
        let all = Choice {
            all: true,
            ..emulator.choice.clone()
        };
        let points = track_all(
            &view,
            &simulated(&view, emulator.fidelity(), &all),
            emulator.fidelity(),
        );
        let stars = view.candidates.len();
        assert!(
            stars > 5 && points <= 4 * stars,
            "{rate:e} deg/s: {points} of {stars} stars"
        );
    }
}

/// At 100 deg/s a body turns by 1 rad in 0.57 s; larger turns are refused with a message.
#[test]
fn turns_beyond_the_limit_are_refused() {
    for (exposure_s, shown) in [(0.5, true), (0.572, true), (0.574, false), (1e4, false)] {
        let mut camera = camera("");
        camera.exposure_s = exposure_s;
        let mut emulator = emulator(camera, Fidelity::REALTIME, |_| {});
        let exposed = emulator.expose(&vehicle(&Attitude::identity(), [60.0, 80.0, 0.0]), 0);
        assert_eq!(exposed.is_ok(), shown, "{exposure_s} s");
        match exposed {
            Ok(exposed) => check_numbers(&exposed, "100 deg/s"),
            Err(error) => assert!(error.to_string().contains("deg are shown"), "{error}"),
        }
    }
}

/// The observer: not in orbit; at an altitude of 830 km, looking across the orbit's plane, so that
/// the Earth is never in the field; half a million km away.
#[derive(Clone, Copy, Debug, PartialEq)]
enum From {
    Nowhere,
    Low,
    Deep,
}

/// The low orbit.
const LOW_M: f64 = 7.2e6;
const LOW_M_S: f64 = 7500.0;
/// So short that no star drifts in it, s.
const STILL_S: f64 = 1e-3;

/// Pixel error (a part of the brightest) from a low orbit. Velocities follow a parabola through
/// three instants (`effect::drift`), orbits do not. The error is a Gaussian's steepest slope, times
/// the parabola's error of a circular orbit's velocity: `v n^3 T^3 / (6 * 27^(1/2) / 2)` for T on
/// either side, and at most the whole change.
fn off_the_parabola(exposure_s: f64) -> f64 {
    let rate = LOW_M_S / LOW_M;
    let third = (rate * exposure_s / 2.0).powi(3) / (3.0 * 27f64.sqrt());
    let off_px = 2000.0 * LOW_M_S / 299_792_458.0 * third.min(2.0);
    off_px * (-0.5f64).exp() / 0.8
}

/// That observer, turning about +Y (deg/s).
fn observer(from: From, rate: f64) -> VehicleState {
    let attitude = Attitude::towards(1.4, -0.1, 0.0);
    let mut vehicle = match from {
        From::Nowhere => still(&attitude),
        From::Low => orbiter(&attitude, -Vector3::x() * LOW_M, Vector3::z() * LOW_M_S),
        From::Deep => orbiter(&attitude, -Vector3::x() * 5e8, Vector3::z() * 800.0),
    };
    vehicle.rates.y = rate.to_radians();
    vehicle
}

/// A geostationary object's elements, at [`noon`].
const STATIONARY: &str = "\
1 90001U 20001A   26060.50000000  .00000000  00000-0  00000-0 0  9992
2 90001   0.0100   0.0000 0000100   0.0000   0.0000  1.00273790    14
";

fn stationary() -> Vec<Object> {
    let set = skyloop::orbit::parse(STATIONARY, "stationary.tle");
    set.unwrap().objects
}

/// Its position at that time, m.
fn stationary_m() -> Vector3<f64> {
    stationary()[0].state(noon()).unwrap().position_m
}

/// That observer at another time, at rest.
fn still_at(vehicle: &VehicleState, off_s: f64) -> VehicleState {
    let mut still = vehicle.at(vehicle.epoch + skyloop::orbit::time::seconds(off_s));
    still.rates = Vector3::zeros();
    still
}

/// The mean light (e-/s) of an exposure: frames of [`STILL_S`] at rest along the motion, by
/// Simpson's rule. Steps of a twentieth of a pixel have an error of 3e-7 of the brightest pixel.
fn mean_of_stills(
    still_one: &mut Emulator,
    vehicle: &VehicleState,
    exposure_s: f64,
    path_px: f64,
) -> Vec<f64> {
    let steps = 2 * ((10.0 * path_px).ceil() as usize).max(1);
    let mut mean = vec![0.0; 64 * 64];
    for k in 0..=steps {
        let weight = simpson(k, steps) / steps as f64;
        let off_s = (k as f64 / steps as f64 - 0.5) * exposure_s;
        let exposed = still_one.expose(&still_at(vehicle, off_s), 0).unwrap();
        let pixels = mean.iter_mut().zip(expected(exposed));
        pixels.for_each(|(mean, e)| *mean += weight / STILL_S * e);
    }
    mean
}

/// Light is proportional to the exposure time, from 0 to hours, and nothing else depends on it.
/// Labelled electrons over time agree to 1e-12. Pixels match the mean of frames at rest. Tracks run
/// between the star's positions at rest when the shutter opens and closes; velocities are this path
/// over time. Cases: in orbit or not, at rest or turning.
///
/// `reference`: pixels agree to 1e-6 (f32) and 1e-6 of the brightest (the rule's sum).
/// `realtime`: to its tolerances, 1e-4 of a source's light (a quarter of it in the brightest
/// pixel), and an effect of 0.05 e-, all stars together.
#[test]
fn light_is_proportional_to_any_exposure_time() {
    let of = |exposure_s: f64, fidelity: Fidelity| {
        let mut camera = camera("");
        camera.exposure_s = exposure_s;
        starry(camera, fidelity)
    };
    let star = |exposed: &ExposedFrame| {
        let mut objects = exposed.label.objects.iter();
        objects.find(|o| o.id == "HIP 24925").unwrap().clone()
    };
    let mut still_one = of(STILL_S, Fidelity::REFERENCE);
    for (fidelity, part) in [(Fidelity::REALTIME, 4e-4), (Fidelity::REFERENCE, 1e-6)] {
        for exposure_s in [0.0, 1e-9, 1e-6, 1.0, 1e3, 1e4] {
            let mut emulator = of(exposure_s, fidelity);
            for (rate, observed_from) in [
                (0.0, From::Nowhere),
                (1e-12, From::Nowhere),
                (1e-4, From::Nowhere),
                (0.0, From::Deep),
                (1e-4, From::Deep),
                (0.0, From::Low),
                (1e-4, From::Low),
            ] {
                let what = format!("{exposure_s} s, {rate:e} deg/s, {observed_from:?}");
                let vehicle = observer(observed_from, rate);
                let exposed = emulator.expose(&vehicle, 0).unwrap();
                check_numbers(&exposed, &what);
                let mut at_rest =
                    |off_s: f64| star(&still_one.expose(&still_at(&vehicle, off_s), 0).unwrap());
                let (one, found) = (at_rest(0.0), star(&exposed));
                let light = found.electrons / one.electrons * STILL_S;
                let miss = (light - exposure_s).abs();
                assert!(miss <= 1e-12 * exposure_s, "{what}: {light}");
                // 1e-4 deg/s for 10^4 s are one degree, 35 px at 2,000 px per radian; aberration's
                // drift is at most 26 arcsec.
                let [dx, dy] = [found.x1_px - found.x0_px, found.y1_px - found.y0_px];
                let path_px = rate.to_radians() * exposure_s * 2000.0;
                assert!(dx.hypot(dy) < 1.001 * path_px + 0.26, "{what}: {dx} {dy}");

                // The ends of the track, except for what is skipped, a position to half a
                // nanosecond, and the neglected drift of aberration: the Earth's own acceleration,
                // 0.0061 m/s^2 at perihelion, and the second order (the Earth's v / c, 1e-4) of the
                // low orbit's 7.8 m/s^2.
                let left_px = (0.0061 + 7.8e-4) * exposure_s / 2.0 / 299_792_458.0 * 2000.0;
                let off_px = fidelity.skip_px + 1e-11 + left_px;
                for (end, part) in [
                    ([found.x0_px, found.y0_px], -0.5),
                    ([found.x1_px, found.y1_px], 0.5),
                ] {
                    let expected = at_rest(part * exposure_s);
                    let miss = (end[0] - expected.x_px).hypot(end[1] - expected.y_px);
                    assert!(miss < off_px, "{what}: {miss:e} px");
                }
                let [vx, vy] = [found.vx_px_s, found.vy_px_s];
                assert!(vx.abs() < 1.0 && vy.abs() < 1.0, "{what}");
                // In the second around the middle a star moves uniformly; rates of a longer
                // exposure are means.
                let around = exposure_s.clamp(1.0, 1e4);
                let [from, to] = [-0.5, 0.5].map(|part| at_rest(part * around));
                let [to_x, to_y] = [to.x_px - from.x_px, to.y_px - from.y_px];
                let miss = (vx - to_x / around).hypot(vy - to_y / around);
                let bound = 2.0 * off_px / exposure_s + 1e-9;
                assert!(exposure_s == 0.0 || miss < bound, "{what}: {miss:e} px/s");

                let pixels = expected(exposed);
                if exposure_s == 0.0 {
                    assert!(pixels.iter().all(|e| *e == 0.0));
                    continue;
                }
                let truth = mean_of_stills(&mut still_one, &vehicle, exposure_s, path_px + 0.26);
                let brightest = truth.iter().copied().fold(0.0, f64::max);
                // Ends of streaks have the slope of the Gaussian.
                let part = part + left_px / (0.8 * TAU.sqrt());
                let part = match observed_from {
                    From::Low => part + off_the_parabola(exposure_s),
                    _ => part,
                };
                let of_bound = pixels.iter().zip(&truth).map(|(e, truth)| {
                    let bound = 1e-6 * truth + part * brightest + fidelity.skip_e / exposure_s;
                    (e / exposure_s - truth).abs() / bound
                });
                let of_bound = of_bound.fold(0.0, f64::max);
                println!("{what}: {of_bound:.2} of the bound");
                assert!(of_bound <= 1.0, "{what}: {of_bound} of the bound");
            }
        }
    }
}

/// 10^4 s of all light except stars: frames are finite, with and without noise, and the light is
/// that of one second times the duration. Reference: dark current `d t`; otherwise the frame of one
/// second, to the tolerances of `reference`: 8 times `area_e` and `area_part` of area light, and
/// 1e-6. The Earth's disc (51 px wide) moves by half a pixel meanwhile; its sum changes by less
/// than a five-hundredth. An object's brightness is that of mid-exposure.
#[test]
fn other_light_is_proportional_to_hours_of_exposure() {
    let attitude = Attitude::towards(1.4, -0.1, 0.0);
    let at_rest = still(&attitude);
    let exposed = |keys: &str, vehicle: &VehicleState, lights: &[&str], exposure_s: f64| {
        let mut camera = camera(keys);
        camera.exposure_s = exposure_s;
        let mut emulator = emulator(camera, Fidelity::REFERENCE, |config| {
            config.choice.off.retain(|name| !lights.contains(name));
            config.choice.off.retain(|name| *name != "shot noise");
            if lights.contains(&"rsos") {
                config.objects = stationary();
            }
        });
        for noise in [true, false] {
            emulator.choice.noise = noise;
            let exposed = emulator.expose(vehicle, 0).unwrap();
            check_numbers(&exposed, &format!("{lights:?} {exposure_s} s"));
            assert!(exposed.frame.dn.iter().all(|digit| *digit <= 60_100));
            if !noise {
                return exposed;
            }
        }
        unreachable!()
    };

    let dark = expected(exposed("detector.dark_e_s = 0.3", &at_rest, &[], 1e4));
    assert!(dark.iter().all(|e| (e / 3e3 - 1.0).abs() < 1e-6));

    let rolling = "timing.shutter = \"rolling\"; timing.row_us = 100.0";
    let area_e = 8.0 * Fidelity::REFERENCE.area_e;
    for (keys, lights, still_e) in [
        ("", &["zodiacal light", "starlight"][..], area_e),
        (rolling, &["stars"], 0.0),
    ] {
        let [one, hours] = [1.0, 1e4].map(|s| expected(exposed(keys, &at_rest, lights, s)));
        assert!(one.iter().sum::<f64>() > 1.0, "{lights:?}");
        let mut worst = 0.0_f64;
        for (one, hours) in one.iter().zip(&hours) {
            let bound = still_e + 9e-6 * one;
            worst = worst.max((hours / 1e4 - one).abs() / bound.max(f64::MIN_POSITIVE));
        }
        println!("{lights:?}: {worst:.2} of the bound");
        assert!(worst <= 1.0, "{lights:?}: {worst}");
    }

    let far = Vector3::new(5e8, 0.0, 0.0);
    let earth = orbiter(&towards(&-far), far, Vector3::y() * 10.0);
    let lights = [
        "earth",
        "limb",
        "earthshine",
        "moonglow",
        "zodiacal light",
        "starlight",
    ];
    let [one, hours] = [1.0, 1e4].map(|s| {
        expected(exposed("", &earth, &lights, s))
            .iter()
            .sum::<f64>()
    });
    println!("Earth: {:.1e}", hours / one / 1e4 - 1.0);
    assert!((hours / one / 1e4 - 1.0).abs() < 2e-3, "{one} {hours}");

    // 1,000 km over the ring.
    let position = stationary_m();
    let velocity = Vector3::z().cross(&position).normalize() * 3e3;
    let over = orbiter(&towards(&-position), position * (43.2 / 42.2), velocity);
    let frames = [1.0, 1e4].map(|s| exposed("", &over, &["rsos"], s));
    let [one, hours] = [0, 1].map(|i| frames[i].label.objects[0].electrons);
    assert!((hours / one / 1e4 - 1.0).abs() < 1e-12, "{hours}");
    let [_, exposed] = frames;
    let sum: f64 = expected(exposed).iter().sum();
    assert!(sum <= hours * (1.0 + 1e-6), "{sum}");
}

/// Reference: the contract; the ends are rounded to the nearest whole nanosecond.
#[test]
fn exposures_end_at_the_nearest_nanosecond() {
    for (duration_s, ns) in [
        (0.0, 0),
        (0.4e-9, 0),
        (1e-9, 1),
        (1.4e-9, 1),
        (3e-9, 2),
        (0.58, 290_000_000),
        (1e4, 5_000_000_000_000),
    ] {
        let exposure = Exposure::around(noon(), duration_s);
        let half = (exposure.end - exposure.mid).total_nanoseconds();
        assert_eq!(half, ns, "{duration_s}");
        assert_eq!(exposure.end - exposure.mid, exposure.mid - exposure.start);
        assert_eq!(exposure.duration_s, duration_s);
    }
    // An exposure across a leap second has its usual length.
    let mid = epoch("2016-12-31T23:59:60");
    let exposure = Exposure::around(mid, 2.0);
    let text = [exposure.start, exposure.end].map(skyloop::orbit::time::utc_text);
    assert_eq!(
        text,
        ["2016-12-31T23:59:59.000Z", "2017-01-01T00:00:00.000Z"]
    );
}

/// A non-finite exposure time is refused before any work.
#[test]
fn a_non_finite_exposure_time_is_refused() {
    for exposure_s in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0, -1e-9] {
        let mut emulator = emulator(camera(""), Fidelity::REALTIME, |_| {});
        emulator.camera_mut().exposure_s = exposure_s;
        for rate in [0.0, 1.0] {
            let refused = emulator.expose(&vehicle(&Attitude::identity(), [rate, 0.0, 0.0]), 0);
            let is_meant = matches!(refused, Err(Unobservable::Exposure { .. }));
            assert!(is_meant, "{exposure_s}");
        }
        let exposure = Exposure::around(noon(), exposure_s);
        assert!(exposure_s.is_finite() || exposure_s.is_infinite() || exposure.start == noon());
    }
}
