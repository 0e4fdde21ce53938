//! The Earth's shadow and the Earth as an obstacle, against independent calculations and physical
//! laws.

use std::str::FromStr;

use crate::reference::{number, rows, vector};
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::sky::bodies::{Bodies, SUN_RADIUS_M};
use skyloop::sky::shadow::{EARTH_FLATTENING, EARTH_RADIUS_M, Earth};

fn epoch(text: &str) -> Epoch {
    Epoch::from_str(text).unwrap()
}

fn earth() -> Earth {
    Earth::at(epoch("2019-06-15T23:35:50 UTC"))
}

/// A Sun at 1 au in the equator plane: `sun`, and unit vectors away from it and across it.
fn sun_in_equator() -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let pole = earth().pole();
    let toward = pole.cross(&Vector3::x()).normalize();
    (toward * 1.495_978_707e11, -toward, toward.cross(&pole))
}

/// The Earth at the epoch of a reference row.
fn earth_of(row: &[&str]) -> Earth {
    Earth::at(epoch(&format!("{} TAI", row[0])))
}

#[test]
fn the_partial_disc_agrees_with_rays_against_the_ellipsoid() {
    let (mut low, mut far, mut compared) = (0.0_f64, 0.0_f64, 0);
    for row in rows(include_str!("../reference/illumination.csv")) {
        let object = vector(&row, 1);
        let part = earth_of(&row).illumination(object, vector(&row, 4));
        let error = (part - number(&row, 7)).abs();
        let is_near = object.norm() < 1e8;
        let worst = if is_near { &mut low } else { &mut far };
        *worst = worst.max(error);
        compared += 1;
    }
    println!("{compared} places, worst {low:.1e} near, {far:.1e} beyond the Moon");
    assert!(compared >= 70);
    assert!(low < 1e-4 && far < 3e-3, "{low} {far}");
}

#[test]
fn lit_or_not_agrees_with_a_library_away_from_the_limb() {
    for row in rows(include_str!("../reference/sunlit.csv")) {
        let bodies = Bodies::at(epoch(&format!("{} TAI", row[0]))).unwrap();
        let part = earth_of(&row).illumination(vector(&row, 1), bodies.sun_apparent_m());
        assert_eq!(part, number(&row, 7), "{row:?}");
    }
}

#[test]
fn occultation_agrees_with_a_library_away_from_the_limb() {
    for row in rows(include_str!("../reference/behind.csv")) {
        let hidden = earth_of(&row).occults(vector(&row, 1), vector(&row, 4));
        assert_eq!(hidden, number(&row, 7) == 1.0, "{row:?}");
    }
}

#[test]
fn light_fades_without_steps_and_never_turns_back() {
    let (sun, away, across) = sun_in_equator();
    let pole = earth().pole();
    for height_m in [1.0, 1e3, 4e5, 2e6, 3.58e7, 4e8, 1.2e9, 1.5e9, 1e10] {
        for side in [across, pole, across + pole, across * 3.0 - pole] {
            let side = side.normalize();
            let distance = EARTH_RADIUS_M + height_m;
            // Around a circle from the sunlit side to the axis of the shadow.
            let steps = 4_000;
            let from = (EARTH_RADIUS_M / distance).asin() + 0.02;
            let mut last = 1.0;
            for k in 0..=steps {
                let angle = from * (1.0 - f64::from(k) / f64::from(steps));
                let object = (side * angle.sin() + away * angle.cos()) * distance;
                let part = earth().illumination(object, sun);
                assert!((0.0..=1.0).contains(&part));
                // The light neither grows inward nor steps.
                let is_even = part <= last + 1e-9 && last - part < 0.1;
                assert!(is_even, "at {height_m} m: {last} then {part}");
                last = part;
            }
        }
    }
}

/// The largest x in [a, b] for which `f` holds; it holds at a and not at b.
fn last_where(f: impl Fn(f64) -> bool, mut a: f64, mut b: f64) -> f64 {
    assert!(f(a) && !f(b));
    for _ in 0..60 {
        let middle = 0.5 * (a + b);
        if f(middle) { a = middle } else { b = middle }
    }
    a
}

#[test]
fn the_umbra_is_1_38_million_km_long() {
    let (sun, away, _) = sun_in_equator();
    let dark = |distance: f64| earth().illumination(away * distance, sun) == 0.0;
    let length = last_where(dark, 1e8, 3e9);
    // Similar triangles: R D / (R_sun - R) = 1.3841e9 m at 1 au for a sphere of the equatorial
    // radius. The ellipsoid's polar radius shortens it by up to b/a.
    let sphere = EARTH_RADIUS_M * sun.norm() / (SUN_RADIUS_M - EARTH_RADIUS_M);
    println!("umbra {:.4e} m, sphere {sphere:.4e} m", length);
    assert!(length <= sphere * 1.000_01 && length > sphere * (1.0 - 1.5 * EARTH_FLATTENING));
    // Beyond it the Earth is a dark spot on the Sun: R^2/R_sun^2 times (D + l)^2/l^2.
    let l = 3.0e9;
    let spot = (EARTH_RADIUS_M / SUN_RADIUS_M * (sun.norm() + l) / l).powi(2);
    let part = earth().illumination(away * l, sun);
    assert!((1.0 - part - spot).abs() < 0.005 * spot, "{part} {spot}");
}

#[test]
fn the_penumbra_is_as_wide_as_the_suns_disc() {
    let (sun, away, across) = sun_in_equator();
    let pole = earth().pole();
    for (distance, side) in [(6.778e6, across), (6.778e6, pole), (42.164e6, across)] {
        // Along the line perpendicular to the limb's tangent.
        let behind = (distance * distance - EARTH_RADIUS_M * EARTH_RADIUS_M).sqrt();
        let part = |offset: f64| earth().illumination(away * behind + side * offset, sun);
        let (a, b) = (0.9 * EARTH_RADIUS_M, 1.2 * EARTH_RADIUS_M);
        let umbra = last_where(|x| part(x) == 0.0, a, b);
        let light = last_where(|x| part(x) < 1.0, a, b);
        // Tangents to both sides of the Sun: width l 2 R_sun / D, with l from the limb: 21 km at
        // 400 km height.
        let law = behind * 2.0 * SUN_RADIUS_M / sun.norm();
        let (width, middle) = (light - umbra, 0.5 * (light + umbra));
        println!("penumbra {width:.0} m at {distance:.0} m");
        assert!((width - law).abs() < 0.003 * law, "{width} {law}");
        // The limb of the ellipsoid lies between the two tangents.
        let flattening = if side == pole { EARTH_FLATTENING } else { 0.0 };
        let limb = EARTH_RADIUS_M * (1.0 - flattening);
        assert!((middle - limb).abs() < 0.02 * law + 50.0, "{middle} {limb}");
    }
}

#[test]
fn contact_is_where_the_rays_to_the_suns_limb_touch_the_ellipsoid() {
    let earth = earth();
    let (sun, away, across) = sun_in_equator();
    for tilt in [0.0, 0.3, 0.8, 1.2, 1.5] {
        let side = across * f64::cos(tilt) + earth.pole() * f64::sin(tilt);
        let behind = 2.3e6;
        let position = |offset: f64| away * behind + side * offset;
        let (a, b) = (0.97 * EARTH_RADIUS_M, 1.2 * EARTH_RADIUS_M);
        let light = last_where(|x| earth.illumination(position(x), sun) < 1.0, a, b);
        // The point of the Sun's limb nearest to the Earth, tried all around; hidden means a
        // partial phase.
        let touches = |x: f64| {
            let to_sun = sun - position(x);
            let line = to_sun.normalize();
            // The limb of a sphere lies slightly outside the disc of the same radius.
            let disc = to_sun.norm() * (SUN_RADIUS_M / to_sun.norm()).asin().tan();
            let (u, v) = (line.cross(&side).normalize(), side - line * line.dot(&side));
            (0..500).any(|k| {
                let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 500.0).sin_cos();
                earth.occults(position(x), sun + (u * cos + v.normalize() * sin) * disc)
            })
        };
        let rays = last_where(touches, a, b);
        println!("tilt {tilt}: first contact {:.3} m apart", light - rays);
        assert!((light - rays).abs() < 0.5, "tilt {tilt}: {light} {rays}");
    }
}

#[test]
fn rcm_1_has_just_left_the_penumbra() {
    // X-Val: tangents to the ellipsoid about the true pole (pyerfa 2.0.1.5) and the apparent Sun
    // (JPL DE440), for RCM-1's states at 23:35:30 UTC of sets B and A. The Sun's lower limb clears
    // the Earth by 3.748 and 5.018 km, so all of the Sun is visible. On a sphere of the equatorial
    // radius it would be 5.8 and 4.5 km below.
    let t = epoch("2019-06-15T23:35:30 UTC");
    let (earth, sun) = (Earth::at(t), Bodies::at(t).unwrap().sun_apparent_m());
    for (state_km, clearance_km) in [
        ([-4430.936493, -262.035886, -5381.095637], 3.748),
        ([-4437.761118, -260.540264, -5375.555765], 5.018),
    ] {
        let object = Vector3::from(state_km) * 1e3;
        assert_eq!(earth.illumination(object, sun), 1.0);
        // Moved down along the Earth's radius, the limb touches after the clearance over the cosine
        // of its slant.
        let radius = object.norm();
        let lit = |drop: f64| earth.illumination(object * (1.0 - drop / radius), sun) == 1.0;
        let drop = last_where(lit, 0.0, 1e5);
        let slant = (EARTH_RADIUS_M / radius).acos().cos();
        println!("limb clears by {:.3} km", drop * slant / 1e3);
        assert!((drop * slant / 1e3 - clearance_km).abs() < 0.1, "{drop}");
    }
}

#[test]
fn occultation_of_stars_and_inside_the_earth_is_defined() {
    let earth = earth();
    let (_, away, across) = sun_in_equator();
    let observer = away * 7e6;
    // Behind, in front of, and next to the Earth.
    assert!(earth.occults(observer, away * -7e6));
    assert!(!earth.occults(observer, away * 8e6));
    assert!(!earth.occults(observer, away * 6.5e6));
    assert!(!earth.occults(observer, across * 4e7));
    // Inside the Earth: a target is hidden; an observer is not blocked.
    assert!(earth.occults(observer, away * 6.0e6));
    assert!(earth.occults(observer, Vector3::zeros()));
    assert!(!earth.occults(Vector3::zeros(), across * 4e7));
    assert!(!earth.occults_direction(Vector3::zeros(), across));
    assert!(!earth.occults(observer, observer));
    assert_eq!(earth.illumination(Vector3::zeros(), away * -1.5e11), 0.0);
    assert!(earth.contains(Vector3::zeros()) && !earth.contains(observer));

    // A star's direction disappears behind the limb at asin(a/r) from the Earth's centre, at a
    // smaller angle over the flattened pole.
    let limb = |side: Vector3<f64>| {
        let hidden = |angle: f64| {
            earth.occults_direction(observer, away * -angle.cos() + side * angle.sin())
        };
        last_where(hidden, 0.0, 2.0)
    };
    assert!((limb(across) - (EARTH_RADIUS_M / 7e6).asin()).abs() < 1e-9);
    // An ellipse from a point on its long axis: tan^2 = b^2 / (r^2 - a^2).
    let b = EARTH_RADIUS_M * (1.0 - EARTH_FLATTENING);
    let polar = (b / (7e6_f64.powi(2) - EARTH_RADIUS_M.powi(2)).sqrt()).atan();
    assert!((limb(earth.pole()) - polar).abs() < 1e-9);
}

#[test]
fn the_axis_is_the_pole_of_date() {
    // X-Val: pyerfa 2.0.1.5, third row of pnm06a: the true pole, nutation (some 9 arcsec) included.
    for (text, x, y) in [
        ("2019-06-15T23:36:27 TAI", 1.85771960e-3, -2.09728309e-5),
        ("2060-12-30T12:00:00 TAI", 5.91293213e-3, -2.32416740e-6),
    ] {
        let pole = Earth::at(epoch(text)).pole();
        let arcsec = (pole.x - x).hypot(pole.y - y) * 206_264.8;
        assert!(arcsec < 12.0, "{text}: {arcsec}");
    }
}
