//! How far a setting's frame is from the reference's: images, background, pixels.

use super::Setting;
use crate::attitude::VehicleState;
use crate::engine::Emulator;
use crate::fidelity::{Choice, Fidelity};
use crate::frame::{Frame, Memory};
use crate::label::VISIBLE_SNR;
use crate::plan::Plan;
use crate::render::render;
use crate::scene::{Scene, Source, Unobservable};
use serde::Serialize;
use skyloop_orbit::sgp4_batch::Level;
use std::collections::HashMap;

/// Images with less of their light on the detector are not compared.
const WHOLE: f64 = 0.9999;

/// What a setting is off by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Errors {
    /// By how much images are moved on average, thousandths of a pixel: the length of the mean of all moves.
    pub centroid_bias_mpx: f64,
    /// The rms of all moves, thousandths of a pixel.
    pub centroid_rms_mpx: f64,
    /// The rms of what images' light is off by, parts in a million.
    pub photometry_ppm: f64,
    /// What the light of a pixel that no object lights is off by on average, e-.
    pub background_e: f64,
    /// The rms of what pixels are off by, e-.
    pub frame_rms_e: f64,
    /// What the pixel is off by that is off most, e-.
    pub worst_e: f64,
}

/// What is summed over frames.
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

/// An image as it is drawn.
struct Drawn {
    /// Electrons on the detector.
    electrons: f64,
    /// Where their centre is, px.
    centre: [f64; 2],
}

impl Drawn {
    fn of(source: &Source, rows: usize) -> Drawn {
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        for (row, column, shares) in source.footprint.rows(0..rows) {
            for (column, share) in (column..).zip(shares) {
                let share = f64::from(*share);
                light += share;
                moments[0] += share * column as f64;
                moments[1] += share * row as f64;
            }
        }
        Drawn {
            electrons: light * source.electrons,
            centre: moments.map(|moment| moment / light),
        }
    }
}

/// A frame by some tolerances: its scene with all its noise, and its pixels without any.
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
    let frame = render(
        &plan,
        &scene,
        Some(Level::best()),
        true,
        &mut Memory::default(),
    );
    drop(plan);
    Ok((scene, frame))
}

/// Adds to `sums` what each of `settings` is off by in the frame of `vehicle`.
///
/// Fails only where [`crate::scene::View::new`] does.
pub fn add(
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
    let drawn = seen.map(|source| (source, Drawn::of(source, rows)));
    let whole = drawn.filter(|(source, drawn)| drawn.electrons >= WHOLE * source.electrons);
    let images: HashMap<_, Drawn> = whole
        .map(|(source, drawn)| (source.body.identity(), drawn))
        .collect();
    for (setting, sums) in settings.iter().zip(sums) {
        let (scene, frame) = frame(emulator, vehicle, setting.fidelity)?;
        let sources = scene.sources.iter();
        let known = sources.filter_map(|source| {
            let truth = images.get(&source.body.identity())?;
            Some((truth, Drawn::of(source, rows)))
        });
        let found = known.fold(0, |found, (truth, drawn)| {
            sums.image(truth, &drawn);
            found + 1
        });
        // All light of the others is lost.
        let lost = images.len().saturating_sub(found) as f64;
        sums.images += lost;
        sums.light_squared += lost;
        sums.frames += 1.0;
        sums.background_e += scene.background_e() - truth.background_e();
        let [charge, true_charge] =
            [&frame, &true_frame].map(|frame| frame.charge_e.as_deref().unwrap_or_default());
        for (e, true_e) in charge.iter().zip(true_charge) {
            let off = f64::from(*e) - f64::from(*true_e);
            sums.pixels += 1.0;
            sums.pixels_squared += off * off;
            sums.worst_e = sums.worst_e.max(off.abs());
        }
    }
    Ok(())
}

impl Sums {
    fn image(&mut self, truth: &Drawn, drawn: &Drawn) {
        let light = drawn.electrons / truth.electrons - 1.0;
        self.images += 1.0;
        self.light_squared += light * light;
        let moves = [0, 1].map(|axis| drawn.centre[axis] - truth.centre[axis]);
        // An image without light has no centre.
        if moves.iter().all(|px| px.is_finite()) {
            self.moved += 1.0;
            self.moves = [0, 1].map(|axis| self.moves[axis] + moves[axis]);
            self.moves_squared += moves[0] * moves[0] + moves[1] * moves[1];
        }
    }

    /// Those of a frame of one pixel that is off by so much, e-.
    #[cfg(test)]
    pub fn of_pixels(e: f64) -> Sums {
        Sums {
            pixels: 1.0,
            pixels_squared: e * e,
            worst_e: e,
            ..Sums::default()
        }
    }

    /// Their means.
    pub fn errors(&self) -> Errors {
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
