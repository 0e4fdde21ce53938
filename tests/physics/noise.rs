//! Noise against theory: flat fields of dark charge, and the dependencies of the draws.

use std::str::FromStr;

use crate::fixtures::Frames;
use crate::plain_camera::camera;
use hifitime::Epoch;
use skyloop::attitude::VehicleState;
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::sky::catalog::Selection;

/// A blind camera. The exposure is 1 s, so that the dark current is the mean charge.
#[derive(Clone, Copy, Debug)]
struct Flat {
    mean_e: f64,
    gain: f64,
    read_e: f64,
    offset_dn: f64,
    full_well_e: f64,
    bits: u32,
}

const FLAT: Flat = Flat {
    mean_e: 20.0,
    gain: 1.0,
    read_e: 0.0,
    offset_dn: 100.0,
    full_well_e: 1e5,
    bits: 16,
};

const NOISY: Flat = Flat {
    read_e: 5.0,
    ..FLAT
};

impl Flat {
    fn emulator(&self, seed: u64) -> Emulator {
        let mut config = Config::defaults().unwrap();
        config.camera = camera(&format!(
            "optics.transmission = 0.0; detector.width_px = 512; detector.height_px = 400; \
             detector.dark_e_s = {:?}; detector.read_noise_e = {:?}; \
             detector.full_well_e = {:?}; detector.gain_e_per_dn = {:?}; \
             detector.offset_dn = {:?}; detector.adc_bits = {}; timing.exposure_s = 1.0",
            self.mean_e, self.read_e, self.full_well_e, self.gain, self.offset_dn, self.bits
        ));
        config.seed = seed;
        config.sky.selection = Selection::Bsc;
        Emulator::new(&mut config)
    }

    /// The probability of every DN: Poisson charge, clipped at the full well, with normal read
    /// noise, rounded and clipped by the converter.
    fn theory(&self) -> Vec<f64> {
        let top = (1usize << self.bits) - 1;
        let mut dn = vec![0.0; top + 1];
        let reach = 12.0 * self.mean_e.sqrt() + 12.0;
        let first = (self.mean_e - reach).max(0.0).floor() as u64;
        for k in first..=(self.mean_e + reach) as u64 {
            let k = k as f64;
            let p = (k * self.mean_e.ln() - self.mean_e - libm::lgamma(k + 1.0)).exp();
            let charge = k.min(self.full_well_e);
            let at = charge / self.gain + self.offset_dn;
            if self.read_e == 0.0 {
                dn[((at + 0.5).floor() as usize).min(top)] += p;
                continue;
            }
            let sigma = self.read_e / self.gain;
            let below = |edge: f64| 0.5 * libm::erfc((at - edge) / sigma / 2f64.sqrt());
            let low = (at - 12.0 * sigma).floor().max(0.0) as usize;
            let high = ((at + 12.0 * sigma).ceil().max(0.0) as usize).min(top);
            for (dn, digit) in dn.iter_mut().enumerate().take(high + 1).skip(low) {
                let from = if dn == 0 { 0.0 } else { below(dn as f64 - 0.5) };
                let end = below(dn as f64 + 0.5);
                let to = if dn == top { 1.0 } else { end };
                *digit += p * (to - from);
            }
            // The whole interval lies above the top, or below zero.
            if low > top {
                dn[top] += p;
            } else if at + 12.0 * sigma < 0.0 {
                dn[0] += p;
            }
        }
        dn
    }
}

fn vehicle(sequence: u32) -> VehicleState {
    let epoch = Epoch::from_str("2020-02-03T04:05:06 UTC").unwrap();
    VehicleState::new(sequence, epoch, [0.0, 0.0, 0.0, 1.0], [0.0; 3], None).unwrap()
}

fn dn(emulator: &mut Emulator, sequence: u32) -> Vec<u16> {
    emulator.expose(&vehicle(sequence), 0).unwrap().frame.dn
}

/// Mean and variance of `pixels`, each as (measured, theory, standard error).
fn moments(pixels: &[u16], theory: &[f64]) -> [(f64, f64, f64); 2] {
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|p| f64::from(*p)).sum::<f64>() / n;
    let squares = pixels.iter().map(|p| (f64::from(*p) - mean).powi(2));
    let variance = squares.sum::<f64>() / (n - 1.0);
    let total: f64 = theory.iter().sum();
    assert!((total - 1.0).abs() < 1e-9, "{total}");
    let moment = |f: &dyn Fn(f64) -> f64| -> f64 {
        let all = theory.iter().enumerate();
        all.map(|(dn, p)| p * f(dn as f64)).sum()
    };
    let mu = moment(&|dn| dn);
    let sigma2 = moment(&|dn| (dn - mu).powi(2));
    let fourth = moment(&|dn| (dn - mu).powi(4));
    [
        (mean, mu, (sigma2 / n).sqrt()),
        (variance, sigma2, ((fourth - sigma2 * sigma2) / n).sqrt()),
    ]
}

#[test]
fn flat_fields_have_the_mean_and_variance_of_theory() {
    let mut worst = 0.0f64;
    for case in 0..24 {
        let flat = Flat {
            mean_e: [0.5, 20.0, 2000.0][case / 8],
            gain: [1.0, 2.5][case / 4 % 2],
            read_e: [0.0, 5.0][case / 2 % 2],
            offset_dn: [100.0, 0.0][case % 2],
            ..FLAT
        };
        let pixels = dn(&mut flat.emulator(11), 3);
        for (measured, theory, error) in moments(&pixels, &flat.theory()) {
            let off = (measured - theory) / error;
            worst = worst.max(off.abs());
            let what = format!("{measured} against {theory}, {off:.1} standard errors");
            assert!(off.abs() < 4.0, "{flat:?}: {what}");
        }
    }
    println!("worst {worst:.2} standard errors");
}

/// Half of the draws of mean 2000 exceed a full well of 2000. Read noise is added after clipping.
#[test]
fn the_full_well_clips_before_read_noise() {
    let well = Flat {
        mean_e: 2000.0,
        full_well_e: 2000.0,
        ..FLAT
    };
    let pixels = dn(&mut well.emulator(1), 0);
    assert_eq!(pixels.iter().max(), Some(&2100));
    let full = pixels.iter().filter(|dn| **dn == 2100).count() as f64 / pixels.len() as f64;
    assert!((0.49..0.53).contains(&full), "{full}");
    let read = Flat {
        read_e: 5.0,
        ..well
    };
    let pixels = dn(&mut read.emulator(1), 0);
    assert!(*pixels.iter().max().unwrap() > 2110);
    for (measured, theory, error) in moments(&pixels, &read.theory()) {
        assert!((measured - theory).abs() < 4.0 * error);
    }
}

/// Correlation of two frames' noise, in its standard errors.
fn correlation(a: &[u16], b: &[u16]) -> f64 {
    let n = a.len() as f64;
    let mean = |x: &[u16]| x.iter().map(|p| f64::from(*p)).sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let sum = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        let centred = a.iter().zip(b);
        let centred = centred.map(|(a, b)| (f64::from(*a) - ma, f64::from(*b) - mb));
        centred.map(|(a, b)| f(a, b)).sum()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt() * n.sqrt()
}

#[test]
fn frames_seeds_and_neighbouring_pixels_are_independent() {
    let mut emulator = NOISY.emulator(7);
    let first = dn(&mut emulator, 10);
    let again = emulator.expose(&vehicle(10), 1).unwrap().frame.dn;
    let of_seed = |seed: u64| dn(&mut NOISY.emulator(seed), 10);
    for (what, other) in [
        ("the next sequence number", dn(&mut emulator, 11)),
        ("a repeat", again),
        ("the next seed", of_seed(8)),
        ("a seed's upper half", of_seed(7 + (1 << 32))),
    ] {
        let r = correlation(&first, &other);
        let is_other = r.abs() < 4.0 && first != other;
        assert!(is_other, "{what}: {r:.1} standard errors");
    }
    for shift in [1, 2, 4, 512] {
        let r = correlation(&first[shift..], &first[..first.len() - shift]);
        assert!(r.abs() < 4.0, "pixels {shift} apart: {r:.1}");
    }
}

#[test]
fn noise_depends_on_the_sequence_number_only() {
    let alone = dn(&mut NOISY.emulator(7), 42);
    let mut busy = NOISY.emulator(7);
    for sequence in [3, 41, 42, 7] {
        dn(&mut busy, sequence);
    }
    assert_eq!(dn(&mut busy, 42), alone);
    assert_eq!(busy.next_frame(), 5);
}

/// The built-in scene with and without its objects' light.
#[test]
fn an_objects_light_changes_only_the_pixels_that_it_lights() {
    let exposed = |reflectance: f64| {
        let mut config = Config::builtin().unwrap();
        config.sphere.reflectance = reflectance;
        let mut frames = Frames::of(config);
        frames.emulator.keep_expected = true;
        let frame = frames.expose(20).frame;
        (frame.expected_e.unwrap(), frame.dn)
    };
    let ((lit_e, lit), (dark_e, dark)) = (exposed(0.2), exposed(0.0));
    let (mut touched, mut changed) = (0, 0);
    for i in 0..lit.len() {
        let (is_touched, is_changed) = (lit_e[i] != dark_e[i], lit[i] != dark[i]);
        assert!(is_touched || !is_changed, "pixel {i}");
        touched += u32::from(is_touched);
        changed += u32::from(is_changed);
    }
    let is_right = (100..1000).contains(&touched) && changed > 20;
    assert!(is_right, "{touched} {changed}");
}
