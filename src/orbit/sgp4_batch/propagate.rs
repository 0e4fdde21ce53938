//! Many blocks at a time. Each step is done for all of them before the next: the long dependent
//! chain of a single block would leave the processor waiting.

use super::lanes::{BLOCK, Part};
use super::secular::{Instant, Instants, When};
use super::short_period::{Perturbed, Way};
use super::{Batch, BlockStates, CHUNK, Model, NOBODY};
use crate::StateVector;
use hifitime::Epoch;
use pulp::{Simd, WithSimd};

/// What is asked of a block.
trait Ask {
    /// Which.
    fn block(&self) -> usize;

    /// How many places of the answer count.
    fn places(&self) -> usize;

    /// The mean elements of it.
    fn perturbed<M: Model, S: Simd>(&self, block: &M, part: Part<S>) -> Perturbed<S>;
}

/// A block at one instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Asked {
    block: usize,
    when: When,
}

impl Asked {
    /// That block at that instant.
    pub fn of(block: usize, t: Epoch) -> Asked {
        let when = When::At(Instant::of(t));
        Asked { block, when }
    }
}

impl Ask for Asked {
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
struct Alone<const N: usize> {
    /// Its place in the catalogue's blocks.
    place: usize,
    instants: Instants,
}

impl<const N: usize> Ask for Alone<N> {
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

impl Batch {
    /// The blocks from `first` on at one instant, as many as `states` has.
    pub(super) fn blocks_at(&self, first: usize, when: When, states: &mut [BlockStates]) {
        for (chunk, states) in states.chunks_mut(CHUNK).enumerate() {
            let first = first + chunk * CHUNK;
            let asked: [Asked; CHUNK] = std::array::from_fn(|i| Asked {
                block: first + i,
                when,
            });
            self.blocks_asked(&asked[..states.len()], states);
        }
    }

    /// Calls `each` with the states of some objects in turn, at the same `N` instants, up to
    /// [`BLOCK`].
    pub fn states_at<const N: usize>(
        &self,
        objects: &[usize],
        when: &[Epoch; N],
        mut each: impl FnMut([Result<StateVector, u8>; N]),
    ) {
        const { assert!(N <= BLOCK, "a block has no more places") };
        let instants = Instants::of(when);
        let mut found = vec![BlockStates::NONE; objects.len().min(CHUNK)];
        for objects in objects.chunks(CHUNK) {
            let alone = objects.iter().map(|object| Alone::<N> {
                place: self.places.get(*object).copied().unwrap_or(NOBODY) as usize,
                instants,
            });
            let alone: Vec<Alone<N>> = alone.collect();
            let found = &mut found[..objects.len()];
            found.fill(BlockStates::NONE);
            self.answer(&alone, found);
            for states in &*found {
                each(std::array::from_fn(|i| states.get(i)));
            }
        }
    }

    /// Some blocks, each at its own instant.
    pub(crate) fn blocks_asked(&self, asked: &[Asked], states: &mut [BlockStates]) {
        self.answer(asked, states);
    }

    /// What is asked for, in that order; of blocks that there are not, `states` stay as they are.
    fn answer<A: Ask>(&self, asked: &[A], states: &mut [BlockStates]) {
        let ends = self.ends();
        let kind = |asked: &A| ends.iter().filter(|end| asked.block() >= **end).count();
        let mut rest = states;
        for asked in asked.chunk_by(|a, b| kind(a) == kind(b)) {
            let states;
            (states, rest) = rest.split_at_mut(asked.len().min(rest.len()));
            match kind(&asked[0]) {
                0 => self.of_kind(&self.near, 0, asked, states),
                1 => self.of_kind(&self.deep, ends[0], asked, states),
                2 => self.of_kind(&self.one_day, ends[1], asked, states),
                3 => self.of_kind(&self.half_day, ends[2], asked, states),
                _ => {}
            }
        }
    }

    /// The numbers of blocks behind the last of each kind.
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

    /// Those of one kind, whose first block has the number `first`.
    fn of_kind<M: Model, A: Ask>(
        &self,
        blocks: &[M],
        first: usize,
        asked: &[A],
        states: &mut [BlockStates],
    ) {
        for (asked, states) in asked.chunks(CHUNK).zip(states.chunks_mut(CHUNK)) {
            match asked.len() {
                1 => self.level.run(Propagate::<M, A, 1> {
                    blocks,
                    first,
                    asked,
                    states,
                }),
                _ => self.level.run(Propagate::<M, A, CHUNK> {
                    blocks,
                    first,
                    asked,
                    states,
                }),
            }
        }
    }
}

/// At most `N` blocks, step by step, with the instructions of a level.
struct Propagate<'a, M, A, const N: usize> {
    blocks: &'a [M],
    /// The number of the first of them.
    first: usize,
    asked: &'a [A],
    states: &'a mut [BlockStates],
}

impl<M: Model, A: Ask, const N: usize> WithSimd for Propagate<'_, M, A, N> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let mut ways = [const { Way::EMPTY }; N];
        for (asked, way) in self.asked.iter().zip(&mut ways) {
            if let Some(block) = self.blocks.get(asked.block() - self.first) {
                for part in Part::first(simd, asked.places()) {
                    asked.perturbed(block, part).long_period(part, way);
                }
            }
        }
        for (asked, way) in self.asked.iter().zip(&mut ways) {
            for part in Part::first(simd, asked.places()) {
                way.solve(part);
            }
        }
        for ((asked, way), states) in self.asked.iter().zip(&ways).zip(self.states) {
            for part in Part::first(simd, asked.places()) {
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
