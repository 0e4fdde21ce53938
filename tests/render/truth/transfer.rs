//! Frame transfer against its definition, and labels that exclude its smear trails.

use skyloop::camera::Shutter;
use skyloop::engine::ExposedFrame;
use skyloop::label::EffectLabel;

use super::brute::{changed_fai, image, maximum, stamp, turning, verdict};

fn frame(row_us: f64, rates: [f64; 3]) -> (ExposedFrame, EffectLabel) {
    // Exposed for 0.1 s: a trail of some hundredths of the light of its column.
    let row_s = row_us * 1e-6;
    let shutter = Shutter::FrameTransfer { row_s };
    let mut emulator = changed_fai(|emulator| emulator.camera_mut().shutter = shutter);
    let vehicle = turning(rates);
    let verdict = verdict(&emulator, &vehicle, "frame transfer");
    (emulator.expose(&vehicle, 0).unwrap(), verdict)
}

#[test]
fn every_pixel_passes_every_row_of_its_column_once() {
    for (row_us, rates) in [
        (4.0, [0.0; 3]),
        (100.0, [0.0; 3]),
        (100.0, [10.0, -5.0, 60.0]),
    ] {
        let (exposed, effect) = frame(row_us, rates);
        let truth = image(&exposed.label, &exposed.camera);
        let part = row_us * 1e-6 / 0.1;
        let column = |c: usize| -> f64 { truth.e.iter().skip(c).step_by(truth.width).sum() };
        let trails: Vec<f64> = (0..truth.width).map(|c| part * column(c)).collect();
        let dark = exposed.camera.detector.dark_e_s * exposed.label.exposure_s;
        let background = dark + trails.iter().sum::<f64>() / trails.len() as f64;
        assert!((exposed.label.background_e_px / background - 1.0).abs() < 1e-5);
        let expected = exposed.frame.expected_e.iter().flatten();
        let off = expected
            .zip(&truth.e)
            .enumerate()
            .map(|(i, (seen, light))| {
                (f64::from(*seen) - light - trails[i % truth.width] - dark).abs()
            });
        let worst = maximum(off) / truth.peak();
        println!("{row_us} us: {worst:.1e} of the peak");
        assert!(worst < 2e-5, "{worst}");

        // The declared error is the brightest trail.
        let label = &exposed.label;
        let brightest = maximum(trails.iter().copied());
        assert!((effect.error_e.unwrap() / brightest - 1.0).abs() < 1e-4 && effect.run);

        // snr: sqrt(sum s^2 / (s + dark + trail + read^2 + gain^2 / 12)) over the unsaturated
        // pixels.
        let detector = &exposed.camera.detector;
        let digit = detector.gain_e_per_dn;
        let floor = detector.read_noise_e.powi(2) + digit * digit / 12.0;
        let reach = (f64::from(detector.max_dn()) - detector.offset_dn) * digit;
        let full = reach.min(detector.full_well_e);
        for o in label.objects.iter().filter(|o| o.electrons > 1.0) {
            let (region, light) = stamp(label, o, &exposed.camera);
            let columns = (region.past[0] - region.low[0]).max(1) as usize;
            let term = |(i, s): (usize, &f64)| {
                let transfer_smear = trails[region.low[0] as usize + i % columns];
                let held = s + dark + transfer_smear;
                if held < full {
                    s * s / (held + floor)
                } else {
                    0.0
                }
            };
            let snr = light.iter().enumerate().map(term).sum::<f64>().sqrt();
            assert!((o.snr - snr).abs() < 1e-4 * snr + 1e-4, "{snr} {o:?}");
        }
    }
}

#[test]
fn labels_exclude_frame_transfer_smear() {
    let ((with, _), (without, _)) = (frame(100.0, [0.0; 3]), frame(1e-3, [0.0; 3]));
    for (a, b) in with.label.objects.iter().zip(&without.label.objects) {
        assert_eq!((a.electrons, a.x_px, a.y_px), (b.electrons, b.x_px, b.y_px));
        assert!(a.snr <= b.snr);
    }
}
