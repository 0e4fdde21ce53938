//! Passes through a camera's field, against another program's brute force and by hand.

use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use skyloop::camera::Camera;
use skyloop::flight::Flight;
use skyloop::load::Folder;
use skyloop::orbit::elements::Elements;
use skyloop::orbit::time::{parse_utc, utc_text};
use skyloop::orbit::{Identity, Object, Orbit, StateVector, parse};
use skyloop::passes::{Pass, Passes, Search, passes};
use skyloop::scene::Hidden;
use skyloop::sky::bodies::Bodies;
use skyloop::sky::photometry::Sphere;
use skyloop::sky::population::Appearances;
use skyloop::sky::shadow::Earth;
use skyloop::sky::{Corrections, Population};
use skyloop_firmware_sim::profile::{Profile, orbit_of};
use std::f64::consts::PI;
use std::sync::Arc;

fn utc(text: &str) -> Epoch {
    parse_utc(text).unwrap()
}

fn camera() -> Camera {
    Camera::load("fai-nir", &Folder::current()).unwrap()
}

fn population(objects: Vec<Object>) -> Population {
    Population::new(objects, Sphere::default(), Appearances::new())
}

fn found(
    search: &Search,
    flight: &Flight,
    objects: Vec<Object>,
    corrections: &Corrections,
) -> Passes {
    let population = population(objects);
    let tick = |part: f64| assert!((0.0..=1.0).contains(&part));
    passes(search, flight, &camera(), &population, corrections, tick).unwrap()
}

#[test]
fn passes_match_another_programs_brute_force() {
    let loaded = parse(include_str!("../reference/passes.tle"), "passes.tle").unwrap();
    assert!(loaded.rejected.is_empty());
    let mut objects = loaded.objects;
    let observer = objects.remove(0);
    let from = utc("2026-11-22T00:00:00Z");
    // X-Val: Q and RATES of reference/passes.py.
    let q = nalgebra::Quaternion::new(0.76, 0.1, 0.6, -0.2);
    let flight = Flight {
        profile: Profile::Slew {
            start: from,
            attitude: UnitQuaternion::new_normalize(q),
            rates_rad_s: Vector3::new(0.02, -0.05, 0.03).map(f64::to_radians),
        },
        orbit: orbit_of(observer),
        target: None,
    };
    let search = Search {
        from,
        to: from + Unit::Second * 900.0,
        shortest_s: 0.05,
    };
    let ids: Vec<String> = objects.iter().map(|object| object.id.to_string()).collect();
    let found = found(&search, &flight, objects, &Corrections::default());
    assert!(found.unknown.is_empty());
    // X-Val: reference/passes.csv, one line a pass.
    let table = include_str!("../reference/passes.csv").lines().skip(1);
    let expected: Vec<Vec<&str>> = table.map(|line| line.split(',').collect()).collect();
    let number = |row: &[&str], k: usize| -> f64 { row[k].parse().unwrap() };
    assert_eq!(found.passes.len(), expected.len());
    let mut worst = [0.0f64; 6];
    for row in expected {
        let id = format!("NORAD {}", row[0]);
        let pass = found.passes.iter().find(|pass| ids[pass.index] == id);
        let pass = pass.unwrap_or_else(|| panic!("{id} is not found"));
        let after = |epoch: Epoch| (epoch - from).to_seconds();
        let px = |at: [f64; 2], k| (at[0] - number(&row, k)).hypot(at[1] - number(&row, k + 1));
        let errors = [
            (after(pass.entry.point.epoch) - number(&row, 1)).abs(),
            (after(pass.exit.point.epoch) - number(&row, 2)).abs(),
            px(pass.entry.position_px, 3).max(px(pass.exit.position_px, 5)),
            (pass.nearest.off_axis.to_degrees() - number(&row, 8)).abs(),
            (pass.closest.1 * 1e-3 - number(&row, 9)).abs(),
            (pass.nearest.point.mag - number(&row, 10)).abs(),
        ];
        for (worst, error) in worst.iter_mut().zip(errors) {
            *worst = worst.max(error);
        }
        // The minimum angle is flat: its instant is less well determined than its value.
        let off_s = after(pass.nearest.point.epoch) - number(&row, 7);
        assert!(off_s.abs() < 0.1, "{id}");
        assert!(!pass.in_field_at_start && !pass.in_field_at_end, "{id}");
    }
    println!("s, s, px, deg, km, mag: {worst:?}");
    // Entry and exit are bisected to 1 ms, in which no image here moves 0.05 px.
    for (worst, allowed) in worst.iter().zip([1e-3, 1e-3, 0.05, 1e-5, 1e-3, 1e-4]) {
        assert!(worst <= &allowed, "{worst} of {allowed}");
    }
}

/// An object on a straight line at constant speed: its states at both ends of ten minutes around
/// `mid`, m and m/s.
fn straight(mid: Epoch, position: Vector3<f64>, velocity: Vector3<f64>) -> Object {
    let line = |dt: f64| {
        let at = (position + velocity * dt) * 1e-3;
        let v = velocity * 1e-3;
        let utc = utc_text(mid + Unit::Second * dt);
        format!("{utc} {} {} {} {} {} {}\n", at.x, at.y, at.z, v.x, v.y, v.z)
    };
    let ends = [-300.0, 300.0].map(|dt| utc_text(mid + Unit::Second * dt));
    let text = format!(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\nMETA_START\nOBJECT_NAME = LINE\n\
         OBJECT_ID = LINE\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = {}\nSTOP_TIME = {}\n\
         INTERPOLATION = LINEAR\nINTERPOLATION_DEGREE = 1\nMETA_STOP\n{}{}",
        ends[0],
        ends[1],
        line(-300.0),
        line(300.0)
    );
    let loaded = parse(&text, "line.oem").unwrap();
    assert!(loaded.rejected.is_empty(), "{:?}", loaded.rejected);
    loaded.objects.into_iter().next().unwrap()
}

/// A vehicle at rest with its boresight along `z` and its columns along `x`.
fn at_rest(position_m: Vector3<f64>, z: Vector3<f64>, x: Vector3<f64>) -> Flight {
    let z = z.normalize();
    let x = (x - z * x.dot(&z)).normalize();
    let rows = [x, z.cross(&x), z].map(|axis| axis.transpose());
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&rows));
    Flight {
        profile: Profile::Hold(UnitQuaternion::from_rotation_matrix(&rotation)),
        orbit: Arc::new(move |_| {
            Ok(StateVector {
                position_m,
                velocity_m_s: Vector3::zeros(),
            })
        }),
        target: None,
    }
}

fn the_one(found: Passes) -> Pass {
    assert_eq!(found.passes.len(), 1);
    found.passes.into_iter().next().unwrap()
}

#[track_caller]
fn close(value: f64, expected: f64, within: f64) {
    let is_close = (value - expected).abs() <= within;
    assert!(is_close, "{value}, not {expected}");
}

/// An equinox: the Sun is in the plane of the equator.
struct Scene {
    mid: Epoch,
    sun: Vector3<f64>,
    /// Along the equator.
    across: Vector3<f64>,
}

fn scene() -> Scene {
    let mid = utc("2026-03-20T14:46:00Z");
    let sun = Bodies::at(mid).unwrap().sun_apparent_m().normalize();
    let across = Earth::at(mid).pole().cross(&sun).normalize();
    Scene { mid, sun, across }
}

impl Scene {
    fn search(&self, from_s: f64, to_s: f64) -> Search {
        Search {
            from: self.mid + Unit::Second * from_s,
            to: self.mid + Unit::Second * to_s,
            shortest_s: 0.05,
        }
    }

    /// Seconds from the middle.
    fn after(&self, epoch: Epoch) -> f64 {
        (epoch - self.mid).to_seconds()
    }

    /// 8,000 km from the Earth's centre, below the Sun; the camera points down.
    fn flight(&self) -> Flight {
        at_rest(self.sun * 8e6, -self.sun, self.across)
    }
}

/// The reason for missing states of the only such object.
fn unknown(found: &Passes) -> &str {
    assert_eq!(found.unknown.len(), 1);
    found.unknown.values().next().unwrap()
}

#[test]
fn a_straight_pass_matches_the_hand_calculation() {
    let scene = scene();
    // In front of the Earth, Sun behind the camera; 1000 km away, 7 km/s along the columns.
    let passed = |search: &Search| {
        let object = straight(scene.mid, scene.sun * 7e6, scene.across * 7e3);
        the_one(found(
            search,
            &scene.flight(),
            vec![object],
            &Corrections::NONE,
        ))
    };
    let pass = passed(&scene.search(-60.0, 60.0));
    let after = |epoch: Epoch| scene.after(epoch);
    // X-Val: by hand: f = 13.8 mm / 26 um = 530.769 px. The image is at 127.5 + 530.769 * 7 t /
    // 1000. It is at -0.5 and 255.5 for t = -+128 * 1000 / (530.769 * 7) = -+34.4513 s, and moves
    // 3.71538 px/s.
    close(after(pass.entry.point.epoch), -34.4513, 1.1e-3);
    close(after(pass.exit.point.epoch), 34.4513, 1.1e-3);
    close(pass.entry.position_px[0], -0.5, 5e-3);
    close(pass.exit.position_px[0], 255.5, 5e-3);
    close(pass.exit.position_px[1], 127.5, 1e-3);
    close(pass.rate_px_s, 3.71538, 1e-4);
    close(after(pass.nearest.point.epoch), 0.0, 2e-3);
    close(pass.nearest.off_axis, 0.0, 1e-5);
    close(pass.closest.1, 1e6, 1.0);
    // X-Val: by hand: phase 0, 1000 km, 10 m: 1.9631 at 1 au; the Sun is at 0.9962 au: 5
    // log10(0.9962) = -0.0083.
    let brightest = pass.brightest.unwrap();
    close(brightest.point.mag, 1.9548, 2e-3);
    close(after(brightest.point.epoch), 0.0, 1.0);
    // X-Val: by hand: 13.56 deg off axis the object is at 1000 / cos = 1028.7 km, 5 log10 = 0.0614.
    // Phase 13.56 deg: F = 2 / (3 pi^2) ((pi - 0.2367) cos 0.2367 + sin 0.2367) = 0.20654; against
    // 0.21221, -2.5 log10 = 0.0294.
    close(pass.entry.point.mag, 1.9548 + 0.0614 + 0.0294, 2e-3);
    assert_eq!(pass.lit.len(), 1);
    assert_eq!(pass.lit[0].hidden, None);
    assert!(!pass.in_field_at_start && !pass.in_field_at_end);

    // A search that begins and ends within the pass reports both.
    let pass = passed(&scene.search(-10.0, 12.5));
    assert!(pass.in_field_at_start && pass.in_field_at_end);
    close(after(pass.entry.point.epoch), -10.0, 1e-9);
    close(after(pass.exit.point.epoch), 12.5, 1e-9);
}

#[test]
fn an_occulted_pass_is_never_visible() {
    let scene = scene();
    let Scene { mid, sun, across } = scene;
    // Through the Earth's centre, across the line to the Sun: sunlit, and occulted all the time.
    let object = straight(mid, across * -9e6, sun * 7e3);
    let flight = at_rest(across * 8e6, -across, sun);
    let search = scene.search(-250.0, 250.0);
    let pass = the_one(found(&search, &flight, vec![object], &Corrections::NONE));
    assert!(pass.brightest.is_none());
    let hidden: Vec<_> = pass.lit.iter().map(|lit| lit.hidden).collect();
    assert_eq!(hidden, [Some(Hidden::ByEarth)]);
}

#[test]
fn light_ends_at_the_shadow_cone() {
    // The shadow has the equator's radius.
    let scene = scene();
    let Scene { mid, sun, across } = scene;
    // 8000 km behind the Earth's centre, 7 km/s inwards, 6341.2 km from the axis at mid.
    let object = straight(mid, sun * -8e6 + across * 6.3412e6, across * -7e3);
    let flight = at_rest(sun * -2.5e7 + across * 6.3412e6, sun, across);
    let search = scene.search(-60.0, 60.0);
    let pass = the_one(found(&search, &flight, vec![object], &Corrections::NONE));
    let hidden: Vec<_> = pass.lit.iter().map(|lit| lit.hidden).collect();
    assert_eq!(hidden, [None, Some(Hidden::InShadow)]);
    // X-Val: by hand: sin alpha = (695700 - 6378.1) / 149.02e6 = 0.0046257; the umbra's radius at
    // 8000 km is (6378.137 - 8000 sin alpha) / cos alpha = 6341.20 km: reached at mid. 100 m are
    // 0.014 s.
    close(scene.after(pass.lit[0].to), 0.0, 0.03);
    let brightest = pass.brightest.unwrap();
    assert!(brightest.point.epoch < mid && pass.exit.point.band_mag().is_none());
}

#[test]
fn an_object_without_a_state_is_reported() {
    let scene = scene();
    let object = |mid: Epoch| straight(mid, scene.sun * 7e6, scene.across * 7e3);
    let mut old = object(scene.mid - Unit::Day * 1.0);
    old.id = "OLD".into();
    let objects = vec![old, object(scene.mid)];
    let search = scene.search(-60.0, 60.0);
    let found = found(&search, &scene.flight(), objects, &Corrections::NONE);
    assert!(found.unknown.contains_key("OLD (LINE)"));
    assert!(unknown(&found).contains("outside its ephemeris"));
    assert_eq!(the_one(found).index, 1);
}

/// Corners are crossed in a short time. No pass longer than the limit is missed, at any step.
#[test]
fn passes_down_to_the_minimum_duration_are_found() {
    let scene = scene();
    let Scene {
        mid,
        sun,
        across: x,
    } = scene;
    let y = (-sun).cross(&x);
    // X-Val: by hand: a corner is 128 px from the detector's centre in both axes: 128 / 530.769 *
    // 1000 km = 241.159 km each.
    let corner = 128.0 / 530.769_23 * 1e6;
    for (seconds, at_s) in [(0.06, 3.21), (0.3, 4.999), (2.0, -17.3)] {
        // Along the diagonal across the corner; a chord of that length at 7 km/s is half its length
        // from the corner.
        let speed = 7e3;
        let depth = speed * seconds / 2.0;
        let out = (x + y) / 2f64.sqrt();
        let along = (x - y) / 2f64.sqrt();
        let position = sun * 7e6 + (x + y) * corner - out * depth;
        let object = straight(mid + Unit::Second * at_s, position, along * speed);
        let search = scene.search(-60.0, 60.0);
        let pass = the_one(found(
            &search,
            &scene.flight(),
            vec![object],
            &Corrections::NONE,
        ));
        let [entry, exit] = [pass.entry, pass.exit].map(|edge| scene.after(edge.point.epoch));
        close(exit - entry, seconds, 2.1e-3);
        close(entry + seconds / 2.0, at_s, 2e-3);
    }
}

/// An object is found within the interval of its states, whatever the start of the search.
#[test]
fn a_pass_ends_where_states_end() {
    let scene = scene();
    let Scene { mid, sun, across } = scene;
    // The path of `a_straight_pass_matches_the_hand_calculation`, with states for ten minutes
    // around a time: they end or begin within the pass.
    let pass_known_around = |after_s: f64, from_s: f64| {
        let position = sun * 7e6 + across * 7e3 * after_s;
        let object = straight(mid + Unit::Second * after_s, position, across * 7e3);
        let search = scene.search(from_s, 60.0);
        let found = found(&search, &scene.flight(), vec![object], &Corrections::NONE);
        assert!(unknown(&found).contains("outside its ephemeris"));
        the_one(found)
    };
    let after = |epoch: Epoch| scene.after(epoch);
    for from_s in [-60.0, -57.7, -53.3, -51.0] {
        let ended = pass_known_around(-283.7, from_s);
        close(after(ended.entry.point.epoch), -34.4513, 1.1e-3);
        close(after(ended.exit.point.epoch), 16.3, 2.1e-3);
        // X-Val: by hand: 127.5 + 530.769 * 7 * 16.3 / 1000 px.
        close(ended.exit.position_px[0], 188.061, 1e-2);
        assert!(!ended.in_field_at_end && ended.brightest.is_some());

        let begun = pass_known_around(306.2, from_s);
        close(after(begun.entry.point.epoch), 6.2, 2.1e-3);
        close(after(begun.exit.point.epoch), 34.4513, 1.1e-3);
        assert!(!begun.in_field_at_start);
    }
}

/// Invented elements: those of a line of `src/orbit/tests/data/synthetic_elements.txt` with these
/// values changed.
fn elements(eccentricity: f64, mean_motion: f64, drag: f64) -> Object {
    let degrees = f64::to_radians;
    let set = Elements {
        norad: 99_999,
        epoch: utc("2020-11-18T08:34:00Z"),
        inclination: degrees(12.604),
        node: degrees(24.9151),
        eccentricity,
        perigee: degrees(272.6404),
        mean_anomaly: degrees(282.2654),
        mean_motion,
        drag,
    };
    Object {
        id: "NORAD 99999".into(),
        names: Vec::new(),
        identity: Identity::default(),
        orbit: Orbit::Elements(set, Vec::new()),
    }
}

/// Ten seconds around `mid`, for an observer at rest `above_m` above the object's position at
/// `mid`, with its camera pointed at it.
fn ten_seconds(object: &Object, mid: Epoch, above_m: f64) -> Passes {
    let position = object.state(mid).unwrap().position_m;
    let up = position.normalize();
    let flight = at_rest(position + up * above_m, -up * above_m, Vector3::z());
    let search = Search {
        from: mid - Unit::Second * 5.0,
        to: mid + Unit::Second * 5.0,
        shortest_s: 0.05,
    };
    let objects = vec![object.clone()];
    found(&search, &flight, objects, &Corrections::default())
}

#[test]
fn decay_within_an_exposure_ends_the_pass_only() {
    // Invented: a perigee 160 km inside the Earth.
    let object = elements(0.08, 0.0682, 0.0);
    let epoch = object.sets().next().unwrap().epoch;
    let known = |s: f64| object.state(epoch + Unit::Second * s).is_ok();
    let [mut low, mut high] = [0.0, (1..6000).map(f64::from).find(|s| !known(*s)).unwrap()];
    while high - low > 1e-5 {
        let mid = (low + high) / 2.0;
        *(if known(mid) { &mut low } else { &mut high }) = mid;
    }
    for margin_s in [0.02, 0.7, 2.9] {
        let mid = epoch + Unit::Second * (low - margin_s);
        let found = ten_seconds(&object, mid, 1e6);
        assert!(unknown(&found).contains("decayed"));
        let pass = the_one(found);
        assert!(pass.in_field_at_start && !pass.in_field_at_end);
        close((pass.exit.point.epoch - mid).to_seconds(), margin_s, 2.1e-3);
    }
}

#[test]
fn only_times_with_states_are_searched() {
    use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
    // X-Val: PyPI sgp4 2.27: from the fifth day on error code 1, in every minute.
    let sunk = elements(0.0, 0.0682, 0.1);
    let epoch = sunk.sets().next().unwrap().epoch;
    let ephemeris = straight(epoch, Vector3::x() * 7e6, Vector3::y() * 7e3);
    let (start, _) = ephemeris.span().unwrap();
    for (object, days, most_steps) in [
        (&sunk, 20.0, 0),
        (&ephemeris, 2.0, 0),
        (&ephemeris, -40.0, 0),
        // Its ten minutes, and a step on either side.
        (&ephemeris, -15.0, 70),
    ] {
        let near = if days == 20.0 { epoch } else { start };
        let from = near + Unit::Day * days;
        let search = Search {
            from,
            to: from + Unit::Day * 30.0,
            shortest_s: 0.05,
        };
        let flight = at_rest(Vector3::x() * 5e7, -Vector3::x(), Vector3::z());
        let population = population(vec![object.clone()]);
        let steps = AtomicUsize::new(0);
        let tick = |_: f64| _ = steps.fetch_add(1, Relaxed);
        let none = &Corrections::NONE;
        let found = passes(&search, &flight, &camera(), &population, none, tick);
        assert_eq!(found.unwrap().unknown.len(), 1);
        let steps = steps.into_inner();
        let is_searched = steps > 0;
        assert!(
            steps <= most_steps && is_searched == (most_steps > 0),
            "{steps} steps"
        );
    }
}

/// X-Val: PyPI sgp4 2.27, error code 0: beyond 4e6 km after 177 days, at 0.3 km/s; after 140 days
/// 545,605 km away, at 0.8 km/s, and 1,535 km further 0.1 s later.
#[test]
fn diverged_sgp4_has_no_state() {
    let runaway = elements(0.024_079, 15.186_928_66 * PI / 720.0, -0.021_836);
    for (days, km) in [(177.0, 4.036e6), (140.0, 5.456e5)] {
        let mid = utc("2020-11-18T08:34:00Z") + Unit::Day * days;
        let place_m = runaway.state(mid).unwrap().position_m;
        close(place_m.norm() * 1e-3, km, km * 1e-3);
        let found = ten_seconds(&runaway, mid, -1e8);
        assert!(found.passes.is_empty());
        assert!(unknown(&found).contains("more than 4e6 km or 100 km/s"));
    }
}
