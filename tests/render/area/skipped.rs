//! Skipped area light: hidden by a frame full of other light, or lost in noise.

use super::frames::expected;
use crate::fixtures::{Frames, cropped, scene};
use skyloop::camera::Stray;
use skyloop::engine::ExposedFrame;
use skyloop::fidelity::Fidelity;

/// A frame with its expected electrons.
fn expose(frames: &mut Frames, number: u32) -> ExposedFrame {
    frames.emulator.keep_expected = true;
    frames.expose(number)
}

fn runs(exposed: &ExposedFrame, name: &str) -> (bool, String) {
    let effects = &exposed.label.effects;
    let effect = effects.iter().find(|e| e.effect == name).unwrap();
    (effect.run, effect.why.to_string())
}

#[test]
fn effects_hidden_by_a_full_frame_are_skipped() {
    let mut near_sun = Frames::of(scene("near-sun.toml"));
    let exposed = expose(&mut near_sun, 7);
    assert_eq!(exposed.label.flooded_by, Some("sunlight"));
    assert!(runs(&exposed, "sunlight").0);
    for name in ["stars", "zodiacal light", "starlight", "pixel response"] {
        let (run, why) = runs(&exposed, name);
        let is_hidden = why.contains("all pixels are full of other light");
        assert!(!run && is_hidden, "{name}: {why}");
    }
    near_sun.emulator.choice.all = true;
    let all = expose(&mut near_sun, 7);
    assert!(runs(&all, "stars").0 && all.frame.dn == exposed.frame.dn);

    // An effect that fills the frame alone is never skipped because of another one that does too.
    let mut twice = Frames::of(scene("near-sun.toml"));
    twice.emulator.choice.off = vec!["sunlight"];
    let without = expose(&mut twice, 7);
    assert_eq!(without.label.flooded_by, None);
    assert!(runs(&without, "stars").0 && runs(&without, "zodiacal light").0);
}

/// A veil of sunlight below the noise of each pixel, but above and below that of all pixels
/// together.
#[test]
fn light_is_skipped_only_where_all_of_it_is_lost_in_noise() {
    let veil = |pst: f64| {
        let mut config = scene("deep-sky.toml");
        config.camera = cropped(config.camera, 64);
        let detector = &mut config.camera.detector;
        (detector.read_noise_e, detector.gain_e_per_dn) = (10.0, 1.0);
        config.camera.optics.stray = Stray::new(&[[0.1, pst], [3.1, pst]], 0.0);
        let mut frames = Frames::of(config);
        let lights = [
            "stars",
            "zodiacal light",
            "starlight",
            "moonglow",
            "earthshine",
        ];
        frames.emulator.choice.off = [&lights[..], &["dark current"]].concat();
        let exposed = expose(&mut frames, 0);
        let e = f64::from(expected(&exposed)[0]);
        (runs(&exposed, "sunlight"), e)
    };
    let ((run, _), e) = veil(1e-6);
    assert!(run && e > 0.1, "{e}");
    // The electrons of a pixel for a signal-to-noise ratio over all: e sqrt(pixels / (e + read^2 +
    // gain^2 / 12)).
    let of_snr = |snr: f64| snr * (100.0 + 1.0 / 12.0f64).sqrt() / 64.0;
    let at = |wanted: f64| veil(1e-6 * wanted / e);
    let ((run, why), e_px) = at(of_snr(0.2));
    assert!(run, "{why}");
    let is_met = (e_px / of_snr(0.2) - 1.0).abs() < 1e-3;
    assert!(is_met && e_px < 0.05, "{e_px}");
    let ((run, why), lost) = at(of_snr(0.02));
    assert!(!run && why.contains("within the tolerance"), "{why}");
    assert_eq!(lost, 0.0);
}

/// Where area light saturates all pixels, the excess is not computed, and the pixel values are
/// unchanged.
#[test]
fn area_light_beyond_saturation_is_not_computed() {
    let held = |full_well_e: f64, fidelity: Fidelity| {
        let mut config = scene("limb-by-day.toml");
        config.camera = scene("deep-sky.toml").camera;
        config.camera.detector.full_well_e = full_well_e;
        let mut limb = Frames::of(config);
        limb.emulator.choice.noise = false;
        limb.emulator.choice.off = vec!["earthshine"];
        limb.emulator.set_fidelity(fidelity);
        let (emulator, vehicle) = (&limb.emulator, limb.vehicle(0));
        let scene = emulator.scene(&emulator.camera(), &vehicle, 0, &emulator.choice);
        let areas = scene.unwrap().areas;
        let evaluations: usize = areas.iter().map(|area| area.work.lights).sum();
        let exposed = expose(&mut limb, 0);
        let held = expected(&exposed).iter().map(|e| e.min(full_well_e as f32));
        (held.collect::<Vec<f32>>(), evaluations)
    };
    let tolerances = Fidelity::REALTIME;
    let (full, evaluations) = held(2e4, tolerances);
    let (exact, _) = held(2e4, Fidelity::REFERENCE);
    let (_, evaluations_of_all) = held(1e12, tolerances);
    assert!(
        3 * evaluations < 2 * evaluations_of_all,
        "{evaluations} of {evaluations_of_all}"
    );
    let some = full.iter().filter(|e| **e >= 2e4).count();
    assert!(some > full.len() / 4 && some < full.len(), "{some}");
    for (i, (full, exact)) in full.iter().zip(&exact).enumerate() {
        // Four kinds of light and its kinks, each within its bound (`fidelity`).
        let bound = 4.0 * 8.0 * (tolerances.area_e + tolerances.area_part * f64::from(*exact));
        let off = f64::from(full - exact).abs();
        assert!(off <= bound, "pixel {i}: {full} and not {exact} e-");
    }
}
