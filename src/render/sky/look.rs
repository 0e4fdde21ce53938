//! Known appearance of an object, and the sunlight that it reflects to an observer during an
//! exposure.

use super::apparent::{ApparentObject, Observer, parabola};
use super::bodies::{LIGHT_M_S, SUN_RADIUS_M};
use super::body_attitude::BodyAttitude;
use super::shape::Shape;
use crate::attitude::angle_between;
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_base::range::nearest;
use skyloop_orbit::StateVector;
use skyloop_orbit::time::seconds;

/// A body of known shape and attitude.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Its facets.
    pub shape: Shape,
    /// Its attitude.
    pub attitude: BodyAttitude,
}

/// An object and its observer during an exposure.
#[derive(Debug)]
pub struct Passage<'a> {
    /// The observer at the exposure's start, mid and end.
    pub observers: &'a [Observer; 3],
    /// The object as seen by them.
    pub seen: [&'a ApparentObject; 3],
    /// Earth's centre to the apparent Sun, m.
    pub sun_m: Vector3<f64>,
    /// Whether light time is included.
    pub light_time: bool,
}

/// Instants of an exposure per crossing of the narrowest lobe: the light of one crossing is
/// accurate to 3 %.
const INSTANTS: f64 = 32.0;
/// Greatest number of instants times facets: if all are sides of cylinders, a tenth of a second of
/// computation. A body that rotates further gets the mean of as many attitudes as this permits.
const MAX_WORK: f64 = 50_000.0;

impl Body {
    /// Eq. (6), m^2/sr: the mean over the exposure, during which glints and tumbling change it. The
    /// number of instants grows with the rotation of the body and of its line to the observer; one
    /// is enough without any rotation.
    pub fn mean_reflective_area(&self, passage: &Passage<'_>) -> f64 {
        let [start, _, end] = passage.observers;
        let duration_s = (end.epoch - start.epoch).to_seconds();
        let turn = self.attitude.rate(&passage.seen[1].state) * duration_s + passage.turn();
        let needed = (turn / self.shape.detail(passage.at(0.5).sun_radius()) * INSTANTS).ceil();
        let max = (MAX_WORK / self.shape.facets() as f64).max(1.0);
        let instants = nearest(needed, 1.0..=max) as usize;
        let parts = (0..instants).map(|i| (i as f64 + 0.5) / instants as f64);
        let sum: f64 = parts
            .map(|part| self.reflective_area(&passage.at(part)))
            .sum();
        sum / instants as f64
    }

    fn reflective_area(&self, instant: &Instant) -> f64 {
        let to_body = self.attitude.matrix(instant.epoch, &instant.state);
        let axes = |v: &Vector3<f64>| (to_body * v).normalize();
        self.shape.reflective_area(
            &axes(&instant.to_sun),
            &axes(&instant.to_sensor),
            instant.sun_radius(),
        )
    }
}

/// Inputs of an object's brightness when the light leaves it; ICRF axes, m.
struct Instant {
    epoch: Epoch,
    state: StateVector,
    to_sun: Vector3<f64>,
    to_sensor: Vector3<f64>,
}

impl Instant {
    /// The angular radius of the Sun's disc, rad.
    fn sun_radius(&self) -> f64 {
        libm::asin((SUN_RADIUS_M / self.to_sun.norm()).min(1.0))
    }
}

impl Passage<'_> {
    /// At a part of the exposure (0: start, 1: end).
    fn at(&self, part: f64) -> Instant {
        let position_m = parabola(&self.seen.map(|seen| seen.seen_at_m), part);
        let observers_m = self.observers.each_ref().map(|at| at.position_m);
        let to_sensor = parabola(&observers_m, part) - position_m;
        let [start, _, end] = self.observers;
        let delay_s = if self.light_time {
            to_sensor.norm() / LIGHT_M_S
        } else {
            0.0
        };
        let open_s = (end.epoch - start.epoch).to_seconds();
        Instant {
            epoch: start.epoch + seconds(open_s * part - delay_s),
            state: StateVector {
                position_m,
                velocity_m_s: parabola(&self.seen.map(|seen| seen.state.velocity_m_s), part),
            },
            to_sun: self.sun_m - position_m,
            to_sensor,
        }
    }

    /// Rotation of the line to the observer during the exposure, rad. (The line to the Sun rotates
    /// by 1e-4 rad per hour.)
    fn turn(&self) -> f64 {
        let [a, b, c] = [0.0, 0.5, 1.0].map(|part| self.at(part).to_sensor);
        angle_between(&a, &b) + angle_between(&b, &c)
    }
}
