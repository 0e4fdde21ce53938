//! Bodies and apparent directions against independent libraries and physical laws.

use std::collections::HashMap;
use std::convert::Infallible;
use std::str::FromStr;

use crate::reference::{number, rows, vector};
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop::sky::apparent::{
    Corrections, Observer, Sight, StarMotion, StarPlace, catalogue_direction, object_direction,
};
use skyloop::sky::bodies::{AU_M, Bodies, LIGHT_M_S};
use skyloop_orbit::StateVector;

pub const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;
const MAS: f64 = ARCSEC / 1000.0;

pub fn tai(text: &str) -> Epoch {
    Epoch::from_str(&format!("{text} TAI")).unwrap()
}

/// Angle between two vectors, arcsec.
pub fn arcsec(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a.cross(&b).norm().atan2(a.dot(&b)) / ARCSEC
}

#[test]
fn bodies_agree_with_de440() {
    let (mut position_km, mut velocity_mm_s) = (0.0_f64, 0.0_f64);
    let (mut sun, mut apparent_sun) = (0.0_f64, 0.0_f64);
    for row in rows(include_str!("../reference/bodies.csv")) {
        let bodies = Bodies::at(tai(row[0])).unwrap();
        position_km = position_km.max((bodies.earth_barycentric_m / 1e3 - vector(&row, 1)).norm());
        velocity_mm_s = velocity_mm_s
            .max((bodies.earth_barycentric_velocity_m_s - vector(&row, 4) * 1e3).norm() * 1e3);
        sun = sun.max(arcsec(bodies.sun_geocentric_m, vector(&row, 7)));
        apparent_sun = apparent_sun.max(arcsec(bodies.sun_apparent_m(), vector(&row, 10)));
    }
    println!("Earth {position_km:.1} km {velocity_mm_s:.1} mm/s; Sun {sun:.3}\"");
    // DE440's barycentre includes the Kuiper belt and differs by some 100 km from that of the
    // series.
    assert!(position_km < 150.0 && velocity_mm_s < 6.0);
    assert!(sun < 0.02 && apparent_sun < 0.02);
}

#[test]
fn an_epoch_beyond_the_series_is_refused_by_name() {
    let error = Bodies::at(tai("2150-06-01T00:00:00")).unwrap_err();
    let error = error.to_string();
    assert!(
        error.contains("2150") && error.contains("1900 to 2100"),
        "{error}"
    );
    // Every time that the packets can carry (32 bits of seconds since 1958) is inside.
    let first = tai("1958-01-01T00:00:00");
    for s in [0, u32::MAX] {
        assert!(Bodies::at(first + Unit::Second * f64::from(s)).is_ok());
    }
}

fn observer(epoch: Epoch, position_m: Vector3<f64>, velocity_m_s: Vector3<f64>) -> Observer {
    Observer {
        epoch,
        position_m,
        velocity_m_s,
        bodies: Bodies::at(epoch).unwrap(),
    }
}

pub fn at_the_earths_centre(epoch: Epoch) -> Observer {
    observer(epoch, Vector3::zeros(), Vector3::zeros())
}

/// The observer of a row: epoch, position and velocity in the columns from 1 on.
pub fn observer_of(row: &[&str]) -> Observer {
    observer(tai(row[1]), vector(row, 2), vector(row, 5))
}

fn star_place(row: &[&str]) -> StarPlace {
    StarPlace {
        ra_rad: number(row, 1),
        dec_rad: number(row, 2),
        parallax_rad: number(row, 3) * MAS,
        pm_ra_cosdec_rad_yr: number(row, 4) * MAS,
        pm_dec_rad_yr: number(row, 5) * MAS,
    }
}

#[test]
fn stars_agree_with_two_libraries() {
    let observers = rows(include_str!("../reference/observers.csv"));
    let observers = observers.map(|row| (row[0], observer_of(&row)));
    let observers: HashMap<&str, Observer> = observers.collect();
    let before_light_bends = Corrections {
        deflection: false,
        aberration: false,
        ..Corrections::default()
    };
    let mut worst: HashMap<&str, (f64, String)> = HashMap::new();
    let mut compared = 0;
    for row in rows(include_str!("../reference/stars.csv")) {
        let source = row[7];
        let corrections = match source {
            "astrometric" => before_light_bends,
            _ => Corrections::default(),
        };
        let ours =
            Sight::of(&observers[row[6]], &corrections).of_star(&StarMotion::of(&star_place(&row)));
        let error = arcsec(ours, vector(&row, 8));
        let entry = worst.entry(source).or_default();
        if error > entry.0 {
            *entry = (error, format!("HIP {} by {}", row[0], row[6]));
        }
        compared += 1;
    }
    println!("{compared} directions, worst (arcsec): {worst:?}");
    assert!(compared > 2000 && worst.len() == 3);
    for (source, (error, which)) in worst {
        assert!(error < 0.002, "{source}: {error} arcsec, {which}");
    }
}

#[test]
fn each_correction_has_its_size_and_its_switch() {
    let observer = at_the_earths_centre(tai("2019-06-15T23:36:27"));
    // Groombridge 1830, Hipparcos-2: parallax 109.99 mas, proper motion 7.0 arcsec/yr.
    let star = StarPlace {
        ra_rad: 3.084_8,
        dec_rad: 0.658_2,
        parallax_rad: 109.99 * MAS,
        pm_ra_cosdec_rad_yr: 4003.98 * MAS,
        pm_dec_rad_yr: -5813.62 * MAS,
    };
    let none = Corrections::NONE;
    let seen = |c: &Corrections| Sight::of(&observer, c).of_star(&StarMotion::of(&star));
    let start = seen(&none);
    assert!(arcsec(start, catalogue_direction(&star)) < 1e-9);

    let (mut motion, mut parallax, mut aberration) = (none, none, none);
    motion.proper_motion = true;
    parallax.parallax = true;
    aberration.aberration = true;
    let across = |v: Vector3<f64>| start.cross(&v).norm();
    let aberrated = across(observer.barycentric_velocity_m_s()) / LIGHT_M_S / ARCSEC;
    for (correction, law, within) in [
        // 28.2 years of 7.059 arcsec.
        (motion, 28.205 * 7.059, 0.1),
        // Parallax times the baseline's component across the line of sight.
        (
            parallax,
            0.109_99 * across(observer.barycentric_m()) / AU_M,
            1e-6,
        ),
        // v/c times the sine of the angle, to first order.
        (aberration, aberrated, 0.002),
    ] {
        let moved = arcsec(seen(&correction), start);
        assert!(
            (moved - law).abs() < within,
            "{correction:?}: {moved} {law}"
        );
    }
    assert!(aberrated > 5.0);
}

#[test]
fn sunlight_bends_by_einsteins_law_and_stays_finite_behind_the_sun() {
    let observer = at_the_earths_centre(tai("2019-06-15T23:36:27"));
    let sun = observer.bodies.sun_geocentric_m;
    let (toward, distance) = (sun.normalize(), sun.norm());
    let side = toward.cross(&Vector3::z()).normalize();
    let bend = Corrections {
        deflection: true,
        ..Corrections::NONE
    };
    let mut last = 0.0;
    for elongation_deg in [
        0.0, 0.01, 0.05, 0.08, 0.1, 0.267, 1.0, 5.0, 45.0, 90.0, 150.0, 180.0_f64,
    ] {
        let angle = elongation_deg.to_radians();
        let u = toward * angle.cos() + side * angle.sin();
        let star = StarPlace {
            ra_rad: u.y.atan2(u.x),
            dec_rad: u.z.asin(),
            parallax_rad: 0.0,
            pm_ra_cosdec_rad_yr: 0.0,
            pm_dec_rad_yr: 0.0,
        };
        let seen = Sight::of(&observer, &bend).of_star(&StarMotion::of(&star));
        let shift = arcsec(seen, u);
        assert!(
            shift.is_finite() && shift < 6.0,
            "{elongation_deg}: {shift}"
        );
        if elongation_deg > 0.2 {
            // X-Val: 4.0719 mas * cot(elongation / 2) at 1 au (IERS Conventions 2010, chapter 11,
            // gamma = 1).
            let law = 4.0719e-3 * AU_M / distance / (angle / 2.0).tan();
            let miss = (shift - law).abs();
            assert!(miss < 2e-5, "{elongation_deg}: {shift} against {law}");
            assert!(shift < last || last == 0.0);
            last = shift;
            let is_away = seen.dot(&toward) <= u.dot(&toward) + 1e-15;
            assert!(is_away, "bent toward the Sun");
        }
    }
}

/// Two-body motion with the elements of a row of objects.csv, `dt` seconds after its epoch.
fn kepler(row: &[&str], dt: f64) -> StateVector {
    const GM: f64 = 3.986_004_418e14; // X-Val: objects.csv
    let [a, e, i, node, perigee, mean] = std::array::from_fn(|k| number(row, 8 + k));
    let n = (GM / a.powi(3)).sqrt();
    let anomaly = mean + n * dt;
    let mut big_e: f64 = anomaly;
    for _ in 0..50 {
        big_e -= (big_e - e * big_e.sin() - anomaly) / (1.0 - e * big_e.cos());
    }
    let b = a * (1.0 - e * e).sqrt();
    let rate = n / (1.0 - e * big_e.cos());
    let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), node)
        * nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), i)
        * nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), perigee);
    StateVector {
        position_m: turn * Vector3::new(a * (big_e.cos() - e), b * big_e.sin(), 0.0),
        velocity_m_s: turn * Vector3::new(-a * big_e.sin() * rate, b * big_e.cos() * rate, 0.0),
    }
}

#[test]
fn objects_agree_with_a_barycentric_library() {
    let (mut worst, mut compared) = ((0.0, String::new()), 0);
    for row in rows(include_str!("../reference/objects.csv")) {
        let observer = observer_of(&row);
        let since = |t: Epoch| (t - observer.epoch).to_seconds();
        let target = |t: Epoch| Ok::<_, Infallible>(kepler(&row, since(t)));
        let seen = object_direction(target, &observer, &Corrections::default()).unwrap();
        // Parallel unit vectors lose digits in skyfield next to 1 au: 2e-5 m in the range.
        let tolerance = 0.005 + 1e-4 / seen.range_m / ARCSEC;
        let error = arcsec(seen.direction, vector(&row, 14));
        let what = format!("{} at {}, {:.0} km", row[0], row[1], seen.range_m / 1e3);
        assert!(error < tolerance, "{what}: {error} arcsec");
        if error > worst.0 {
            worst = (error, what);
        }
        assert!((seen.range_m - number(&row, 17)).abs() < 1e-3);
        // Geocentric against barycentric time in flight: first order of the Earth's velocity over
        // c.
        let light_time_s = (seen.seen_at_m - observer.position_m).norm() / LIGHT_M_S;
        assert!((light_time_s / number(&row, 18) - 1.0).abs() < 2e-4);
        compared += 1;
    }
    println!("{compared} directions, worst (arcsec) {worst:?}");
    assert!(compared >= 140);
}

#[test]
fn light_time_and_aberration_cancel_for_neighbours_in_step() {
    // Two satellites in uniform motion side by side: both are at rest in their own frame.
    let epoch = tai("2024-11-05T03:12:45");
    let velocity_m_s = Vector3::new(0.0, 7_500.0, 0.0);
    let observer = observer(epoch, Vector3::new(7e6, 0.0, 0.0), velocity_m_s);
    let separation = Vector3::new(3e4, 2e4, -1e4);
    let target = |t: Epoch| {
        let moved = velocity_m_s * (t - epoch).to_seconds();
        Ok::<_, Infallible>(StateVector {
            position_m: observer.position_m + separation + moved,
            velocity_m_s,
        })
    };
    let both = object_direction(target, &observer, &Corrections::default()).unwrap();
    let off = arcsec(both.direction, separation);
    assert!(off < 1e-4, "{off}: more than the second order of v/c");
    let one = Corrections {
        light_time: false,
        ..Corrections::default()
    };
    let half = object_direction(target, &observer, &one).unwrap();
    let off = arcsec(half.direction, separation);
    assert!(off > 2.0, "{off}: each alone is seconds of arc");
    assert_eq!(half.seen_at_m, half.state.position_m);
    assert_eq!(both.range_rate_m_s, 0.0);

    let plain = object_direction(target, &observer, &Corrections::NONE).unwrap();
    assert_eq!(plain.direction, separation.normalize());
}

#[test]
fn an_object_at_the_observer_has_no_direction() {
    let state = StateVector {
        position_m: Vector3::new(7e6, 0.0, 0.0),
        velocity_m_s: Vector3::zeros(),
    };
    let epoch = tai("2024-11-05T03:12:45");
    let observer = observer(epoch, state.position_m, state.velocity_m_s);
    let all = Corrections::default();
    let seen = object_direction(|_| Ok::<_, Infallible>(state), &observer, &all).unwrap();
    let (range, rate) = (seen.range_m, seen.range_rate_m_s);
    assert_eq!((seen.direction, range, rate), (Vector3::zeros(), 0.0, 0.0));
    let failed = object_direction(|_| Err("outside"), &observer, &all);
    assert_eq!(failed, Err("outside"));
}
