//! The pixel loops, each compiled for several levels of vector instructions.
//!
//! The bodies are plain Rust over blocks of pixels, which the compiler vectorizes. All levels give
//! the same bits: fused multiply-adds are explicit (a function call on processors without them),
//! and no other function of the platform is called. Each body has a twin that works pixel by pixel
//! (`rng::word`, `rng::normal`, `rng::poisson`, [`Converter::dn`]); tests compare both.

#![allow(unsafe_code)]

mod bloom;
mod corners;
mod dots;
mod ends;
mod light;
mod lines;
mod pack;
mod real;
mod search;

pub use bloom::Bloom;
pub use corners::{Nodes, Place};
pub use dots::{Circle, Dot, MAX_TILE_OFFSET, Sheet};
pub use ends::{Ends, ROWS};
pub use light::{Reading, Span};
pub use lines::Lines;
pub use real::Real;

use corners::{body as corners_body, twin as corners_twin};
use dots::{body as dots_body, twin as dots_twin};
use ends::{ends_body, ends_twin};
use light::{light_body, light_twin, signal_body, signal_twin};
use pack::{body as pack_body, twin as pack_twin};
use search::{BLOCK, search};
use skyloop_base::rng::normal;
use skyloop_base::rng::poisson::{self, SEARCHED, Switch};
use skyloop_base::rng::{self, NoiseKey};
use skyloop_orbit::sgp4_batch::Level;

/// Defines a function of `level`: the body compiled with that level's instructions, or with the
/// baseline instructions; without a level, the twin.
macro_rules! kernel {
    ($(#[$doc:meta])* $name:ident = $body:ident, $twin:ident ($($arg:ident: $type:ty),*)) => {
        $(#[$doc])*
        pub fn $name(level: Option<Level>, $($arg: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512cd,avx512dq,avx512vl,fma")]
                fn avx512($($arg: $type),*) {
                    $body($($arg),*);
                }
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,fma")]
                fn avx2($($arg: $type),*) {
                    $body($($arg),*);
                }
                // With FMA, for a fair comparison of times, but without wide vectors.
                #[target_feature(enable = "fma")]
                fn fused($($arg: $type),*) {
                    $twin($($arg),*);
                }
                if level == Some(Level::Avx512) && Level::Avx512.is_available() {
                    // SAFETY: the processor has these instructions.
                    return unsafe { avx512($($arg),*) };
                }
                if level == Some(Level::Avx2) && Level::Avx2.is_available() {
                    // SAFETY: the processor has these instructions.
                    return unsafe { avx2($($arg),*) };
                }
                if level.is_none() && Level::Avx2.is_available() {
                    // SAFETY: the AVX2 level includes FMA.
                    return unsafe { fused($($arg),*) };
                }
            }
            match level {
                Some(_) => $body($($arg),*),
                None => $twin($($arg),*),
            }
        }
    };
}

kernel! {
    /// Draws pixels' electrons from their means, from pixel `first` on, each with the random word
    /// of its pixel (`rng::word`).
    shot_noise = shot_body, shot_twin (key: NoiseKey, effect: u8, first: usize, switch: Switch, electrons: &mut [f32])
}

kernel! {
    /// Adds normal noise of `sigma` (e-) to pixels from `first` on, each with the random word of
    /// its pixel.
    read_noise = read_body, read_twin (key: NoiseKey, effect: u8, first: usize, sigma: f32, electrons: &mut [f32])
}

kernel! {
    /// Converts pixels' electrons to digital numbers.
    digitise = convert_body, convert_body (converter: &Converter, electrons: &[f32], dn: &mut [u16])
}

kernel! {
    /// Packs pixels of 12 bits for the wire, most significant bit first; an odd last pixel fills
    /// two bytes.
    pack_12 = pack_body, pack_twin (pixels: &[u16], bytes: &mut [u8])
}

kernel! {
    /// Adds linear light to pixels: `from + rise i` to the i-th. `first` is the index of the first
    /// pixel of the slice.
    ramp = ramp_body, ramp_twin (from: f32, rise: f32, first: u32, electrons: &mut [f32])
}

kernel! {
    /// Adds light pixel by pixel.
    add = add_body, add_body (light: &[f32], electrons: &mut [f32])
}

kernel! {
    /// Widens each row's range of columns to include those that the circles of dots touch.
    reach_dots = ends_body, ends_twin (circle: &Circle, dots: &[Dot], ends: &mut Ends<'_>)
}

kernel! {
    /// Adds the light of dots to pixels; the sheet has room for all tiles.
    add_dots = dots_body, dots_twin (lines: &Lines<f32>, circle: &Circle, dots: &[Dot], sheet: &mut Sheet<'_, f32>)
}

kernel! {
    /// The same in double precision.
    add_dots_f64 = dots_body, dots_twin (lines: &Lines<f64>, circle: &Circle, dots: &[Dot], sheet: &mut Sheet<'_, f64>)
}

kernel! {
    /// Interpolates a table at each position of a line.
    table_line = corners_body, corners_twin (nodes: &Nodes<'_>, across: &[Place], down: &Place, line: &mut [f64])
}

kernel! {
    /// Adds light of `electrons` (e-) to the pixels of a band with rows of `wide` pixels. `spans`
    /// are in consecutive rows from the band's row `first` on, each with its part of the `shares`
    /// (1).
    add_light = light_body, light_twin (electrons: f32, spans: &[Span], shares: &[f32], first: usize, wide: usize, pixels: &mut [f32])
}

kernel! {
    /// Adds up the square of a signal-to-noise ratio over pixels with their `shares` (1) of
    /// `electrons` (e-) and a `background` (e-); both slices have the same length.
    add_signal = signal_body, signal_twin (reading: &Reading, electrons: f64, shares: &[f32], background: &[f32], sum: &mut f64)
}

#[inline(always)]
fn shot_body(key: NoiseKey, effect: u8, first: usize, switch: Switch, electrons: &mut [f32]) {
    let mut words = [0; BLOCK];
    let [mut means, mut normals, mut searched] = [[0.0; BLOCK]; 3];
    let mut done = 0;
    while done < electrons.len() {
        let skip = (first + done) % BLOCK;
        let count = (BLOCK - skip).min(electrons.len() - done);
        let pixels = &mut electrons[done..done + count];
        means[skip..skip + count].copy_from_slice(pixels);
        // The order of non-negative numbers is that of their bits.
        let (mut min_mean, mut max_mean) = (u32::MAX, 0);
        for mean in &mut means {
            *mean = poisson::mean_of(*mean);
            min_mean = min_mean.min(mean.to_bits());
            max_mean = max_mean.max(mean.to_bits());
        }
        if max_mean == 0 {
            pixels.fill(0.0);
            done += count;
            continue;
        }
        fill(key, effect, first + done - skip, &mut words);
        let (min_mean, max_mean) = (f32::from_bits(min_mean), f32::from_bits(max_mean));
        if max_mean >= switch.0 {
            normals_of(&words, &mut normals);
        }
        if min_mean < switch.0 {
            search(&means, &words, &mut searched);
        }
        if max_mean < SEARCHED && max_mean < switch.0 {
            pixels.copy_from_slice(&searched[skip..skip + count]);
        } else {
            let mut inverse = means;
            for mean in &mut inverse {
                *mean = poisson::inverse_root(*mean);
            }
            for i in 0..BLOCK {
                let expanded = poisson::expansion(means[i], inverse[i], normals[i]);
                normals[i] = if means[i] < switch.0 {
                    searched[i]
                } else {
                    expanded
                };
            }
            pixels.copy_from_slice(&normals[skip..skip + count]);
            // If exact draws are requested.
            if switch.0 > SEARCHED {
                for (i, pixel) in (skip..).zip(pixels) {
                    if means[i] >= SEARCHED && means[i] < switch.0 {
                        *pixel = poisson::from_below(means[i], words[i]);
                    }
                }
            }
        }
        done += count;
    }
}

#[inline(always)]
fn read_body(key: NoiseKey, effect: u8, first: usize, sigma: f32, electrons: &mut [f32]) {
    let (mut words, mut normals) = ([0; BLOCK], [0.0; BLOCK]);
    let mut done = 0;
    while done < electrons.len() {
        let skip = (first + done) % BLOCK;
        let count = (BLOCK - skip).min(electrons.len() - done);
        fill(key, effect, first + done - skip, &mut words);
        normals_of(&words, &mut normals);
        for (e, z) in electrons[done..done + count]
            .iter_mut()
            .zip(&normals[skip..])
        {
            *e += sigma * z;
        }
        done += count;
    }
}

/// The words of a block of pixels.
#[inline(always)]
fn fill(key: NoiseKey, effect: u8, base: usize, words: &mut [u32; BLOCK]) {
    for (group, words) in words.chunks_exact_mut(rng::GROUP).enumerate() {
        let first = (base / rng::GROUP + group) * rng::COUNTERS;
        let (halves, last) = words.split_at_mut(2 * rng::COUNTERS);
        let (a, b) = halves.split_at_mut(rng::COUNTERS);
        let (c, d) = last.split_at_mut(rng::COUNTERS);
        for i in 0..rng::COUNTERS {
            [a[i], b[i], c[i], d[i]] =
                rng::block::<{ rng::PIXEL_ROUNDS }>(key, effect, (first + i) as u32, 0);
        }
    }
}

/// The normal draws of words: first all by the central formula, then those in the tails; one group
/// of words in 35 has any. Each step runs over the whole block: a processor cannot overlap whole
/// draws of consecutive pixels.
#[inline(always)]
fn normals_of(words: &[u32; BLOCK], normals: &mut [f32; BLOCK]) {
    for i in 0..BLOCK {
        normals[i] = normal::one_minus_x2_scaled(normal::beyond(words[i]));
    }
    for normal in normals.iter_mut() {
        *normal = normal::to_middle(*normal);
    }
    for i in 0..BLOCK {
        normals[i] = normal::near(words[i], normals[i]);
    }
    let groups = words.as_chunks::<{ rng::GROUP }>().0.iter();
    for (words, normals) in groups.zip(normals.as_chunks_mut::<{ rng::GROUP }>().0) {
        let ends = words.iter().map(|word| normal::distance_from_end(*word));
        if ends.fold(u32::MAX, u32::min) < normal::FAR {
            for i in 0..rng::GROUP {
                if normal::distance_from_end(words[i]) < normal::FAR {
                    normals[i] = normal::far(words[i]);
                }
            }
        }
    }
}

#[inline(always)]
fn convert_body(converter: &Converter, electrons: &[f32], dn: &mut [u16]) {
    for (dn, e) in dn.iter_mut().zip(electrons) {
        *dn = converter.dn(*e);
    }
}

/// Without fused multiply-adds, which are slow on old processors: rounding of the sums does not
/// matter here.
#[inline(always)]
fn ramp_body(from: f32, rise: f32, first: u32, electrons: &mut [f32]) {
    for (i, e) in electrons.iter_mut().enumerate() {
        *e += from + rise * (first as i32 + i as i32) as f32;
    }
}

#[inline(always)]
fn ramp_twin(from: f32, rise: f32, first: u32, electrons: &mut [f32]) {
    for (i, e) in (first as i32..).zip(electrons) {
        *e += from + rise * i as f32;
    }
}

#[inline(always)]
fn add_body(light: &[f32], electrons: &mut [f32]) {
    for (e, light) in electrons.iter_mut().zip(light) {
        *e += light;
    }
}

#[inline(always)]
fn shot_twin(key: NoiseKey, effect: u8, first: usize, switch: Switch, electrons: &mut [f32]) {
    for (pixel, e) in (first..).zip(electrons) {
        *e = poisson::poisson(*e, rng::word(key, effect, pixel), switch);
    }
}

#[inline(always)]
fn read_twin(key: NoiseKey, effect: u8, first: usize, sigma: f32, electrons: &mut [f32]) {
    for (pixel, e) in (first..).zip(electrons) {
        *e += sigma * normal::normal(rng::word(key, effect, pixel));
    }
}

/// The analogue-to-digital converter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Converter {
    /// Inverse gain, DN/e-.
    pub per_electron: f64,
    /// Value without charge, DN.
    pub offset: f64,
    /// Greatest value, DN.
    pub max: u16,
}

impl Converter {
    /// The value for `electrons` (e-); 0 for NaN.
    #[inline(always)]
    pub fn dn(&self, electrons: f32) -> u16 {
        let dn = f64::from(electrons) * self.per_electron + self.offset + 0.5;
        let (low, high) = (0.0, f64::from(self.max));
        let dn = if dn > low { dn } else { low };
        let dn = if dn < high { dn } else { high };
        // SAFETY: it is a number from 0 to 65535.
        unsafe { dn.to_int_unchecked::<i32>() as u16 }
    }
}
