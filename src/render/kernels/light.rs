//! Light of sources on pixels: adding it, and its signal-to-noise ratio.

/// Pixels computed in parallel lanes.
const LANES: usize = 8;
/// Pixels of a sum in single precision.
const CHUNK: usize = 256;
/// Light (e-) that counts as none: its square is close to the smallest number of single precision.
const MIN_E: f32 = 1e-15;

/// Factors of the last lanes: 1 within a row, 0 beyond it. A product avoids branches.
const COUNTS: [f32; 2 * LANES] = {
    let mut counts = [0.0; 2 * LANES];
    let mut i = 0;
    while i < LANES {
        counts[i] = 1.0;
        i += 1;
    }
    counts
};

/// The pixels of a footprint in one row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// First column.
    pub column: u32,
    /// Index of the first share.
    pub offset: u32,
    /// Number of pixels.
    pub length: u32,
}

/// Properties of the readout.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Non-linearity: the missing share of a full pixel's signal (1).
    pub bend: f64,
    /// Inverse of the full well, 1/e-.
    pub inverse_full_well: f64,
    /// Whether charge has shot noise: 1 or 0.
    pub shot_noise: f64,
    /// Variance without shot noise, e-^2; above 0.
    pub floor: f64,
    /// Saturation charge, e-.
    pub full_e: f64,
}

/// [`Reading`] in single precision, and the light of the source.
#[derive(Debug, Clone, Copy)]
struct Single {
    electrons: f32,
    bend: f32,
    inverse_full_well: f32,
    shot: f32,
    floor: f32,
    full_e: f32,
}

impl Single {
    #[inline(always)]
    fn of(reading: &Reading, electrons: f64) -> Single {
        // More than any pixel holds, with finite products.
        const MAX_E: f64 = 1e30;
        // Fainter light is ignored: its products would be subnormal.
        let counts = electrons > f64::from(MIN_E);
        Single {
            electrons: if counts {
                electrons.min(MAX_E) as f32
            } else {
                0.0
            },
            bend: reading.bend as f32,
            inverse_full_well: reading.inverse_full_well as f32,
            shot: reading.shot_noise as f32,
            floor: reading.floor as f32,
            full_e: reading.full_e.min(MAX_E) as f32,
        }
    }

    /// The term of a pixel with light s and background b (e-) in the square of the ratio:
    ///
    /// ```text
    /// (c(s + b) - c(b))^2 / (c'(s + b)^2 (s + b) + floor)
    /// c(e) = e (1 - bend p(e)),   p(e) = min(e / full, 1)
    /// c(s + b) - c(b) = s (1 - bend p(s + b)) - b bend min(s / full, 1 - p(b))
    /// ```
    #[inline(always)]
    fn term(&self, share: f32, b: f32) -> f32 {
        let s = self.electrons * share;
        let held = s + b;
        let whole = self.bend * min(held * self.inverse_full_well, 1.0);
        let rest = 1.0 - min(b * self.inverse_full_well, 1.0);
        let signal = s * (1.0 - whole) - b * self.bend * min(s * self.inverse_full_well, rest);
        let slope = 1.0 - 2.0 * whole;
        let variance = slope * slope * self.shot * held + self.floor;
        // No branch around the division: it would prevent vectorization.
        let shows = (s > MIN_E) & (held < self.full_e);
        let signal = if shows { signal } else { 0.0 };
        signal * signal / variance
    }
}

#[inline(always)]
fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Lanes beyond the end of a span add 0.
#[inline(always)]
pub(crate) fn light_body(
    electrons: f32,
    spans: &[Span],
    shares: &[f32],
    first: usize,
    wide: usize,
    pixels: &mut [f32],
) {
    for (row, span) in spans.iter().enumerate() {
        let (length, offset) = (span.length as usize, span.offset as usize);
        let from = (first + row) * wide + span.column as usize;
        let whole = length.next_multiple_of(LANES);
        if let Some(pixels) = pixels.get_mut(from..from + whole)
            && let Some(shares) = shares.get(offset..offset + whole)
        {
            let mut left = length;
            let pixels = pixels.as_chunks_mut::<LANES>().0.iter_mut();
            for (pixels, shares) in pixels.zip(shares.as_chunks::<LANES>().0) {
                let counts = &COUNTS[LANES - left.min(LANES)..][..LANES];
                left -= left.min(LANES);
                let mut sums = *pixels;
                for i in 0..LANES {
                    sums[i] = f32::mul_add(electrons * counts[i], shares[i], sums[i]);
                }
                *pixels = sums;
            }
        } else {
            let pixels = pixels[from..from + length].iter_mut();
            for (pixel, share) in pixels.zip(&shares[offset..offset + length]) {
                *pixel = f32::mul_add(electrons, *share, *pixel);
            }
        }
    }
}

#[inline(always)]
pub(crate) fn light_twin(
    electrons: f32,
    spans: &[Span],
    shares: &[f32],
    first: usize,
    wide: usize,
    pixels: &mut [f32],
) {
    for (row, span) in spans.iter().enumerate() {
        for i in 0..span.length as usize {
            let share = shares[span.offset as usize + i];
            let pixel = &mut pixels[(first + row) * wide + span.column as usize + i];
            *pixel = f32::mul_add(electrons, share, *pixel);
        }
    }
}

#[inline(always)]
pub(crate) fn signal_body(
    reading: &Reading,
    electrons: f64,
    shares: &[f32],
    background: &[f32],
    sum: &mut f64,
) {
    let reading = Single::of(reading, electrons);
    for (shares, background) in shares.chunks(CHUNK).zip(background.chunks(CHUNK)) {
        let mut sums = [0.0; LANES];
        // The last lanes are padded with zeros and use the same code: for a loop of their own, the
        // compiler would split the sums into vectors of 4, 1, 2 and 1 lanes.
        let mut add = |shares: &[f32; LANES], background: &[f32; LANES]| {
            for i in 0..LANES {
                sums[i] += reading.term(shares[i], background[i]);
            }
        };
        let (shares, last) = shares.as_chunks();
        let (background, rest) = background.as_chunks();
        for (shares, background) in shares.iter().zip(background) {
            add(shares, background);
        }
        add(&filled(last), &filled(rest));
        for part in sums {
            *sum += f64::from(part);
        }
    }
}

/// `values`, and zeros in the other lanes.
#[inline(always)]
fn filled(values: &[f32]) -> [f32; LANES] {
    std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0))
}

#[inline(always)]
pub(crate) fn signal_twin(
    reading: &Reading,
    electrons: f64,
    shares: &[f32],
    background: &[f32],
    sum: &mut f64,
) {
    let reading = Single::of(reading, electrons);
    for (shares, background) in shares.chunks(CHUNK).zip(background.chunks(CHUNK)) {
        let mut sums = [0.0; LANES];
        for (i, (share, b)) in shares.iter().zip(background).enumerate() {
            sums[i % LANES] += reading.term(*share, *b);
        }
        sums.iter().for_each(|part| *sum += f64::from(*part));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::{add_light, add_signal};
    use skyloop_orbit::sgp4_batch::Level;

    #[test]
    fn all_levels_add_the_same_light() {
        let spans: Vec<Span> = (0..23u32)
            .map(|i| Span {
                column: (7 * i) % 11,
                offset: i * (i + 1) / 2,
                length: i + 1,
            })
            .collect();
        let shares: Vec<f32> = (0..300).map(|i| 1.0 / (i as f32 + 3.0)).collect();
        let added = |level: Option<Level>| {
            let mut pixels: Vec<f32> = (0..40 * 30).map(|i| i as f32 * 0.37).collect();
            add_light(level, 1234.5, &spans, &shares, 3, 40, &mut pixels);
            pixels
        };
        let twin = added(None);
        // X-Val: by hand, row 5 of the spans: column 35 % 11 = 2, share 15 is 1 / 18.
        let (pixel, before) = (8 * 40 + 2, (8 * 40 + 2) as f32 * 0.37);
        assert_eq!(twin[pixel], 1234.5f32.mul_add(1.0 / 18.0, before));
        for level in Level::available() {
            assert_eq!(added(Some(level)), twin, "{level:?}");
        }
    }

    #[test]
    fn all_levels_add_the_same_signal() {
        let reading = Reading {
            bend: 0.03,
            inverse_full_well: 1e-4,
            shot_noise: 1.0,
            floor: 20.0,
            full_e: 9_000.0,
        };
        // Not a multiple of the lanes.
        let shares: Vec<f32> = (0..403).map(|i| (i % 37) as f32 * 1e-3).collect();
        let background: Vec<f32> = (0..403).map(|i| (i % 11) as f32 * 30.0).collect();
        let sum = |level: Option<Level>| {
            let mut sum = 0.0;
            add_signal(level, &reading, 270e3, &shares, &background, &mut sum);
            sum
        };
        let twin = sum(None);
        assert!(twin > 4.0);
        for level in Level::available() {
            assert_eq!(sum(Some(level)).to_bits(), twin.to_bits(), "{level:?}");
        }
    }
}
