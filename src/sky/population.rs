//! The resident space objects of a scene, and how an observer sees them at one exposure.

use super::apparent::{ApparentObject, Corrections, Observer, object_direction, parabola};
use super::look::{Body, Passage};
use super::photometry::{Sphere, magnitude, phase_angle};
use super::shadow::Earth;
use nalgebra::Vector3;
use rayon::prelude::*;
use skyloop_orbit::{Object, OrbitError, frames};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::Arc;

/// Objects and what they reflect.
#[derive(Debug, Default)]
pub struct Population {
    /// Orbits and names.
    pub objects: Vec<Object>,
    /// What an object reflects of which nothing is known.
    pub sphere: Sphere,
    /// What is known of others.
    pub looks: Looks,
}

/// What is known of objects, by their ids.
pub type Looks = BTreeMap<String, Look>;

/// What an object looks like.
#[derive(Debug, Clone)]
pub enum Look {
    /// The same from all sides.
    Sphere(Sphere),
    /// A body with a shape and an attitude.
    Body(Arc<Body>),
}

/// An object in the field.
#[derive(Debug, Clone)]
pub struct SeenObject {
    /// Index into the population.
    pub index: usize,
    /// As seen at the middle of the exposure.
    pub apparent: ApparentObject,
    /// Apparent vectors from the observer (m, ICRF axes): direction times range at the exposure's start, mid
    /// and end. They change smoothly where directions may swing.
    pub lines_m: [Vector3<f64>; 3],
    /// Phase angle Sun - object - observer, rad.
    pub phase: f64,
    /// Part of the Sun's disc that lights it, 0..1.
    pub illumination: f64,
    /// Whether the Earth stands before it.
    pub occulted: bool,
    /// Magnitude by Eq. (9), in full sunlight; of a body with an attitude the mean light over the exposure.
    pub mag: f64,
}

/// The observer at an exposure's start, mid and end.
pub type Shutter = [Observer; 3];

/// Nearer than this (m) an object is the observer's own vehicle.
pub const OWN_VEHICLE_M: f64 = 1.0;
/// What light time and aberration may turn a direction by (rad): 16 km/s over c, each, rounded up.
const WANDER: f64 = 2e-4;

impl Population {
    /// The objects that may stand within `angle` (rad) of `axis` (unit vector, ICRF) at some time of the
    /// exposure, in the population's order, and the errors of those whose orbit has no answer.
    pub fn in_cone(
        &self,
        axis: &Vector3<f64>,
        angle: f64,
        shutter: &Shutter,
        corrections: &Corrections,
    ) -> (Vec<SeenObject>, Vec<OrbitError>) {
        let mid = &shutter[1];
        let duration_s = (shutter[2].epoch - shutter[0].epoch).to_seconds();
        let rotation = frames::teme_to_gcrf(mid.epoch);
        let earth = Earth::at(mid.epoch);
        let near_axis = |object: &Object| -> Result<bool, OrbitError> {
            let state = object.state_with(mid.epoch, &rotation)?;
            let line = state.position_m - mid.position_m;
            let range = line.norm();
            // From mid-exposure to either end the line turns by no more than asin(w / range) on a way w; by up to half a turn where
            // w is longer. Pi w / range is above both, with room for a way that bends.
            let way = (state.velocity_m_s - mid.velocity_m_s).norm() * duration_s / 2.0;
            let sweep = PI * way / range.max(1e-3);
            let reach = (angle + WANDER + sweep).min(PI);
            Ok(range >= OWN_VEHICLE_M && line.dot(axis) >= range * reach.cos())
        };
        let seen: Vec<Result<SeenObject, OrbitError>> = self
            .objects
            .par_iter()
            .enumerate()
            .filter_map(|(index, object)| match near_axis(object) {
                Ok(true) => Some(self.see(index, &earth, shutter, corrections)),
                Ok(false) => None,
                Err(error) => Some(Err(error)),
            })
            .collect();
        let (mut objects, mut errors) = (Vec::new(), Vec::new());
        for one in seen {
            match one {
                Ok(object) => objects.push(object),
                Err(error) => errors.push(error),
            }
        }
        (objects, errors)
    }

    /// The object of that index as it is seen during an exposure, wherever it stands; `earth` is that of mid-exposure.
    ///
    /// Errors: its orbit has no answer.
    pub fn see(
        &self,
        index: usize,
        earth: &Earth,
        shutter: &Shutter,
        corrections: &Corrections,
    ) -> Result<SeenObject, OrbitError> {
        let object = self.objects[index].settled(shutter[1].epoch);
        let at = |observer: &Observer| object_direction(|t| object.state(t), observer, corrections);
        let line = |seen: &ApparentObject| seen.direction * seen.range_m;
        let (apparent, start, end) = (at(&shutter[1])?, at(&shutter[0])?, at(&shutter[2])?);
        let observer_m = shutter[1].position_m;
        let sun_m = shutter[1].bodies.sun_apparent_m();
        let to_sun = sun_m - apparent.seen_at_m;
        let phase = phase_angle(&to_sun, &(observer_m - apparent.seen_at_m));
        let reflective_area = match self.looks.get(&object.id) {
            None => self.sphere.reflective_area(phase),
            Some(Look::Sphere(sphere)) => sphere.reflective_area(phase),
            Some(Look::Body(body)) => body.mean_reflective_area(&Passage {
                observers: shutter,
                seen: [&start, &apparent, &end],
                sun_m,
                light_time: corrections.light_time,
            }),
        };
        Ok(SeenObject {
            index,
            lines_m: [line(&start), line(&apparent), line(&end)],
            phase,
            illumination: earth.illumination(apparent.seen_at_m, sun_m),
            occulted: earth.occults(observer_m, apparent.seen_at_m),
            mag: magnitude(reflective_area, to_sun.norm(), apparent.range_m),
            apparent,
        })
    }
}

impl SeenObject {
    /// The apparent vector at a part of the exposure (0: start, 1: end), by the parabola through
    /// start, mid and end; what it misses is a jerk of some 0.01 m/s^3: micrometres in a second.
    pub fn line_m(&self, part: f64) -> Vector3<f64> {
        parabola(&self.lines_m, part)
    }
}
