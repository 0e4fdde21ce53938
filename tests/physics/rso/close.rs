//! Objects so near that their direction turns by a large angle within an exposure.

use crate::oem::oem;
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop::fidelity::Orbits;
use skyloop::orbit::time::parse_utc;
use skyloop::sky::apparent::{Corrections, Observer};
use skyloop::sky::bodies::Bodies;
use skyloop::sky::field::Field;
use skyloop::sky::photometry::Sphere;
use skyloop::sky::population::{Appearances, Population};

const POSITION_KM: Vector3<f64> = Vector3::new(7000.0, 0.0, 0.0);

/// An observer at rest at that position, at the beginning, middle and end of an exposure.
fn at_rest(mid: Epoch, exposure_s: f64) -> [Observer; 3] {
    [-0.5, 0.0, 0.5].map(|part| Observer {
        epoch: mid + Unit::Second * (part * exposure_s),
        position_m: POSITION_KM * 1e3,
        velocity_m_s: Vector3::zeros(),
        bodies: Bodies::at(mid).unwrap(),
    })
}

/// 14 km/s for 0.1 s, past an observer at rest: an object far behind at mid-exposure is in front of
/// the camera at its end.
#[test]
fn an_object_nearer_than_its_path_is_seen() {
    let mid = parse_utc("2026-03-01T12:00:00").unwrap();
    let velocity = Vector3::new(14.0, 0.0, 0.0);
    let shutter = at_rest(mid, 0.1);
    let corrections = Corrections {
        light_time: false,
        aberration: false,
        ..Corrections::default()
    };
    let angle = 10_f64.to_radians();
    // Metres behind the observer at mid-exposure, and aside; the path to the end is 700 m.
    for behind in [10.0, 300.0, 460.0, 600.0, 690.0, 20_000.0] {
        let seen = behind <= 600.0;
        let start = POSITION_KM + Vector3::new(-behind, 5.0, 0.0) * 1e-3;
        let objects = oem("PASSER", mid, |s| (start + velocity * s, velocity));
        let population = Population::new(objects, Sphere::default(), Appearances::new());
        let field = Field {
            axis: Vector3::x(),
            angle,
            sides: &[],
            shutter: &shutter,
            reach_m: f64::INFINITY,
        };
        let found = population.in_field(&field, &corrections, Orbits::Tracked);
        assert!(found.notices.is_empty(), "{:?}", found.notices);
        let objects = found.objects;
        // At the end of the exposure.
        let in_field = |line: Vector3<f64>| line.angle(&Vector3::x()) < angle;
        if seen {
            assert_eq!(objects.len(), 1, "{behind} m behind");
            assert!(in_field(objects[0].lines_m[2]), "{behind} m behind");
        } else {
            assert!(!objects.iter().any(|one| in_field(one.lines_m[2])));
        }
    }
}

/// 60 km/s, faster than escape from the Earth, as in the message of a fly-by: far outside the field
/// at the middle of a 16 s exposure, inside it at the end.
#[test]
fn an_object_faster_than_escape_is_seen_at_the_end() {
    let mid = parse_utc("2026-03-01T12:00:00").unwrap();
    let velocity = Vector3::new(0.0, 60.0, 0.0);
    let shutter = at_rest(mid, 16.0);
    let start = POSITION_KM + Vector3::new(2000.0, -700.0, 0.0);
    let population = |start: Vector3<f64>| {
        let objects = oem("FLY-BY", mid, |s| (start + velocity * s, velocity));
        Population::new(objects, Sphere::default(), Appearances::new())
    };
    let field = Field {
        axis: Vector3::x(),
        angle: 10_f64.to_radians(),
        sides: &[],
        shutter: &shutter,
        reach_m: f64::INFINITY,
    };
    let seen = |start| {
        let found = population(start).in_field(&field, &Corrections::default(), Orbits::Tracked);
        assert!(found.notices.is_empty(), "{:?}", found.notices);
        found.objects.len()
    };
    assert_eq!(seen(start), 1);
    assert_eq!(seen(start - velocity * 40.0), 0);
}
