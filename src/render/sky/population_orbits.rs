//! The orbits of a population from frame to frame, and the objects in a camera's field.

use super::apparent::Corrections;
use super::field::{Bright, Excluded, Field, Found};
use super::objects::{Objects, SeenObject};
use super::propagate::{Instants, Outcome, Propagation, TASK};
use super::shadow::Earth;
use crate::fidelity::Orbits;
use rayon::prelude::*;
use skyloop_orbit::tracks::Tracks;
use skyloop_orbit::{Object, Orbit, OrbitError};
use std::collections::HashSet;
use std::sync::Arc;

/// The objects in a camera's field during an exposure.
#[derive(Debug, Default)]
pub struct Seen {
    /// The objects that may be seen, in the population's order.
    pub objects: Vec<Arc<SeenObject>>,
    /// Indices of the objects without an image, with the reason; in the same order.
    pub excluded: Vec<(usize, Excluded)>,
    /// Number of objects of the population without a position at this time.
    pub unknown: usize,
    /// The reasons; each object is reported only once.
    pub notices: Vec<OrbitError>,
}

/// Replaces the number of an element set if the object has no other set.
const SOLE: u32 = u32::MAX;

/// The orbits of a population.
#[derive(Debug)]
pub(crate) struct PopulationOrbits {
    tracks: Tracks,
    /// The element set of each track: an object's index, and the number of its set, or [`SOLE`].
    sets: Vec<(u32, u32)>,
    /// Bound of each track's light.
    bright: Vec<Bright>,
    /// Objects without a track.
    others: Vec<u32>,
    /// Objects reported as without a position.
    reported: HashSet<u32>,
}

impl PopulationOrbits {
    /// The orbits of `population`.
    pub fn new(population: &Objects) -> PopulationOrbits {
        let objects = population.all();
        let (mut of, mut elements) = (Vec::new(), Vec::new());
        of.reserve(objects.len());
        elements.reserve(objects.len());
        for (index, object) in (0..).zip(objects) {
            let is_sole = object.sets().count() == 1;
            for (number, set) in (0..).zip(object.sets()) {
                of.push((index, if is_sole { SOLE } else { number }));
                elements.push(*set);
            }
        }
        // All sets from files initialise. If another set fails, the scalar model reports the error.
        let tracks = Tracks::new(&elements).unwrap_or_default();
        let mut others = Vec::new();
        if tracks.is_empty() {
            others.extend(of.drain(..).map(|(index, _)| index));
        }
        let has_ephemeris = |object: &Object| matches!(object.orbit, Orbit::Ephemeris(_));
        others.extend((0..objects.len() as u32).filter(|&i| has_ephemeris(&objects[i as usize])));
        others.sort_unstable();
        others.dedup();
        let bright = |&(index, _): &(u32, u32)| population.brightest(index as usize);
        PopulationOrbits {
            bright: of.iter().map(bright).collect(),
            tracks,
            sets: of,
            others,
            reported: HashSet::new(),
        }
    }

    /// Memory of the orbits, bytes.
    pub fn bytes(&self) -> usize {
        self.tracks.bytes()
            + self.sets.capacity() * size_of::<(u32, u32)>()
            + self.bright.capacity() * size_of::<Bright>()
    }

    /// Indices of the objects that may be in the field, with or without an image; and the reasons
    /// for missing positions, each object once.
    pub fn candidates(
        &mut self,
        population: &Objects,
        field: &Field<'_>,
    ) -> (Vec<usize>, Vec<OrbitError>) {
        let at = Instants::of(field);
        let mut tested = self.tested(population, field, &at, Orbits::Tracked);
        for &index in &self.others {
            let object = &population.all()[index as usize];
            let state = object.state_with(field.shutter[1].epoch, &at.rotations[1]);
            match state.map(|state| field.may_hold(&state)) {
                Ok(true) => tested.near.push((index, None)),
                Ok(false) => {}
                Err(_) => tested.failed.push((index, 0)),
            }
        }
        let near = tested.near.iter().map(|(index, _)| *index as usize);
        let excluded = tested.excluded.iter().map(|(index, _)| *index);
        let all = near.chain(excluded).collect();
        (all, self.notices(population, field, &tested.failed))
    }

    /// The result of the field's test for the tracks.
    fn tested(
        &mut self,
        population: &Objects,
        field: &Field<'_>,
        at: &Instants,
        orbits: Orbits,
    ) -> Tested {
        let mid = field.shutter[1].epoch;
        let test = field.test(&at.rotations[1], &self.bright);
        self.tracks.exact = orbits == Orbits::Exact;
        let found = match orbits {
            Orbits::Scalar => (0..self.sets.len() as u32).map(Found::Candidate).collect(),
            Orbits::Tracked | Orbits::Exact => self.tracks.at(mid, &test),
        };
        let mut tested = Tested::default();
        for one in found {
            let (Found::Candidate(set) | Found::Excluded(set, _) | Found::Failed(set, _)) = one;
            let (index, number) = self.sets[set as usize];
            // Of several element sets the nearest in time counts.
            let counts = || population.all()[index as usize].set_index_at(mid) as u32;
            if number != SOLE && number != counts() {
                continue;
            }
            match one {
                Found::Candidate(_) => tested.near.push((index, Some(set))),
                Found::Excluded(_, why) => tested.excluded.push((index as usize, why)),
                Found::Failed(_, code) => tested.failed.push((index, code)),
            }
        }
        tested
    }

    /// The reasons for missing positions at mid-exposure, each object once.
    fn notices(
        &mut self,
        population: &Objects,
        field: &Field<'_>,
        failed: &[(u32, u8)],
    ) -> Vec<OrbitError> {
        let new = failed
            .iter()
            .filter(|(index, _)| self.reported.insert(*index));
        let mid = field.shutter[1].epoch;
        let why = |(index, code): &(u32, u8)| population.all()[*index as usize].failure(mid, *code);
        new.map(why).collect()
    }

    /// The objects of `population` in the field.
    pub fn in_field(
        &mut self,
        population: &Objects,
        field: &Field<'_>,
        corrections: &Corrections,
        orbits: Orbits,
    ) -> Seen {
        let at = Instants::of(field);
        let mid = field.shutter[1].epoch;
        let Tested {
            mut near,
            mut excluded,
            failed,
        } = self.tested(population, field, &at, orbits);
        near.extend(self.others.iter().map(|&index| (index, None)));
        let propagation = Propagation {
            population,
            field,
            test: field.test(&at.rotations[1], &self.bright),
            tracks: (orbits != Orbits::Scalar).then_some(&self.tracks),
            at: &at,
            earth: Earth::at(mid),
            corrections,
        };
        let results = near.par_chunks(TASK);
        let results: Vec<Vec<Outcome>> = results.map(|near| propagation.run(near)).collect();
        let mut seen = Seen {
            unknown: failed.len(),
            ..Seen::default()
        };
        for one in results.into_iter().flatten() {
            match one {
                Outcome::Seen(object) => seen.objects.push(object),
                Outcome::Excluded(index, why) => excluded.push((index, why)),
                Outcome::Failed(index, error) => {
                    seen.unknown += 1;
                    if self.reported.insert(index) {
                        seen.notices.push(error);
                    }
                }
            }
        }
        seen.objects.par_sort_unstable_by_key(|object| object.index);
        excluded.par_sort_unstable();
        seen.notices
            .extend(self.notices(population, field, &failed));
        seen.excluded = excluded;
        seen
    }
}

/// The result of the field's test, by objects' indices.
#[derive(Default)]
struct Tested {
    /// With the track's number.
    near: Vec<(u32, Option<u32>)>,
    excluded: Vec<(usize, Excluded)>,
    /// With SGP4's error code.
    failed: Vec<(u32, u8)>,
}
