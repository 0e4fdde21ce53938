//! Published observed magnitudes of satellites of known size and material:
//! `tests/reference/satellites.csv`.

use super::facets::{SUN_RADIUS, lossless, made, one_plate};
use crate::reference::{number, rows};
use nalgebra::{Rotation3, Vector3};
use skyloop::sky::bodies::AU_M;
use skyloop::sky::photometry::magnitude;
use skyloop::sky::shape::{Lobe, Surface};

#[test]
fn published_magnitudes_are_met_within_one() {
    let mut met = 0;
    for row in rows(include_str!("../../reference/satellites.csv")) {
        let mirror = Surface {
            reflectance: number(&row, 3),
            ..lossless(1.0, Lobe::Mirror)
        };
        let sizes = row[2].split(" x ").map(|size| size.parse().unwrap());
        let shape = match (row[1], &sizes.collect::<Vec<f64>>()[..]) {
            ("sphere", [diameter_m]) => made(|shape| shape.sphere(*diameter_m, mirror)),
            ("plate", [width_m, height_m]) => one_plate(width_m * height_m, mirror),
            _ => panic!("{row:?}"),
        };
        // The plate mirrors the Sun to the observer: its normal, +Z, lies halfway.
        let half = number(&row, 5).to_radians() / 2.0;
        let turned =
            |angle: f64| Rotation3::from_axis_angle(&Vector3::y_axis(), angle) * Vector3::z();
        let area = shape.reflective_area(&turned(half), &turned(-half), SUN_RADIUS);
        let got = magnitude(area, AU_M, number(&row, 4) * 1e3);
        let published = number(&row, 6);
        let what = format!("{}: published {published}, here {got:.2}", row[0]);
        println!("{what}");
        assert!((got - published).abs() < 1.0, "{what}");
        met += 1;
    }
    assert!(met >= 2);
}
