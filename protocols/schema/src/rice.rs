//! A second encoder of the Rice code of CCSDS 121.0-B-3 (ICD, section 3.14), for the golden
//! vectors. It tries all options of a block to find the shortest.

use crate::bytes::Bits;

/// Samples of a block.
const BLOCK: usize = 16;

/// Compresses pixels.
pub fn encode(pixels: &[u64], bits: usize) -> Vec<u8> {
    let max = (1_u64 << bits) - 1;
    let option_bits = if bits <= 8 { 3 } else { 4 };
    // Identifier of no compression: all ones. 0 is for the low-entropy options.
    let raw = (1 << option_bits) - 1;
    let mut out = Bits::default();
    let mut last: Option<u64> = None;
    for block in pixels.chunks(BLOCK) {
        let reference = block.first().filter(|_| last.is_none());
        let mut samples: Vec<u64> = Vec::new();
        for pixel in block {
            samples.extend(last.map(|last| mapped(last, *pixel, max)));
            last = Some(*pixel);
        }
        samples.resize(BLOCK - usize::from(reference.is_some()), 0);
        let length = |k: &usize| {
            let lengths = samples.iter().map(|sample| (sample >> k) as usize + 1 + k);
            lengths.sum::<usize>()
        };
        let best = (0..raw - 1).min_by_key(length);
        let best = best.filter(|k| length(k) < samples.len() * bits);
        out.put(best.map_or(raw, |k| k + 1) as u64, option_bits);
        if let Some(reference) = reference {
            out.put(*reference, bits);
        }
        if let Some(k) = best {
            for sample in &samples {
                out.put(1, (sample >> k) as usize + 1);
            }
        }
        for sample in &samples {
            out.put(*sample, best.unwrap_or(bits));
        }
    }
    out.bytes()
}

/// The prediction error mapper.
fn mapped(predicted: u64, pixel: u64, max: u64) -> u64 {
    let side = predicted.min(max - predicted);
    let error = pixel.abs_diff(predicted);
    match (error <= side, pixel >= predicted) {
        (true, true) => 2 * error,
        (true, false) => 2 * error - 1,
        (false, _) => side + error,
    }
}
