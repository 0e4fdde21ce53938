//! What facets send and where, by the laws that hold for any of them.

use nalgebra::{Unit, Vector3};
use skyloop::sky::bodies::{AU_M, SUN_RADIUS_M};
use skyloop::sky::photometry::{SPECULAR_PHASE, diffuse_phase};
use skyloop::sky::shape::{Ends, Lobe, Plate, Shape, Surface};
use std::f64::consts::PI;

/// The Sun's angular radius at 1 au, rad. X-Val: by hand, asin(695,700 km / 149,597,870.7 km).
pub const SUN_RADIUS: f64 = 4.650_484e-3;

pub const BOTH: Ends = Ends {
    base: true,
    top: true,
};

/// Lossless, of this lobe, `specular` of its light mirrored.
pub fn lossless(specular: f64, lobe: Lobe) -> Surface {
    Surface {
        reflectance: 1.0,
        diffuse: 1.0 - specular,
        specular,
        lobe,
    }
}

pub fn glossy(deg: f64) -> Lobe {
    Lobe::Smooth(deg.to_radians())
}

pub fn unit(x: f64, y: f64, z: f64) -> Unit<Vector3<f64>> {
    Unit::new_normalize(Vector3::new(x, y, z))
}

/// The unit vector at an angle (deg) from +Z towards +X.
fn from_z(deg: f64) -> Vector3<f64> {
    let (sin, cos) = deg.to_radians().sin_cos();
    Vector3::new(sin, 0.0, cos)
}

pub fn one_plate(area_m2: f64, surface: Surface) -> Shape {
    let mut shape = Shape::default();
    shape.plate(Plate::new(area_m2, Vector3::z_axis()), surface);
    shape
}

/// All light that a shape sends, as an area (m^2): the integral of its reflective area over all directions, in steps of a degree.
fn sent(shape: &Shape, to_sun: &Vector3<f64>) -> f64 {
    const RINGS: usize = 180;
    let mut sum = 0.0;
    for i in 0..RINGS {
        let theta = (i as f64 + 0.5) * PI / RINGS as f64;
        let around = 2 * RINGS;
        let solid_angle = theta.sin() * (PI / RINGS as f64) * (2.0 * PI / around as f64);
        for j in 0..around {
            let phi = (j as f64 + 0.5) * 2.0 * PI / around as f64;
            let to = Vector3::new(
                theta.sin() * phi.cos(),
                theta.sin() * phi.sin(),
                theta.cos(),
            );
            sum += shape.reflective_area(to_sun, &to, SUN_RADIUS) * solid_angle;
        }
    }
    sum
}

/// The area (m^2) of light that a closed convex shape takes: that of its shadow.
struct Solid {
    name: &'static str,
    shape: fn(Surface) -> Shape,
    shadow_m2: fn(&Vector3<f64>) -> f64,
}

const SOLIDS: &[Solid] = &[
    Solid {
        name: "plate",
        shape: |surface| one_plate(2.0, surface),
        shadow_m2: |s| 2.0 * s.z.max(0.0),
    },
    Solid {
        name: "box",
        shape: |surface| {
            let mut shape = Shape::default();
            shape.cuboid([1.0, 2.0, 3.0], surface);
            shape
        },
        shadow_m2: |s| 6.0 * s.x.abs() + 3.0 * s.y.abs() + 2.0 * s.z.abs(),
    },
    Solid {
        name: "cylinder",
        shape: |surface| {
            let mut shape = Shape::default();
            shape.cone(Vector3::z_axis(), [1.0, 1.0], 3.0, BOTH, surface);
            shape
        },
        shadow_m2: |s| 3.0 * s.x.hypot(s.y) + PI / 4.0 * s.z.abs(),
    },
    Solid {
        name: "cone",
        shape: |surface| {
            let mut shape = Shape::default();
            shape.cone(Vector3::z_axis(), [2.0, 0.0], 3.0, BOTH, surface);
            shape
        },
        // Sides of 10,000 plates, and the base.
        shadow_m2: |s| {
            let slant = 10f64.sqrt();
            let lit = (0..10_000).map(|i| {
                let (sin, cos) = (f64::from(i) * PI / 5000.0).sin_cos();
                Vector3::new(3.0 * cos, 3.0 * sin, 1.0).dot(s).max(0.0) / slant
            });
            PI * slant * lit.sum::<f64>() / 10_000.0 + PI * (-s.z).max(0.0)
        },
    },
    Solid {
        name: "sphere",
        shape: |surface| {
            let mut shape = Shape::default();
            shape.sphere(2.0, surface);
            shape
        },
        shadow_m2: |_| PI,
    },
];

#[test]
fn lossless_solids_return_all_the_light_they_take() {
    // Across, along and at an angle to the axes; grazing.
    let suns = [
        unit(1.0, 0.0, 0.0),
        unit(0.0, 0.0, 1.0),
        unit(0.3, -0.5, 0.6),
        unit(0.2, -0.97, 0.02),
    ];
    for solid in SOLIDS {
        for sun in suns {
            let taken = (solid.shadow_m2)(&sun);
            for surface in [
                lossless(0.0, Lobe::Mirror),
                lossless(1.0, glossy(20.0)),
                lossless(0.5, glossy(90.0)),
            ] {
                let sent = sent(&(solid.shape)(surface), &sun);
                assert!(
                    (sent - taken).abs() < 2e-3 * taken.max(1e-2),
                    "{}, {sun:?}, {surface:?}: takes {taken}, sends {sent}",
                    solid.name
                );
            }
        }
    }
}

/// A sphere of diameter 2 m as `bands` of plates, twice as many around, each as large as its part of the sphere.
fn faceted(bands: usize, surface: Surface) -> Shape {
    let mut shape = Shape::default();
    let edge = |i: usize| PI * i as f64 / bands as f64;
    for i in 0..bands {
        let area_m2 = (edge(i).cos() - edge(i + 1).cos()) * PI / bands as f64;
        let (sin, cos) = (0.5 * (edge(i) + edge(i + 1))).sin_cos();
        for j in 0..2 * bands {
            let phi = PI * (j as f64 + 0.5) / bands as f64;
            let normal = unit(sin * phi.cos(), sin * phi.sin(), cos);
            shape.plate(Plate::new(area_m2, normal), surface);
        }
    }
    shape
}

/// The same of rings: cones cut off where the sphere's circles of latitude are.
fn turned(bands: usize, surface: Surface) -> Shape {
    let mut shape = Shape::default();
    let open = Ends {
        base: false,
        top: false,
    };
    let edge = |i: usize| PI * i as f64 / bands as f64;
    for i in 0..bands {
        let [base, top] = [edge(i + 1), edge(i)];
        let diameters_m = [base, top].map(|theta| 2.0 * theta.sin());
        let length_m = top.cos() - base.cos();
        shape.cone(Vector3::z_axis(), diameters_m, length_m, open, surface);
    }
    shape
}

/// The greatest relative error of `shape` against `phase_function`, with the Sun and the sensor on all sides.
fn worst(shape: &Shape, phases_deg: &[f64], phase_function: impl Fn(f64) -> f64) -> f64 {
    let mut worst = 0.0f64;
    for sun in [
        unit(1.0, 0.0, 0.0),
        unit(0.2, 0.3, 0.9),
        unit(-0.4, 0.7, -0.1),
    ] {
        let across = Unit::new_normalize(sun.cross(&Vector3::new(0.1, -0.3, 0.5)));
        for &phase_deg in phases_deg {
            let phase = f64::to_radians(phase_deg);
            for side in 0..8 {
                let side = nalgebra::Rotation3::from_axis_angle(&sun, f64::from(side));
                let tilt = nalgebra::Rotation3::from_axis_angle(&(side * across), phase);
                let got = shape.reflective_area(&sun, &(tilt * sun.into_inner()), SUN_RADIUS);
                worst = worst.max((got / (PI * phase_function(phase)) - 1.0).abs());
            }
        }
    }
    worst
}

#[test]
fn a_faceted_sphere_converges_to_the_diffuse_one() {
    let matt = lossless(0.0, Lobe::Mirror);
    let phases = [0.0, 10.0, 45.0, 90.0, 120.0, 150.0];
    for make in [faceted, turned] {
        let errors = [8, 16, 32, 64].map(|n| worst(&make(n, matt), &phases, diffuse_phase));
        println!("Eq. (7): {errors:?}");
        // Halved facets, errors down to a quarter.
        for pair in errors.windows(2) {
            assert!(pair[1] < 0.4 * pair[0], "{errors:?}");
        }
        assert!(errors[3] < 4e-3, "{errors:?}");
    }
}

#[test]
fn a_faceted_sphere_converges_to_the_mirror_one() {
    // The lobe covers several facets; beyond 180 deg less its radius parts of it would come from behind the horizon.
    let phases = [0.0, 10.0, 45.0, 90.0, 120.0];
    for make in [faceted, turned] {
        let shiny = lossless(1.0, glossy(40.0));
        let errors = [8, 16, 32, 64].map(|n| worst(&make(n, shiny), &phases, |_| SPECULAR_PHASE));
        println!("Eq. (8): {errors:?}");
        for pair in errors.windows(2) {
            assert!(pair[1] < 0.4 * pair[0], "{errors:?}");
        }
        assert!(errors[3] < 4e-3, "{errors:?}");
    }
}

#[test]
fn a_glint_carries_the_flux_that_the_suns_solid_angle_demands() {
    let solid_angle = PI * (SUN_RADIUS_M / AU_M).powi(2);
    for (reflectance, incidence_deg) in [(1.0, 0.0), (0.7, 35.0), (1.0, 80.0)] {
        let surface = Surface {
            reflectance,
            ..lossless(1.0, Lobe::Mirror)
        };
        let plate = one_plate(3.0, surface);
        let sun = from_z(incidence_deg);
        let wanted = reflectance * 3.0 * incidence_deg.to_radians().cos() / solid_angle;
        // X-Val: the Sun's radius of 959.63 arcsec is 0.26656 deg. All over the image of its disc, and nothing beside it.
        for off in [0.0, 0.2, -0.265] {
            let got = plate.reflective_area(&sun, &from_z(-incidence_deg + off), SUN_RADIUS);
            assert!(
                (got / wanted - 1.0).abs() < 1e-4,
                "{incidence_deg}, {off}: {got}"
            );
        }
        for off in [0.268, -0.268, 5.0] {
            assert_eq!(
                plate.reflective_area(&sun, &from_z(-incidence_deg + off), SUN_RADIUS),
                0.0
            );
        }
    }
}

#[test]
fn a_glint_lies_where_the_mirror_law_says_and_moves_by_twice_the_plates_turn() {
    for turn_deg in [0.0, 3.0, -20.0] {
        let mut plate = Shape::default();
        let normal = Unit::new_normalize(from_z(turn_deg));
        plate.plate(Plate::new(1.0, normal), lossless(1.0, glossy(2.0)));
        let brightest = (-9000..9000).map(|i| f64::from(i) * 0.01).max_by(|a, b| {
            let light = |deg: f64| plate.reflective_area(&from_z(30.0), &from_z(deg), SUN_RADIUS);
            light(*a).total_cmp(&light(*b))
        });
        let expected = -30.0 + 2.0 * turn_deg;
        assert!(
            (brightest.unwrap() - expected).abs() < 0.02,
            "{brightest:?}"
        );
    }
}

#[test]
fn what_faces_away_is_dark() {
    let surface = lossless(0.5, glossy(30.0));
    let plate = one_plate(1.0, surface);
    let bright = |sun_deg, seen_deg| {
        plate.reflective_area(&from_z(sun_deg), &from_z(seen_deg), SUN_RADIUS) > 0.0
    };
    assert!(bright(80.0, -80.0) && bright(0.0, 0.0));
    assert!(!bright(91.0, 0.0) && !bright(0.0, 91.0) && !bright(100.0, 100.0));
    let mut two_sided = Shape::default();
    two_sided.plate(
        Plate {
            two_sided: true,
            ..Plate::new(1.0, Vector3::z_axis())
        },
        surface,
    );
    let back = two_sided.reflective_area(&from_z(150.0), &from_z(140.0), SUN_RADIUS);
    let front = two_sided.reflective_area(&from_z(30.0), &from_z(40.0), SUN_RADIUS);
    assert!(back > 0.0 && (back - front).abs() < 1e-12 * front);
    assert_eq!(
        two_sided.reflective_area(&from_z(150.0), &from_z(40.0), SUN_RADIUS),
        0.0
    );
    // The back of a closed box adds nothing: from the front it is one plate.
    let mut cube = Shape::default();
    cube.cuboid([1.0; 3], surface);
    let (sun, seen) = (from_z(0.0), from_z(1e-9));
    let ratio = cube.reflective_area(&sun, &seen, SUN_RADIUS)
        / plate.reflective_area(&sun, &seen, SUN_RADIUS);
    assert!((ratio - 1.0).abs() < 1e-6);
}

#[test]
fn a_diffuse_plate_follows_lambert() {
    let plate = one_plate(2.0, lossless(0.0, Lobe::Mirror));
    let got = plate.reflective_area(&from_z(60.0), &from_z(-60.0), SUN_RADIUS);
    // X-Val: by hand, 2 * 0.5 * 0.5 / pi.
    assert!((got - 0.5 / PI).abs() < 1e-12);
}

#[test]
fn a_panel_turns_about_its_axis_to_face_the_sun() {
    let surface = lossless(0.0, Lobe::Mirror);
    let panel = |normal: Unit<Vector3<f64>>| {
        let mut shape = Shape::default();
        shape.plate(
            Plate {
                hinge: Some(Vector3::y_axis()),
                ..Plate::new(1.0, normal)
            },
            surface,
        );
        shape
    };
    // Wherever the Sun is around the axis, the panel faces it.
    for deg in [0.0, 60.0, 135.0, 270.0] {
        let sun = from_z(deg);
        let facing = panel(Vector3::x_axis()).reflective_area(&sun, &sun, SUN_RADIUS);
        assert!((facing - 1.0 / PI).abs() < 1e-12, "{deg}");
    }
    // A Sun 30 deg off the plane across the axis is met at 30 deg, and at no less by any turn.
    let sun = unit(0.0, 0.5, 0.75f64.sqrt());
    let met = panel(Vector3::x_axis()).reflective_area(&sun, &sun, SUN_RADIUS);
    assert!((met - 0.75 / PI).abs() < 1e-12);
    // On the axis itself no turn helps.
    let along = Vector3::y();
    assert_eq!(
        panel(Vector3::x_axis()).reflective_area(&along, &along, SUN_RADIUS),
        0.0
    );
    // A panel whose normal leans towards the axis keeps its lean.
    let lean = panel(unit(1.0, 1.0, 0.0));
    let got = lean.reflective_area(&from_z(10.0), &from_z(10.0), SUN_RADIUS);
    assert!((got - 0.5 / PI).abs() < 1e-12);
}
