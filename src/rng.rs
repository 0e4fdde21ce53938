//! Counter-based random numbers: what a pixel draws depends on its key alone, never on order or threads.
//!
//! Generator: Philox 4x32-10, Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", SC11.
//! All functions of floats go through `libm`, so the draws are the same on every platform.

use std::sync::LazyLock;

/// What the noise of one frame is keyed by: `(seed, attitude sequence number)`; effect and pixel follow. A
/// second frame of the same attitude message gets draws of its own by its `repeat`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoiseKey {
    /// The run's seed.
    pub seed: u64,
    /// The sequence number of the attitude message that the frame answers.
    pub sequence: u32,
    /// How many frames of this attitude message came before.
    pub repeat: u32,
}

/// The random numbers of one effect in one pixel of one frame.
pub struct PixelStream {
    key: [u32; 2],
    counter: [u32; 4],
    block: [u32; 4],
    used: usize,
}

impl PixelStream {
    /// The stream of `pixel` (row-major index) for the effect with identity `effect`, 0 to 255.
    pub fn new(key: NoiseKey, effect: u8, pixel: u32) -> Self {
        PixelStream {
            key: [key.seed as u32, (key.seed >> 32) as u32],
            counter: [pixel, 0, u32::from(effect) | key.repeat << 8, key.sequence],
            block: [0; 4],
            used: 4,
        }
    }

    fn next_u32(&mut self) -> u32 {
        if self.used == 4 {
            self.block = philox(self.counter, self.key);
            self.counter[1] = self.counter[1].wrapping_add(1);
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

    /// Standard normal, exact: the ziggurat of Marsaglia and Tsang 2000, J. Stat. Software 5(8), with the layer drawn
    /// from bits of its own (Doornik 2005).
    pub fn normal(&mut self) -> f64 {
        let Ziggurat { x, height } = &*ZIGGURAT;
        loop {
            let bits = u64::from(self.next_u32()) << 32 | u64::from(self.next_u32());
            let layer = (bits % LAYERS as u64) as usize;
            let u = ((bits >> 12) as f64 + 0.5) * (1.0 / (1u64 << 51) as f64) - 1.0;
            let at = u * x[layer];
            if at.abs() < x[layer + 1] {
                return at;
            }
            if layer == 0 {
                return self.normal_beyond(x[1]).copysign(u);
            }
            let up = height[layer] + self.uniform() * (height[layer + 1] - height[layer]);
            if up < density(at) {
                return at;
            }
        }
    }

    /// A normal draw, given that it exceeds `start` (Marsaglia 1964).
    fn normal_beyond(&mut self, start: f64) -> f64 {
        loop {
            let over = -libm::log(self.uniform()) / start;
            if -2.0 * libm::log(self.uniform()) > over * over {
                return start + over;
            }
        }
    }

    /// Poisson, exact at every mean; 0 for a mean that is not positive.
    pub fn poisson(&mut self, mean: f64) -> f64 {
        if mean.is_nan() || mean <= 0.0 {
            0.0
        } else if mean < 10.0 {
            self.poisson_by_inversion(mean)
        } else {
            self.poisson_by_rejection(mean)
        }
    }

    /// Sequential search of the cumulative distribution (Devroye 1986, X.3.3).
    fn poisson_by_inversion(&mut self, mean: f64) -> f64 {
        let mut left = self.uniform();
        let mut probability = libm::exp(-mean);
        let mut k = 0.0;
        // 200 lies beyond the smallest uniform's quantile for every mean below 10.
        while left > probability && k < 200.0 {
            left -= probability;
            k += 1.0;
            probability *= mean / k;
        }
        k
    }

    /// Transformed rejection PTRS (Hörmann 1993, Insurance: Mathematics and Economics 12, 39).
    fn poisson_by_rejection(&mut self, mean: f64) -> f64 {
        let b = 0.931 + 2.53 * libm::sqrt(mean);
        let a = -0.059 + 0.02483 * b;
        let v_r = 0.9277 - 3.6224 / (b - 2.0);
        loop {
            let u = self.uniform() - 0.5;
            let v = self.uniform();
            let us = 0.5 - u.abs();
            let k = libm::floor((2.0 * a / us + b) * u + mean + 0.43);
            if us >= 0.07 && v <= v_r {
                return k;
            }
            if k < 0.0 || (us < 0.013 && v > us) {
                continue;
            }
            // One draw in seven or fewer comes to this.
            let inverse_alpha = 1.1239 + 1.1328 / (b - 3.4);
            let accept = libm::log(v * inverse_alpha / (a / (us * us) + b));
            if accept <= k * libm::log(mean) - mean - libm::lgamma(k + 1.0) {
                return k;
            }
        }
    }
}

/// Layers of the ziggurat; a power of two of at most 2^12.
const LAYERS: usize = 128;
/// Where the lowest layer's tail begins, and the area of every layer under `exp(-x^2 / 2)` (Doornik 2005, for 128 layers).
const TAIL: f64 = 3.442_619_855_899;
const AREA: f64 = 9.912_563_035_262_17e-3;

static ZIGGURAT: LazyLock<Ziggurat> = LazyLock::new(Ziggurat::new);

/// Layers of equal area that cover the half bell: layer `i` spans `0..x[i]` and `height[i]..height[i + 1]`; layer 0 is
/// as wide as a rectangle of its area, tail included, would be.
struct Ziggurat {
    x: [f64; LAYERS + 1],
    height: [f64; LAYERS + 1],
}

impl Ziggurat {
    fn new() -> Self {
        let (mut x, mut height) = ([0.0; LAYERS + 1], [0.0; LAYERS + 1]);
        x[0] = AREA / density(TAIL);
        x[1] = TAIL;
        height[1] = density(TAIL);
        for i in 1..LAYERS {
            height[i + 1] = (height[i] + AREA / x[i]).min(1.0);
            x[i + 1] = libm::sqrt(-2.0 * libm::log(height[i + 1]));
        }
        // The top closes at 1 but for the rounding of the two constants.
        x[LAYERS] = 0.0;
        height[LAYERS] = 1.0;
        Ziggurat { x, height }
    }
}

/// The normal density, 1 at its top.
fn density(x: f64) -> f64 {
    libm::exp(-0.5 * x * x)
}

/// Poisson at one mean, tabulated, for the many pixels of a frame that share it. Exact.
pub struct PoissonTable {
    first: usize,
    /// `P(k <= first + i)`.
    cumulative: Vec<f64>,
    /// Where the search for a uniform in `j / n .. (j + 1) / n` begins.
    guide: Vec<u32>,
}

impl PoissonTable {
    /// Means up to this (e-) are tabulated; the table then has 650 entries, and rejection is as fast beyond.
    const LARGEST_MEAN: f64 = 1000.0;

    /// Whether there is a table for that mean.
    pub fn covers(mean: f64) -> bool {
        mean > 0.0 && mean <= Self::LARGEST_MEAN
    }

    /// None for a mean beyond the largest or not above 0.
    pub fn new(mean: f64) -> Option<Self> {
        if !Self::covers(mean) {
            return None;
        }
        // Ten sigma and ten: what lies outside is rarer than the smallest uniform.
        let reach = 10.0 * libm::sqrt(mean) + 10.0;
        let first = libm::floor(mean - reach).max(0.0) as usize;
        let last = libm::ceil(mean + reach) as usize;
        let log_mean = libm::log(mean);
        let mut sum = 0.0;
        let cumulative: Vec<f64> = (first..=last)
            .map(|k| {
                let k = k as f64;
                sum += libm::exp(k * log_mean - mean - libm::lgamma(k + 1.0));
                sum
            })
            .collect();
        let n = cumulative.len();
        let guide = (0..n)
            .map(|j| cumulative.partition_point(|c| c * n as f64 <= j as f64) as u32)
            .collect();
        Some(PoissonTable {
            first,
            cumulative,
            guide,
        })
    }

    /// The draw that `uniform` of (0, 1) stands for: indexed search (Chen and Asau 1974; Devroye 1986, III.2.4).
    pub fn draw(&self, uniform: f64) -> f64 {
        let last = self.cumulative.len() - 1;
        let slot = (uniform * self.guide.len() as f64) as usize;
        let mut i = self.guide.get(slot).map_or(last, |&i| i as usize).min(last);
        while i < last && self.cumulative[i] <= uniform {
            i += 1;
        }
        (self.first + i) as f64
    }
}

/// Philox 4x32 with ten rounds: one bijection of the counter under the key.
fn philox(mut c: [u32; 4], mut k: [u32; 2]) -> [u32; 4] {
    for _ in 0..10 {
        let p0 = u64::from(c[0]) * 0xD251_1F53;
        let p1 = u64::from(c[2]) * 0xCD9E_8D57;
        c = [
            (p1 >> 32) as u32 ^ c[1] ^ k[0],
            p1 as u32,
            (p0 >> 32) as u32 ^ c[3] ^ k[1],
            p0 as u32,
        ];
        k = [
            k[0].wrapping_add(0x9E37_79B9),
            k[1].wrapping_add(0xBB67_AE85),
        ];
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: NoiseKey = NoiseKey {
        seed: 7,
        sequence: 3,
        repeat: 0,
    };

    // X-Val: Random123 1.14 `kat_vectors`, lines "philox4x32 10".
    #[test]
    fn philox_meets_the_known_answers() {
        assert_eq!(
            philox([0; 4], [0; 2]),
            [0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8]
        );
        assert_eq!(
            philox([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd]
        );
        assert_eq!(
            philox(
                [0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344],
                [0xa4093822, 0x299f31d0]
            ),
            [0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1]
        );
    }

    /// Mean, variance and third central moment within 5 standard errors of Poisson's.
    #[test]
    fn poisson_has_poissons_moments_on_both_sides_of_the_switch() {
        const N: u32 = 200_000;
        for mean in [0.01, 0.3, 3.0, 9.99, 10.0, 47.0, 1e3, 1e6] {
            let (mut s1, mut s2, mut s3) = (0.0, 0.0, 0.0);
            for pixel in 0..N {
                let d = PixelStream::new(KEY, 1, pixel).poisson(mean) - mean;
                s1 += d;
                s2 += d * d;
                s3 += d * d * d;
            }
            let n = f64::from(N);
            let (m, variance, third) = (s1 / n, s2 / n, s3 / n);
            // Central moments of Poisson: mu4 = mean (1 + 3 mean), mu6 = mean (1 + 25 mean + 15 mean^2).
            let mu4 = mean * (1.0 + 3.0 * mean);
            let mu6 = mean * (1.0 + 25.0 * mean + 15.0 * mean * mean);
            assert!(m.abs() < 5.0 * (mean / n).sqrt(), "mean {mean}: bias {m}");
            assert!((variance - mean).abs() < 5.0 * ((mu4 - mean * mean) / n).sqrt());
            assert!(
                (third - mean).abs() < 5.0 * (mu6 / n).sqrt(),
                "{mean}: third {third}"
            );
        }
        assert_eq!(PixelStream::new(KEY, 1, 0).poisson(0.0), 0.0);
        assert_eq!(PixelStream::new(KEY, 1, 0).poisson(f64::NAN), 0.0);
    }

    #[test]
    fn normal_has_the_normal_moments_and_tails() {
        const N: u32 = 400_000;
        let draws: Vec<f64> = (0..N)
            .map(|p| PixelStream::new(KEY, 2, p).normal())
            .collect();
        let n = f64::from(N);
        let moment = |k: i32| draws.iter().map(|x| x.powi(k)).sum::<f64>() / n;
        assert!(moment(1).abs() < 5.0 / n.sqrt());
        assert!((moment(2) - 1.0).abs() < 5.0 * (2.0 / n).sqrt());
        assert!((moment(4) - 3.0).abs() < 5.0 * (96.0 / n).sqrt());
        // The whole shape: chi-square over 60 bins of 0.1 sigma from -3 to 3.
        let phi = |x: f64| 0.5 * libm::erfc(-x / std::f64::consts::SQRT_2);
        let mut bins = [0.0; 60];
        for x in draws.iter().filter(|x| x.abs() < 3.0) {
            bins[(((x + 3.0) * 10.0) as usize).min(59)] += 1.0;
        }
        let chi2: f64 = (0..60)
            .map(|i| {
                let from = -3.0 + 0.1 * i as f64;
                let expected = n * (phi(from + 0.1) - phi(from));
                (bins[i] - expected) * (bins[i] - expected) / expected
            })
            .sum();
        assert!(chi2 < 60.0 + 4.0 * 120f64.sqrt(), "{chi2}");
        let beyond_3 = draws.iter().filter(|x| x.abs() > 3.0).count() as f64;
        // X-Val: 2 (1 - Phi(3)) = 0.0026997961.
        let expected = 0.0026997961 * n;
        assert!((beyond_3 - expected).abs() < 5.0 * expected.sqrt());
    }

    #[test]
    fn the_table_is_the_inverse_of_poissons_distribution() {
        for mean in [1e-3, 0.4, 9.9, 132.0, 1000.0] {
            let table = PoissonTable::new(mean).unwrap();
            // Exactly one step of the distribution separates two neighbouring draws.
            // Below ten sigma there is nothing: P(k) = exp(k ln m - m - ln k!).
            let mut k = (mean - 10.0 * mean.sqrt()).max(0.0).floor();
            let mut p = libm::exp(k * mean.ln() - mean - libm::lgamma(k + 1.0));
            let mut sum = 0.0;
            while sum < 1.0 - 1e-9 {
                let (low, high) = (sum + 1e-12, sum + p - 1e-12);
                if high > low && high < 1.0 {
                    assert_eq!((table.draw(low), table.draw(high)), (k, k), "mean {mean}");
                }
                sum += p;
                k += 1.0;
                p *= mean / k;
            }
            assert!(table.draw(1.0 - f64::EPSILON) > mean && table.draw(f64::MIN_POSITIVE) < mean);
        }
        assert!(PoissonTable::new(0.0).is_none() && PoissonTable::new(f64::NAN).is_none());
    }
}
