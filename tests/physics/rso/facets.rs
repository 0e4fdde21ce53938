//! Light of facets: total amount and directions, by laws that hold for all of them.

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

/// A lossless surface with this lobe; the fraction `specular` of its light is mirrored.
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
pub fn from_z(deg: f64) -> Vector3<f64> {
    let (sin, cos) = deg.to_radians().sin_cos();
    Vector3::new(sin, 0.0, cos)
}

pub fn made(add: impl FnOnce(&mut Shape)) -> Shape {
    let mut shape = Shape::default();
    add(&mut shape);
    shape
}

pub fn one_plate(area_m2: f64, surface: Surface) -> Shape {
    made(|shape| shape.plate(Plate::new(area_m2, Vector3::z_axis()), surface))
}

/// All light that a shape reflects, as an area (m^2): the integral of its reflective area over all
/// directions, in steps of a degree.
fn sent(shape: &Shape, to_sun: &Vector3<f64>) -> f64 {
    const RINGS: usize = 180;
    let mut sum = 0.0;
    for i in 0..RINGS {
        let theta = (i as f64 + 0.5) * PI / RINGS as f64;
        let around = 2 * RINGS;
        let solid_angle = theta.sin() * (PI / RINGS as f64) * (2.0 * PI / around as f64);
        for j in 0..around {
            let phi = (j as f64 + 0.5) * 2.0 * PI / around as f64;
            let (y, x) = phi.sin_cos();
            let to = Vector3::new(theta.sin() * x, theta.sin() * y, theta.cos());
            sum += shape.reflective_area(to_sun, &to, SUN_RADIUS) * solid_angle;
        }
    }
    sum
}

/// A closed convex shape; the light that it intercepts (m^2) is the area of its shadow.
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
        shape: |surface| made(|shape| shape.cuboid([1.0, 2.0, 3.0], surface)),
        shadow_m2: |s| 6.0 * s.x.abs() + 3.0 * s.y.abs() + 2.0 * s.z.abs(),
    },
    Solid {
        name: "cylinder",
        shape: |surface| made(|of| of.cone(Vector3::z_axis(), [1.0, 1.0], 3.0, BOTH, surface)),
        shadow_m2: |s| 3.0 * s.x.hypot(s.y) + PI / 4.0 * s.z.abs(),
    },
    Solid {
        name: "cone",
        shape: |surface| made(|of| of.cone(Vector3::z_axis(), [2.0, 0.0], 3.0, BOTH, surface)),
        // A side of 10,000 plates, and the base.
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
        shape: |surface| made(|shape| shape.sphere(2.0, surface)),
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
                let (name, bound) = (solid.name, 2e-3 * taken.max(1e-2));
                let is_all = (sent - taken).abs() < bound;
                assert!(
                    is_all,
                    "{name}, {sun:?}, {surface:?}: takes {taken}, sends {sent}"
                );
            }
        }
    }
}

/// A sphere of diameter 2 m as `bands` of plates, twice as many around, each with the area of its
/// part of the sphere.
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

/// The same sphere of rings: frusta between the sphere's circles of latitude.
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

/// The maximum relative error of `shape` against `phase_function`, with the Sun and the sensor on
/// all sides.
fn worst(shape: &Shape, phases_deg: &[f64], phase_function: impl Fn(f64) -> f64) -> f64 {
    let mut worst = 0.0f64;
    let suns = [[1.0, 0.0, 0.0], [0.2, 0.3, 0.9], [-0.4, 0.7, -0.1]];
    for sun in suns.map(|[x, y, z]| unit(x, y, z)) {
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

/// Reference: Eqs. (7) and (8), of a matt and of a mirroring sphere. The mirror's lobe covers
/// several facets. Beyond 180 deg minus its radius, parts of it would come from behind the horizon.
#[test]
fn faceted_spheres_converge_to_both_sphere_laws() {
    let (matt, shiny) = (lossless(0.0, Lobe::Mirror), lossless(1.0, glossy(40.0)));
    let phases = [0.0, 10.0, 45.0, 90.0, 120.0, 150.0];
    let mirror: fn(f64) -> f64 = |_| SPECULAR_PHASE;
    for (equation, surface, phases, phase_function) in [
        (7, matt, &phases[..], diffuse_phase as fn(f64) -> f64),
        (8, shiny, &phases[..5], mirror),
    ] {
        for make in [faceted, turned] {
            let of = |n| worst(&make(n, surface), phases, phase_function);
            let errors = [8, 16, 32, 64].map(of);
            println!("Eq. ({equation}): {errors:?}");
            // Facets of half the size: the error falls to about a quarter.
            let falls = errors.windows(2).all(|pair| pair[1] < 0.4 * pair[0]);
            assert!(falls && errors[3] < 4e-3, "Eq. ({equation}): {errors:?}");
        }
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
        // X-Val: the Sun's radius of 959.63 arcsec is 0.26656 deg. Full light over the image of its
        // disc, none next to it.
        for off in [0.0, 0.2, -0.265] {
            let got = plate.reflective_area(&sun, &from_z(-incidence_deg + off), SUN_RADIUS);
            let is_met = (got / wanted - 1.0).abs() < 1e-4;
            assert!(is_met, "{incidence_deg}, {off}: {got}");
        }
        for off in [0.268, -0.268, 5.0] {
            let outside = from_z(-incidence_deg + off);
            assert_eq!(plate.reflective_area(&sun, &outside, SUN_RADIUS), 0.0);
        }
    }
}

#[test]
fn a_glint_lies_where_the_mirror_law_says_and_moves_by_twice_the_plates_turn() {
    for turn_deg in [0.0, 3.0, -20.0] {
        let turned = Plate::new(1.0, Unit::new_normalize(from_z(turn_deg)));
        let plate = made(|shape| shape.plate(turned, lossless(1.0, glossy(2.0))));
        let brightest = (-9000..9000).map(|i| f64::from(i) * 0.01).max_by(|a, b| {
            let light = |deg: f64| plate.reflective_area(&from_z(30.0), &from_z(deg), SUN_RADIUS);
            light(*a).total_cmp(&light(*b))
        });
        let off = brightest.unwrap() - (2.0 * turn_deg - 30.0);
        assert!(off.abs() < 0.02, "{brightest:?}");
    }
}

#[test]
fn back_faces_are_dark() {
    let surface = lossless(0.5, glossy(30.0));
    let light = |shape: &Shape, sun_deg, seen_deg| {
        shape.reflective_area(&from_z(sun_deg), &from_z(seen_deg), SUN_RADIUS)
    };
    let plate = one_plate(1.0, surface);
    let bright = |sun_deg, seen_deg| light(&plate, sun_deg, seen_deg) > 0.0;
    assert!(bright(80.0, -80.0) && bright(0.0, 0.0));
    assert!(!bright(91.0, 0.0) && !bright(0.0, 91.0) && !bright(100.0, 100.0));
    let mut both = Plate::new(1.0, Vector3::z_axis());
    both.two_sided = true;
    let two_sided = made(|shape| shape.plate(both, surface));
    let (back, front) = (
        light(&two_sided, 150.0, 140.0),
        light(&two_sided, 30.0, 40.0),
    );
    assert!(back > 0.0 && (back - front).abs() < 1e-12 * front);
    assert_eq!(light(&two_sided, 150.0, 40.0), 0.0);
    // The back of a closed box adds nothing: from the front it is one plate.
    let cube = made(|shape| shape.cuboid([1.0; 3], surface));
    let ratio = light(&cube, 0.0, 6e-8) / light(&plate, 0.0, 6e-8);
    assert!((ratio - 1.0).abs() < 1e-6);
}

#[test]
fn a_panel_turns_about_its_axis_to_face_the_sun() {
    // Seen from the Sun: Lambert's law, the cosine squared over pi.
    let light = |normal: Unit<Vector3<f64>>, sun: Vector3<f64>| {
        let mut panel = Plate::new(1.0, normal);
        panel.hinge = Some(Vector3::y_axis());
        let panel = made(|shape| shape.plate(panel, lossless(0.0, Lobe::Mirror)));
        PI * panel.reflective_area(&sun, &sun, SUN_RADIUS)
    };
    for (what, normal, sun, wanted) in [
        ("around the axis", Vector3::x_axis(), from_z(0.0), 1.0),
        ("around the axis", Vector3::x_axis(), from_z(60.0), 1.0),
        ("around the axis", Vector3::x_axis(), from_z(135.0), 1.0),
        ("around the axis", Vector3::x_axis(), from_z(270.0), 1.0),
        // No rotation brings the normal nearer than this angle.
        (
            "30 deg off",
            Vector3::x_axis(),
            Vector3::new(0.0, 0.5, 0.75f64.sqrt()),
            0.75,
        ),
        (
            "on the axis no turn helps",
            Vector3::x_axis(),
            Vector3::y(),
            0.0,
        ),
        (
            "a normal keeps its lean",
            unit(1.0, 1.0, 0.0),
            from_z(10.0),
            0.5,
        ),
    ] {
        let found = light(normal, sun);
        assert!((found - wanted).abs() < 4e-12, "{what}, {sun}: {found}");
    }
}
