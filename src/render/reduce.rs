//! Maxima over many pixels in vector lanes, with the same result on every processor.

use rayon::prelude::*;

const LANES: usize = 16;
/// Values of a chunk: independent of the number of threads.
const CHUNK: usize = 1 << 16;

/// The greatest value; at least 0.
pub fn greatest(values: &[f32]) -> f32 {
    if values.len() <= CHUNK {
        return greatest_of(values);
    }
    let greatest = values.par_chunks(CHUNK).map(greatest_of);
    greatest.reduce(|| 0.0, f32::max)
}

fn greatest_of(values: &[f32]) -> f32 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    chunks.iter().for_each(|chunk| raise(&mut lanes, chunk));
    lanes.iter().chain(rest).copied().fold(0.0, f32::max)
}

/// The greatest difference of values at the same index, up to the shorter length.
pub fn max_difference(values: &[f32], others: &[f32]) -> f32 {
    let both = values.len().min(others.len());
    let (chunks, rest) = values[..both].as_chunks::<LANES>();
    let (other_chunks, other_rest) = others[..both].as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    for (chunk, others) in chunks.iter().zip(other_chunks) {
        raise(
            &mut lanes,
            &std::array::from_fn(|i| (chunk[i] - others[i]).abs()),
        );
    }
    let rest = rest.iter().zip(other_rest).map(|(a, b)| (a - b).abs());
    lanes.into_iter().chain(rest).fold(0.0, f32::max)
}

/// `f32::max` would prevent vectorization by its handling of NaN.
fn raise(lanes: &mut [f32; LANES], to: &[f32; LANES]) {
    for (lane, to) in lanes.iter_mut().zip(to) {
        *lane = if to > lane { *to } else { *lane };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_agree_with_single_values() {
        for count in [0, 1, 15, 16, 17, 1000] {
            let values: Vec<f32> = (0..count).map(|i| ((i * 37) % 101) as f32 - 20.0).collect();
            let others: Vec<f32> = values.iter().rev().copied().collect();
            let max = values.iter().copied().fold(0.0, f32::max);
            let differences = values.iter().zip(&others).map(|(a, b)| (a - b).abs());
            assert_eq!(greatest(&values), max);
            assert_eq!(
                max_difference(&values, &others),
                differences.fold(0.0, f32::max)
            );
        }
    }
}
