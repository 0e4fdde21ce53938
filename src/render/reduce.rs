//! Greatest values of many pixels, in lanes that a processor works out side by side: the same on
//! every one.

use rayon::prelude::*;

const LANES: usize = 16;
/// Values that are computed one after the other, whatever threads there are.
const TOGETHER: usize = 1 << 16;

/// The greatest; 0 where none is above it.
pub fn greatest(values: &[f32]) -> f32 {
    if values.len() <= TOGETHER {
        return greatest_of(values);
    }
    let greatest = values.par_chunks(TOGETHER).map(greatest_of);
    greatest.reduce(|| 0.0, f32::max)
}

fn greatest_of(values: &[f32]) -> f32 {
    let (chunks, rest) = values.as_chunks::<LANES>();
    let mut lanes = [0.0; LANES];
    chunks.iter().for_each(|chunk| raise(&mut lanes, chunk));
    lanes.iter().chain(rest).copied().fold(0.0, f32::max)
}

/// How far values and those at the same place of `others` are apart at most, as many as both have.
pub fn furthest_apart(values: &[f32], others: &[f32]) -> f32 {
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

/// Not by `f32::max`, whose care for what is not a number keeps lanes from running side by side.
fn raise(lanes: &mut [f32; LANES], to: &[f32; LANES]) {
    for (lane, to) in lanes.iter_mut().zip(to) {
        *lane = if to > lane { *to } else { *lane };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_give_what_single_values_give() {
        for count in [0, 1, 15, 16, 17, 1000] {
            let values: Vec<f32> = (0..count).map(|i| ((i * 37) % 101) as f32 - 20.0).collect();
            let others: Vec<f32> = values.iter().rev().copied().collect();
            let most = values.iter().copied().fold(0.0, f32::max);
            let apart = values.iter().zip(&others).map(|(a, b)| (a - b).abs());
            assert_eq!(greatest(&values), most);
            assert_eq!(furthest_apart(&values, &others), apart.fold(0.0, f32::max));
        }
    }
}
