//! Passes of objects through a camera's field, their times and brightness, without frames.
//!
//! The time span is divided into steps. In each step [`Population::candidates`] gives the objects
//! that may be in the cone of the field. For each of these the step is bisected. A part is finished
//! when the image, even at its highest speed, cannot reach the edge of the detector: the object is
//! in the field or out of it throughout. Bisection ends at [`Search::shortest_s`], so every longer
//! pass is found, and shorter ones may be missed. A pass also begins or ends where the object's
//! states do.

mod crossing;
mod field;
mod known;
mod observer_track;
mod pointing;
mod request;
mod search;

pub use crossing::{Lit, Pass, PassInstant};
pub use request::{NoPasses, Search};

use field::Field;
use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Vector3};
use observer_track::ObserverTrack;
use rayon::prelude::*;
use search::ObjectSearch;
use skyloop_config::flight::Flight;
use skyloop_orbit::{Object, Orbit};
use skyloop_render::camera::Camera;
use skyloop_render::sky::field::Field as Cone;
use skyloop_render::sky::{Corrections, Population};
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// Length of a step, s: a low orbit moves 80 km in it.
const STEP_S: f64 = 10.0;
/// Steps of the search for times without a pointing direction, s. Shorter ones are tried if the
/// longer ones miss such a time, as for an observer below the target limb.
const GAP_STEPS_S: [f64; 3] = [STEP_S, 1.0, 0.1];

/// The results of a search.
#[derive(Debug, Default)]
pub struct Passes {
    /// In order of entry.
    pub passes: Vec<Pass>,
    /// Objects whose orbit fails at some time of the search, or is beyond 4e6 km or 100 km/s, each
    /// with one reason.
    pub unknown: BTreeMap<String, String>,
    /// Intervals without a pointing direction, which were not searched.
    pub unpointed: Vec<[Epoch; 2]>,
}

/// The passes of a population through the field of `camera` on a vehicle. `tick` receives the
/// finished fraction of the work, from 0 to 1.
pub fn passes(
    search: &Search,
    flight: &Flight,
    camera: &Camera,
    population: &Population,
    corrections: &Corrections,
    tick: impl Fn(f64) + Sync,
) -> Result<Passes, NoPasses> {
    let within =
        |search: &Search| search_part(search, flight, camera, population, corrections, &tick);
    let mut found = within(search);
    for step_s in GAP_STEPS_S {
        match &found {
            Err(NoPasses::Flight(error)) if error.lacks_direction() => {}
            _ => break,
        }
        let parts = pointing::parts(search, flight, step_s);
        let mut all = Passes {
            unpointed: pointing::gaps(search, &parts),
            ..Passes::default()
        };
        let searched: Result<Vec<Passes>, _> = parts.iter().map(within).collect();
        found = match searched {
            // If no part has a pointing direction, the error of the whole search has the reason.
            Ok(parts) if parts.is_empty() => break,
            Ok(parts) => {
                for part in parts {
                    all.passes.extend(part.passes);
                    all.unknown.extend(part.unknown);
                }
                Ok(all)
            }
            Err(error) => Err(error),
        };
    }
    found
}

/// The passes during a search with a pointing direction throughout.
fn search_part(
    search: &Search,
    flight: &Flight,
    camera: &Camera,
    population: &Population,
    corrections: &Corrections,
    tick: &(impl Fn(f64) + Sync),
) -> Result<Passes, NoPasses> {
    let Some(search) = &with_states(search, population.objects()) else {
        let middle = search.from + (search.to - search.from) * 0.5;
        let why = population.objects().iter().filter_map(|object| {
            let state = known::state(object, middle, &Matrix3::identity());
            Some((object.label(), state.err()?.to_string()))
        });
        return Ok(Passes {
            passes: Vec::new(),
            unknown: why.collect(),
            unpointed: Vec::new(),
        });
    };
    let observer_track = ObserverTrack::new(
        flight,
        search.from,
        search.length_s(),
        STEP_S,
        search.shortest_s,
    )?;
    let (candidates, mut unknown) = candidates(&observer_track, camera, population, tick);
    let field = Field::new(camera);
    let found: Result<Vec<_>, NoPasses> = candidates
        .par_iter()
        .map(|(index, steps)| {
            let object_search = ObjectSearch {
                observer_track: &observer_track,
                field: &field,
                camera,
                corrections,
                object: &population.objects()[*index],
                lost: OnceCell::new(),
            };
            let crossings = object_search.crossings(steps, search)?;
            let passes = crossings.into_iter();
            let passes = passes.map(|times| object_search.pass(population, *index, times, search));
            let passes: Result<Vec<Pass>, _> = passes.filter_map(Result::transpose).collect();
            Ok((passes?, object_search.lost.into_inner()))
        })
        .collect();
    let mut passes = Vec::new();
    for (index, (found, lost)) in candidates.keys().zip(found?) {
        passes.extend(found);
        if let Some(reason) = lost {
            let label = population.objects()[*index].label();
            unknown.entry(label).or_insert(reason);
        }
    }
    passes.sort_by_key(|pass| (pass.entry.point.epoch, pass.index));
    tick(1.0);
    Ok(Passes {
        passes,
        unknown,
        unpointed: Vec::new(),
    })
}

/// The part of a search in which any object may have a state, plus a step at both ends, so that a
/// pass there does not look cut off by the search; none if no object has a state.
fn with_states(search: &Search, objects: &[Object]) -> Option<Search> {
    let spans = objects.iter().filter_map(Object::span);
    let (first, last) = spans.reduce(|(a, b), (start, end)| (a.min(start), b.max(end)))?;
    let step = Unit::Second * STEP_S;
    let part = Search {
        from: search.from.max(first - step),
        to: search.to.min(last + step),
        // `max` replaces NaN.
        shortest_s: search.shortest_s.max(1e-3),
    };
    let any = || objects.par_iter().any(|object| has_states(object, &part));
    (part.from <= part.to && any()).then_some(part)
}

/// Whether an object has a state during a search. Element sets are tested at the ends of steps: a
/// failure of SGP4 there lasts longer than a step.
fn has_states(object: &Object, search: &Search) -> bool {
    if let Orbit::Ephemeris(ephemeris) = &object.orbit {
        let within = |(start, end)| start <= search.to && end >= search.from;
        return ephemeris.interval().is_some_and(within);
    }
    let steps = (search.length_s() / STEP_S).ceil() as usize;
    let instants = (0..=steps).map(|step| search.from + Unit::Second * (STEP_S * step as f64));
    let mut instants = instants.map(|instant| instant.min(search.to));
    instants.any(|instant| known::state(object, instant, &Matrix3::identity()).is_ok())
}

/// The steps in which each object may be in the field, and the reasons of objects without a state.
/// A step also counts if the object has no state in its middle and may have one elsewhere in it.
#[allow(clippy::type_complexity)]
fn candidates(
    observer_track: &ObserverTrack,
    camera: &Camera,
    population: &Population,
    tick: &impl Fn(f64),
) -> (BTreeMap<usize, Vec<usize>>, BTreeMap<String, String>) {
    let (mut candidates, mut unknown) = (BTreeMap::new(), BTreeMap::new());
    let cone = camera.cone_rad(0.0);
    let objects = population.objects();
    let ends = |object: &Object| matches!(object.orbit, Orbit::Ephemeris(_));
    let mut may_lack: BTreeSet<usize> = (0..objects.len()).filter(|&i| ends(&objects[i])).collect();
    let mut by_label: BTreeMap<String, usize> = BTreeMap::new();
    for (number, step) in observer_track.steps.iter().enumerate() {
        let pointing = step.vehicle.attitude.then(&camera.mounting);
        let axis = pointing.matrix().transpose() * Vector3::z();
        let reach = cone + step.rate * (step.end_s - step.start_s) / 2.0;
        let (near, errors) = population.candidates(&Cone {
            axis,
            angle: reach,
            sides: &[],
            shutter: &step.shutter,
            reach_m: f64::INFINITY,
        });
        for index in near {
            let steps: &mut Vec<usize> = candidates.entry(index).or_default();
            steps.push(number);
        }
        if by_label.is_empty() && !errors.is_empty() {
            by_label = (0..)
                .zip(objects)
                .map(|(i, one)| (one.label(), i))
                .collect();
        }
        for error in errors {
            may_lack.extend(by_label.get(error.object()));
            let reason = unknown.entry(error.object().to_string());
            reason.or_insert_with(|| error.to_string());
        }
        let (middle, half_s) = (step.shutter[1].epoch, (step.end_s - step.start_s) / 2.0);
        for &index in &may_lack {
            let (object, rotation) = (&objects[index], &step.rotation);
            if let Err(error) = known::state(object, middle, rotation)
                && known::may_have_near(object, &error, middle, half_s, rotation)
            {
                let steps = candidates.entry(index).or_default();
                if steps.last() != Some(&number) {
                    steps.push(number);
                }
            }
        }
        tick(0.5 * number as f64 / observer_track.steps.len() as f64);
    }
    (candidates, unknown)
}
