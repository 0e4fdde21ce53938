//! Extreme charge: expectations from 0 to 10^9 electrons, full wells, and converters of 1 to 16
//! bits.

use super::stage::{emulator, square, still};
use skyloop::attitude::Attitude;
use skyloop::camera::{Pattern, PatternStats};
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::fidelity::Fidelity;
use std::sync::Arc;

const PIXELS: usize = 256 * 256;

/// A blind detector of 256 x 256 px with a dark charge of `mean_e`, with these keys and without
/// these effects.
fn dark(mean_e: f64, keys: &str, off: &[&'static str]) -> Emulator {
    let camera = square(
        256,
        &format!(
            "optics.transmission = 0.0; timing.exposure_s = 1.0; detector.dark_e_s = {mean_e:e}; \
             detector.full_well_e = 1e9; detector.adc_clips_first = true; {keys}"
        ),
    );
    let mut emulator = emulator(camera, Fidelity::REALTIME, |config| {
        config.choice.off.retain(|name| *name != "shot noise");
        config.choice.off.extend(off);
    });
    emulator.choice.noise = true;
    // Otherwise noise of less than 0.05 e- is left out.
    emulator.choice.all = true;
    emulator
}

fn expose(emulator: &mut Emulator) -> ExposedFrame {
    let vehicle = still(&Attitude::identity());
    emulator.expose(&vehicle, 0).unwrap()
}

/// Zero expectation gives no electron; no expectation gives negative or infinite charge.
#[test]
fn without_expectation_there_is_no_charge() {
    let mut emulator = dark(0.0, "", &[]);
    let exposed = expose(&mut emulator);
    assert!(exposed.frame.charge_e.unwrap().iter().all(|e| *e == 0.0));
    assert!(exposed.frame.dn.iter().all(|dn| *dn == 100));
}

/// Reference: `DN = round(N / gain + offset)`, clipped to the converter's range, and N to the full
/// well. Without noise every DN is exact, unless the product with 1 / gain lies within 1e-9 of a
/// half and rounds in the other direction.
#[test]
fn full_wells_and_converters_of_1_to_16_bits_saturate_and_never_wrap() {
    let size = "detector.width_px = 4; detector.height_px = 3";
    let mut emulator = dark(0.0, size, &[]);
    emulator.choice.noise = false;
    for mean in [0.0, 0.5, 1.0, 1e3, 65_534.4, 65_535.0, 65_536.0, 1e5, 1e9] {
        let figures = PatternStats {
            serial: 1,
            width: 4,
            height: 3,
            prnu: 0.0,
            dark_e_s: mean,
            dark_nonuniformity: 0.0,
            hot_fraction: 0.0,
            hot_e_s: 0.0,
            dead_fraction: 0.0,
            dead_px: Vec::new(),
            stuck_fraction: 0.0,
            stuck_px: Vec::new(),
        };
        let pattern = Arc::new(Pattern::new(&figures));
        for bits in [1_u8, 2, 8, 12, 14, 15, 16] {
            let top = (1_u64 << bits) - 1;
            for (gain, offset) in [
                (1.0, 0.0),
                (0.37, 0.0),
                (1e-4, 0.0),
                (1e6, 0.0),
                (2.0, top as f64 - 1.0),
            ] {
                for well in [1.0, 65_535.0, 1e9] {
                    let detector = &mut emulator.camera_mut().detector;
                    (detector.bits, detector.gain_e_per_dn, detector.offset_dn) =
                        (bits, gain, offset);
                    (detector.full_well_e, detector.dark_e_s) = (well, mean);
                    detector.pattern = pattern.clone();
                    let held = f64::from((mean as f32).min(well as f32));
                    let read = held / gain + offset + 0.5;
                    let expected = read.floor().clamp(0.0, top as f64) as u16;
                    let dn = expose(&mut emulator).frame.dn;
                    let what = format!("{bits} bits {gain} {mean} {well}: {} {expected}", dn[0]);
                    assert!(dn.iter().all(|dn| dn.abs_diff(expected) <= 1), "{what}");
                    let step = (read - read.round()).abs();
                    let exact = step > 1e-9 * read || mean.fract() == 0.0 && gain == 1.0;
                    assert!(!exact || dn.iter().all(|dn| *dn == expected), "{what}");
                }
            }
        }
    }
}

/// Read noise below the offset is clipped at 0 and does not wrap around. Reference: half of a
/// normal distribution lies below its middle.
#[test]
fn negative_readout_is_clipped_to_zero() {
    let keys = "detector.read_noise_e = 50.0; detector.offset_dn = 0.0";
    let mut emulator = dark(0.0, keys, &[]);
    let dn = expose(&mut emulator).frame.dn;
    let none = dn.iter().filter(|dn| **dn == 0).count() as f64 / PIXELS as f64;
    // Values below half a DN round to 0: 1/2 + 0.5 / (50 sqrt(2 pi)) = 0.5040, with a tolerance of
    // five standard errors of 0.002.
    assert!((none - 0.5040).abs() < 0.01, "{none}");
    assert!(dn.iter().all(|dn| *dn < 400));
}
