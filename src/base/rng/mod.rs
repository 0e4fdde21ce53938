//! Counter-based random numbers: a pixel's draw depends on its key alone, not on order or threads.
//!
//! Generator: Philox 4x32, Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", SC11.
//! All float functions are our own or `libm`'s, so the draws are the same on every platform.

pub mod normal;
pub mod poisson;

use normal::normal;
use poisson::{Switch, poisson};

/// Noise key of a frame: `(seed, attitude sequence number)`; effect and pixel are added later. A
/// second frame of the same attitude message has its own draws by its `repeat`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoiseKey {
    /// The run's seed.
    pub seed: u64,
    /// The sequence number of the frame's attitude message.
    pub sequence: u32,
    /// Number of earlier frames of this attitude message.
    pub repeat: u32,
}

/// Pixels in a group, which shares 16 counters. Pixel `i` of a group has word `i / 16` of counter
/// `i % 16`, so that vectors of sixteen counters give the words of sixteen neighbours.
pub const GROUP: usize = 64;
/// Counters of a group.
pub const COUNTERS: usize = 16;

/// Rounds of Philox, with the authors' safety margin.
const ROUNDS: usize = 10;
/// Rounds for words that every pixel of every frame draws: the minimum that passes all of BigCrush
/// (table 2 of the source).
pub const PIXEL_ROUNDS: usize = 7;

/// The word of a pixel (row-major index) for an effect with one draw for each pixel.
#[inline(always)]
pub fn word(key: NoiseKey, effect: u8, pixel: usize) -> u32 {
    let counter = pixel / GROUP * COUNTERS + pixel % COUNTERS;
    block::<PIXEL_ROUNDS>(key, effect, counter as u32, 0)[pixel % GROUP / COUNTERS]
}

/// The four words of a counter.
#[inline(always)]
pub fn block<const ROUNDS: usize>(key: NoiseKey, effect: u8, index: u32, draw: u32) -> [u32; 4] {
    let counter = [
        index,
        draw,
        u32::from(effect) | key.repeat << 8,
        key.sequence,
    ];
    philox::<ROUNDS>(counter, [key.seed as u32, (key.seed >> 32) as u32])
}

/// Stream of random numbers for one effect in one pixel of one frame.
pub struct PixelStream {
    key: NoiseKey,
    effect: u8,
    pixel: u32,
    draw: u32,
    block: [u32; 4],
    used: usize,
}

impl PixelStream {
    /// The stream of `pixel` (row-major index) for the effect with identity `effect`, 0 to 255.
    pub fn new(key: NoiseKey, effect: u8, pixel: u32) -> Self {
        PixelStream {
            key,
            effect,
            pixel,
            draw: 0,
            block: [0; 4],
            used: 4,
        }
    }

    fn next_u32(&mut self) -> u32 {
        if self.used == 4 {
            self.block = block::<ROUNDS>(self.key, self.effect, self.pixel, self.draw);
            self.draw = self.draw.wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.block[self.used - 1]
    }

    /// Uniform in the open interval (0, 1), 52 bits.
    pub fn uniform(&mut self) -> f64 {
        let bits = (u64::from(self.next_u32()) << 20) | u64::from(self.next_u32() >> 12);
        (bits as f64 + 0.5) * (1.0 / (1u64 << 52) as f64)
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        f64::from(normal(self.next_u32()))
    }

    /// Poisson; 0 for a mean that is not positive.
    pub fn poisson(&mut self, mean: f64) -> f64 {
        f64::from(poisson(mean as f32, self.next_u32(), Switch::within(1e-4)))
    }
}

/// Philox 4x32: a bijection of the counter under the key. Words are in the lower halves of 64 bits;
/// the upper halves of products are ignored.
#[inline(always)]
fn philox<const ROUNDS: usize>(counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    const LOW: u64 = 0xFFFF_FFFF;
    let mut c = counter.map(u64::from);
    for _ in 0..ROUNDS {
        let p0 = (c[0] & LOW) * 0xD251_1F53;
        let p1 = (c[2] & LOW) * 0xCD9E_8D57;
        let [k0, k1] = key.map(u64::from);
        c = [p1 >> 32 ^ c[1] ^ k0, p1, p0 >> 32 ^ c[3] ^ k1, p0];
        key = [
            key[0].wrapping_add(0x9E37_79B9),
            key[1].wrapping_add(0xBB67_AE85),
        ];
    }
    c.map(|word| word as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: NoiseKey = NoiseKey {
        seed: 7,
        sequence: 3,
        repeat: 0,
    };

    // X-Val: Random123 1.14 `kat_vectors`, lines "philox4x32 10" and "philox4x32 7".
    #[test]
    fn philox_agrees_with_known_answers() {
        let pi = [0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344];
        for (counter, key, ten, seven) in [
            (
                [0; 4],
                [0; 2],
                [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8],
                [0x5f6fb709, 0x0d893f64, 0x4f121f81, 0x4f730a48],
            ),
            (
                [u32::MAX; 4],
                [u32::MAX; 2],
                [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd],
                [0x5207ddc2, 0x45165e59, 0x4d8ee751, 0x8c52f662],
            ),
            (
                pi,
                [0xa4093822, 0x299f31d0],
                [0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1],
                [0x4dfccaba, 0x190a87f0, 0xc47362ba, 0xb6b5242a],
            ),
        ] {
            assert_eq!(philox::<10>(counter, key), ten);
            assert_eq!(philox::<7>(counter, key), seven);
        }
    }

    #[test]
    fn words_of_pixels_differ() {
        let mut words: Vec<u32> = (0..1 << 16).map(|pixel| word(KEY, 1, pixel)).collect();
        words.extend((0..1 << 16).map(|pixel| word(KEY, 2, pixel)));
        words.sort_unstable();
        words.dedup();
        // In 2^17 words 2^17^2 / 2^33 = 2 pairs are equal by chance.
        assert!(words.len() > (1 << 17) - 10, "{}", words.len());
    }
}
