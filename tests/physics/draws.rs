//! Noise draws: the kernels that draw for many pixels. Single draws are tested in
//! `src/base/tests/`.

use skyloop::kernels;
use skyloop::orbit::sgp4_batch::Level;
use skyloop::rng::normal::normal;
use skyloop::rng::poisson::{Switch, poisson};
use skyloop::rng::{NoiseKey, word};

const KEY: NoiseKey = NoiseKey {
    seed: 0x1234_5678_9ABC,
    sequence: 77,
    repeat: 0,
};

#[test]
fn every_level_draws_what_single_pixels_draw() {
    let (none, infinite, max) = (f32::NAN, f32::INFINITY, f32::MAX);
    let means = [
        0.0, -1.0, none, infinite, 1e-30, 0.5, 3.0, 15.999, 16.0, 50.0, 1e5, 1e9, 1e30, max,
        -infinite,
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
            // Bright and dark means alone, then all of them mixed.
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
        let dn: Vec<u16> = read.iter().map(|e| converter.dn(*e)).collect();
        assert!(single.iter().all(|k| *k >= 0.0 && k.is_finite()));
        let levels = Level::available().into_iter().map(Some);
        for level in levels.chain([None]) {
            let mut pixels = light.clone();
            kernels::shot_noise(level, KEY, 5, first, switch, &mut pixels);
            assert_eq!(pixels, single, "{level:?}");
            kernels::read_noise(level, KEY, 6, first, sigma, &mut pixels);
            assert_eq!(pixels, read, "{level:?}");
            let mut digitised = vec![7; count];
            kernels::digitise(level, &converter, &pixels, &mut digitised);
            assert_eq!(digitised, dn, "{level:?}");
        }
    }
    for e in [f32::NAN, f32::NEG_INFINITY, -1e9] {
        assert_eq!(converter.dn(e), 0);
    }
    assert_eq!(converter.dn(f32::INFINITY), 4095);
}

#[test]
fn invalid_means_draw_nothing() {
    for word in [0, 1, 0x7FFF_FFFF, 0x8000_0000, u32::MAX] {
        for mean in [0.0, -0.0, -5.0, f32::NAN, f32::NEG_INFINITY] {
            assert_eq!(poisson(mean, word, Switch::within(1e-4)), 0.0);
        }
    }
}
