//! Light of sources on pixels: adding it, and what it is worth among noise.

/// Pixels whose light is added side by side, and whose signals are.
const WIDE: usize = 8;
const LANES: usize = 4;

/// What counts of the last of such, and what does not: a product instead of jumps.
const COUNTS: [f32; 2 * WIDE] = {
    let mut counts = [0.0; 2 * WIDE];
    let mut i = 0;
    while i < WIDE {
        counts[i] = 1.0;
        i += 1;
    }
    counts
};

/// One row's pixels of what lights some.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// The first.
    pub column: u32,
    /// Where its share is among all.
    pub offset: u32,
    /// How many.
    pub length: u32,
}

/// How charge is read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// By what part a full pixel's charge is read too low (1).
    pub bend: f64,
    /// The inverse of a full pixel's charge, 1/e-.
    pub part_of_full: f64,
    /// Whether charge has shot noise: 1 or 0.
    pub shot: f64,
    /// Variance beside the charge's own, e-^2; above 0.
    pub floor: f64,
    /// Charge from which a pixel shows no more, e-.
    pub full_e: f64,
}

impl Reading {
    /// What a pixel that holds `s` beside `b` (e-) adds to the square of the ratio:
    ///
    /// ```text
    /// (c(s + b) - c(b))^2 / (c'(s + b)^2 (s + b) + floor),   c(e) = e (1 - bend e / full)
    /// ```
    #[inline(always)]
    fn term(&self, s: f64, b: f64) -> f64 {
        let held = s + b;
        let (whole, rest) = (self.bent(held), self.bent(b));
        // c(s + b) - c(b), without what both have in common
        let signal = s * (1.0 - whole) - b * (whole - rest);
        let slope = 1.0 - 2.0 * whole;
        let variance = slope * slope * self.shot * held + self.floor;
        // Not by a jump around the division, which keeps lanes from running side by side.
        let shows = (s > 0.0) & (held < self.full_e);
        let signal = if shows { signal } else { 0.0 };
        signal * signal / variance
    }

    /// What a charge is read too low by, as a part of it.
    #[inline(always)]
    fn bent(&self, e: f64) -> f64 {
        let part = e * self.part_of_full;
        let part = if part > 0.0 { part } else { 0.0 };
        self.bend * if part < 1.0 { part } else { 1.0 }
    }
}

/// Nothing is added to the pixels behind a row's last, whichever they are.
#[inline(always)]
pub fn light_body(
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
        let whole = length.next_multiple_of(WIDE);
        if let Some(pixels) = pixels.get_mut(from..from + whole)
            && let Some(shares) = shares.get(offset..offset + whole)
        {
            let mut left = length;
            let pixels = pixels.as_chunks_mut::<WIDE>().0.iter_mut();
            for (pixels, shares) in pixels.zip(shares.as_chunks::<WIDE>().0) {
                let counts = &COUNTS[WIDE - left.min(WIDE)..][..WIDE];
                left -= left.min(WIDE);
                let mut sums = *pixels;
                for i in 0..WIDE {
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
pub fn light_twin(
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
pub fn signal_body(
    reading: &Reading,
    electrons: f64,
    shares: &[f32],
    background: &[f32],
    sums: &mut [f64; LANES],
) {
    let term = |share: f32, b: f32| reading.term(electrons * f64::from(share), f64::from(b));
    let (shares, last) = shares.as_chunks::<LANES>();
    let (background, rest) = background.as_chunks::<LANES>();
    let mut all = *sums;
    for (shares, background) in shares.iter().zip(background) {
        let terms: [f64; LANES] = std::array::from_fn(|i| term(shares[i], background[i]));
        for i in 0..LANES {
            all[i] += terms[i];
        }
    }
    for (sum, (share, b)) in all.iter_mut().zip(last.iter().zip(rest)) {
        *sum += term(*share, *b);
    }
    *sums = all;
}

#[inline(always)]
pub fn signal_twin(
    reading: &Reading,
    electrons: f64,
    shares: &[f32],
    background: &[f32],
    sums: &mut [f64; LANES],
) {
    for (i, (share, b)) in shares.iter().zip(background).enumerate() {
        sums[i % LANES] += reading.term(electrons * f64::from(*share), f64::from(*b));
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
            part_of_full: 1e-4,
            shot: 1.0,
            floor: 20.0,
            full_e: 9_000.0,
        };
        // Not a multiple of what is worked out side by side.
        let shares: Vec<f32> = (0..403).map(|i| (i % 37) as f32 * 1e-3).collect();
        let background: Vec<f32> = (0..403).map(|i| (i % 11) as f32 * 30.0).collect();
        let sums = |level: Option<Level>| {
            let mut sums = [0.0; LANES];
            add_signal(level, &reading, 270e3, &shares, &background, &mut sums);
            sums
        };
        let twin = sums(None);
        assert!(twin.iter().all(|sum| *sum > 1.0));
        for level in Level::available() {
            assert_eq!(
                sums(Some(level)).map(f64::to_bits),
                twin.map(f64::to_bits),
                "{level:?}"
            );
        }
    }
}
