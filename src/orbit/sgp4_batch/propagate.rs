//! Propagates many blocks at a time. Each step is done for all of them before the next. In a single
//! block every operation would wait for the one before.
//!
//! The first step depends on the kind of block. The others do not, and are compiled once for all
//! kinds.

use super::block::BlockStates;
use super::lanes::{BLOCK, Part};
use super::model::Model;
use super::secular::{Instant, Instants, When};
use super::short_period::{Intermediate, Perturbed};
use hifitime::Epoch;
use pulp::{Simd, WithSimd};

/// A request for the states of a block.
pub(crate) trait Request {
    /// The number of the block.
    fn block(&self) -> usize;

    /// How many slots of the result are used.
    fn slots(&self) -> usize;

    /// The perturbed mean elements.
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S>;
}

/// A block at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Requested {
    pub(super) block: usize,
    pub(super) when: When,
}

impl Requested {
    /// The block at an instant.
    pub fn of(block: usize, t: Epoch) -> Requested {
        let when = When::At(Instant::of(t));
        Requested { block, when }
    }
}

impl Request for Requested {
    fn block(&self) -> usize {
        self.block
    }

    // A constant: its loops have a fixed length.
    #[inline(always)]
    fn slots(&self) -> usize {
        BLOCK
    }

    #[inline(always)]
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S> {
        block.perturbed(part, block.secular().minutes(part, self.when))
    }
}

/// One object at several instants, each in its own slot.
#[derive(Clone, Copy, Debug)]
pub(super) struct SingleObject {
    /// The object's slot in the catalogue's blocks.
    pub slot: usize,
    pub instants: Instants,
}

impl Request for SingleObject {
    fn block(&self) -> usize {
        self.slot / BLOCK
    }

    #[inline(always)]
    fn slots(&self) -> usize {
        self.instants.count
    }

    #[inline(always)]
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S> {
        let part = part.broadcast(self.slot % BLOCK);
        block.perturbed(part, block.secular().minutes_to(part, &self.instants))
    }
}

/// The first step: mean elements with perturbations, and long-period terms.
pub(super) struct Begin<'a, M, A> {
    pub blocks: &'a [M],
    /// The number of the first block.
    pub first: usize,
    pub requests: &'a [A],
    pub work: &'a mut [Intermediate],
}

impl<M: Model, A: Request> WithSimd for Begin<'_, M, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (request, work) in self.requests.iter().zip(self.work) {
            if let Some(block) = self.blocks.get(request.block() - self.first) {
                for part in Part::first(simd, request.slots()) {
                    request.perturbed(block, part).long_period(part, work);
                }
            }
        }
    }
}

/// The other steps: Kepler's equation and short-period terms.
pub(super) struct Finish<'a, A> {
    pub requests: &'a [A],
    pub work: &'a mut [Intermediate],
    pub states: &'a mut [BlockStates],
}

impl<A: Request> WithSimd for Finish<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for (request, work) in self.requests.iter().zip(&mut *self.work) {
            for part in Part::first(simd, request.slots()) {
                work.solve(part);
            }
        }
        for ((request, work), states) in self.requests.iter().zip(self.work).zip(self.states) {
            for part in Part::first(simd, request.slots()) {
                work.state(part, states);
            }
        }
    }
}

/// Advances the integrators of blocks.
pub(super) struct Advance<'a, M> {
    pub when: When,
    pub blocks: &'a mut [M],
}

impl<M: Model> WithSimd for Advance<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for block in self.blocks {
            for part in Part::all(simd) {
                block.advance(part, self.when);
            }
        }
    }
}
