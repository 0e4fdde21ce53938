//! Occultation by the Earth: its shadow on an object, and its body in front of one.
//!
//! The Earth is the WGS84 ellipsoid, its axis along the mean pole of date. Stretching space along
//! that axis by a/b makes it a sphere of radius a and preserves lines and tangents, so the rest is
//! geometry of a sphere. There is no atmosphere: it neither bends nor dims sunlight at the limb (in
//! reality it does over the lowest 20 km or so, some 5 s of a low orbit).

use hifitime::Epoch;
use nalgebra::Vector3;
use std::f64::consts::PI;

use super::constants::{SUN_RADIUS_M, tt_days_since_j2000};
use crate::attitude::angle_between;

/// Equatorial radius of the WGS84 ellipsoid, m.
pub const EARTH_RADIUS_M: f64 = 6_378_137.0;
/// Flattening of the WGS84 ellipsoid.
pub const EARTH_FLATTENING: f64 = 1.0 / 298.257_223_563;

const ARCSEC: f64 = PI / 648_000.0;
const DAYS_PER_CENTURY: f64 = 36_525.0;

/// The Earth's ellipsoid at one epoch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Earth {
    /// The Earth's axis, unit vector, GCRF.
    pole: Vector3<f64>,
}

/// The Earth's limb for one observer: in stretched space a circle around the direction of the
/// centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LimbCone {
    earth: Earth,
    /// From the observer, in stretched space, m.
    centre: Vector3<f64>,
    /// rad, in stretched space.
    pub radius: f64,
}

impl LimbCone {
    /// [`Earth::limb_angle`].
    pub fn angle(&self, direction: &Vector3<f64>) -> f64 {
        let line = self.earth.to_sphere(*direction);
        let across = line.cross(&self.centre).norm();
        libm::atan2(across, line.dot(&self.centre)) - self.radius
    }
}

impl Earth {
    /// The Earth at `t`, its axis along the mean pole of date.
    ///
    /// Nutation (9 arcsec) is omitted: it tilts the limb by at most 1 m. Omitting precession as
    /// well would cost 40 m in 2019 and 130 m in 2060.
    pub fn at(t: Epoch) -> Self {
        // X and Y of the pole, first terms of the polynomials of IAU 2006 (IERS Conventions 2010,
        // Eq. 5.16).
        let c = tt_days_since_j2000(t) / DAYS_PER_CENTURY;
        let x =
            (-0.016_617 + c * (2_004.191_898 + c * (-0.429_782_9 + c * -0.198_618_34))) * ARCSEC;
        let y = (-0.006_951 + c * (-0.025_896 + c * (-22.407_274_7 + c * 0.001_900_59))) * ARCSEC;
        Self {
            pole: Vector3::new(x, y, 1.0).normalize(),
        }
    }

    /// The Earth's axis: unit vector, GCRF.
    pub fn pole(&self) -> Vector3<f64> {
        self.pole
    }

    /// Stretches space along the axis by a/b: the ellipsoid becomes a sphere of the equatorial
    /// radius.
    pub(super) fn to_sphere(self, v: Vector3<f64>) -> Vector3<f64> {
        const STRETCH: f64 = 1.0 / (1.0 - EARTH_FLATTENING) - 1.0;
        v + self.pole * (STRETCH * v.dot(&self.pole))
    }

    /// The inverse of [`Earth::to_sphere`].
    pub(super) fn unstretched(self, v: Vector3<f64>) -> Vector3<f64> {
        v - self.pole * (EARTH_FLATTENING * v.dot(&self.pole))
    }

    /// Whether a point (GCRF, m) lies inside the ellipsoid.
    pub fn contains(&self, point_m: Vector3<f64>) -> bool {
        self.to_sphere(point_m).norm_squared() < EARTH_RADIUS_M * EARTH_RADIUS_M
    }

    /// Whether the Earth hides `target_m` from `observer_m` (both GCRF, m).
    ///
    /// Nothing is hidden from an observer inside the Earth, such as the fictitious one at its
    /// centre. A target inside the Earth is hidden from every observer outside.
    pub fn occults(&self, observer_m: Vector3<f64>, target_m: Vector3<f64>) -> bool {
        if self.contains(observer_m) {
            return false;
        }
        let observer = self.to_sphere(observer_m);
        let line = self.to_sphere(target_m) - observer;
        // The Earth hides the target if the line's nearest point lies before the target, or if the
        // target is inside.
        let before_target = -observer.dot(&line) < line.norm_squared();
        self.line_meets_sphere(observer, line) && (before_target || self.contains(target_m))
    }

    /// Whether the Earth hides an infinitely distant source in `direction` (unit vector), such as a
    /// star. Nothing is hidden from an observer inside the Earth.
    pub fn occults_direction(&self, observer_m: Vector3<f64>, direction: Vector3<f64>) -> bool {
        !self.contains(observer_m)
            && self.line_meets_sphere(self.to_sphere(observer_m), self.to_sphere(direction))
    }

    /// The first intersection of the line of sight from `observer_m` (GCRF, m) along `direction`
    /// (any length) with the ground, GCRF, m: exact to 1e-7 m near the Earth, to 1e-5 m from the
    /// Moon's distance. None without an intersection, and for an observer inside the Earth.
    pub fn meets(&self, observer_m: Vector3<f64>, direction: Vector3<f64>) -> Option<Vector3<f64>> {
        if self.contains(observer_m) {
            return None;
        }
        let start = self.to_sphere(observer_m);
        let line = self.to_sphere(direction);
        let along = line.norm();
        // Half the chord: R^2 minus the squared distance of the line from the centre, as a product
        // to preserve precision from afar.
        let miss = start.cross(&line).norm() / along;
        let inside = (EARTH_RADIUS_M - miss) * (EARTH_RADIUS_M + miss);
        let nearest = -start.dot(&line) / along;
        (inside > 0.0 && nearest > 0.0)
            .then(|| observer_m + direction * ((nearest - inside.sqrt()) / along))
    }

    /// The angle (rad) from the Earth's limb, for an observer at `observer_m` (GCRF, m), to a
    /// direction (any length): negative in front of the Earth; infinite for an observer inside it.
    /// The sign is exact; the magnitude has a relative error of the order of the flattening.
    pub fn limb_angle(&self, observer_m: Vector3<f64>, direction: &Vector3<f64>) -> f64 {
        let cone = self.limb_cone(observer_m);
        cone.map_or(f64::INFINITY, |cone| cone.angle(direction))
    }

    /// The Earth's limb for an observer at `observer_m` (GCRF, m); none from inside.
    pub(crate) fn limb_cone(&self, observer_m: Vector3<f64>) -> Option<LimbCone> {
        let centre = -self.to_sphere(observer_m);
        let sin = EARTH_RADIUS_M / centre.norm();
        (sin <= 1.0).then(|| LimbCone {
            earth: *self,
            centre,
            radius: libm::asin(sin),
        })
    }

    /// The upward normal of the ellipsoid at one of its points (GCRF, m), unit vector: the gradient
    /// of |S x|^2, `S` the stretch, is 2 S S x.
    pub fn normal(&self, point_m: Vector3<f64>) -> Vector3<f64> {
        self.to_sphere(self.to_sphere(point_m)).normalize()
    }

    /// Minimum and maximum angle (rad) from the direction of the Earth's centre to the outline of
    /// the Earth with a shell of `altitude_m`, which is not a circle, for an observer (GCRF, m).
    /// Both include a margin of 1e-5 rad. Pi for an observer inside.
    pub fn outline(&self, observer_m: Vector3<f64>, altitude_m: f64) -> [f64; 2] {
        const POINTS: usize = 360;
        const MARGIN: f64 = 1e-5;
        let observer = self.to_sphere(observer_m);
        let sin = (EARTH_RADIUS_M + altitude_m) / observer.norm();
        if sin >= 1.0 {
            return [PI; 2];
        }
        let axis = observer.normalize() * -1.0;
        let toward_centre = -observer_m.normalize();
        let cos = ((1.0 - sin) * (1.0 + sin)).sqrt();
        let (mut min, mut max) = (PI, 0.0f64);
        for k in 0..POINTS {
            let turn = 2.0 * PI * k as f64 / POINTS as f64;
            let edge = self.unstretched(axis * cos + self.across(axis, turn) * sin);
            let angle = angle_between(&edge, &toward_centre);
            (min, max) = (min.min(angle), max.max(angle));
        }
        [(min - MARGIN).max(0.0), (max + MARGIN).min(PI)]
    }

    /// The unit vector perpendicular to `axis` (unit vector) at the angle `turn` (rad) from the
    /// perpendicular that is nearest to the pole.
    pub(super) fn across(self, axis: Vector3<f64>, turn: f64) -> Vector3<f64> {
        // Within 26 deg of the pole another direction replaces it as the reference.
        let other = if self.pole.dot(&axis).abs() < 0.9 {
            self.pole
        } else {
            Vector3::x()
        };
        let first = (other - axis * axis.dot(&other)).normalize();
        let (sin, cos) = libm::sincos(turn);
        first * cos + axis.cross(&first) * sin
    }

    /// Whether the ray from `start` along `line`, both in stretched space, approaches the origin
    /// and passes within the Earth's radius of it.
    fn line_meets_sphere(self, start: Vector3<f64>, line: Vector3<f64>) -> bool {
        // Distance of a line from the origin: |start x line| / |line|.
        start.dot(&line) < 0.0
            && start.cross(&line).norm_squared()
                < EARTH_RADIUS_M * EARTH_RADIUS_M * line.norm_squared()
    }

    /// The part of the Sun's disc visible from `object_m` past the Earth: 1 in full light, 0 in the
    /// umbra and inside the Earth. `sun_m` is
    /// [`Bodies::sun_apparent_m`](super::bodies::Bodies::sun_apparent_m); both GCRF, m.
    ///
    /// The disc is uniform (no limb darkening). First and last contact are within 0.1 m of the
    /// tangents to both bodies. Between them the fraction is within 4e-5 of a ray-by-ray
    /// integration up to geostationary orbit, and within 0.003 from the tip of the umbra (1.38
    /// million km) outward, where the Earth's whole outline matters.
    pub fn illumination(&self, object_m: Vector3<f64>, sun_m: Vector3<f64>) -> f64 {
        let object = self.to_sphere(object_m);
        let distance = object.norm();
        if distance < EARTH_RADIUS_M {
            return 0.0;
        }
        let to_sun = self.to_sphere(sun_m - object_m);
        let sun_distance = to_sun.norm();
        let (toward_sun, toward_earth) = (to_sun / sun_distance, object / -distance);

        let separation = angle_between(&toward_sun, &toward_earth);
        let earth_radius = libm::asin(EARTH_RADIUS_M / distance);
        let sun_radius =
            libm::asin(self.stretched_sun_radius(toward_sun, toward_earth) / sun_distance);
        1.0 - covered_fraction(sun_radius, earth_radius, separation)
    }

    /// Radius of the Sun in stretched space, m, perpendicular to the line of sight and toward the
    /// Earth's centre.
    fn stretched_sun_radius(self, toward_sun: Vector3<f64>, toward_earth: Vector3<f64>) -> f64 {
        let across = toward_earth - toward_sun * toward_sun.dot(&toward_earth);
        // Support function of an ellipsoid S(ball): |S n| for the unit normal n. If the Sun is in
        // line with the Earth's centre, there is no such normal, and the radius is not stretched.
        across
            .try_normalize(1e-12)
            .map_or(SUN_RADIUS_M, |n| SUN_RADIUS_M * self.to_sphere(n).norm())
    }
}

/// The part of a small disc of angular radius `sun` (the Sun) covered by another of radius `earth`,
/// with centres `separation` apart; all rad.
///
/// The Earth's limb is approximated by the plane circle of radius tan(`earth`) that touches it next
/// to the Sun with the same curvature there: exact at contact, and accurate to the square of the
/// Sun's radius (2e-5) across it.
fn covered_fraction(sun: f64, earth: f64, separation: f64) -> f64 {
    // A limb of larger radius is a line across the Sun's disc, and would lose precision below.
    let radius = libm::tan(earth).min(1e6 * sun);
    let to_limb = separation - earth; // of the Sun's centre; negative inside the disc of the Earth
    if to_limb >= sun {
        return 0.0;
    }
    if to_limb <= -sun && radius >= sun {
        return 1.0;
    }
    let centres = (to_limb + radius).max(0.0);
    if centres + radius <= sun {
        return (radius / sun).powi(2); // annular: the Earth in front of the Sun
    }

    // Two circular segments on either side of the common chord. With d the centres' distance, the
    // chord lies
    //     x = (d^2 + s^2 - R^2) / 2 d
    // from the Sun's centre, where d^2 - R^2 = (d - R)(d + R) stays precise when R is large.
    let x = (to_limb * (centres + radius) + sun * sun) / (2.0 * centres);
    let half_chord = ((sun - x) * (sun + x)).max(0.0).sqrt();
    let area = segment(sun, half_chord, x) + segment(radius, half_chord, centres - x);
    (area / (PI * sun * sun)).clamp(0.0, 1.0)
}

/// Area of the segment that a chord cuts off a circle. The chord is `half_chord` long to each side
/// and `x` from the centre (negative: the segment is the larger part): R^2 (alpha - sin(alpha)
/// cos(alpha)), alpha the half angle of the chord at the centre.
fn segment(radius: f64, half_chord: f64, x: f64) -> f64 {
    radius * radius * libm::atan2(half_chord, x) - half_chord * x
}
