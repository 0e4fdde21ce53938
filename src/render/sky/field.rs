//! Selects the objects of a catalogue that may be in the field, by directions and distances, before
//! any photometry.
//!
//! ```text
//! every object:  in the cone? -> in the field? -> behind the Earth? -> bright enough?
//! candidates:    apparent directions, shadow, brightness (`propagate`)
//! ```
//!
//! All bounds are on the safe side: every object that might be seen during the exposure remains.
//! The test is in TEME and km, as the orbits are: rotating the observer is cheaper than rotating
//! the catalogue.

use super::apparent::Observer;
use super::bodies::LIGHT_M_S;
use super::photometry::{Sphere, diffuse_phase};
use crate::camera::Side;
use nalgebra::{Matrix3, Vector3};
use skyloop_orbit::StateVector;
use skyloop_orbit::cone::{Cone, FASTEST_KM_S};
use skyloop_orbit::sgp4_batch::{BLOCK, NO_OBJECT};
use skyloop_orbit::tracks::{BOUND_KM, Look, Places};
use std::f64::consts::PI;

/// An object nearer than this is the observer's own vehicle, m.
pub const OWN_VEHICLE_M: f64 = 1.0;

/// Bound of the shift of a direction by light time and aberration, rad: 100 km/s over c for each,
/// rounded up. Neither observers nor objects are faster.
const MAX_SHIFT: f64 = 7e-4;
/// Radius of a sphere inside the Earth, km: the polar radius.
const EARTH_KM: f64 = 6356.7;
const LIGHT_KM_S: f64 = LIGHT_M_S * 1e-3;
/// Rounding error of a distance, km.
const ROUNDING_KM: f64 = 1e-3;

/// The field during an exposure: a cone around the boresight, or its part within some planes.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a> {
    /// The boresight, unit vector, ICRF.
    pub axis: Vector3<f64>,
    /// Half the cone's angle, rad.
    pub angle: f64,
    /// Planes (ICRF) that bound the field within the cone; may be empty.
    pub sides: &'a [Side],
    /// The observer at the exposure's start, mid and end.
    pub shutter: &'a [Observer; 3],
    /// Distance (m) from which a body of 1 m^2/sr of reflective area, in full sunlight, is below
    /// the noise; infinite without such a limit.
    pub reach_m: f64,
}

/// Upper bound of an object's reflective area: the factor of the diffuse phase function, m^2, and
/// the part that is the same at all phases, m^2/sr.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Bright {
    diffuse: f32,
    specular: f32,
}

impl Bright {
    /// No bound.
    pub const ANY: Bright = Bright {
        diffuse: 0.0,
        specular: f32::INFINITY,
    };

    /// The bound of a sphere, rounded up.
    pub fn of(sphere: &Sphere) -> Bright {
        let [diffuse, specular] = sphere.parts();
        Bright {
            diffuse: (diffuse as f32).next_up(),
            specular: (specular as f32).next_up(),
        }
    }

    /// The reflective area at a phase angle (rad), m^2/sr.
    fn reflective_area(&self, phase: f64) -> f64 {
        f64::from(self.diffuse) * diffuse_phase(phase) + f64::from(self.specular)
    }
}

/// Why an object in the field has no image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Excluded {
    /// It is behind the Earth throughout the exposure.
    BehindEarth,
    /// Even in full light it is below the noise.
    TooFaint,
}

impl Field<'_> {
    fn duration_s(&self) -> f64 {
        (self.shutter[2].epoch - self.shutter[0].epoch).to_seconds()
    }

    /// Whether an object with this state at mid-exposure (GCRF) may be in the field during the
    /// exposure.
    pub(crate) fn may_hold(&self, state: &StateVector) -> bool {
        let mid = &self.shutter[1];
        let line = state.position_m - mid.position_m;
        let range = line.norm();
        // If the object moves by w relative to the observer, the line of sight turns by at most
        // asin(w / range), or by up to pi if w exceeds the range. Pi w / range exceeds both, with a
        // margin for a curved path.
        let path_m = (state.velocity_m_s - mid.velocity_m_s).norm() * self.duration_s() / 2.0;
        let sweep = PI * path_m / range.max(1e-3);
        let reach = (self.angle + MAX_SHIFT + sweep).min(PI);
        range >= OWN_VEHICLE_M
            && line.dot(&self.axis) >= range * libm::cos(reach)
            && self.sides.iter().all(|side| {
                let beyond = (side.beyond + MAX_SHIFT + sweep).min(PI / 2.0);
                line.dot(&side.inward) >= -range * libm::sin(beyond)
            })
    }

    /// The inward normal of each side, and a bound: a fixed direction (unit vector, ICRF) may be
    /// within the side during the exposure if its product with the normal is at least that.
    pub(crate) fn star_side_bounds(&self) -> Vec<(Vector3<f64>, f64)> {
        let sides = self.sides.iter().map(|side| {
            let beyond = (side.beyond + MAX_SHIFT).min(PI / 2.0);
            (side.inward, -libm::sin(beyond))
        });
        sides.collect()
    }

    /// The test of a catalogue in TEME; `rotation` is TEME to GCRF, `bright` bounds each object's
    /// light.
    pub(crate) fn test<'a>(&self, rotation: &Matrix3<f64>, bright: &'a [Bright]) -> Test<'a> {
        let mid = &self.shutter[1];
        let to_teme = rotation.transpose();
        let observer = to_teme * mid.position_m * 1e-3;
        let half_s = self.duration_s() / 2.0;
        let margin_km = (FASTEST_KM_S + mid.velocity_m_s.norm() * 1e-3) * half_s;
        let margin_km = margin_km + BOUND_KM + ROUNDING_KM;
        let axis = (to_teme * self.axis).into();
        let angle = (self.angle + MAX_SHIFT).min(PI);
        // The Earth hides nothing from an observer inside it.
        let outside = observer.norm() > EARTH_KM + 100.0 + margin_km;
        Test {
            sun_km: to_teme * mid.bodies.sun_apparent_m() * 1e-3,
            cone: Cone::new(observer.into(), axis, angle, margin_km),
            sides: self
                .sides
                .iter()
                .map(|side| {
                    let beyond = (side.beyond + MAX_SHIFT).min(PI / 2.0);
                    (to_teme * side.inward, libm::sin(beyond))
                })
                .collect(),
            earth_km: if outside { EARTH_KM - margin_km } else { 0.0 },
            reach_km: self.reach_m * 1e-3,
            bright,
        }
    }
}

/// The test of a block of a catalogue, TEME.
pub(crate) struct Test<'a> {
    sun_km: Vector3<f64>,
    /// The cone around the field, and how far object and observer may move.
    cone: Cone,
    /// Normals of the planes around the field, and sines of the angles by which it extends beyond.
    sides: Vec<(Vector3<f64>, f64)>,
    /// Radius of the occulting Earth; 0 if it hides nothing.
    earth_km: f64,
    reach_km: f64,
    bright: &'a [Bright],
}

/// The result of the test for an object, by its number in the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// It may be seen.
    Candidate(u32),
    /// It is in the field, and not seen.
    Excluded(u32, Excluded),
    /// It has no position; SGP4's error code.
    Failed(u32, u8),
}

impl Look for Test<'_> {
    type Found = Found;

    fn cone(&self) -> &Cone {
        &self.cone
    }

    #[inline(always)]
    fn look(&self, places: &Places<'_>, found: &mut Vec<Found>) -> bool {
        let mut inside = [false; BLOCK];
        let [x, y, z] = &places.position_km;
        for (inside, ((x, y), z)) in inside.iter_mut().zip(x.iter().zip(y).zip(z)) {
            *inside = self.cone.holds([*x, *y, *z]);
        }
        let met = inside != [false; BLOCK];
        if !met && places.code == [0; BLOCK] {
            return false;
        }
        for (i, &object) in places.objects.iter().enumerate() {
            if object == NO_OBJECT {
                continue;
            }
            if places.code[i] != 0 {
                found.push(Found::Failed(object, places.code[i]));
            } else if inside[i] {
                let position = places.position_km.map(|row| row[i]);
                let bright = self.bright.get(object as usize).copied();
                match self.within(&position, bright.unwrap_or(Bright::ANY)) {
                    None => {}
                    Some(Err(why)) => found.push(Found::Excluded(object, why)),
                    Some(Ok(())) => found.push(Found::Candidate(object)),
                }
            }
        }
        met
    }
}

impl Test<'_> {
    /// The result for one object by its state (TEME) and the bound of its light: none outside the
    /// field, `Err` if it is not seen. An object faster than any bound orbit always passes.
    pub fn assess(&self, state: &StateVector, bright: Bright) -> Option<Result<(), Excluded>> {
        if state.velocity_m_s.norm() > FASTEST_KM_S * 1e3 {
            return Some(Ok(()));
        }
        let place_km: [f64; 3] = (state.position_m * 1e-3).into();
        if self.cone.holds(place_km) {
            self.within(&place_km, bright)
        } else {
            None
        }
    }

    /// The same for an object in the cone.
    fn within(&self, place_km: &[f64; 3], bright: Bright) -> Option<Result<(), Excluded>> {
        let observer = Vector3::from(self.cone.apex_km());
        let line = Vector3::from(*place_km) - observer;
        let range = line.norm();
        // An object at range r in a direction `b` rad beyond a plane is r sin b beyond it. If it
        // moves by w, its range may be greater by w, too.
        let inside = |(inward, sin): &(Vector3<f64>, f64)| {
            line.dot(inward) >= -(range + self.cone.margin_km) * sin - self.cone.margin_km
        };
        if !self.sides.iter().all(inside) {
            return None;
        }
        Some(match self.excluded(&line, range, bright) {
            Some(why) if range > 0.0 => Err(why),
            _ => Ok(()),
        })
    }

    /// Why an object on that line from the observer (km) is not seen.
    fn excluded(&self, line: &Vector3<f64>, range: f64, bright: Bright) -> Option<Excluded> {
        let observer = Vector3::from(self.cone.apex_km());
        // The point of the line of sight that is nearest to the Earth's centre.
        let part = (-observer.dot(line) / (range * range)).clamp(0.0, 1.0);
        // The object appears where it was when the light left.
        let light_km = FASTEST_KM_S * range / LIGHT_KM_S;
        if (observer + line * part).norm() < self.earth_km - light_km {
            return Some(Excluded::BehindEarth);
        }
        // At the smallest phase angle of the exposure, where it is brightest.
        let to_sun = self.sun_km - observer - line;
        let phase = (-line.dot(&to_sun) / (range * to_sun.norm())).clamp(-1.0, 1.0);
        let turn = PI * self.cone.margin_km / range + MAX_SHIFT;
        let area = bright.reflective_area((libm::acos(phase) - turn).max(0.0));
        let reach_km = self.reach_km * area.sqrt();
        (range - self.cone.margin_km > reach_km).then_some(Excluded::TooFaint)
    }
}
