//! Resident space objects, their reflectance, and their appearance to an observer.

use super::apparent::{ApparentObject, Corrections, Observer, object_direction, parabola};
use super::field::Bright;
use super::look::{Body, Passage};
use super::photometry::{Sphere, magnitude, phase_angle};
use super::shadow::Earth;
use nalgebra::Vector3;
use skyloop_orbit::elements::Elements;
use skyloop_orbit::{Object, OrbitError};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Objects and their reflectance.
#[derive(Debug, Default)]
pub struct Objects {
    all: Vec<Object>,
    sphere: Sphere,
    /// The known appearances, each once.
    looks: Vec<Appearance>,
    /// Index of each object's appearance; [`PLAIN`] if unknown.
    look_of: Vec<u32>,
}

/// Appearances of objects, by object id.
pub type Appearances = BTreeMap<String, Appearance>;

/// The reflectance of an object.
#[derive(Debug, Clone)]
pub enum Appearance {
    /// The same from all directions.
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
    /// Apparent vectors from the observer (m, ICRF axes): direction times range at the exposure's
    /// start, mid and end. A parabola fits them better than directions, which may change fast.
    pub lines_m: [Vector3<f64>; 3],
    /// Phase angle Sun - object - observer, rad.
    pub phase: f64,
    /// Part of the Sun's disc that illuminates it, 0..1.
    pub illumination: f64,
    /// Whether the Earth occults it.
    pub occulted: bool,
    /// Magnitude by Eq. (9), in full sunlight; for a body with an attitude the mean over the
    /// exposure.
    pub mag: f64,
}

/// The observer at an exposure's start, mid and end.
pub type Shutter = [Observer; 3];

/// Index for objects without a known appearance: the population's sphere.
const PLAIN: u32 = u32::MAX;

impl Objects {
    /// Objects, the known `looks` by object id, and a sphere for all others.
    pub(crate) fn new(all: Vec<Object>, sphere: Sphere, looks: Appearances) -> Objects {
        let (ids, looks): (Vec<String>, Vec<Appearance>) = looks.into_iter().unzip();
        // The ids of a map are sorted.
        let of = |object: &Object| ids.binary_search(&object.id).map_or(PLAIN, |i| i as u32);
        Objects {
            look_of: all.iter().map(of).collect(),
            all,
            sphere,
            looks,
        }
    }

    /// The objects.
    pub(crate) fn all(&self) -> &[Object] {
        &self.all
    }

    /// Memory of the objects, bytes, with names and appearances, and 16 for each allocation.
    pub(crate) fn bytes(&self) -> usize {
        const PIECE: usize = 16;
        let text = |text: &String| PIECE + text.capacity();
        let of = |object: &Object| {
            let names = object.names.iter().map(text).sum::<usize>();
            let held = PIECE + object.names.capacity() * size_of::<String>();
            let sets = object.sets().count().saturating_sub(1) * size_of::<Elements>();
            size_of::<Object>() + text(&object.id) + held + names + sets
        };
        let looks = self.looks.capacity() * size_of::<Appearance>();
        let look_of = self.look_of.capacity() * size_of::<u32>();
        self.all.iter().map(of).sum::<usize>() + looks + look_of
    }

    fn look_at(&self, index: usize) -> Option<&Appearance> {
        let look = self.look_of.get(index)?;
        self.looks.get(*look as usize)
    }

    /// Upper bound of an object's light; none for a body, whose light depends on its attitude.
    pub(crate) fn brightest(&self, index: usize) -> Bright {
        match self.look_at(index) {
            None => Bright::of(&self.sphere),
            Some(Appearance::Sphere(sphere)) => Bright::of(sphere),
            Some(Appearance::Body(_)) => Bright::ANY,
        }
    }

    /// An object during an exposure, in or outside the field, by the scalar SGP4; `earth` is that
    /// of mid-exposure. Fails if its orbit has no position at that time.
    pub(crate) fn see(
        &self,
        index: usize,
        earth: &Earth,
        shutter: &Shutter,
        corrections: &Corrections,
    ) -> Result<SeenObject, OrbitError> {
        let object = self.all[index].with_set_at(shutter[1].epoch);
        let at = |i: usize| object_direction(|t| object.state(t), &shutter[i], corrections);
        let seen = [at(0)?, at(1)?, at(2)?];
        Ok(self.seen_object(index, earth, shutter, corrections, seen))
    }

    /// An object and its light, from its appearance at the exposure's start, mid and end.
    pub(crate) fn seen_object(
        &self,
        index: usize,
        earth: &Earth,
        shutter: &Shutter,
        corrections: &Corrections,
        [start, apparent, end]: [ApparentObject; 3],
    ) -> SeenObject {
        let line = |seen: &ApparentObject| seen.direction * seen.range_m;
        let observer_m = shutter[1].position_m;
        let sun_m = shutter[1].bodies.sun_apparent_m();
        let to_sun = sun_m - apparent.seen_at_m;
        let phase = phase_angle(&to_sun, &(observer_m - apparent.seen_at_m));
        let reflective_area = match self.look_at(index) {
            None => self.sphere.reflective_area(phase),
            Some(Appearance::Sphere(sphere)) => sphere.reflective_area(phase),
            Some(Appearance::Body(body)) => body.mean_reflective_area(&Passage {
                observers: shutter,
                seen: [&start, &apparent, &end],
                sun_m,
                light_time: corrections.light_time,
            }),
        };
        SeenObject {
            index,
            lines_m: [line(&start), line(&apparent), line(&end)],
            phase,
            illumination: earth.illumination(apparent.seen_at_m, sun_m),
            occulted: earth.occults(observer_m, apparent.seen_at_m),
            mag: magnitude(reflective_area, to_sun.norm(), apparent.range_m),
            apparent,
        }
    }
}

impl SeenObject {
    /// The apparent vector at a part of the exposure (0: start, 1: end), by the parabola through
    /// start, mid and end. A jerk of some 0.01 m/s^3 is ignored: micrometres in a second.
    pub(crate) fn line_m(&self, part: f64) -> Vector3<f64> {
        parabola(&self.lines_m, part)
    }
}
