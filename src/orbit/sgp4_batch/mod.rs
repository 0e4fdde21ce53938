//! SGP4 and SDP4 of a whole catalogue at once.
//!
//! ```text
//! Elements -> sgp4 crate: constants -> rows of blocks of 8 -> lanes of 1, 2, 4 or 8 -> position, velocity, code
//! ```
//!
//! Blocks are sorted by kind of orbit: near the Earth, deep space, and there resonant with a day or
//! half a day. All other cases are masks. The constants are those of the `sgp4` crate, whose scalar
//! propagation ([`Elements::state_teme`]) is the reference in tests:
//!
//! | module | what |
//! |---|---|
//! | `level` | vector instructions of the processor |
//! | `lanes`, `trig` | arithmetic on several objects side by side |
//! | `figures` | constants of one object |
//! | `site` | kind of orbit |
//! | `secular`, `near`, `deep`, `resonance` | perturbed mean elements |
//! | `short_period` | from these to positions and velocities |
//! | `propagate` | many blocks at a time, step by step |
//!
//! A state depends on elements and time alone: not on threads, processor, neighbours or earlier
//! calls.

mod deep;
mod figures;
mod lanes;
mod level;
mod near;
mod propagate;
mod resonance;
mod secular;
mod short_period;
mod site;
mod trig;

pub use lanes::{BLOCK, Row};
pub use level::Level;

use crate::StateVector;
use crate::elements::{Elements, ModelError};
use deep::Deep;
use figures::Figures;
use hifitime::Epoch;
use lanes::{Lanes, Part};
use nalgebra::Vector3;
use near::Near;
use propagate::Advance;
pub(crate) use propagate::Asked;
use pulp::Simd;
use rayon::prelude::*;
use resonance::{Free, HalfDay, OneDay};
use secular::{Instant, Secular, When};
use short_period::Perturbed;
use site::Site;
use std::sync::OnceLock;

/// The reference's code of a position inside the Earth.
pub const DECAYED: u8 = 6;
/// Not a code of the reference: farther from the epoch than
/// [`MAX_ELAPSED_DAYS`](crate::elements::MAX_ELAPSED_DAYS).
pub const TOO_FAR: u8 = 7;
/// Not a code of the reference: numbers that are not finite.
pub const UNKNOWN: u8 = 8;

/// Blocks that a thread takes at a time.
const CHUNK: usize = 32;

/// A catalogue, ready to propagate.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    level: Level,
    near: Vec<Near>,
    deep: Vec<Deep<Free>>,
    one_day: Vec<Deep<OneDay>>,
    half_day: Vec<Deep<HalfDay>>,
    /// The place of each object of the input.
    places: Vec<u32>,
    /// The object in each place, or [`NOBODY`].
    objects: Vec<u32>,
}

/// Marks the unused places of a block.
pub const NOBODY: u32 = u32::MAX;

/// The states of a block, TEME; zero where the code is not.
#[derive(Clone, Debug, Default)]
#[repr(align(64))]
pub struct BlockStates {
    /// x, y, z, km.
    pub position_km: [Row; 3],
    /// x, y, z, km/s.
    pub velocity_km_s: [Row; 3],
    /// 0, or the code of a failure, see [`States::get`].
    pub code: Row,
}

/// The states of a catalogue. Its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct States {
    blocks: Vec<BlockStates>,
    places: Vec<u32>,
}

/// A block of one kind of orbits.
trait Model: Default + Send + Sync {
    const SITE: Site;

    fn set(&mut self, i: usize, elements: &Elements, figures: &Figures);
    /// Integrates to near an instant, and keeps the state.
    fn advance<S: Simd>(&mut self, _: Part<S>, _: When) {}
    fn secular(&self) -> &Secular;
    /// The mean elements `t` min after the epochs, with all but their short-period perturbations.
    fn perturbed<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Perturbed<S>;
}

impl Batch {
    /// Errors: the first set that the model cannot start from.
    pub fn new(sets: &[Elements]) -> Result<Batch, ModelError> {
        let sites = sets.par_iter().map(Site::of);
        let sites: Vec<Result<Site, ModelError>> = sites.collect();
        let sites: Vec<Site> = sites.into_iter().collect::<Result<_, _>>()?;
        let mut batch = Batch {
            level: Level::best(),
            places: vec![NOBODY; sets.len()],
            ..Batch::default()
        };
        batch.near = batch.fill(sets, &sites)?;
        batch.deep = batch.fill(sets, &sites)?;
        batch.one_day = batch.fill(sets, &sites)?;
        batch.half_day = batch.fill(sets, &sites)?;
        Ok(batch)
    }

    /// The blocks of one kind. An object's constants (600 bytes) are written straight to their
    /// place.
    fn fill<M: Model>(&mut self, sets: &[Elements], sites: &[Site]) -> Result<Vec<M>, ModelError> {
        let ours = (0..sites.len()).filter(|at| sites[*at] == M::SITE);
        let ours: Vec<usize> = ours.collect();
        let members = ours.chunks(BLOCK);
        for object in members.flat_map(|members| (0..BLOCK).map(|i| members.get(i).copied())) {
            if let Some(place) = object.and_then(|at| self.places.get_mut(at)) {
                *place = self.objects.len() as u32;
            }
            self.objects.push(object.map_or(NOBODY, |at| at as u32));
        }
        let failed = OnceLock::new();
        let block = |members: &[usize]| {
            let mut block = M::default();
            for i in 0..BLOCK {
                // The last one fills unused places.
                let member = members.get(i).or(members.last());
                let Some(elements) = member.and_then(|&at| sets.get(at)) else {
                    continue;
                };
                match M::SITE.figures(elements) {
                    Ok(figures) => block.set(i, elements, &figures),
                    Err(error) => drop(failed.set(error)),
                }
            }
            block
        };
        let blocks = ours.par_chunks(BLOCK).map(block).collect();
        failed.into_inner().map_or(Ok(blocks), Err)
    }

    /// Number of objects.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.objects.len() / BLOCK
    }

    /// The objects of the input in a block's places, or [`NOBODY`].
    pub fn objects_of(&self, block: usize) -> &[u32] {
        let from = block * BLOCK;
        self.objects.get(from..from + BLOCK).unwrap_or(&[])
    }

    /// The instructions that are used.
    pub fn level(&self) -> Level {
        self.level
    }

    /// Uses these instructions; the portable ones where the processor lacks them.
    pub fn set_level(&mut self, level: Level) {
        self.level = level;
    }

    /// Memory of the catalogue, bytes.
    pub fn octets(&self) -> usize {
        fn of<M>(blocks: &Vec<M>) -> usize {
            blocks.capacity() * size_of::<M>()
        }
        of(&self.near)
            + of(&self.deep)
            + of(&self.one_day)
            + of(&self.half_day)
            + of(&self.places)
            + of(&self.objects)
    }

    /// Every object at one instant.
    pub fn propagate(&mut self, t: Epoch, states: &mut States) {
        self.states(When::At(Instant::of(t)), states);
    }

    /// Every object a number of minutes after the epoch of its own elements.
    pub fn propagate_after(&mut self, minutes: f64, states: &mut States) {
        self.states(When::After(minutes), states);
    }

    fn states(&mut self, when: When, states: &mut States) {
        self.advance(when);
        states.places.clone_from(&self.places);
        let blocks = self.blocks();
        states.blocks.resize_with(blocks, BlockStates::default);
        let chunks = states.blocks.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, states)| self.blocks_at(chunk * CHUNK, when, states));
    }

    /// The state of one object at an instant, as [`States::get`] gives it.
    pub fn state(&self, object: usize, t: Epoch) -> Result<StateVector, u8> {
        let mut found = Err(UNKNOWN);
        self.states_at(&[object], &[t], |[state]| found = state);
        found
    }

    /// Integrates resonances to near an instant. States do not depend on it, but their time does.
    pub(crate) fn advance_to(&mut self, t: Epoch) {
        self.advance(When::At(Instant::of(t)));
    }

    /// The blocks from `first` on at an instant, as many as `states` has.
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
}

impl BlockStates {
    /// Nothing is known yet.
    pub(crate) const NONE: BlockStates = BlockStates {
        position_km: [[0.0; BLOCK]; 3],
        velocity_km_s: [[0.0; BLOCK]; 3],
        code: [UNKNOWN as f64; BLOCK],
    };

    fn get(&self, i: usize) -> Result<StateVector, u8> {
        let vector = |rows: &[Row; 3]| Vector3::from_fn(|axis, _| rows[axis][i] * 1e3);
        match self.code[i] as u8 {
            0 => Ok(StateVector {
                position_m: vector(&self.position_km),
                velocity_m_s: vector(&self.velocity_km_s),
            }),
            code => Err(code),
        }
    }
}

impl States {
    /// The state of an object of the input, TEME, m and m/s; or the code of its failure: that of
    /// the reference (1 mean eccentricity, 2 mean motion, 3 perturbed eccentricity, 4 semi-latus
    /// rectum, 6 decayed), [`TOO_FAR`] or [`UNKNOWN`], also for an index without an object.
    pub fn get(&self, object: usize) -> Result<StateVector, u8> {
        let place = self.places.get(object).copied().unwrap_or(NOBODY) as usize;
        let states = self.blocks.get(place / BLOCK);
        states.map_or(Err(UNKNOWN), |states| states.get(place % BLOCK))
    }
}
