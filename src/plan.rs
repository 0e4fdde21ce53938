//! The plan of one frame: every effect's verdict on the scene, in physical order.

use crate::effect::{EFFECTS, Effect, Verdict};
use crate::fidelity::Fidelity;
use crate::scene::Scene;

/// One effect's verdict.
pub struct Step<'s> {
    /// The effect.
    pub effect: &'static Effect,
    /// What it answered.
    pub verdict: Verdict<'s>,
}

/// What a frame is rendered by.
pub struct Plan<'s> {
    /// One step an effect, in the order of [`EFFECTS`].
    pub steps: Vec<Step<'s>>,
}

impl<'s> Plan<'s> {
    /// Asks every effect.
    pub fn new(scene: &'s Scene, fidelity: &Fidelity) -> Plan<'s> {
        let steps = EFFECTS
            .iter()
            .map(|effect| Step {
                effect,
                verdict: (effect.judge)(scene, fidelity),
            })
            .collect();
        Plan { steps }
    }
}
