//! Many blocks at a time. Each step is done for all of them before the next: the long dependent
//! chain of a single block would leave the processor waiting.

use super::block::BlockStates;
use super::lanes::{BLOCK, Part};
use super::model::Model;
use super::secular::{Instant, Instants, When};
use super::short_period::{Perturbed, Way};
use hifitime::Epoch;
use pulp::{Simd, WithSimd};

/// A request to a block.
pub(crate) trait Request {
    /// The number of the block.
    fn block(&self) -> usize;

    /// How many places of the result are used.
    fn places(&self) -> usize;

    /// Its perturbed mean elements.
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S>;
}

/// A block at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Requested {
    pub(super) block: usize,
    pub(super) when: When,
}

impl Requested {
    /// That block at that instant.
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
    fn places(&self) -> usize {
        BLOCK
    }

    #[inline(always)]
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S> {
        block.perturbed(part, block.secular().minutes(part, self.when))
    }
}

/// One object at several instants, each in a place of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Alone<const N: usize> {
    /// Its place in the catalogue's blocks.
    pub place: usize,
    pub instants: Instants,
}

impl<const N: usize> Request for Alone<N> {
    fn block(&self) -> usize {
        self.place / BLOCK
    }

    #[inline(always)]
    fn places(&self) -> usize {
        N
    }

    #[inline(always)]
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S> {
        let part = part.alone(self.place % BLOCK);
        block.perturbed(part, block.secular().minutes_to(part, &self.instants))
    }
}

/// At most `N` blocks, step by step, with the instructions of a level.
pub(super) struct Propagate<'a, M, A, const N: usize> {
    pub blocks: &'a [M],
    /// The number of the first of them.
    pub first: usize,
    pub asked: &'a [A],
    pub states: &'a mut [BlockStates],
}

impl<M: Model, A: Request, const N: usize> WithSimd for Propagate<'_, M, A, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut ways = [const { Way::EMPTY }; N];
        for (requested, way) in self.asked.iter().zip(&mut ways) {
            if let Some(block) = self.blocks.get(requested.block() - self.first) {
                for part in Part::first(simd, requested.places()) {
                    requested.perturbed(block, part).long_period(part, way);
                }
            }
        }
        for (requested, way) in self.asked.iter().zip(&mut ways) {
            for part in Part::first(simd, requested.places()) {
                way.solve(part);
            }
        }
        for ((requested, way), states) in self.asked.iter().zip(&ways).zip(self.states) {
            for part in Part::first(simd, requested.places()) {
                way.state(part, states);
            }
        }
    }
}

/// The integrators of some blocks.
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
