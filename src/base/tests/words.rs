//! Draws of all 2^32 words, counted: the error of the normal draw, the tails of both distributions,
//! and the distance from Poisson's.

use crate::drawn::{Drawn, word_at};
use crate::runs::{ALL, RUN, runs};
use pulp::{Simd, WithSimd};
use skyloop_base::rng::normal::{normal, uniform_of};
use skyloop_base::rng::poisson::{Switch, expanded, poisson};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

const FRAMES: &str = include_str!("../../../docs/explanation/frames.md");

/// The largest error of normal draws against `[exact, slope, bend]`: the quantile of the run's
/// middle word, and of the others by Taylor's series.
struct Off<'a> {
    z: &'a [f32; RUN],
    series: [f64; 3],
}

impl WithSimd for Off<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> f64 {
        let [exact, slope, bend] = self.series;
        let mut furthest = 0;
        for i in 0..RUN {
            let d = i as i32 as f64 - (RUN / 2) as f64;
            let off = (f64::from(self.z[i]) - (exact + d * (slope + d * bend))).abs();
            // Non-negative numbers are ordered as their bits are.
            furthest = off.to_bits().max(furthest);
        }
        f64::from_bits(furthest)
    }
}

/// The share of the normal distribution beyond `z`.
fn beyond(z: f64) -> f64 {
    0.5 * libm::erfc(z / std::f64::consts::SQRT_2)
}

/// The share of the words beyond `word`, on its side.
fn tail(word: u32) -> f64 {
    (f64::from(word & 0x7FFF_FFFF) + 0.5) / ALL
}

/// The quantile near `z`, without its sign, beyond which lies `tail`. Also its first derivative by
/// the tail, and half of the second. With `T' = -phi` and `phi' = -z phi`:
///
/// ```text
/// z(t + d) = z - d / phi + d^2 z / (2 phi^2) + ...
/// ```
fn quantile(tail: f64, z: f64) -> [f64; 3] {
    let series = |z: f64| {
        let density = (-z * z / 2.0).exp() / std::f64::consts::TAU.sqrt();
        [-1.0 / density, z / (2.0 * density * density)]
    };
    let [slope, bend] = series(z);
    let d = tail - beyond(z);
    let z = z + d * (slope + d * bend);
    let [slope, bend] = series(z);
    [z, slope, bend]
}

/// Number of draws beyond `sigmas`, on either side.
struct Tail {
    sigmas: f32,
    beyond: [AtomicU64; 2],
}

/// Reference: the normal distribution by `erfc`.
#[test]
fn every_words_normal_draw_is_its_quantile() {
    /// The measured value is 7.27e-6.
    const WITHIN: f64 = 7.3e-6;
    // With so few words beyond, each has a quantile of its own.
    const ENDS: u32 = 1 << 20;
    let worst = AtomicU64::new(0);
    let tails = [3.0, 4.0, 5.0].map(|sigmas| Tail {
        sigmas,
        beyond: Default::default(),
    });
    runs(|arch, first, z| {
        let is_upper = first >> 31 == 1;
        let off = if first & 0x7FFF_FFFF < ENDS {
            let off = (first..).zip(z).map(|(word, z)| {
                assert_eq!(*z > 0.0, is_upper, "{word:x}: {z}");
                let z = f64::from(z.abs());
                (quantile(tail(word), z)[0] - z).abs()
            });
            off.fold(0.0, f64::max)
        } else {
            let middle = first + RUN as u32 / 2;
            let series = quantile(tail(middle), f64::from(z[RUN / 2].abs()));
            let by_words = [1.0, 1.0 / ALL, 1.0 / (ALL * ALL)];
            let sign = if is_upper { 1.0 } else { -1.0 };
            let series = std::array::from_fn(|i| sign * series[i] * by_words[i]);
            arch.dispatch(Off { z, series })
        };
        assert!(off < WITHIN, "from {first:x} on: {off:e}");
        worst.fetch_max(off.to_bits(), Relaxed);
        for tail in &tails {
            if z[0].abs().max(z[RUN - 1].abs()) > tail.sigmas {
                let beyond = z.iter().filter(|z| z.abs() > tail.sigmas).count();
                tail.beyond[usize::from(is_upper)].fetch_add(beyond as u64, Relaxed);
            }
        }
    });
    let worst = f64::from_bits(worst.into_inner());
    println!("off by {worst:.2e}");
    assert!(worst > WITHIN - 1e-7, "{worst:e}");
    for document in [FRAMES, include_str!("../rng/normal.rs")] {
        assert!(document.contains(&format!("within {WITHIN:e} of the exact quantile")));
    }
    for tail in tails {
        let due = ALL * beyond(f64::from(tail.sigmas));
        for seen in tail.beyond {
            let seen = seen.into_inner() as f64;
            println!("{} sigma: {seen} for {due:.1}", tail.sigmas);
            // The tail's logarithm falls by 5.2 a sigma there, times the error of draws; and one
            // word.
            assert!((seen - due).abs() < 4e-5 * due + 1.0, "{seen} for {due}");
        }
    }
    // Where the polynomials meet.
    let falls = normal(979_348) - normal(979_349);
    assert!((falls - 8.3e-6).abs() < 1e-7, "{falls:e}");
    // The words at the ends; X-Val: SciPy's `ndtri(2^-33)` = -6.338.
    assert!((normal(0) + 6.338).abs() < 1e-3 && normal(1 << 31) == -normal(0));
}

#[test]
fn words_have_positions() {
    for position in [0, 1, 12_345, (1 << 31) - 1, 1 << 31, (1 << 32) - 1] {
        let expected = (position as f64 + 0.5) / ALL;
        assert_eq!(uniform_of(word_at(position)), expected);
    }
}

/// 2^20: from here on the expansion draws at any switch.
const TWO_20: f32 = 1_048_576.0;

/// Counts of the expansion. The words of the last means lie near the limit where single precision
/// counts in steps of two.
static EXPANDED: LazyLock<Vec<Drawn>> = LazyLock::new(|| {
    Drawn::expanded(&[
        6.0, 6.2, 7.7, 9.4, 12.0, 12.3, 16.0, 16.3, 17.5, 20.0, 23.7, 30.0, 50.0, 77.7, 100.0,
        300.0, 1e3, 4321.5, 1e4, 1e5, 1e6, TWO_20, 5e6, 1.67e7,
    ])
});

/// Distance of the expansion from Poisson's distribution at one of these means.
fn expanded_at(mean: f32) -> f64 {
    let mut drawn = EXPANDED.iter().filter(|drawn| drawn.mean == mean);
    drawn.next().unwrap().variation()
}

#[test]
fn draws_are_as_near_poisson_as_the_switch_says() {
    // The expansion is least accurate where it begins.
    let cases = [(1e-4, 12.0, 5e6), (6e-5, 16.0, TWO_20), (5e-4, 6.0, 5e6)];
    for (variation_is, begins, to) in cases {
        let switch = Switch::within(variation_is);
        let below = f32::from_bits(f32::to_bits(begins) - 1);
        assert!(Drawn::searched(below, switch).variation() < 5e-9);
        let mut worst = 0.0f64;
        let range = begins..=to;
        for drawn in EXPANDED.iter().filter(|of| range.contains(&of.mean)) {
            for i in 0..1000_u32 {
                let word = i.wrapping_mul(0x9E37_79B1);
                let expanded = expanded(drawn.mean, normal(word));
                assert_eq!(poisson(drawn.mean, word, switch), expanded);
            }
            let (mean, apart) = (drawn.mean, drawn.variation());
            println!("within {variation_is}, mean {mean}: {apart:.2e}");
            worst = worst.max(apart);
            assert!(apart < variation_is, "{mean}: {apart:e}");
        }
        assert!(worst > 0.5 * variation_is, "{variation_is}: {worst:e}");
    }
    assert_eq!(Switch::within(2e-4), Switch::within(1e-4));
}

/// The neglected third term matters most below the mean: 12 e- are less than four standard
/// deviations from zero.
#[test]
fn expansions_have_poissons_tails() {
    for drawn in EXPANDED.iter().filter(|drawn| drawn.mean >= 12.0) {
        let mean = f64::from(drawn.mean);
        for sigmas in [-5.0, -4.0, -3.0, 3.0, 4.0, 5.0] {
            let [words, due] = drawn.tail(sigmas);
            println!("mean {mean}, {sigmas} sigma: {words} for {due:.1}");
            let within = 1.5e-3 + if sigmas > 0.0 { 0.42 } else { 1.2 } / mean;
            let is_met = if sigmas > 0.0 || mean >= 30.0 {
                (words - due).abs() < within * due + 1.0
            } else {
                words > due - 1.0 && words < 2.0 * due + 1.0
            };
            assert!(is_met, "{mean}, {sigmas}: {words} for {due}");
        }
    }
}

/// Reference: the same expansion in double precision, which resolves single electrons at these
/// means.
#[test]
fn single_precision_bounds_draws_of_large_means() {
    // Below 2^24 e- (9 sigma above the last mean) single precision holds each whole number; beyond,
    // draws are multiples of 2, 4, ... e-.
    for (mean, within) in [(TWO_20, 6e-5), (5e6, 1e-4), (1.67e7, 2e-4)] {
        let apart = expanded_at(mean);
        println!("mean {mean}: {apart:.2e}");
        assert!(apart < within, "{mean}: {apart:e}");
        assert!(apart > 0.5 * within, "{mean}: {apart:e}");
    }
    let switch = Switch::within(1e-6);
    for mean in [1.6e7_f32, 1e8, 1e9, 1e12, 1e20] {
        let spacing = f64::from(f32::from_bits(mean.to_bits() + 1) - mean);
        let m = f64::from(mean);
        for i in 0..100_000_u32 {
            let word = i.wrapping_mul(0x9E37_79B1);
            let z = f64::from(normal(word));
            let due = m + m.sqrt() * z + 1.0 / 3.0 + z * z / 6.0;
            let off = (f64::from(poisson(mean, word, switch)) - due).abs();
            // Terms: the floor; the sum's last digit (a draw may lie beyond the next power of two);
            // and 5e-6 of the root, a product of two factors.
            let bound = 1.0 + spacing + 6e-6 * (m.sqrt() * z).abs();
            assert!(off < bound, "{mean}, {word:x}: {off}");
        }
    }
}

#[test]
fn searches_are_exact() {
    // Each probability that is worth a word is within 2^-32.
    let small = [1e-6, 0.01, 0.3, 1.0, 4.7, 10.0, 12.0, 15.999, 16.0, 50.0];
    for mean in small.into_iter().chain([1e3, 1e4, 1e5, 1e6, TWO_20 - 1.0]) {
        let drawn = Drawn::searched(mean, Switch::within(0.0));
        let exact = drawn.variation();
        println!("mean {mean}: {exact:.2e}");
        let draws = 13.0 * f64::from(mean).sqrt() + 20.0;
        assert!(exact < draws / 8_589_934_592.0, "{mean}: {exact:e}");
        // The best bound that `poisson_tv` promises.
        assert!(exact < 1e-6, "{mean}: {exact:e}");
        for sigmas in [-5.0, -4.0, -3.0, 3.0, 4.0, 5.0] {
            let [words, due] = drawn.tail(sigmas);
            let is_exact = (words - due).abs() < 64.0;
            assert!(is_exact, "{mean}, {sigmas}: {words} for {due}");
        }
    }
}

#[test]
fn documented_distances_are_measured() {
    let head = "| mean, e- | total-variation distance |\n|---|---|\n";
    let (_, table) = FRAMES.split_once(head).unwrap();
    let rows = table.lines().take_while(|row| row.starts_with('|'));
    let rows: Vec<Vec<&str>> = rows
        .map(|row| row.split('|').map(str::trim).collect())
        .collect();
    assert!(rows.len() > 10);
    for cells in rows {
        let mean = cells[1].split(' ').next().unwrap();
        let apart = match mean.parse() {
            Ok(mean) => expanded_at(mean),
            Err(_) => {
                assert_eq!(cells[1], "searched, below 16");
                let means = [1.0, 4.7, 12.0, 15.999].into_iter();
                let searched = means.map(|mean| Drawn::searched(mean, Switch::within(0.0)));
                searched.map(|drawn| drawn.variation()).fold(0.0, f64::max)
            }
        };
        assert_eq!(cells[2], format!("{apart:.1e}"), "{mean}");
    }
    // The switch of `reference`.
    let max = Drawn::searched(TWO_20 - 1.0, Switch::within(0.0)).variation();
    let text = format!("are within {max:.1e} up to there");
    assert!(FRAMES.contains(&text), "{text}");
}
