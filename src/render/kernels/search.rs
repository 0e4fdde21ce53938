//! Poisson draws of small means in vector lanes: all pixels of a group take each step of the
//! search, until the last has its result.
//!
//! A search in double precision agrees with the twin, `rng::poisson`. Single precision has twice as
//! many lanes and a shorter series. It agrees too, if a word is farther than [`poisson::UNSURE`]
//! from each step of the cumulative distribution. Otherwise the group is searched again in double
//! precision.

use skyloop_base::rng::normal::{uniform_f32, uniform_of};
use skyloop_base::rng::poisson::{self, SEARCHED};

/// Pixels of a block: they stay in the first-level cache.
pub(super) const BLOCK: usize = 256;

/// Means searched in parallel lanes.
const LANES: usize = 32;

/// The draws of means below 16; undefined for others.
#[inline(always)]
pub(super) fn search(means: &[f32; BLOCK], words: &[u32; BLOCK], draws: &mut [f32; BLOCK]) {
    let (words, draws) = (words.as_chunks().0, draws.as_chunks_mut().0);
    let lanes = means.as_chunks().0.iter().zip(words);
    for ((means, words), draws) in lanes.zip(draws) {
        if !search_quickly(means, words, draws) {
            search_finely(means, words, draws);
        }
    }
}

/// The draws in single precision; returns whether all are certain.
#[inline(always)]
fn search_quickly(means: &[f32; LANES], words: &[u32; LANES], draws: &mut [f32; LANES]) -> bool {
    let [mut mean, mut probability, mut left] = [[0.0; LANES]; 3];
    let mut nearest = [1.0_f32; LANES];
    for i in 0..LANES {
        mean[i] = if means[i] < SEARCHED { means[i] } else { 0.0 };
        probability[i] = poisson::exp_minus_f32(mean[i]);
        left[i] = uniform_f32(words[i]);
    }
    // The number of steps, and of steps beyond the draw: these have a negative rest, with the sign
    // bit set. Wrapping sums vectorize; checked sums do not.
    let (mut k, mut beyond) = (0, [0_u32; LANES]);
    for two in poisson::INVERSE_OF_NEXT.as_chunks::<2>().0 {
        for inverse in two {
            for i in 0..LANES {
                left[i] -= probability[i];
                beyond[i] = beyond[i].wrapping_add(left[i].to_bits() >> 31);
                probability[i] *= mean[i] * inverse;
                let distance = left[i].abs();
                nearest[i] = if distance < nearest[i] {
                    distance
                } else {
                    nearest[i]
                };
            }
        }
        k += 2;
        let more = |left: &f32| u32::from(*left >= 0.0);
        if left.iter().map(more).fold(0, |any, more| any | more) == 0 {
            break;
        }
    }
    for (draw, beyond) in draws.iter_mut().zip(beyond) {
        *draw = (k - beyond as i32) as f32;
    }
    let near = |distance: &f32| u32::from(*distance < poisson::UNSURE);
    nearest.iter().map(near).fold(0, |any, near| any | near) == 0
}

/// The draws in double precision, like the twin.
#[inline(always)]
fn search_finely(means: &[f32; LANES], words: &[u32; LANES], draws: &mut [f32; LANES]) {
    let [mut mean, mut u, mut probability, mut cumulative, mut k] = [[0.0; LANES]; 5];
    for i in 0..LANES {
        mean[i] = f64::from(if means[i] < SEARCHED { means[i] } else { 0.0 });
        u[i] = uniform_of(words[i]);
        probability[i] = poisson::exp_minus(mean[i]);
        cumulative[i] = probability[i];
    }
    for inverse in &poisson::INVERSE[1..] {
        let mut steps = 0;
        for i in 0..LANES {
            let step = u[i] >= cumulative[i];
            steps |= u64::from(step);
            k[i] += if step { 1.0 } else { 0.0 };
            probability[i] *= mean[i] * inverse;
            cumulative[i] += probability[i];
        }
        if steps == 0 {
            break;
        }
    }
    for (draw, k) in draws.iter_mut().zip(&k) {
        *draw = *k as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_base::rng::poisson::Switch;

    /// Words on both sides of each step of the distribution, from adjacent ones to those where
    /// single precision is certain, and the extreme words.
    fn words(mean: f32) -> Vec<u32> {
        let mut words = vec![0, 1, 0x7FFF_FFFF, 0x8000_0000, u32::MAX];
        let (mean, all) = (f64::from(mean), 4_294_967_296.0);
        let mut probability = libm::exp(-mean);
        let mut cumulative = probability;
        for k in 1..40 {
            for away in [0.0, 1.0, 3e2, 1e4, 4e4, 4.4e4, 1e5, 1e6] {
                for position in [cumulative * all - away, cumulative * all + away] {
                    let position = position.clamp(0.0, all - 1.0) as u32;
                    // The upper half counts down.
                    words.push(if position >> 31 == 0 {
                        position
                    } else {
                        !position | 0x8000_0000
                    });
                }
            }
            probability *= mean / f64::from(k);
            cumulative += probability;
        }
        words
    }

    #[test]
    fn words_near_a_step_agree_with_single_draws() {
        let (mut sure, mut unsure) = (0, 0);
        for i in 0..1600 {
            let mean = (i as f32 + 0.37) * 0.01;
            let mut words = words(mean);
            words.resize(words.len().next_multiple_of(BLOCK), 12345);
            let means = [mean; BLOCK];
            for words in words.as_chunks::<BLOCK>().0 {
                let exact = words.map(|word| poisson::poisson(mean, word, Switch::within(0.0)));
                let mut draws = [0.0; BLOCK];
                search(&means, words, &mut draws);
                assert_eq!(draws, exact, "{mean}");
                for (words, exact) in words.iter().zip(exact) {
                    let (means, words) = ([mean; LANES], [*words; LANES]);
                    let mut draws = [0.0; LANES];
                    if search_quickly(&means, &words, &mut draws) {
                        assert_eq!(draws, [exact; LANES], "{mean}, {:x}", words[0]);
                        sure += 1;
                    } else {
                        unsure += 1;
                    }
                }
            }
        }
        println!("{sure} sure, {unsure} not");
        assert!(sure > 100_000 && unsure > 100_000);
    }

    /// The error of single precision is below half of [`poisson::UNSURE`].
    #[test]
    fn single_precision_errs_by_less_than_the_margin() {
        for i in 0..1600 {
            let mean = (i as f32 + 0.37) * 0.01;
            let (mut quick, mut fine) = (
                poisson::exp_minus_f32(mean),
                poisson::exp_minus(mean.into()),
            );
            let (mut left, mut cumulative) = (1.0_f32, 0.0_f64);
            for (k, inverse) in poisson::INVERSE_OF_NEXT.iter().enumerate() {
                left -= quick;
                cumulative += fine;
                let off = (f64::from(left) - (1.0 - cumulative)).abs();
                assert!(
                    off < 0.5 * f64::from(poisson::UNSURE),
                    "{mean}, {k}: {off:e}"
                );
                quick *= mean * inverse;
                fine *= f64::from(mean) / (k + 1) as f64;
            }
        }
        for word in (0..u32::MAX).step_by(9973) {
            let off = f64::from(uniform_f32(word)) - uniform_of(word);
            assert!(off.abs() < 1e-7, "{word:x}: {off:e}");
        }
    }
}
