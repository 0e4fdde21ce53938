//! The Rice code of CCSDS 121.0-B-3 as the ICD describes it (section 3.14), written once more for the golden vectors: the
//! shortest option of a block is found by trying all of them.

use crate::bytes::Bits;

/// Samples of a block.
const BLOCK: usize = 16;

/// The code of these pixels.
pub fn encode(pixels: &[u64], bits: usize) -> Vec<u8> {
    let most = (1_u64 << bits) - 1;
    let option_bits = if bits <= 8 { 3 } else { 4 };
    let mut out = Bits::default();
    for (number, block) in pixels.chunks(BLOCK).enumerate() {
        let before = number
            .checked_sub(1)
            .and_then(|number| pixels.get(number * BLOCK + BLOCK - 1));
        let mut samples: Vec<u64> = Vec::new();
        let mut last = before.copied();
        for pixel in block {
            samples.extend(last.map(|last| mapped(last, *pixel, most)));
            last = Some(*pixel);
        }
        let reference = if number == 0 { block.first() } else { None };
        samples.resize(BLOCK - usize::from(reference.is_some()), 0);
        let length = |k: usize| {
            samples
                .iter()
                .map(|sample| (sample >> k) as usize + 1 + k)
                .sum::<usize>()
        };
        // All ones are no compression, 0 the low-entropy options.
        let options = (1 << option_bits) - 2;
        let best = (0..options)
            .min_by_key(|k| length(*k))
            .filter(|k| length(*k) < samples.len() * bits);
        out.put(
            best.map_or((1 << option_bits) - 1, |k| k as u64 + 1),
            option_bits,
        );
        out.put(
            reference.copied().unwrap_or_default(),
            reference.map_or(0, |_| bits),
        );
        for sample in samples.iter().filter(|_| best.is_some()) {
            out.put(1, (sample >> best.unwrap_or_default()) as usize + 1);
        }
        for sample in &samples {
            out.put(*sample, best.unwrap_or(bits));
        }
    }
    out.octets()
}

/// The prediction error mapper.
fn mapped(predicted: u64, pixel: u64, most: u64) -> u64 {
    let side = predicted.min(most - predicted);
    let error = pixel.abs_diff(predicted);
    match (error <= side, pixel >= predicted) {
        (true, true) => 2 * error,
        (true, false) => 2 * error - 1,
        (false, _) => side + error,
    }
}
