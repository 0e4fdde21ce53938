//! The effects, from light to digits. Adding one is a file here and a line in [`EFFECTS`].

mod dark;
mod full_well;
mod point;
mod read;
mod readout;
mod shot;

use crate::fidelity::Fidelity;
use crate::frame::Tile;
use crate::scene::Scene;

/// Every effect, in physical order.
pub const EFFECTS: &[Effect] = &[
    point::STARS,
    point::RSOS,
    dark::DARK_CURRENT,
    shot::SHOT_NOISE,
    full_well::FULL_WELL,
    read::READ_NOISE,
    readout::READOUT,
];

/// Something between the sky and the digits.
pub struct Effect {
    /// Name, as plans give it.
    pub name: &'static str,
    /// Where it stands in the chain.
    pub stage: Stage,
    /// Whether this scene needs it.
    pub judge: for<'s> fn(&'s Scene, &Fidelity) -> Verdict<'s>,
}

/// The chain's stages, in order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Adds expected electrons.
    Light,
    /// Turns expected electrons into drawn ones, or clips them.
    Charge,
    /// Turns electrons into digits.
    Digits,
}

/// What an effect does to one tile.
pub type Pass<'s> = Box<dyn Fn(&mut Tile<'_>) + Send + Sync + 's>;

/// An effect's answer to a scene.
pub enum Verdict<'s> {
    /// The scene does not need it.
    Skip {
        /// Why not.
        why: &'static str,
        /// What leaving it out costs, e- a pixel at most.
        error_e: f64,
    },
    /// The scene needs it.
    Run {
        /// What it does to a tile.
        pass: Pass<'s>,
        /// Why it is needed.
        because: &'static str,
        /// What it is expected to cost, ms on one core.
        price_ms: f64,
    },
}

/// The price (ms) of `ns` nanoseconds a pixel.
fn per_pixel(scene: &Scene, ns: f64) -> f64 {
    scene.camera.detector.pixels() as f64 * ns * 1e-6
}
