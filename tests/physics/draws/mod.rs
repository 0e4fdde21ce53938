//! The draws of noise: Philox's words, the normal distribution, Poisson's, and the kernels that draw them for many pixels.

mod drawn;
mod runs;
mod theory;
mod words;

use skyloop::kernels;
use skyloop::orbit::sgp4_batch::Level;
use skyloop::rng::normal::{normal, uniform_of};
use skyloop::rng::poisson::{Switch, poisson};
use skyloop::rng::{NoiseKey, word};
use theory::Theory;

const KEY: NoiseKey = NoiseKey {
    seed: 0x1234_5678_9ABC,
    sequence: 77,
    repeat: 0,
};
const DRAWS: usize = 10_000_000;
/// Pixels that are drawn at a time.
const BLOCK: usize = 1 << 16;

/// Calls `each` with as many draws of `kernel`.
fn draws(kernel: impl Fn(usize, &mut [f32]), mut each: impl FnMut(usize, f64)) {
    let mut pixels = vec![0.0; BLOCK];
    for first in (0..DRAWS).step_by(BLOCK) {
        let count = BLOCK.min(DRAWS - first);
        kernel(first, &mut pixels[..count]);
        for (i, draw) in pixels[..count].iter().enumerate() {
            each(first + i, f64::from(*draw));
        }
    }
}

fn poissons(mean: f32, each: impl FnMut(usize, f64)) {
    let level = Some(Level::best());
    let kernel = |first, pixels: &mut [f32]| {
        pixels.fill(mean);
        kernels::shot_noise(level, KEY, 1, first, Switch::within(1e-4), pixels);
    };
    draws(kernel, each);
}

fn normals(each: impl FnMut(usize, f64)) {
    let level = Some(Level::best());
    let kernel = |first, pixels: &mut [f32]| {
        pixels.fill(0.0);
        kernels::read_noise(level, KEY, 2, first, 1.0, pixels);
    };
    draws(kernel, each);
}

/// How many standard deviations chi-square of `counts` lies above its mean; bins that expect fewer than 5 are joined.
fn chi_square(counts: &[f64], expected: &[f64]) -> f64 {
    let mut bins: Vec<[f64; 2]> = vec![[0.0; 2]];
    for (count, expect) in counts.iter().zip(expected) {
        if bins[bins.len() - 1][1] >= 5.0 {
            bins.push([0.0; 2]);
        }
        let last = bins.len() - 1;
        bins[last][0] += count;
        bins[last][1] += expect;
    }
    if bins[bins.len() - 1][1] < 5.0 {
        let [count, expect] = bins.pop().unwrap();
        let last = bins.last_mut().unwrap();
        *last = [last[0] + count, last[1] + expect];
    }
    assert!(bins.len() > 1);
    let squares = bins.iter();
    let squares = squares.map(|[count, expect]| (count - expect).powi(2) / expect);
    let sum: f64 = squares.sum();
    let freedom = bins.len() as f64 - 1.0;
    (sum - freedom) / (2.0 * freedom).sqrt()
}

/// Kolmogorov and Smirnov's statistic, times the root of the number of values, of values in (0, 1) that are counted in cells.
struct Uniformity(Vec<f64>);

impl Uniformity {
    const CELLS: usize = 1 << 16;

    fn new() -> Uniformity {
        Uniformity(vec![0.0; Self::CELLS])
    }

    fn count(&mut self, value: f64) {
        let cell = (value * Self::CELLS as f64) as usize;
        self.0[cell.min(Self::CELLS - 1)] += 1.0;
    }

    fn statistic(&self) -> f64 {
        let all: f64 = self.0.iter().sum();
        let (mut below, mut furthest) = (0.0, 0.0f64);
        for (i, count) in self.0.iter().enumerate() {
            below += count;
            furthest = furthest.max((below / all - (i + 1) as f64 / Self::CELLS as f64).abs());
        }
        furthest * all.sqrt()
    }
}

/// X-Val: Kolmogorov's distribution: 1 in 1000 values is beyond 1.95.
const KOLMOGOROV: f64 = 1.95;

#[test]
fn poisson_draws_are_poissons() {
    for mean in [0.01, 0.1, 1.0, 3.0, 10.0, 30.0, 100.0, 1e3, 1e5] {
        let theory = Theory::of(mean);
        let mut counts = vec![0.0; theory.probability.len()];
        let mut uniformity = Uniformity::new();
        let below = theory.probability.iter().scan(0.0, |sum, p| {
            *sum += p;
            Some(*sum - p)
        });
        let below: Vec<f64> = below.collect();
        poissons(mean, |pixel, k| {
            let at = k as usize - theory.first;
            counts[at] += 1.0;
            // The randomised integral of the probability: uniform where k is Poisson's.
            let part = uniform_of(word(KEY, 9, pixel));
            uniformity.count(below[at] + part * theory.probability[at]);
        });
        let n = DRAWS as f64;
        let expected: Vec<f64> = theory.probability.iter().map(|p| n * p).collect();
        let chi2 = chi_square(&counts, &expected);
        assert!(chi2 < 4.0, "mean {mean}: {chi2:.1} standard deviations");
        let ks = uniformity.statistic();
        assert!(ks < KOLMOGOROV, "mean {mean}: {ks:.2}");
        if mean < 10.0 {
            continue;
        }
        // Three draws are due beyond 5 sigma, too few to miss: `words` counts those of all words.
        for sigmas in [3.0, 4.0, 5.0] {
            for side in [-1.0, 1.0] {
                let edge = f64::from(mean) + side * sigmas * f64::from(mean).sqrt();
                let beyond = |values: &[f64]| -> f64 {
                    let values = values.iter().enumerate();
                    let beyond =
                        values.filter(|(i, _)| side * ((theory.first + i) as f64 - edge) > 0.0);
                    beyond.map(|(_, value)| value).sum()
                };
                let (seen, due) = (beyond(&counts), beyond(&expected));
                let is_met = (seen - due).abs() < 4.0 * due.sqrt() + 1.0;
                assert!(is_met, "mean {mean}, {sigmas} sigma: {seen} for {due:.1}");
            }
        }
    }
}

#[test]
fn normal_draws_are_normal() {
    const CELLS: usize = 1000;
    let phi = |z: f64| 0.5 * libm::erfc(-z / std::f64::consts::SQRT_2);
    let (mut uniformity, mut cells) = (Uniformity::new(), vec![0.0; CELLS]);
    let mut beyond = [[0.0; 3]; 2];
    normals(|_, z| {
        let p = phi(z);
        uniformity.count(p);
        cells[((p * CELLS as f64) as usize).min(CELLS - 1)] += 1.0;
        for sigmas in [3, 4, 5] {
            if z.abs() > f64::from(sigmas) {
                beyond[usize::from(z > 0.0)][sigmas as usize - 3] += 1.0;
            }
        }
    });
    let n = DRAWS as f64;
    let chi2 = chi_square(&cells, &vec![n / CELLS as f64; CELLS]);
    assert!(chi2.abs() < 4.0, "{chi2}");
    assert!(uniformity.statistic() < KOLMOGOROV);
    // X-Val: 1 - Phi(3, 4, 5) = 1.349898e-3, 3.167124e-5, 2.866516e-7.
    for (i, p) in [1.349_898e-3, 3.167_124e-5, 2.866_516e-7]
        .into_iter()
        .enumerate()
    {
        for side in beyond {
            let (seen, due, sigmas) = (side[i], n * p, i + 3);
            let is_met = (seen - due).abs() < 4.0 * due.sqrt() + 1.0;
            assert!(is_met, "{sigmas} sigma: {seen} for {due}");
        }
    }
}

#[test]
fn every_level_draws_what_single_pixels_draw() {
    let (none, endless, most) = (f32::NAN, f32::INFINITY, f32::MAX);
    let means = [
        0.0, -1.0, none, endless, 1e-30, 0.5, 3.0, 15.999, 16.0, 50.0, 1e5, 1e9, 1e30, most,
        -endless,
    ];
    let converter = kernels::Converter {
        per_electron: 0.37,
        offset: 12.5,
        max: 4095,
    };
    let switches = [5e-4, 1e-4, 0.0].map(Switch::within);
    for (first, count, switch) in [
        (0, 5000, switches[0]),
        (0, 5000, switches[1]),
        (0, 5000, switches[2]),
        (1, 255, switches[1]),
        (63, 2, switches[1]),
        (64 * 7 + 13, 1000, switches[1]),
        (300, 0, switches[0]),
        (1 << 22, 257, switches[2]),
    ] {
        let of = |i: usize| match i % 1000 {
            // Bright and dark ones alone, and all among one another.
            0..300 => means[5 + i % 3],
            300..600 => means[8 + i % 4],
            _ => means[(i * 7) % means.len()],
        };
        let light: Vec<f32> = (first..first + count).map(of).collect();
        let pixels = (first..).zip(&light);
        let single = pixels.map(|(pixel, mean)| poisson(*mean, word(KEY, 5, pixel), switch));
        let single: Vec<f32> = single.collect();
        let sigma = 3.7;
        let pixels = (first..).zip(&single);
        let read = pixels.map(|(pixel, e)| e + sigma * normal(word(KEY, 6, pixel)));
        let read: Vec<f32> = read.collect();
        let digits: Vec<u16> = read.iter().map(|e| converter.digit(*e)).collect();
        assert!(single.iter().all(|k| *k >= 0.0 && k.is_finite()));
        let levels = Level::available().into_iter().map(Some);
        for level in levels.chain([None]) {
            let mut pixels = light.clone();
            kernels::shot_noise(level, KEY, 5, first, switch, &mut pixels);
            assert_eq!(pixels, single, "{level:?}");
            kernels::read_noise(level, KEY, 6, first, sigma, &mut pixels);
            assert_eq!(pixels, read, "{level:?}");
            let mut dn = vec![7; count];
            kernels::digitise(level, &converter, &pixels, &mut dn);
            assert_eq!(dn, digits, "{level:?}");
        }
    }
    for e in [f32::NAN, f32::NEG_INFINITY, -1e9] {
        assert_eq!(converter.digit(e), 0);
    }
    assert_eq!(converter.digit(f32::INFINITY), 4095);
}

#[test]
fn no_mean_draws_nothing() {
    for word in [0, 1, 0x7FFF_FFFF, 0x8000_0000, u32::MAX] {
        for mean in [0.0, -0.0, -5.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(poisson(mean, word, Switch::within(1e-4)), 0.0);
        }
    }
}
