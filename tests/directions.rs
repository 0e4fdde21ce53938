//! Directions of the Sun, the Moon, the Earth and the planets against an independent library.

mod reference;

use std::str::FromStr;

use hifitime::Epoch;
use nalgebra::Vector3;
use reference::{number, rows, vector};
use skyloop::sky::bodies::Bodies;
use skyloop::sky::{Corrections, Observer};

const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

fn observer(row: &[&str]) -> Observer {
    let epoch = Epoch::from_str(&format!("{} TAI", row[1])).unwrap();
    Observer {
        epoch,
        position_m: vector(row, 2),
        velocity_m_s: vector(row, 5),
        bodies: Bodies::at(epoch).unwrap(),
    }
}

/// Angle between two vectors, arcsec.
fn arcsec(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a.cross(&b).norm().atan2(a.dot(&b)) / ARCSEC
}

#[test]
fn sun_moon_and_earth_stand_where_de440_has_them() {
    let (mut worst, mut moon_km, mut compared) = ([0.0_f64; 3], 0.0_f64, 0);
    for row in rows(include_str!("reference/directions.csv")) {
        let observer = observer(&row);
        let all = Corrections::default();
        let seen = [
            observer.sun_m(&all),
            observer.moon_m(&all),
            observer.earth_m(&all),
        ];
        for (k, (ours, worst)) in seen.iter().zip(&mut worst).enumerate() {
            let theirs = vector(&row, 8 + 4 * k);
            assert_eq!(theirs.norm() == 0.0, *ours == Vector3::zeros());
            if theirs.norm() > 0.0 {
                *worst = worst.max(arcsec(*ours, theirs));
                compared += 1;
            }
        }
        moon_km = moon_km.max((seen[1].norm() - number(&row, 15)).abs() / 1e3);
    }
    println!("{compared} directions; Sun, Moon, Earth (arcsec): {worst:?}; Moon {moon_km:.1} km");
    assert_eq!(compared, 560);
    assert!(worst[0] < 0.02 && worst[1] < 10.0 && worst[2] < 0.02);
    // The library's light runs in the barycentric frame, in which the Earth moves up to 39 km meanwhile; ours in the Earth's.
    assert!(moon_km < 39.0 + 13.0);
}

/// Each correction has its size: without any the directions are geometric.
#[test]
fn corrections_move_the_moon_by_seconds_of_arc() {
    let rows: Vec<_> = rows(include_str!("reference/directions.csv")).collect();
    let observer = observer(rows.iter().find(|row| row[0] == "leo").unwrap());
    let none = Corrections::NONE;
    let plain = observer.moon_m(&none);
    assert_eq!(
        plain,
        observer.bodies.moon_geocentric_m - observer.position_m
    );
    assert_eq!(observer.earth_m(&none), -observer.position_m);

    let moved = |c: Corrections| arcsec(observer.moon_m(&c), plain);
    // 1.0 km/s for 1.3 s at 384,400 km: 0.6 to 0.8 arcsec.
    let light_time = moved(Corrections {
        light_time: true,
        ..none
    });
    assert!((0.5..0.9).contains(&light_time), "{light_time}");
    // v sin(angle) / c, at most 7.7 km/s: 5.3 arcsec.
    let aberration = moved(Corrections {
        aberration: true,
        ..none
    });
    let across = plain.normalize().cross(&observer.velocity_m_s).norm() / 299_792_458.0 / ARCSEC;
    assert!((aberration - across).abs() < 1e-3, "{aberration} {across}");
}
