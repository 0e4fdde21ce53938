//! Frame-transfer smear: charge collects light while it is shifted below the cover.
//!
//! ```text
//! N_xy <- N_xy + (t_row / t_int) sum_y' N_xy'
//! ```
//!
//! The sum runs over the column's pixels on the detector (computed in `scene::transfer_smear`).
//! Reference: Powell et al. 1999 (Applied Optics 38, 1343).
//! Validity: frames follow each other without a separate clearing of the image area; the scene
//! stands still during transfer; pixel responses average out over a column; rows shift at a
//! constant rate.
//! Price: a sum a pixel.

use super::cause::{no_light, three_digits};
use super::{Assessment, Effect, LazyBound, Pass};
use crate::camera::Shutter;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{ALL_FULL, final_change_e, is_flooded_without, of_cells};
use crate::scene::{EffectId, Scene};

/// Smear of frame transfer.
pub(crate) const FRAME_TRANSFER: Effect =
    Effect::light(EffectId::FrameTransfer, "frame transfer", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let smear_e = &scene.transfer_smear_e;
    let max_e = smear_e.iter().copied().fold(0.0, f64::max);
    let own = EffectId::FrameTransfer;
    let assessment = match scene.view.camera.shutter {
        Shutter::FrameTransfer { .. } if is_flooded_without(scene, own) => {
            Assessment::none(ALL_FULL)
        }
        Shutter::FrameTransfer { .. } if max_e > 0.0 => {
            let because = format!(
                "columns get trails of up to {} e- a pixel",
                three_digits(max_e)
            );
            Assessment {
                error: LazyBound::of(move || final_change_e(scene, || of_cells(smear_e), own)),
                drawn_e: smear_e.iter().sum::<f64>() * scene.view.camera.detector.height as f64,
                ..Assessment::of_pixels(scene, because, 0.0, 0.17)
            }
        }
        Shutter::FrameTransfer { .. } => Assessment::none(no_light(scene)),
        Shutter::Global => {
            Assessment::none("the shutter is global: no charge is shifted through light")
        }
        Shutter::Rolling { .. } => {
            Assessment::none("the shutter is rolling: no charge is shifted through light")
        }
    };
    let pass = Pass::Tile(Box::new(move |tile| {
        for row in tile.electrons.chunks_mut(tile.width) {
            for (e, smear_e) in row.iter_mut().zip(smear_e) {
                *e += *smear_e as f32;
            }
        }
    }));
    (assessment, pass)
}
