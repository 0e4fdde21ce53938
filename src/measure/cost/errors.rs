//! Errors of a setting's frame relative to the reference: images, background, pixels.

use super::setting::Setting;
use crate::rendered;
use serde::Serialize;
use skyloop_render::attitude::VehicleState;
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::{Choice, Fidelity};
use skyloop_render::footprint::Footprint;
use skyloop_render::frame::Frame;
use skyloop_render::label::VISIBLE_SNR;
use skyloop_render::plan::Plan;
use skyloop_render::scene::{Scene, Source, Unobservable};
use std::collections::HashMap;

/// Images with a smaller share of their light on the detector are not compared.
const WHOLE: f64 = 0.9999;

/// Errors of a setting.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Errors {
    /// Length of the mean shift of images, thousandths of a pixel.
    pub centroid_bias_mpx: f64,
    /// The rms of all shifts, thousandths of a pixel.
    pub centroid_rms_mpx: f64,
    /// The rms of relative errors of images' light, parts in a million.
    pub photometry_ppm: f64,
    /// Mean error of the light of a pixel without objects, e-.
    pub background_e: f64,
    /// The rms of errors of pixels, e-.
    pub frame_rms_e: f64,
    /// Greatest error of a pixel, e-.
    pub worst_e: f64,
}

/// Sums over frames.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sums {
    images: f64,
    moved: f64,
    moves: [f64; 2],
    moves_squared: f64,
    light_squared: f64,
    frames: f64,
    background_e: f64,
    pixels: f64,
    pixels_squared: f64,
    worst_e: f64,
}

struct Drawn {
    /// Electrons on the detector.
    electrons: f64,
    /// Their centroid, px.
    centre: [f64; 2],
}

impl Drawn {
    fn of(footprint: &Footprint, electrons: f64, rows: usize) -> Drawn {
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        for (row, column, shares) in footprint.rows(0..rows) {
            for (column, share) in (column..).zip(shares) {
                let share = f64::from(*share);
                light += share;
                moments[0] += share * column as f64;
                moments[1] += share * row as f64;
            }
        }
        Drawn {
            electrons: light * electrons,
            centre: moments.map(|moment| moment / light),
        }
    }
}

/// A frame with these tolerances: its scene with all its noise, and its pixels without noise.
fn frame(
    emulator: &mut Emulator,
    vehicle: &VehicleState,
    fidelity: Fidelity,
) -> Result<(Scene, Frame), Unobservable> {
    emulator.set_fidelity(fidelity);
    let scene = emulator.scene(&emulator.camera(), vehicle, 0, &emulator.choice)?;
    let quiet = Choice {
        noise: false,
        ..emulator.choice.clone()
    };
    let plan = Plan::new(&scene, &fidelity, &quiet);
    let frame = rendered(&plan, &scene);
    drop(plan);
    Ok((scene, frame))
}

/// Adds the errors of each of `settings` in the frame of `vehicle` to `sums`.
///
/// Errors: those of [`skyloop_render::scene::build_view`].
pub(crate) fn add(
    emulator: &mut Emulator,
    vehicle: &VehicleState,
    settings: &[Setting],
    sums: &mut [Sums],
) -> Result<(), Unobservable> {
    let (truth, true_frame) = frame(emulator, vehicle, Fidelity::REFERENCE)?;
    let rows = truth.view.camera.detector.height;
    let seen = truth
        .sources
        .iter()
        .filter(|source| source.snr >= VISIBLE_SNR);
    let drawn_of = |source: &Source| Drawn::of(&source.footprint, source.electrons, rows);
    let drawn = seen.map(|source| (source, drawn_of(source)));
    let whole = drawn.filter(|(source, drawn)| drawn.electrons >= WHOLE * source.electrons);
    let images: HashMap<_, Drawn> = whole
        .map(|(source, drawn)| (source.body.identity(), drawn))
        .collect();
    for (setting, sums) in settings.iter().zip(sums) {
        let (scene, frame) = frame(emulator, vehicle, setting.fidelity)?;
        let sources = scene.sources.iter();
        let known = sources.filter_map(|source| {
            let truth = images.get(&source.body.identity())?;
            Some((truth, drawn_of(source)))
        });
        let found = known.fold(0, |found, (truth, drawn)| {
            sums.image(truth, &drawn);
            found + 1
        });
        sums.lost(images.len().saturating_sub(found));
        sums.background(scene.background_e() - truth.background_e());
        let [charge, true_charge] =
            [&frame, &true_frame].map(|frame| frame.charge_e.as_deref().unwrap_or_default());
        sums.pixels(true_charge, charge);
    }
    Ok(())
}

impl Sums {
    fn image(&mut self, truth: &Drawn, drawn: &Drawn) {
        let light = drawn.electrons / truth.electrons - 1.0;
        self.images += 1.0;
        self.light_squared += light * light;
        let moves = [0, 1].map(|axis| drawn.centre[axis] - truth.centre[axis]);
        // An image without light has no centroid.
        if moves.iter().all(|px| px.is_finite()) {
            self.moved += 1.0;
            self.moves = [0, 1].map(|axis| self.moves[axis] + moves[axis]);
            self.moves_squared += moves[0] * moves[0] + moves[1] * moves[1];
        }
    }

    /// Adds images that are missing from the frame: each has lost all its light.
    fn lost(&mut self, images: usize) {
        let images = images as f64;
        self.images += images;
        self.light_squared += images;
    }

    /// Adds the error of a frame's background, e-.
    fn background(&mut self, off_e: f64) {
        self.frames += 1.0;
        self.background_e += off_e;
    }

    /// Adds the charges of pixels, e-.
    fn pixels(&mut self, truth_e: &[f32], drawn_e: &[f32]) {
        for (e, true_e) in drawn_e.iter().zip(truth_e) {
            let off = f64::from(*e) - f64::from(*true_e);
            self.pixels += 1.0;
            self.pixels_squared += off * off;
            self.worst_e = self.worst_e.max(off.abs());
        }
    }

    /// The sums of a frame of one pixel with this error, e-.
    #[cfg(test)]
    pub(crate) fn of_pixels(e: f64) -> Sums {
        Sums {
            pixels: 1.0,
            pixels_squared: e * e,
            worst_e: e,
            ..Sums::default()
        }
    }

    /// The means.
    pub(crate) fn errors(&self) -> Errors {
        let mean = |sum: f64, count: f64| if count > 0.0 { sum / count } else { 0.0 };
        let [x, y] = self.moves.map(|sum| mean(sum, self.moved));
        Errors {
            centroid_bias_mpx: libm::hypot(x, y) * 1e3,
            centroid_rms_mpx: mean(self.moves_squared, self.moved).sqrt() * 1e3,
            photometry_ppm: mean(self.light_squared, self.images).sqrt() * 1e6,
            background_e: mean(self.background_e, self.frames),
            frame_rms_e: mean(self.pixels_squared, self.pixels).sqrt(),
            worst_e: self.worst_e,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_config::Config;
    use skyloop_config::flight;

    /// An image with `electrons` on a detector of 4 x 4 pixels: its shares by column and row.
    fn image(electrons: f64, shares: &[([usize; 2], f32)]) -> Drawn {
        const SIDE: usize = 4;
        let mut all = vec![0.0; SIDE * SIDE];
        for ([column, row], share) in shares {
            all[row * SIDE + column] = *share;
        }
        Drawn::of(&Footprint::whole(SIDE, all), electrons, SIDE)
    }

    fn assert_near(value: f64, expected: f64) {
        assert!(
            (value - expected).abs() <= 1e-12 * expected,
            "{value} {expected}"
        );
    }

    /// One image shifted by (0.5, 0) px, and one by (-0.5, 0.25) px with three quarters of its
    /// light.
    fn two_images() -> Sums {
        let mut sums = Sums::default();
        sums.image(
            &image(1000.0, &[([1, 1], 0.5), ([2, 1], 0.5)]),
            &image(1000.0, &[([2, 1], 1.0)]),
        );
        sums.image(
            &image(200.0, &[([2, 2], 1.0)]),
            &image(
                200.0,
                &[([1, 2], 0.1875), ([1, 3], 0.1875), ([2, 2], 0.375)],
            ),
        );
        sums
    }

    #[test]
    fn drawn_image_has_the_light_and_centroid_on_the_detector() {
        let drawn = image(80.0, &[([1, 2], 0.25), ([3, 2], 0.125), ([3, 0], 0.125)]);
        // X-Val: by hand, half of 80 e-; columns (1 + 3) / 2, rows (2 + 2 / 2 + 0) / 2.
        assert_eq!((drawn.electrons, drawn.centre), (40.0, [2.0, 1.5]));
    }

    #[test]
    fn opposite_shifts_cancel_in_the_bias_but_not_in_the_rms() {
        let errors = two_images().errors();
        // X-Val: by hand, the second image's centroid is 1/2 (2, 2) + 1/4 (1, 2) + 1/4 (1, 3) =
        // (1.5, 2.25). The mean of the shifts is (0, 0.125), the rms (1/2 (0.5^2 + 0.5^2 +
        // 0.25^2))^(1/2); of the light 0 and -1/4 it is (1/2 (1/4)^2)^(1/2).
        assert_near(errors.centroid_bias_mpx, 125.0);
        assert_near(errors.centroid_rms_mpx, 1e3 * 0.28125f64.sqrt());
        assert_near(errors.photometry_ppm, 1e6 * 0.03125f64.sqrt());
        let others = [errors.background_e, errors.frame_rms_e, errors.worst_e];
        assert_eq!(others, [0.0; 3]);
    }

    #[test]
    fn lost_image_counts_in_photometry_only() {
        let (mut lost, mut dark) = (two_images(), two_images());
        lost.lost(1);
        // Found, but without light on the detector.
        dark.image(&image(9.0, &[([1, 1], 1.0)]), &image(9.0, &[]));
        for sums in [lost, dark] {
            let (errors, before) = (sums.errors(), two_images().errors());
            // X-Val: by hand, (1/3 ((1/4)^2 + 1))^(1/2).
            assert_near(errors.photometry_ppm, 1e6 * (1.0625f64 / 3.0).sqrt());
            assert_eq!(errors.centroid_bias_mpx, before.centroid_bias_mpx);
            assert_eq!(errors.centroid_rms_mpx, before.centroid_rms_mpx);
        }
    }

    #[test]
    fn background_is_a_mean_and_pixels_are_rms_and_maximum() {
        let mut sums = Sums::default();
        sums.background(0.5);
        sums.pixels(&[10.0, 20.0, 7.0], &[13.0, 20.0, 7.0]);
        sums.background(-0.125);
        sums.pixels(&[0.0, 5.0, 7.0], &[0.0, 1.0, 12.0]);
        sums.background(0.0);
        sums.pixels(&[2.0; 3], &[2.0; 3]);
        sums.background(0.0);
        sums.pixels(&[2.0; 3], &[0.0, 2.0, 2.0]);
        // X-Val: by hand, errors of 3, -4, 5 and -2 in twelve pixels.
        let errors = Errors {
            background_e: 0.09375,
            frame_rms_e: 4.5f64.sqrt(),
            worst_e: 5.0,
            ..Errors::default()
        };
        assert_eq!(sums.errors(), errors);
        sums.pixels(&[9.0], &[1.0]);
        assert_eq!(sums.errors().worst_e, 8.0, "negative errors count too");
        assert_eq!(Sums::default().errors(), Errors::default());
    }

    #[test]
    fn reference_has_no_error_and_omitted_stars_lose_their_light() {
        let mut config = Config::builtin().unwrap();
        // Listed stars always have images, so list only those with a higher ratio.
        config.label_snr = 100.0;
        let mission = flight::mission(&config).unwrap();
        let vehicle = flight::vehicle(&mission, 0).unwrap();
        let mut emulator = Emulator::new(&mut config);
        let reference = Fidelity::REFERENCE;
        let star_snr = 10.0;
        let settings = [
            reference,
            Fidelity {
                star_snr,
                ..reference
            },
        ]
        .map(|fidelity| Setting {
            name: String::new(),
            moved: None,
            fidelity,
        });
        let mut sums = [Sums::default(); 2];
        add(&mut emulator, &vehicle, &settings, &mut sums).unwrap();
        let [same, fewer] = sums.map(|sums| (sums, sums.errors()));
        assert_eq!(same.1, Errors::default());
        assert_eq!(same.0.images, fewer.0.images);
        assert_eq!(same.0.images, same.0.moved);
        let lost = fewer.0.images - fewer.0.moved;
        assert!(lost > 0.0 && fewer.0.moved > 0.0, "{lost}");
        let Errors {
            centroid_rms_mpx,
            photometry_ppm,
            background_e,
            worst_e,
            ..
        } = fewer.1;
        assert_eq!((centroid_rms_mpx, background_e), (0.0, 0.0));
        assert_near(photometry_ppm, 1e6 * (lost / fewer.0.images).sqrt());
        assert!(worst_e > 1.0, "{worst_e}");
    }
}
