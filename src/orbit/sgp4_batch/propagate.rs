//! Propagates many blocks at a time. Each step is done for all of them before the next. In a single
//! block every operation would wait for the one before.

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
pub(super) struct SingleObject<const N: usize> {
    /// The object's slot in the catalogue's blocks.
    pub slot: usize,
    pub instants: Instants,
}

impl<const N: usize> Request for SingleObject<N> {
    fn block(&self) -> usize {
        self.slot / BLOCK
    }

    #[inline(always)]
    fn slots(&self) -> usize {
        N
    }

    #[inline(always)]
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S> {
        let part = part.broadcast(self.slot % BLOCK);
        block.perturbed(part, block.secular().minutes_to(part, &self.instants))
    }
}

/// Propagates up to `N` blocks, with the instructions of a level.
pub(super) struct Propagate<'a, M, A, const N: usize> {
    pub blocks: &'a [M],
    /// The number of the first block.
    pub first: usize,
    pub requests: &'a [A],
    pub states: &'a mut [BlockStates],
}

impl<M: Model, A: Request, const N: usize> WithSimd for Propagate<'_, M, A, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut work = [const { Intermediate::EMPTY }; N];
        for (request, work) in self.requests.iter().zip(&mut work) {
            if let Some(block) = self.blocks.get(request.block() - self.first) {
                for part in Part::first(simd, request.slots()) {
                    request.perturbed(block, part).long_period(part, work);
                }
            }
        }
        for (request, work) in self.requests.iter().zip(&mut work) {
            for part in Part::first(simd, request.slots()) {
                work.solve(part);
            }
        }
        for ((request, work), states) in self.requests.iter().zip(&work).zip(self.states) {
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
