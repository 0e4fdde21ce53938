//! Frame transfer: charge that is shifted below its cover collects light on the way.
//!
//! ```text
//! N_xy <- N_xy + (t_row / t_int) sum_y' N_xy'
//! ```
//!
//! The sum runs over the column's pixels on the detector (see `scene::trail`, where it is worked
//! out).
//! Reference: Powell et al. 1999 (Applied Optics 38, 1343).
//! Validity: frames follow each other without a pause in which the image area is emptied another
//! way; the scene stands still while it is transferred; the response of single pixels averages out
//! over a column; charge moves on evenly.
//! Price: a sum a pixel.

use super::cause::{no_light, three_digits};
use super::{Assessment, Effect, LazyBound, Pass};
use crate::camera::Shutter;
use crate::fidelity::Fidelity;
use crate::scene::bounds::{BELOW_NOISE, is_below_noise, of_cells, shown_e};
use crate::scene::{EffectId, Scene};

/// The trails of frame transfer.
pub const FRAME_TRANSFER: Effect = Effect::light(EffectId::FrameTransfer, "frame transfer", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let transfer_smear = &scene.transfer_smear_e;
    let most = transfer_smear.iter().copied().fold(0.0, f64::max);
    let own = EffectId::FrameTransfer;
    let assessment = match scene.view.camera.shutter {
        Shutter::FrameTransfer { .. } if is_below_noise(scene, own) => {
            Assessment::none(BELOW_NOISE)
        }
        Shutter::FrameTransfer { .. } if most > 0.0 => {
            let because = format!(
                "columns get trails of up to {} e- a pixel",
                three_digits(most)
            );
            Assessment {
                error: LazyBound::of(move || shown_e(scene, || of_cells(transfer_smear), own)),
                drawn_e: transfer_smear.iter().sum::<f64>()
                    * scene.view.camera.detector.height as f64,
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
            for (e, transfer_smear) in row.iter_mut().zip(transfer_smear) {
                *e += *transfer_smear as f32;
            }
        }
    }));
    (assessment, pass)
}
