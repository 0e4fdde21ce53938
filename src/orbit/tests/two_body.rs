//! Two-body motion and J2 against closed forms.

use hifitime::Epoch;
use nalgebra::{Matrix3, Rotation3, Vector3};
use skyloop_orbit::StateVector;
use skyloop_orbit::frames::teme_to_gcrf;
use skyloop_orbit::two_body::{EARTH_J2, EARTH_MU, EARTH_RADIUS_M, propagate, propagate_j2};
use std::f64::consts::{PI, TAU};

/// An ellipse: semi-major axis (m), eccentricity, inclination (rad); node 1.1 rad, perigee 0.7 rad.
#[derive(Clone, Copy)]
struct Ellipse {
    a: f64,
    e: f64,
    i: f64,
}

const LOW: Ellipse = Ellipse {
    a: 6_878_000.0,
    e: 0.001,
    i: 1.7,
};
const MOLNIYA: Ellipse = Ellipse {
    a: 26_560_000.0,
    e: 0.74,
    i: 1.107,
};
const GEO: Ellipse = Ellipse {
    a: 42_164_000.0,
    e: 0.0003,
    i: 0.001,
};

impl Ellipse {
    /// n = sqrt(mu / a^3), rad/s
    fn mean_motion(self) -> f64 {
        (EARTH_MU / self.a.powi(3)).sqrt()
    }

    fn period(self) -> f64 {
        TAU / self.mean_motion()
    }

    /// Kepler's closed form at a mean anomaly (rad).
    fn state(self, mean_anomaly: f64) -> StateVector {
        // M = E - e sin E, by Newton's method
        let mut ecc = mean_anomaly;
        for _ in 0..50 {
            ecc -= (ecc - self.e * ecc.sin() - mean_anomaly) / (1.0 - self.e * ecc.cos());
        }
        let (sin, cos) = ecc.sin_cos();
        let b = self.a * (1.0 - self.e * self.e).sqrt();
        let rate = self.mean_motion() / (1.0 - self.e * cos);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 1.1)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), self.i)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), 0.7);
        StateVector {
            position_m: turn * Vector3::new(self.a * (cos - self.e), b * sin, 0.0),
            velocity_m_s: turn * Vector3::new(-self.a * rate * sin, b * rate * cos, 0.0),
        }
    }
}

fn distance(a: &StateVector, b: &StateVector) -> f64 {
    (a.position_m - b.position_m).norm()
}

#[test]
fn motion_without_j2_is_keplers_ellipse() {
    for (name, orbit, limit_m) in [
        ("low", LOW, 7e-4),
        ("Molniya", MOLNIYA, 0.06),
        ("GEO", GEO, 0.01),
    ] {
        for revolutions in [0.01, 0.37, 1.0, -1.0] {
            let dt = revolutions * orbit.period();
            let found = propagate(&orbit.state(0.3), dt, 0.0);
            let closed = orbit.state(0.3 + TAU * revolutions);
            let error = distance(&found, &closed);
            println!("{name}, {revolutions} revolutions: {error:.2e} m");
            assert!(error < limit_m, "{name}, {revolutions}: {error} m");
        }
    }
}

#[test]
fn j2_rotates_the_node_at_the_secular_rate() {
    // d(node)/dt = -(3/2) n J2 (Re / p)^2 cos i   (Vallado, 4th edition, eq. 9-41)
    let p = LOW.a * (1.0 - LOW.e * LOW.e);
    let rate = -1.5 * LOW.mean_motion() * EARTH_J2 * (EARTH_RADIUS_M / p).powi(2) * LOW.i.cos();
    let start = LOW.state(0.3);
    let node = |s: &StateVector| {
        let h = s.position_m.cross(&s.velocity_m_s);
        h.x.atan2(-h.y)
    };
    let dt = 15.0 * LOW.period();
    let drift = (node(&propagate_j2(&start, dt)) - node(&start) + PI).rem_euclid(TAU) - PI;
    println!("node: {:.4} of the secular drift", drift / (rate * dt));
    // The node's short-period amplitude is at most 0.6 % of its drift in fifteen revolutions.
    assert!((drift / (rate * dt) - 1.0).abs() < 0.01);
}

#[test]
fn propagation_forward_and_back_gives_the_start() {
    let start = MOLNIYA.state(2.0);
    let back = propagate_j2(&propagate_j2(&start, 7000.0), -7000.0);
    assert!(distance(&start, &back) < 0.01);
    assert_eq!(propagate_j2(&start, 0.0), start);
}

#[test]
fn the_error_of_the_pole_is_as_documented() {
    let pole: Matrix3<f64> = teme_to_gcrf(Epoch::from_gregorian_utc_at_midnight(2025, 1, 1));
    for (dt, limit_m) in [(60.0, 0.12), (LOW.period(), 310.0)] {
        let worst = (0..12)
            .map(|k| {
                let start = LOW.state(f64::from(k) * PI / 6.0);
                let of_date = propagate_j2(&start.rotated(&pole.transpose()), dt).rotated(&pole);
                distance(&of_date, &propagate_j2(&start, dt))
            })
            .fold(0.0, f64::max);
        println!("pole of date after {dt:.0} s: at most {worst:.2e} m");
        assert!(worst < limit_m);
    }
}

#[test]
fn any_state_and_interval_terminates() {
    let at = |x: f64| StateVector {
        position_m: Vector3::new(x, 0.0, 0.0),
        velocity_m_s: Vector3::new(0.0, 1.0, 0.0),
    };
    for x in [0.0, 1.0, 1e30, f64::NAN] {
        for dt in [-1e3, f64::INFINITY, f64::NAN] {
            let _ = propagate_j2(&at(x), dt);
        }
    }
}
