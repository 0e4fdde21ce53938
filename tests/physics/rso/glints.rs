//! Attitudes, spins and glints during an exposure, up to the labels.

use super::facets::{from_z, glossy, lossless, made, one_plate, unit};
use hifitime::{Epoch, Unit as Time};
use nalgebra::{Unit, Vector3};
use skyloop::attitude::Attitude;
use skyloop::orbit::StateVector;
use skyloop::orbit::time::parse_utc;
use skyloop::sky::Corrections;
use skyloop::sky::apparent::{ApparentObject, Observer};
use skyloop::sky::bodies::{AU_M, Bodies, SUN_RADIUS_M};
use skyloop::sky::body_attitude::BodyAttitude;
use skyloop::sky::look::{Body, Passage};
use skyloop::sky::photometry::{Sphere, diffuse_phase, magnitude};
use skyloop::sky::population::{Appearance, Population, SeenObject};
use skyloop::sky::shadow::Earth;
use skyloop::sky::shape::{Lobe, Plate, Shape};
use std::f64::consts::PI;
use std::sync::Arc;

fn mid() -> Epoch {
    parse_utc("2026-03-01T12:00:00").unwrap()
}

/// An object at rest, with its sensor and the Sun in given directions, for an exposure.
struct Still {
    observers: [Observer; 3],
    seen: [ApparentObject; 3],
    sun_m: Vector3<f64>,
}

impl Still {
    fn new(exposure_s: f64, to_sun: Vector3<f64>, to_sensor: Vector3<f64>) -> Still {
        let position_m = Vector3::new(7e6, 0.0, 0.0);
        let bodies = Bodies::at(mid()).unwrap();
        let observer = |s: f64| Observer {
            epoch: mid() + Time::Second * s,
            position_m: position_m + to_sensor * 1e6,
            velocity_m_s: Vector3::zeros(),
            bodies,
        };
        let seen = ApparentObject {
            direction: -to_sensor,
            range_m: 1e6,
            range_rate_m_s: 0.0,
            state: StateVector {
                position_m,
                velocity_m_s: Vector3::zeros(),
            },
            seen_at_m: position_m,
        };
        Still {
            observers: [-0.5, 0.0, 0.5].map(|part| observer(part * exposure_s)),
            seen: [seen; 3],
            sun_m: position_m + to_sun * AU_M,
        }
    }

    fn mean(&self, shape: &Shape, attitude: BodyAttitude) -> f64 {
        let body = Body {
            shape: shape.clone(),
            attitude,
        };
        body.mean_reflective_area(&Passage {
            observers: &self.observers,
            seen: self.seen.each_ref(),
            sun_m: self.sun_m,
            light_time: false,
        })
    }
}

/// Rotation about ICRF +Y; at mid-exposure the plate's normal, the body's +Z, is along ICRF +Z.
fn spin(rate_deg_s: f64) -> BodyAttitude {
    BodyAttitude::Spin {
        epoch: mid(),
        attitude: Attitude::identity(),
        rates: Vector3::new(0.0, f64::to_radians(rate_deg_s), 0.0),
    }
}

#[test]
fn a_matt_plate_that_turns_once_gives_the_mean_over_the_turn() {
    let plate = one_plate(2.0, lossless(0.0, Lobe::Mirror));
    for phase_deg in [0.0, 50.0, 130.0] {
        let scene = Still::new(1.0, from_z(phase_deg), from_z(0.0));
        let got = scene.mean(&plate, spin(360.0));
        // By hand: the mean of max(cos a, 0) max(cos(a - p), 0) / pi over a is [(pi - p) cos p +
        // sin p] / (4 pi^2).
        let p = f64::to_radians(phase_deg);
        let wanted = 2.0 * ((PI - p) * p.cos() + p.sin()) / (4.0 * PI * PI);
        let is_met = (got / wanted - 1.0).abs() < 2e-3;
        assert!(is_met, "{phase_deg}: {got} {wanted}");
    }
}

#[test]
fn a_passing_glint_counts_for_its_duration() {
    let plate = one_plate(2.0, lossless(1.0, Lobe::Mirror));
    let scene = Still::new(0.5, from_z(40.0), from_z(-40.0));
    let inside = 2.0 * f64::to_radians(40.0).cos() / (PI * (SUN_RADIUS_M / AU_M).powi(2));
    for rate_deg_s in [2.0, 7.0, 40.0] {
        let got = scene.mean(&plate, spin(rate_deg_s));
        // The mirror direction sweeps the image of the Sun, 0.5331 deg across, at twice the plate's
        // rate.
        let lasts_s = 2.0 * (SUN_RADIUS_M / AU_M).asin().to_degrees() / (2.0 * rate_deg_s);
        let wanted = inside * lasts_s / 0.5;
        let is_met = (got / wanted - 1.0).abs() < 0.03;
        assert!(is_met, "{rate_deg_s}: {got} {wanted}");
    }
    // At rest the glint lasts for the whole exposure; one degree away there is none.
    let rest = BodyAttitude::Inertial(Attitude::identity());
    assert!((scene.mean(&plate, rest) / inside - 1.0).abs() < 1e-3);
    let off_glint = Still::new(0.5, from_z(40.0), from_z(-41.0));
    assert_eq!(off_glint.mean(&plate, rest), 0.0);
}

#[test]
fn a_spin_sets_the_attitude_at_each_time() {
    // A quarter of a turn after mid-exposure the plate faces +X.
    let plate = one_plate(1.0, lossless(0.0, Lobe::Mirror));
    let turned = BodyAttitude::Spin {
        epoch: mid() - Time::Second * 9.0,
        attitude: Attitude::identity(),
        rates: Vector3::new(0.0, f64::to_radians(10.0), 0.0),
    };
    let facing = Still::new(0.0, from_z(90.0), from_z(90.0));
    assert!((facing.mean(&plate, turned) - 1.0 / PI).abs() < 1e-9);
    let away = Still::new(0.0, from_z(-90.0), from_z(-90.0));
    assert_eq!(away.mean(&plate, turned), 0.0);
}

/// Object and observer on circular orbits: the observed properties of a body, or of the paper's
/// sphere.
fn seen(body: Option<Body>, range_km: f64) -> SeenObject {
    let position = Vector3::new(-5200.0, 4000.0, 3000.0);
    let velocity = Vector3::new(-4.0, -6.0, 1.0);
    let objects = crate::oem::oem("OBJECT", mid(), crate::oem::falling(position, velocity));
    let looks = body.map(|body| ("OBJECT".to_string(), Appearance::Body(Arc::new(body))));
    let population = Population::new(objects, Sphere::default(), looks.into_iter().collect());
    let bodies = Bodies::at(mid()).unwrap();
    let observer = |s: f64| Observer {
        epoch: mid() + Time::Second * s,
        position_m: (position + unit(-0.3, 0.5, 0.8).into_inner() * range_km + velocity * s) * 1e3,
        velocity_m_s: velocity * 1e3,
        bodies,
    };
    let shutter = [observer(-0.05), observer(0.0), observer(0.05)];
    let seen = population.see(0, &Earth::at(mid()), &shutter, &Corrections::default());
    seen.unwrap()
}

#[test]
fn magnitudes_follow_eq_9_with_range_and_phase() {
    for range_km in [50.0, 500.0] {
        let sphere = seen(None, range_km);
        let sun_m = Bodies::at(mid()).unwrap().sun_apparent_m();
        let to_sun_m = (sun_m - sphere.apparent.seen_at_m).norm();
        // X-Val: Eqs. (7) and (9) by hand for the paper's sphere: 0.2 * pi * 25 m^2 of diffuse
        // light; m_sun = -26.73.
        let area = 0.2 * PI * 25.0 * diffuse_phase(sphere.phase);
        let wanted = -26.73 - 2.5 * area.log10() + 5.0 * (to_sun_m / AU_M * range_km * 1e3).log10();
        assert!(
            (sphere.mag - wanted).abs() < 1e-3,
            "{} {wanted}",
            sphere.mag
        );
        // The same sphere as a shape.
        let mut matt = lossless(0.0, Lobe::Mirror);
        matt.reflectance = 0.2;
        let shape = made(|shape| shape.sphere(10.0, matt));
        let attitude = BodyAttitude::Nadir(Attitude::identity());
        let body = seen(Some(Body { shape, attitude }), range_km);
        assert!((body.mag - wanted).abs() < 1e-3);
        assert_eq!(body.phase, sphere.phase);
    }
}

/// A mirror that reflects the Sun to the observer: the magnitude follows from radiance alone.
#[test]
fn an_aimed_mirror_flashes_and_one_a_degree_off_is_dark() {
    let sphere = seen(None, 200.0);
    let sun_m = Bodies::at(mid()).unwrap().sun_apparent_m();
    let to_sun = (sun_m - sphere.apparent.seen_at_m).normalize();
    let to_observer = -sphere.apparent.direction;
    let normal = (to_sun + to_observer).normalize();
    let aimed = |normal: Vector3<f64>, lobe: Lobe| {
        let plate = Plate::new(1.5, Unit::new_normalize(normal));
        let shape = made(|shape| shape.plate(plate, lossless(1.0, lobe)));
        let attitude = BodyAttitude::Inertial(Attitude::identity());
        seen(Some(Body { shape, attitude }), 200.0).mag
    };
    // X-Val: the observer sees the Sun's radiance, the same at any distance, over the solid angle
    // of the plate: (A cos i / d^2) / (pi R^2 / a^2) of the Sun's light at 1 au. The Sun is 0.991
    // au away: 0.02 mag.
    let cos_i = normal.dot(&to_sun);
    let share = 1.5 * cos_i / 200e3f64.powi(2) / (PI * (SUN_RADIUS_M / AU_M).powi(2));
    let wanted = -26.73 - 2.5 * share.log10();
    let flash = aimed(normal, Lobe::Mirror);
    assert!((flash - wanted).abs() < 1e-3, "{flash} {wanted}");
    assert!(flash < -9.0);
    let across = normal.cross(&to_sun).normalize();
    assert_eq!(aimed(normal + across * 0.01, Lobe::Mirror), f64::INFINITY);
    // A glossy plate spreads the same light.
    let glossy = aimed(normal, glossy(5.0));
    assert!(glossy > flash + 4.0 && glossy.is_finite(), "{glossy}");
    // Eq. (9) with the shape's reflective area.
    let area = share * 200e3f64.powi(2);
    assert!((magnitude(area, AU_M, 200e3) - wanted).abs() < 1e-9);
}
