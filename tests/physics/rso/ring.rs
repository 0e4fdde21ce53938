//! Sides of cylinders and cones: closed forms, and their mirrored bands of light.

use super::facets::{SUN_RADIUS, glossy, lossless, made, unit};
use nalgebra::{Unit, Vector3};
use skyloop::sky::shape::{Ends, Lobe, Plate, Shape, Surface};
use std::f64::consts::PI;

const OPEN: Ends = Ends {
    base: false,
    top: false,
};

/// The side of a cylinder along +Z, diameter 2 m, length 5 m.
fn cylinder(surface: Surface) -> Shape {
    made(|shape| shape.cone(Vector3::z_axis(), [2.0, 2.0], 5.0, OPEN, surface))
}

fn direction(azimuth_deg: f64, elevation_deg: f64) -> Vector3<f64> {
    let (sin, cos) = elevation_deg.to_radians().sin_cos();
    let (y, x) = azimuth_deg.to_radians().sin_cos();
    Vector3::new(cos * x, cos * y, sin)
}

#[test]
fn a_diffuse_cylinder_is_the_closed_form() {
    let shape = cylinder(lossless(0.0, Lobe::Mirror));
    for (sun_deg, seen_deg, apart_deg) in
        [(0.0, 0.0, 0.0), (20.0, -50.0, 70.0), (-10.0, 5.0, 170.0)]
    {
        let (sun, seen) = (
            direction(15.0, sun_deg),
            direction(15.0 + apart_deg, seen_deg),
        );
        let got = shape.reflective_area(&sun, &seen, SUN_RADIUS);
        // By hand: r h / pi cos(e_s) cos(e_o) [(pi - d) cos d + sin d] / 2, d the difference of
        // azimuths.
        let d = f64::to_radians(apart_deg);
        let wanted = 5.0 / PI
            * f64::to_radians(sun_deg).cos()
            * f64::to_radians(seen_deg).cos()
            * ((PI - d) * d.cos() + d.sin())
            / 2.0;
        assert!((got - wanted).abs() < 1e-12, "{got} {wanted}");
    }
}

/// A mirror inverts the elevation against the axis and spreads the Sun around it, over a band as
/// high as the Sun's disc.
#[test]
fn a_mirror_cylinder_sends_a_band_around_its_axis() {
    let shape = cylinder(lossless(1.0, Lobe::Mirror));
    let sun_radius_deg = SUN_RADIUS.to_degrees();
    let sun_elevation = 25.0;
    let sun = direction(0.0, sun_elevation);
    for azimuth in [0.0, 40.0, 110.0, -165.0] {
        let light = |elevation: f64| {
            shape.reflective_area(&sun, &direction(azimuth, elevation), SUN_RADIUS)
        };
        assert!(light(-sun_elevation) > 0.0);
        for off in [-1.01, 1.01, 40.0] {
            let outside = light(-sun_elevation + off * sun_radius_deg);
            assert_eq!(outside, 0.0, "{azimuth}");
        }
        // Across the band: r h cos(e_s) cos(d / 2) / 2, by the area of normals between two azimuths
        // of the mirrored light.
        const STEPS: i32 = 400;
        let step = 2.2 * sun_radius_deg / f64::from(STEPS);
        let across = (0..STEPS).map(|i| {
            let elevation = -sun_elevation - 1.1 * sun_radius_deg + (f64::from(i) + 0.5) * step;
            light(elevation) * elevation.to_radians().cos() * step.to_radians()
        });
        let across: f64 = across.sum();
        let [elevation, half] = [sun_elevation, azimuth / 2.0].map(f64::to_radians);
        let wanted = 2.5 * elevation.cos() * half.cos();
        let is_met = (across / wanted - 1.0).abs() < 2e-3;
        assert!(is_met, "{azimuth}: {across} {wanted}");
    }
    // Opposite to the Sun's azimuth only grazing normals reflect light.
    let opposite = shape.reflective_area(&sun, &direction(0.0, 10.0), SUN_RADIUS);
    assert_eq!(opposite, 0.0);
}

/// A ring against the equivalent plates.
#[test]
fn a_cone_is_the_sum_of_its_plates() {
    let mut compared = 0;
    for (base_m, top_m, length_m) in [(2.0, 0.0, 3.0), (1.0, 3.0, 0.5), (2.0, 2.0, 4.0)] {
        for surface in [
            lossless(0.0, Lobe::Mirror),
            lossless(1.0, glossy(8.0)),
            lossless(1.0, glossy(90.0)),
            lossless(1.0, Lobe::Mirror),
        ] {
            let axis = unit(0.2, -0.5, 0.7);
            let ring = made(|shape| shape.cone(axis, [base_m, top_m], length_m, OPEN, surface));
            let mut plates = Shape::default();
            const PLATES: u32 = 40_000;
            let narrowing = 0.5 * (base_m - top_m);
            let slant = f64::hypot(length_m, narrowing);
            let area_m2 = PI * 0.5 * (base_m + top_m) * slant / f64::from(PLATES);
            let across = Unit::new_normalize(axis.cross(&Vector3::x()));
            for i in 0..PLATES {
                let turn = 2.0 * PI * f64::from(i) / f64::from(PLATES);
                let out = nalgebra::Rotation3::from_axis_angle(&axis, turn) * across.into_inner();
                let normal = Unit::new_normalize(out * length_m + axis.into_inner() * narrowing);
                plates.plate(Plate::new(area_m2, normal), surface);
            }
            let suns = [[1.0, 0.1, 0.0], [0.2, -0.5, 0.7], [-0.5, 0.3, -0.6]];
            for sun in suns.map(|[x, y, z]| unit(x, y, z)) {
                // Towards the mirror direction of one of the normals, and elsewhere.
                let towards = sun.into_inner() - axis.into_inner() * axis.dot(&sun);
                let out = towards.try_normalize(1e-9).unwrap_or(across.into_inner());
                let normal = (out * length_m + axis.into_inner() * narrowing).normalize();
                let mirrored = normal * (2.0 * normal.dot(&sun)) - sun.into_inner();
                let [aside, back] = [unit(0.3, 0.3, -0.9), -sun].map(Unit::into_inner);
                for seen in [mirrored, aside, -back, back] {
                    let got = ring.reflective_area(&sun, &seen, SUN_RADIUS);
                    let wanted = plates.reflective_area(&sun, &seen, SUN_RADIUS);
                    // A mirror's disc covers some fifty plates, and its edge falls between two of
                    // them.
                    let is_mirror = surface.lobe == Lobe::Mirror;
                    let share = if is_mirror { 2.5e-2 } else { 1e-4 };
                    let is_met = (got - wanted).abs() <= share * wanted.max(1e-3);
                    let what = format!("{base_m}, {top_m}, {surface:?}, {sun:?}, {seen:?}");
                    assert!(is_met, "{what}: {got} {wanted}");
                    compared += usize::from(wanted > 0.0);
                }
            }
        }
    }
    assert!(compared > 50, "{compared}");
}
