//! Directions in which an observer sees stars, objects in orbit, the Sun, the Moon and the Earth.
//!
//! All directions are unit vectors along the axes of the ICRF, *proper*: as measured by the moving
//! observer, with aberration.
//!
//! - Stars: space motion since J1991.25, parallax, deflection by the Sun, aberration; all
//!   barycentric.
//! - Objects in Earth orbit: light time and aberration, both geocentric. Observer and object share
//!   the Earth's motion, so the aberration is by the observer's velocity relative to the Earth. By
//!   the barycentric velocity, directions would be off by up to 20.5 arcsec.
//!
//! Omitted for stars, with the error: deflection by Jupiter (17 milliarcsec at its limb, 1 at 15
//! limb distances) and by the Earth (0.6 milliarcsec at its limb), and the change of proper motion
//! by radial velocity, which is not in the catalogue. That change is 1.2 milliarcsec/yr^2 for
//! Barnard's star (2.8 arcsec by 2060) and 0.15 for Groombridge 1830, and below 0.02 arcsec by 2060
//! for all but some tens of nearby stars.

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_orbit::StateVector;
use skyloop_orbit::time::seconds;

use super::bodies::{Aberration, Bodies, aberrate};
use super::constants::{AU_M, LIGHT_M_S, tt_days_since_j2000};

/// Epoch of the Hipparcos catalogue, J1991.25 = JD 2448349.0625, in days since J2000.0. The
/// catalogue uses TCB, this module TT: the difference of 7 s is 2 microarcsec of the fastest proper
/// motion.
const CATALOGUE_EPOCH_DAYS: f64 = 2_448_349.062_5 - 2_451_545.0;
const DAYS_PER_YEAR: f64 = 365.25;
/// Twice the Sun's gravitational parameter over c^2, m: its Schwarzschild radius.
/// GM = 1.327 124 4e20 m^3/s^2 (IAU 2015 Resolution B3).
const SUN_SCHWARZSCHILD_M: f64 = 2.0 * 1.327_124_4e20 / (LIGHT_M_S * LIGHT_M_S);
/// Minimum of the divisor `1 - cos(elongation)` in the deflection: that at 4.9 arcmin from the
/// Sun's centre, well within its disc (16 arcmin at 1 au).
const DEFLECTION_FLOOR: f64 = 1e-6;
/// Iterations for the light time: each reduces the error by a factor v/c, below 1e-4.
const LIGHT_TIME_STEPS: usize = 3;

/// Lagrange's parabola through the values at the start, middle and end of an interval, evaluated at
/// the fraction `part` of it (0: start, 1: end).
pub(crate) fn parabola([a, b, c]: &[Vector3<f64>; 3], part: f64) -> Vector3<f64> {
    a * ((2.0 * part - 1.0) * (part - 1.0))
        + b * (4.0 * part * (1.0 - part))
        + c * (part * (2.0 * part - 1.0))
}

/// A star's catalogue position: ICRS at J1991.25.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StarPlace {
    /// Right ascension, rad.
    pub ra_rad: f64,
    /// Declination, rad.
    pub dec_rad: f64,
    /// Annual parallax, rad. Negative measurements count as zero.
    pub parallax_rad: f64,
    /// Proper motion in right ascension times cos(declination), rad per Julian year.
    pub pm_ra_cosdec_rad_yr: f64,
    /// Proper motion in declination, rad per Julian year.
    pub pm_dec_rad_yr: f64,
}

/// The corrections to apply; all of them by default.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Corrections {
    /// Space motion from J1991.25 to the epoch (stars).
    pub proper_motion: bool,
    /// Parallax by the Earth's orbit and by the observer's orbit around the Earth (stars).
    pub parallax: bool,
    /// Deflection of light by the Sun (stars).
    pub deflection: bool,
    /// Aberration by the observer's velocity: barycentric for stars, geocentric for objects in
    /// orbit.
    pub aberration: bool,
    /// Light time (objects in orbit).
    pub light_time: bool,
}

impl Corrections {
    /// No correction: catalogue positions, geometric positions.
    pub const NONE: Self = Self {
        proper_motion: false,
        parallax: false,
        deflection: false,
        aberration: false,
        light_time: false,
    };
}

impl Default for Corrections {
    fn default() -> Self {
        Self {
            proper_motion: true,
            parallax: true,
            deflection: true,
            aberration: true,
            light_time: true,
        }
    }
}

/// A camera at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observer {
    /// The instant.
    pub epoch: Epoch,
    /// Geocentric position, GCRF, m.
    pub position_m: Vector3<f64>,
    /// Geocentric velocity, GCRF, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// The Earth, the Sun and the Moon at `epoch`, or at another instant of the same exposure.
    pub bodies: Bodies,
}

impl Observer {
    /// Barycentric position, m.
    pub fn barycentric_m(&self) -> Vector3<f64> {
        self.bodies.earth_barycentric_m + self.position_m
    }

    /// Barycentric velocity, m/s.
    pub fn barycentric_velocity_m_s(&self) -> Vector3<f64> {
        self.bodies.earth_barycentric_velocity_m_s + self.velocity_m_s
    }

    /// The apparent vector to the Sun's centre: direction times distance, m. The Sun moves 13 m/s,
    /// so its light time (0.01 arcsec) is omitted.
    pub fn sun_m(&self, corrections: &Corrections) -> Vector3<f64> {
        let line = self.bodies.sun_geocentric_m - self.position_m;
        self.seen(line, self.barycentric_velocity_m_s(), corrections)
    }

    /// The apparent vector to the Moon's centre, m. Light time and aberration are geocentric, as
    /// for objects in orbit.
    pub fn moon_m(&self, corrections: &Corrections) -> Vector3<f64> {
        let mut line = self.bodies.moon_geocentric_m - self.position_m;
        if corrections.light_time {
            // 1.3 s, in which the Moon moves 0.7 arcsec.
            line -= self.bodies.moon_geocentric_velocity_m_s * (line.norm() / LIGHT_M_S);
        }
        self.seen(line, self.velocity_m_s, corrections)
    }

    /// The apparent vector to the Earth's centre, m; zero for an observer at the centre.
    pub fn earth_m(&self, corrections: &Corrections) -> Vector3<f64> {
        self.seen(-self.position_m, self.velocity_m_s, corrections)
    }

    fn light_time_s(&self, from_m: &Vector3<f64>) -> f64 {
        (from_m - self.position_m).norm() / LIGHT_M_S
    }

    fn seen(
        &self,
        line: Vector3<f64>,
        velocity_m_s: Vector3<f64>,
        corrections: &Corrections,
    ) -> Vector3<f64> {
        let distance = line.norm();
        if !corrections.aberration || distance == 0.0 {
            return line;
        }
        aberrate(line / distance, velocity_m_s) * distance
    }
}

/// A star's position and motion at the catalogue's epoch, ICRS: the inputs of its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StarMotion {
    /// [`catalogue_direction`].
    pub direction: Vector3<f64>,
    /// The change of the direction by proper motion, rad per Julian year.
    pub motion: Vector3<f64>,
    /// Annual parallax, rad.
    pub parallax_rad: f64,
}

impl StarMotion {
    /// From a catalogue position: motion is `p mu_ra + q mu_dec`, where p and q point east and
    /// north.
    pub fn of(position: &StarPlace) -> StarMotion {
        let (sin_ra, cos_ra) = libm::sincos(position.ra_rad);
        let (sin_dec, cos_dec) = libm::sincos(position.dec_rad);
        let east = Vector3::new(-sin_ra, cos_ra, 0.0);
        let north = Vector3::new(-sin_dec * cos_ra, -sin_dec * sin_ra, cos_dec);
        StarMotion {
            direction: catalogue_direction(position),
            motion: east * position.pm_ra_cosdec_rad_yr + north * position.pm_dec_rad_yr,
            parallax_rad: position.parallax_rad,
        }
    }
}

/// The common terms of all stars' directions.
#[derive(Debug)]
pub struct Sight<'a> {
    corrections: &'a Corrections,
    /// Since the catalogue's epoch.
    days: f64,
    /// Barycentric position of the observer, m.
    position_m: Vector3<f64>,
    sun: Deflection,
    aberration: Aberration,
}

impl<'a> Sight<'a> {
    /// For `observer`.
    pub fn of(observer: &Observer, corrections: &'a Corrections) -> Sight<'a> {
        Sight {
            corrections,
            days: tt_days_since_j2000(observer.epoch) - CATALOGUE_EPOCH_DAYS,
            position_m: observer.barycentric_m(),
            sun: Deflection::at(observer.position_m - observer.bodies.sun_geocentric_m),
            aberration: Aberration::by(observer.barycentric_velocity_m_s()),
        }
    }

    /// The direction of a star: unit vector, axes of the ICRF. Within 2 milliarcsec of independent
    /// libraries for stars without radial velocity (see the head of this file).
    pub fn of_star(&self, star: &StarMotion) -> Vector3<f64> {
        // Uniform space motion and parallax, in units of the star's distance at the catalogue's
        // epoch (SOFA pmpx, without radial velocity):
        //     u = u0 + (p mu_ra + q mu_dec) (t - t0 + u0 . r / c) - parallax r / au
        // The term in c is the Roemer delay to the barycentre: 0.2 milliarcsec for Barnard's star.
        let mut u = star.direction;
        if self.corrections.proper_motion {
            let roemer_days = u.dot(&self.position_m) / LIGHT_M_S / 86_400.0;
            u += star.motion * ((self.days + roemer_days) / DAYS_PER_YEAR);
        }
        if self.corrections.parallax {
            u -= self.position_m * (star.parallax_rad.max(0.0) / AU_M);
        }
        u = u.normalize();

        if self.corrections.deflection {
            u = self.sun.of(u);
        }
        if self.corrections.aberration {
            u = self.aberration.of(u);
        }
        u
    }
}

/// The unit vector to a star's catalogue position, without any correction.
pub fn catalogue_direction(position: &StarPlace) -> Vector3<f64> {
    let (sin_ra, cos_ra) = libm::sincos(position.ra_rad);
    let (sin_dec, cos_dec) = libm::sincos(position.dec_rad);
    Vector3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec)
}

/// Deflection of light from distant sources by the Sun, away from it.
///
/// With e the unit vector from the Sun to the observer and r their distance,
///
/// ```text
/// u' = u + (2 GM / c^2 r) (e - (u . e) u) / (1 + u . e)
/// ```
///
/// (Explanatory Supplement to the Astronomical Almanac, 3rd ed., 2013, Eq. 7.63, for a source at
/// infinity): 1.75 arcsec at the limb. Behind the Sun's disc the divisor is limited from below, so
/// that the result is finite and continuous.
#[derive(Debug)]
struct Deflection {
    /// `e`, the unit vector from the Sun to the observer; and `2 GM / (c^2 r)`, rad.
    from_sun: Vector3<f64>,
    strength: f64,
}

impl Deflection {
    /// For an observer at `from_sun_m`.
    fn at(from_sun_m: Vector3<f64>) -> Deflection {
        let distance = from_sun_m.norm();
        Deflection {
            from_sun: from_sun_m / distance,
            strength: SUN_SCHWARZSCHILD_M / distance,
        }
    }

    /// The deflected direction of a source whose direction without deflection is `u`.
    fn of(&self, u: Vector3<f64>) -> Vector3<f64> {
        let e = self.from_sun;
        let along = u.dot(&e);
        let strength = self.strength / (1.0 + along).max(DEFLECTION_FLOOR);
        (u + (e - u * along) * strength).normalize()
    }
}

/// An object in Earth orbit as an observer sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApparentObject {
    /// Apparent direction: unit vector, axes of the ICRF. Zero when the object is at the observer's
    /// own position.
    pub direction: Vector3<f64>,
    /// Distance at the observer's epoch, geometric, m.
    pub range_m: f64,
    /// Rate of `range_m`, m/s; positive when receding.
    pub range_rate_m_s: f64,
    /// The object's geometric state at the observer's epoch, GCRF.
    pub state: StateVector,
    /// Position of the object when the light left it, GCRF, m: it determines illumination, phase
    /// and occultation.
    pub seen_at_m: Vector3<f64>,
}

/// The direction in which `observer` sees an object in Earth orbit whose geocentric GCRF state at
/// any epoch is `state_at`. Within 5 milliarcsec of a fully barycentric computation: the difference
/// is of second order in the Earth's velocity over c.
///
/// # Errors
///
/// Those of `state_at`, which is called for the observer's epoch and a light time earlier.
pub fn object_direction<E>(
    state_at: impl Fn(Epoch) -> Result<StateVector, E>,
    observer: &Observer,
    corrections: &Corrections,
) -> Result<ApparentObject, E> {
    let state = state_at(observer.epoch)?;
    let then = if corrections.light_time {
        // At least 1 us, so that the two instants differ.
        let earlier_s = observer.light_time_s(&state.position_m).max(1e-6);
        Some((earlier_s, state_at(observer.epoch - seconds(earlier_s))?))
    } else {
        None
    };
    Ok(apparent_object(state, then, observer, corrections))
}

/// The same for an object with known states: `state` at the observer's epoch, and in `then` a
/// number of seconds and the state that long before. The light must leave within one second of that
/// time. Without `then` light time is ignored.
pub(crate) fn apparent_object(
    state: StateVector,
    then: Option<(f64, StateVector)>,
    observer: &Observer,
    corrections: &Corrections,
) -> ApparentObject {
    let line = state.position_m - observer.position_m;
    let range_m = line.norm();
    let range_rate_m_s = if range_m > 0.0 {
        line.dot(&(state.velocity_m_s - observer.velocity_m_s)) / range_m
    } else {
        0.0
    };

    // Light time: tau = |r(t - tau) - r_observer(t)| / c, by iteration. The path is a parabola
    // through the positions at t and t - d, with the curvature from the change of velocity:
    //     r(t - tau) = r(t) + (r(t - d) - r(t)) tau / d + a tau (tau - d) / 2
    //     a = (v(t) - v(t - d)) / d
    // SGP4's velocity is not the derivative of its positions; the error cancels in the difference.
    // A jerk j, 0.01 m/s^3 or less, adds j tau (tau - d) (tau + d) / 6: micrometres from 40,000 km.
    let mut seen_at_m = state.position_m;
    if let Some((earlier_s, then)) = then {
        let slope = (then.position_m - state.position_m) / earlier_s;
        let half_bend = (state.velocity_m_s - then.velocity_m_s) / (2.0 * earlier_s);
        for _ in 0..LIGHT_TIME_STEPS {
            let tau = observer.light_time_s(&seen_at_m);
            seen_at_m = state.position_m + slope * tau + half_bend * (tau * (tau - earlier_s));
        }
    }

    let mut direction = (seen_at_m - observer.position_m)
        .try_normalize(0.0)
        .unwrap_or_else(Vector3::zeros);
    if corrections.aberration && direction != Vector3::zeros() {
        direction = aberrate(direction, observer.velocity_m_s);
    }
    ApparentObject {
        direction,
        range_m,
        range_rate_m_s,
        state,
        seen_at_m,
    }
}
