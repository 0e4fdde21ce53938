//! Counts of draws over all 2^32 words, measured by search or by counting, and expected.

use crate::runs::{ALL, Poissons, RUN, runs};
use crate::theory::Theory;
use skyloop_base::rng::poisson::{Switch, poisson};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The word at a position in (0, 1), counted in parts of 2^-32.
pub fn word_at(position: u64) -> u32 {
    const HALF: u64 = 1 << 31;
    if position < HALF {
        position as u32
    } else {
        1 << 31 | (2 * HALF - 1 - position) as u32
    }
}

/// Counts of draws over all words, and the expected distribution.
pub struct Drawn {
    pub mean: f32,
    theory: Theory,
    /// By the draw, from the theory's first one on.
    words: Vec<u64>,
}

impl Drawn {
    /// By search. Draws rise monotonically with the word's position, because sums rise and
    /// positions are exact. The positions of the steps give all counts.
    pub fn searched(mean: f32, switch: Switch) -> Drawn {
        let theory = Theory::of(mean);
        let draw = |position| poisson(mean, word_at(position), switch) as usize;
        assert!(draw(0) >= theory.first, "{mean}");
        let (mut before, mut due, mut words) = (0, 0.0, Vec::new());
        for (k, p) in (theory.first..).zip(&theory.probability) {
            due += p * ALL;
            let (mut low, mut high) = (before, 1 << 32);
            let narrow = |low: &mut u64, high: &mut u64, position| {
                if draw(position) <= k {
                    *low = position + 1;
                } else {
                    *high = position;
                }
            };
            // The step lies near its expected position.
            for position in [(due as u64).saturating_sub(64), due as u64 + 64] {
                if (low..high).contains(&position) {
                    narrow(&mut low, &mut high, position);
                }
            }
            while low < high {
                let middle = low + (high - low) / 2;
                narrow(&mut low, &mut high, middle);
            }
            words.push(low - before);
            before = low;
        }
        assert_eq!(before, 1 << 32, "{mean}");
        Drawn {
            mean,
            theory,
            words,
        }
    }

    /// By the expansion, word by word: its draws are not monotonic in the position.
    pub fn expanded(means: &[f32]) -> Vec<Drawn> {
        let theories: Vec<Theory> = means.iter().map(|mean| Theory::of(*mean)).collect();
        let none = |theory: &Theory| -> Vec<AtomicU64> {
            let draws = theory.probability.iter();
            draws.map(|_| AtomicU64::new(0)).collect()
        };
        let counts: Vec<Vec<AtomicU64>> = theories.iter().map(none).collect();
        runs(|arch, _, z| {
            let mut draws = [0.0; RUN];
            for ((mean, theory), counts) in means.iter().zip(&theories).zip(&counts) {
                let count = |draw: f32, words: usize| {
                    counts[draw as usize - theory.first].fetch_add(words as u64, Relaxed)
                };
                let mean = *mean;
                let draws = &mut draws;
                if arch.dispatch(Poissons { mean, z, draws }) {
                    count(draws[0], RUN);
                } else {
                    for same in draws.chunk_by(|a, b| a == b) {
                        count(same[0], same.len());
                    }
                }
            }
        });
        let drawn = means.iter().zip(theories).zip(counts);
        let drawn = drawn.map(|((mean, theory), counts)| Drawn {
            mean: *mean,
            theory,
            words: counts.into_iter().map(AtomicU64::into_inner).collect(),
        });
        drawn.collect()
    }

    /// The total-variation distance from Poisson's distribution.
    pub fn variation(&self) -> f64 {
        let both = self.words.iter().zip(&self.theory.probability);
        let apart = both.map(|(words, p)| (*words as f64 / ALL - p).abs());
        apart.sum::<f64>() / 2.0
    }

    /// Measured and expected number of words beyond `sigmas` standard deviations.
    pub fn tail(&self, sigmas: f64) -> [f64; 2] {
        let mean = f64::from(self.mean);
        let edge = mean + sigmas * mean.sqrt();
        let both = (self.theory.first..).zip(self.words.iter().zip(&self.theory.probability));
        let beyond = both.filter(|(k, _)| (*k as f64 - edge) * sigmas > 0.0);
        beyond.fold([0.0; 2], |[words, due], (_, (n, p))| {
            [words + *n as f64, due + p * ALL]
        })
    }
}
