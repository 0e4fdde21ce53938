//! Lossless compression of pixels: the adaptive Rice coder of CCSDS 121.0-B-3, each packet
//! independent of the others.
//!
//! Blocks of [`BLOCK`] samples, unit-delay predictor, prediction-error mapper. Each block has one
//! option: split samples with `k` low bits, or no compression. The two low-entropy options are not
//! used. A packet starts with a reference sample and is one reference interval, so any decoder of
//! the standard reads it. Its last block is filled up with mapped samples 0, its last byte with
//! zero bits.
//!
//! Bits of a pixel in a flat field with Gaussian noise of sigma (DN):
//!
//! | sigma | bits | ratio to 16 bits |
//! |---|---|---|
//! | 1 | 2.96 | 5.4 times |
//! | 2 | 3.90 | 4.1 times |
//! | 4 | 4.88 | 3.3 times |
//! | 8 | 5.87 | 2.7 times |
//! | 60 | 8.78 | 1.8 times |

use crate::error::DecodeError;

/// Samples of a block: J of the standard.
pub const BLOCK: usize = 16;

/// Compresses as many pixels as fit `out`, in whole blocks or to the last pixel. Returns the number
/// of pixels and of bytes.
///
/// 1368 bytes hold at least 672 pixels of any content. A pixel of more than `bits` bits ends the
/// packet before its block. The result is `(0, 0)` if that is the first block, or if `bits` is not
/// 1 to 16.
pub fn encode(pixels: &[u16], bits: u8, out: &mut [u8]) -> (usize, usize) {
    let Some(coder) = Coder::new(bits) else {
        return (0, 0);
    };
    let room = out.len() * 8;
    out.fill(0);
    let mut writer = BitWriter { out, at: 0 };
    let (mut taken, mut last) = (0, None);
    for block in pixels.chunks(BLOCK) {
        if block.iter().any(|pixel| *pixel > coder.max) {
            break;
        }
        // The first sample of a packet is the reference, which is never split.
        let whole = usize::from(last.is_none());
        let mut mapped = [0; BLOCK];
        for (sample, pixel) in mapped.iter_mut().zip(block) {
            *sample = last.map_or(*pixel, |last| coder.map(last, *pixel));
            last = Some(*pixel);
        }
        let (reference, samples) = mapped.split_at(whole);
        let (k, length) = coder.choose(samples);
        if writer.at + coder.id_bits + whole * coder.bits + length > room {
            break;
        }
        writer.put(k.map_or(coder.raw_id(), |k| k as u32 + 1), coder.id_bits);
        writer.all(reference, coder.bits);
        if let Some(k) = k {
            samples.iter().for_each(|sample| writer.unary(sample >> k));
        }
        writer.all(samples, k.unwrap_or(coder.bits));
        taken += block.len();
    }
    (taken, writer.at.div_ceil(8))
}

/// Decompresses one packet into `pixels`.
///
/// # Errors
/// The bytes are not exactly as many pixels as `pixels` has.
pub fn decode(data: &[u8], bits: u8, pixels: &mut [u16]) -> Result<(), DecodeError> {
    let coder = Coder::new(bits).ok_or(corrupt("must have pixels of 1 to 16 bits"))?;
    let mut reader = BitReader { data, at: 0 };
    let mut last = None;
    for block in pixels.chunks_mut(BLOCK) {
        let k = match reader.take(coder.id_bits) {
            0 => return Err(corrupt("must not have low-entropy options")),
            id if id == coder.raw_id() => None,
            id => Some(id as usize - 1),
        };
        let mut mapped = [0; BLOCK];
        let (reference, samples) = mapped.split_at_mut(usize::from(last.is_none()));
        for sample in reference {
            *sample = reader.take(coder.bits);
        }
        for sample in samples.iter_mut().filter(|_| k.is_some()) {
            *sample = reader.unary();
        }
        let low = k.unwrap_or(coder.bits);
        for sample in samples {
            *sample = *sample << low | reader.take(low);
        }
        if reader.at > data.len() * 8 {
            return Err(corrupt("must not end before the last pixel"));
        }
        let max = mapped.iter().fold(0, |max, sample| max.max(*sample));
        let padding = mapped.get(block.len()..).unwrap_or_default();
        if max > coder.max.into() || padding.iter().any(|sample| *sample != 0) {
            return Err(corrupt("must have samples within bits, 0 after the last"));
        }
        for (pixel, sample) in block.iter_mut().zip(mapped) {
            let sample = sample as u16; // at most `coder.max`
            *pixel = last.map_or(sample, |last| coder.unmap(last, sample));
            last = Some(*pixel);
        }
    }
    if reader.at.div_ceil(8) == data.len() && reader.peek() == 0 {
        Ok(())
    } else {
        Err(corrupt("must end with the last pixel, in zero bits"))
    }
}

const fn corrupt(rule: &'static str) -> DecodeError {
    DecodeError::BadValue {
        field: "Compressed.data",
        rule,
    }
}

/// Constants for the bits of a pixel.
struct Coder {
    bits: usize,
    max: u16,
    /// Length of the option identifier of a block: 3 bits up to 8-bit samples, 4 above.
    id_bits: usize,
}

impl Coder {
    fn new(bits: u8) -> Option<Self> {
        let max = u16::MAX.checked_shr(16_u32.checked_sub(bits.into())?)?;
        let id_bits = if bits <= 8 { 3 } else { 4 };
        let bits = bits.into();
        Some(Self { bits, max, id_bits })
    }

    /// Identifier of the option "no compression"; split samples have `k + 1`.
    const fn raw_id(&self) -> u32 {
        (1 << self.id_bits) - 1
    }

    /// The prediction error mapper: small errors of either sign alternate; larger ones can have
    /// only one sign.
    fn map(&self, predicted: u16, pixel: u16) -> u16 {
        let side = predicted.min(self.max - predicted);
        let error = pixel.abs_diff(predicted);
        if error > side {
            side + error
        } else if pixel < predicted {
            2 * error - 1
        } else {
            2 * error
        }
    }

    fn unmap(&self, predicted: u16, mapped: u16) -> u16 {
        let above = self.max - predicted;
        let side = predicted.min(above);
        let one_sided = u32::from(mapped) > 2 * u32::from(side);
        if one_sided && predicted <= above {
            mapped
        } else if one_sided {
            self.max - mapped
        } else if mapped % 2 == 1 {
            predicted - mapped / 2 - 1
        } else {
            predicted + mapped / 2
        }
    }

    /// The shortest option for these samples, and its length in bits. `None`: no compression.
    ///
    /// One more split bit costs one bit a sample and saves half of the unary part, rounded up. The
    /// first `k` without a saving is the best.
    fn choose(&self, samples: &[u16]) -> (Option<usize>, usize) {
        let sum = |part: fn(u16) -> u16, k| {
            let parts = samples.iter().map(|sample| part(sample >> k));
            parts.map(usize::from).sum::<usize>()
        };
        let max_k = self.raw_id() as usize - 2;
        let k = (0..max_k)
            .find(|k| sum(|s| s.div_ceil(2), *k) <= samples.len())
            .unwrap_or(max_k);
        let split = sum(|s| s, k) + samples.len() * (k + 1);
        let raw = samples.len() * self.bits;
        if split < raw {
            (Some(k), split)
        } else {
            (None, raw)
        }
    }
}

/// Writes bits into zeroed bytes, most significant first.
struct BitWriter<'b> {
    out: &'b mut [u8],
    at: usize,
}

impl BitWriter<'_> {
    /// Writes a value of 0 to 32 bits.
    fn put(&mut self, value: u32, bits: usize) {
        let word = (u64::from(value) << 32 << (32 - bits)) >> (self.at % 8);
        let bytes = self.out.get_mut(self.at / 8..).unwrap_or_default();
        for (byte, part) in bytes.iter_mut().zip(word.to_be_bytes()).take(5) {
            *byte |= part;
        }
        self.at += bits;
    }

    /// Writes the low 0 to 16 bits of each sample.
    fn all(&mut self, samples: &[u16], bits: usize) {
        let mask = (1 << bits) - 1;
        for sample in samples {
            self.put(u32::from(*sample) & mask, bits);
        }
    }

    /// Writes `zeros` bits 0, then a 1. The bytes are 0 already.
    fn unary(&mut self, zeros: u16) {
        self.at += usize::from(zeros);
        self.put(1, 1);
    }
}

/// Reads bits from bytes, most significant first; 0 beyond the end.
struct BitReader<'a> {
    data: &'a [u8],
    at: usize,
}

impl BitReader<'_> {
    /// The next 57 bits or more, from the most significant bit.
    fn peek(&self) -> u64 {
        let rest = self.data.get(self.at / 8..).unwrap_or_default();
        let bytes = rest.first_chunk().copied().unwrap_or_else(|| {
            let mut bytes = [0; 8];
            for (to, from) in bytes.iter_mut().zip(rest) {
                *to = *from;
            }
            bytes
        });
        u64::from_be_bytes(bytes) << (self.at % 8)
    }

    /// The next 0 to 32 bits.
    fn take(&mut self, bits: usize) -> u32 {
        let value = (self.peek() >> 32) >> (32 - bits);
        self.at += bits;
        value as u32
    }

    /// The number of zeros before the next 1, limited to 2^16: every sample is smaller.
    fn unary(&mut self) -> u32 {
        let mut count = 0;
        while self.peek() >> 7 == 0 && count < 1 << 16 {
            count += 57;
            self.at += 57;
        }
        let zeros = self.peek().leading_zeros();
        self.at += zeros as usize + 1;
        (count + zeros).min(1 << 16)
    }
}
