//! A catalogue in blocks of objects.

use super::block::{BlockStates, NO_OBJECT, UNKNOWN};
use super::deep::Deep;
use super::lanes::BLOCK;
use super::level::Level;
use super::model::Model;
use super::near::Near;
use super::orbit_kind::OrbitKind;
use super::propagate::{Advance, Begin, Finish, Request, Requested, SingleObject};
use super::resonance::{Free, HalfDay, OneDay};
use super::secular::{Instant, Instants, When};
use super::short_period::Intermediate;
use crate::StateVector;
use crate::elements::{Elements, ModelError};
use hifitime::Epoch;
use rayon::prelude::*;
use std::sync::OnceLock;

/// Blocks of one work item of a thread.
const CHUNK: usize = 32;

/// A catalogue, ready to propagate.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    level: Level,
    near: Vec<Near>,
    deep: Vec<Deep<Free>>,
    one_day: Vec<Deep<OneDay>>,
    half_day: Vec<Deep<HalfDay>>,
    /// The slot of each object of the input.
    slots: Vec<u32>,
    /// The object in each slot, or [`NO_OBJECT`].
    objects: Vec<u32>,
}

/// The states of a catalogue, in reused memory.
#[derive(Clone, Debug, Default)]
pub struct States {
    blocks: Vec<BlockStates>,
    slots: Vec<u32>,
}

impl Batch {
    /// Sorts the objects into blocks.
    ///
    /// # Errors
    ///
    /// The first element set that SGP4 cannot start from.
    pub fn new(sets: &[Elements]) -> Result<Batch, ModelError> {
        let sites = sets.par_iter().map(OrbitKind::of);
        let sites: Vec<Result<OrbitKind, ModelError>> = sites.collect();
        let sites: Vec<OrbitKind> = sites.into_iter().collect::<Result<_, _>>()?;
        let mut batch = Batch {
            level: Level::best(),
            slots: vec![NO_OBJECT; sets.len()],
            ..Batch::default()
        };
        batch.near = batch.fill(sets, &sites)?;
        batch.deep = batch.fill(sets, &sites)?;
        batch.one_day = batch.fill(sets, &sites)?;
        batch.half_day = batch.fill(sets, &sites)?;
        Ok(batch)
    }

    /// The blocks of one kind. Constants (600 bytes an object) are written directly to their slot.
    fn fill<M: Model>(
        &mut self,
        sets: &[Elements],
        sites: &[OrbitKind],
    ) -> Result<Vec<M>, ModelError> {
        let members = (0..sites.len()).filter(|at| sites[*at] == M::KIND);
        let members: Vec<usize> = members.collect();
        for block in members.chunks(BLOCK) {
            for object in (0..BLOCK).map(|i| block.get(i).copied()) {
                if let Some(slot) = object.and_then(|at| self.slots.get_mut(at)) {
                    *slot = self.objects.len() as u32;
                }
                self.objects.push(object.map_or(NO_OBJECT, |at| at as u32));
            }
        }
        let failed = OnceLock::new();
        let block = |members: &[usize]| {
            let mut block = M::default();
            for i in 0..BLOCK {
                // The last object fills unused slots.
                let member = members.get(i).or(members.last());
                let Some(elements) = member.and_then(|&at| sets.get(at)) else {
                    continue;
                };
                match M::KIND.constants(elements) {
                    Ok(constants) => block.set(i, elements, &constants),
                    Err(error) => drop(failed.set(error)),
                }
            }
            block
        };
        let blocks = members.par_chunks(BLOCK).map(block).collect();
        failed.into_inner().map_or(Ok(blocks), Err)
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.slots.len()
    }

    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Number of blocks.
    pub(crate) fn blocks(&self) -> usize {
        self.objects.len() / BLOCK
    }

    /// The objects of the input in a block's slots, or [`NO_OBJECT`].
    pub(crate) fn objects_of(&self, block: usize) -> &[u32] {
        let from = block * BLOCK;
        self.objects.get(from..from + BLOCK).unwrap_or(&[])
    }

    /// The vector instructions in use.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Sets the vector instructions; portable ones where the processor lacks them.
    pub fn set_level(&mut self, level: Level) {
        self.level = level;
    }

    /// Memory of the catalogue, bytes.
    pub(crate) fn bytes(&self) -> usize {
        fn of<M>(blocks: &Vec<M>) -> usize {
            blocks.capacity() * size_of::<M>()
        }
        of(&self.near)
            + of(&self.deep)
            + of(&self.one_day)
            + of(&self.half_day)
            + of(&self.slots)
            + of(&self.objects)
    }

    /// Propagates every object to one instant.
    pub fn propagate(&mut self, t: Epoch, states: &mut States) {
        self.states(When::At(Instant::of(t)), states);
    }

    /// Propagates every object to a number of minutes after the epoch of its elements.
    pub fn propagate_after(&mut self, minutes: f64, states: &mut States) {
        self.states(When::After(minutes), states);
    }

    fn states(&mut self, when: When, states: &mut States) {
        self.advance(when);
        states.slots.clone_from(&self.slots);
        let blocks = self.blocks();
        states.blocks.resize_with(blocks, BlockStates::default);
        let chunks = states.blocks.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, states)| self.blocks_at(chunk * CHUNK, when, states));
    }

    /// The state of one object at an instant, equal to that of [`States::get`].
    pub fn state(&self, object: usize, t: Epoch) -> Result<StateVector, u8> {
        let mut found = Err(UNKNOWN);
        self.states_at(&[object], &[t], |[state]| found = state);
        found
    }

    /// Integrates resonances to less than a step before an instant. Later calls take less time, and
    /// their states are the same.
    pub(crate) fn advance_to(&mut self, t: Epoch) {
        self.advance(When::At(Instant::of(t)));
    }

    /// The blocks from `first` on at an instant; the length of `states` is their number.
    pub(crate) fn blocks_at_epoch(&self, first: usize, t: Epoch, states: &mut [BlockStates]) {
        self.blocks_at(first, When::At(Instant::of(t)), states);
    }

    fn advance(&mut self, when: When) {
        fn all<M: Model>(level: Level, when: When, blocks: &mut [M]) {
            let chunks = blocks.par_chunks_mut(CHUNK);
            chunks.for_each(|blocks| level.run(Advance { when, blocks }));
        }
        all(self.level, when, &mut self.one_day);
        all(self.level, when, &mut self.half_day);
    }

    /// The blocks from `first` on; the length of `states` is their number.
    fn blocks_at(&self, first: usize, when: When, states: &mut [BlockStates]) {
        for (chunk, states) in states.chunks_mut(CHUNK).enumerate() {
            let first = first + chunk * CHUNK;
            let requested: [Requested; CHUNK] = std::array::from_fn(|i| Requested {
                block: first + i,
                when,
            });
            self.blocks_requested(&requested[..states.len()], states);
        }
    }

    /// Calls `each` with the states of each object in turn, at the same `N` instants (`N` is at
    /// most [`BLOCK`]).
    pub fn states_at<const N: usize>(
        &self,
        objects: &[usize],
        when: &[Epoch; N],
        mut each: impl FnMut([Result<StateVector, u8>; N]),
    ) {
        const { assert!(N <= BLOCK, "more instants than slots in a block") };
        let instants = Instants::of(when);
        let mut found = vec![BlockStates::NONE; objects.len().min(CHUNK)];
        for objects in objects.chunks(CHUNK) {
            let requests = objects.iter().map(|object| SingleObject {
                slot: self.slots.get(*object).copied().unwrap_or(NO_OBJECT) as usize,
                instants,
            });
            let requests: Vec<SingleObject> = requests.collect();
            let found = &mut found[..objects.len()];
            found.fill(BlockStates::NONE);
            self.single_objects(&requests, found);
            for states in &*found {
                each(std::array::from_fn(|i| states.get(i)));
            }
        }
    }

    /// The states of the requested blocks, in that order. The states of a missing block do not
    /// change.
    pub(crate) fn blocks_requested(&self, requested: &[Requested], states: &mut [BlockStates]) {
        self.of_kinds(requested, states);
    }

    /// The states of single objects, each in the first slots of a block.
    fn single_objects(&self, requested: &[SingleObject], states: &mut [BlockStates]) {
        self.of_kinds(requested, states);
    }

    /// Instantiated in this crate alone, by both callers above, which are not generic.
    fn of_kinds<A: Request>(&self, requested: &[A], states: &mut [BlockStates]) {
        let ends = self.ends();
        let kind = |requested: &A| ends.iter().filter(|end| requested.block() >= **end).count();
        let mut rest = states;
        for requests in requested.chunk_by(|a, b| kind(a) == kind(b)) {
            let states;
            (states, rest) = rest.split_at_mut(requests.len().min(rest.len()));
            for (requests, states) in requests.chunks(CHUNK).zip(states.chunks_mut(CHUNK)) {
                match kind(&requests[0]) {
                    0 => self.of_kind(&self.near, 0, requests, states),
                    1 => self.of_kind(&self.deep, ends[0], requests, states),
                    2 => self.of_kind(&self.one_day, ends[1], requests, states),
                    3 => self.of_kind(&self.half_day, ends[2], requests, states),
                    _ => {}
                }
            }
        }
    }

    /// The number of the first block after each kind.
    fn ends(&self) -> [usize; 4] {
        let counts = [
            self.near.len(),
            self.deep.len(),
            self.one_day.len(),
            self.half_day.len(),
        ];
        let mut end = 0;
        counts.map(|count| {
            end += count;
            end
        })
    }

    /// Propagates up to [`CHUNK`] blocks of one kind, whose first block has the number `first`.
    fn of_kind<M: Model, A: Request>(
        &self,
        blocks: &[M],
        first: usize,
        requests: &[A],
        states: &mut [BlockStates],
    ) {
        let (mut single, mut many);
        // A single block is common, and clearing all would take longer than its propagation.
        let work: &mut [Intermediate] = if requests.len() == 1 {
            single = [const { Intermediate::EMPTY }; 1];
            &mut single
        } else {
            many = [const { Intermediate::EMPTY }; CHUNK];
            &mut many[..requests.len()]
        };
        self.level.run(Begin {
            blocks,
            first,
            requests,
            work,
        });
        self.level.run(Finish {
            requests,
            work,
            states,
        });
    }
}

impl States {
    /// The state of an object of the input, TEME, m and m/s. Else the code of the reference (1 mean
    /// eccentricity, 2 mean motion, 3 perturbed eccentricity, 4 semi-latus rectum, 6 decayed),
    /// [`TOO_FAR`](super::TOO_FAR) or [`UNKNOWN`](super::UNKNOWN), also for an index without an
    /// object.
    pub fn get(&self, object: usize) -> Result<StateVector, u8> {
        let slot = self.slots.get(object).copied().unwrap_or(NO_OBJECT) as usize;
        let states = self.blocks.get(slot / BLOCK);
        states.map_or(Err(UNKNOWN), |states| states.get(slot % BLOCK))
    }
}
