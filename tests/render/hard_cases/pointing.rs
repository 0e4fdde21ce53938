//! Poles, the wrap of right ascension, half turns, signs of quaternions, slerps near zero and near
//! half a turn, and ten million steps.

use super::stage::{alone, behind, camera, emulator, noon, square, starry, still, unit, vehicle};
use hifitime::Unit;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use skyloop::attitude::{Attitude, angle_between, degrees_of_turn};
use skyloop::fidelity::Fidelity;
use skyloop_firmware_sim::attitude_list::AttitudeList;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// The worst boresights for coordinates: poles, directions very near them, the wrap.
fn boresights() -> Vec<[f64; 2]> {
    let mut all = Vec::new();
    let pole = FRAC_PI_2;
    for dec in [pole, pole - 1e-9, 1.2, 0.0, 1e-9 - pole, -pole] {
        for ra in [0.0, 1e-12, TAU - 1e-12, PI, PI - 1e-12, -1e-300] {
            all.push([ra, dec]);
        }
    }
    all
}

/// A light placed behind a pixel is imaged on it, everywhere on the sky. Reference: the pixel
/// itself. 1e-9 px: 1e-16 of 2,000 px per radian, times the roundings.
#[test]
fn lights_at_poles_and_across_the_wrap_are_imaged_exactly() {
    let camera = camera("");
    let emulator = emulator(camera.clone(), Fidelity::REALTIME, |_| {});
    for [ra, dec] in boresights() {
        for roll in [0.0, PI, -3.0] {
            let attitude = Attitude::towards(ra, dec, roll);
            let off = attitude.rotate(&unit(ra, dec)) - Vector3::z();
            assert!(off.norm() < 1e-15, "{ra} {dec} {roll}");
            let pixel = [31.2, 10.7];
            let direction = behind(&camera, &attitude, pixel);
            let lit = alone(&emulator, &still(&attitude), direction, 1e4);
            let [x, y] = lit.scene.sources[0].centroid;
            let miss = (x - pixel[0]).hypot(y - pixel[1]);
            assert!(miss < 1e-9, "{ra} {dec} {roll}: {miss:e} px");
        }
    }
}

/// Labelled right ascension is from 0 to below 360, in the text too. Reference:
/// docs/explanation/labels.md.
#[test]
fn right_ascensions_are_below_a_whole_turn() {
    for (angle, degrees) in [
        (0.0, 0.0),
        (-0.0, 0.0),
        (-1e-300, 0.0),
        (-1e-17, 0.0),
        (PI, 180.0),
        (-FRAC_PI_2, 270.0),
    ] {
        assert_eq!(degrees_of_turn(angle), degrees, "{angle:e}");
    }
    assert!(degrees_of_turn(-1e-15) < 360.0);
    // A star a millionth of a degree on either side of the wrap: rounding to nine decimals never
    // gives a whole turn.
    let mut emulator = starry(camera("optics.focal_length_mm = 5.0"), Fidelity::REALTIME);
    let mut found = 0;
    for dec in [-1.2, -0.6, 0.0, 0.5, 1.0, 1.5] {
        let vehicle = still(&Attitude::towards(0.0, dec, 0.0));
        let label = emulator.expose(&vehicle, 0).unwrap().label;
        let ras: Vec<f64> = label.objects.iter().map(|o| o.ra_deg).collect();
        assert!(ras.iter().all(|ra| (0.0..360.0).contains(ra)));
        found += ras.iter().filter(|ra| **ra > 350.0).count();
        // The text of a label whose star is at that position.
        for (ra, text) in [
            (359.999_999_999_7, "\"ra_deg\":0.0,"),
            (359.999_999_999, "\"ra_deg\":359.999999999,"),
        ] {
            let mut label = label.clone();
            let objects = label.objects.iter_mut();
            objects.for_each(|object| object.ra_deg = ra);
            let is_listed = label.to_json().contains(text);
            assert!(label.objects.is_empty() || is_listed, "{ra}");
        }
    }
    assert!(found > 5, "{found}");
}

/// Near half a turn the scalar part is nearly zero, and the choice of the root matters. Reference:
/// the matrix of the conventions, `diag(1, -1, -1)` and the like, and rotating back.
#[test]
fn half_turns_and_signs_of_quaternions_give_the_same_rotation() {
    for axis in 0..3 {
        let mut q = [0.0; 4];
        q[axis] = 1.0;
        let mut expected = -Matrix3::identity();
        expected[(axis, axis)] = 1.0;
        for sign in [1.0, -1.0] {
            let attitude = Attitude::from_xyzw(q.map(|c| sign * c)).unwrap();
            assert_eq!(attitude.matrix(), expected);
        }
    }
    for q in [
        [0.1, -0.7, 0.5, 0.5],
        [0.0, 0.0, 1.0, 1e-17],
        [0.6, 0.0, -0.8, -1e-9],
    ] {
        let norm = q.iter().map(|c: &f64| c * c).sum::<f64>().sqrt();
        let q = q.map(|c| c / norm);
        let [one, other] = [q, q.map(|c| -c)].map(|q| Attitude::from_xyzw(q).unwrap());
        assert_eq!(one.matrix(), other.matrix());
        let back = one.then(&one.inverse()).matrix() - Matrix3::identity();
        assert!(back.norm() < 1e-15, "{q:?}");
        // The frames are the same to the last digit.
        let camera = square(256, "optics.focal_length_mm = 5.0");
        let mut emulator = starry(camera, Fidelity::REALTIME);
        let [a, b] =
            [&one, &other].map(|q| emulator.expose(&vehicle(q, [0.3, 0.2, -0.1]), 0).unwrap());
        assert_eq!(a.frame.dn, b.frame.dn);
        assert!(a.label.objects.len() > 3);
    }
}

/// Reference: the closed form, a turn about one axis by the fraction of the angle, in the shorter
/// direction. 4e-16 rad is a quaternion's last digit.
#[test]
fn slerps_near_zero_and_half_a_turn_are_turns() {
    let start = UnitQuaternion::from_euler_angles(0.3, -1.0, 2.0);
    let near_pi = [-1e-6, -1e-12, 0.0, 1e-9, 0.1].map(|off| PI + off);
    let others = [0.0, 1e-300, 1e-17, 1e-12, 1e-8, 1e-4, 1.0, 3.0, 6.25];
    for angle in near_pi.into_iter().chain(others) {
        let short = angle.min(TAU - angle);
        for axis in [Vector3::x(), Vector3::z(), Vector3::new(0.6, 0.0, -0.8)] {
            let end = UnitQuaternion::from_scaled_axis(axis * angle) * start;
            for sign in [1.0, -1.0] {
                let signed = UnitQuaternion::new_unchecked(Quaternion::from(end.coords * sign));
                let list = vec![(noon(), start), (noon() + Unit::Second * 10, signed)];
                let list = AttitudeList::new(list, "list").unwrap();
                let at = |s: i64| list.at(noon() + Unit::Second * s).unwrap();
                let near = |a: f64, b: f64, what: &str| {
                    assert!((a - b).abs() < 2e-15, "{angle:e} {what}: {a:e} {b:e}")
                };
                near(at(0).attitude.angle_to(&start), 0.0, "start");
                near(at(5).attitude.angle_to(&start), short / 2.0, "middle");
                near(at(10).attitude.angle_to(&end), 0.0, "end");
                near(10.0 * at(5).rates_rad_s.norm(), short, "rate");
                near(at(3).attitude.norm(), 1.0, "norm");
            }
        }
    }
}

/// Reference: `R(t) = exp(-[w x] t) R(0)` in one step. The body makes 1,986 turns: 1e-14 of them
/// are 1.2e-10 rad. The norm stays exact to its last digit.
#[test]
fn ten_million_steps_of_clock_and_attitude_do_not_drift() {
    const STEPS: i64 = 10_000_000;
    // 30 Hz, in whole nanoseconds.
    let step = Unit::Nanosecond * 33_333_333_i64;
    let start = vehicle(&Attitude::towards(0.4, 0.3, 0.2), [0.6, -1.2, 1.7]);
    let mut now = start.clone();
    for _ in 0..STEPS {
        now = now.at(now.epoch + step);
    }
    assert_eq!(
        now.epoch - start.epoch,
        Unit::Nanosecond * (33_333_333 * STEPS)
    );
    let squares = now.attitude.xyzw().map(|c| c * c);
    let norm = squares.iter().sum::<f64>().sqrt();
    assert!((norm - 1.0).abs() < 1e-15, "{norm:.17}");
    let apart = now.attitude.matrix() - start.at(now.epoch).attitude.matrix();
    println!("{STEPS} steps: {:.1e} rad", apart.norm());
    assert!(apart.norm() < 1.2e-10, "{:e}", apart.norm());
}

/// Reference: chords, 2 asin(|a - b| / 2), in exact numbers. An arc cosine gives 0, or 1.5e-8, for
/// all small angles.
#[test]
fn angles_between_directions_keep_their_digits() {
    for angle in [1e-100, 1e-17, 1e-12, 1e-9, 1e-5, 1.0, 3.0, PI - 1e-9, PI] {
        for (axis, scale) in [(Vector3::y(), 1.0), (Vector3::z(), 7e6)] {
            let turned = Vector3::x() * angle.cos() + axis * angle.sin();
            let found = angle_between(&(Vector3::x() * scale), &turned);
            let miss = (found - angle).abs();
            assert!(miss <= 4e-16 * angle, "{angle:e}: {found:e}");
        }
    }
    assert_eq!(angle_between(&Vector3::zeros(), &Vector3::x()), 0.0);
}
