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

    /// Logs what runs and what does not, and why.
    pub fn log(&self) {
        for Step { effect, verdict } in &self.steps {
            match verdict {
                Verdict::Skip { why, error_e } => {
                    tracing::debug!(
                        "{}: skipped, {why}; leaves out {error_e} e- a pixel",
                        effect.name
                    );
                }
                Verdict::Run {
                    because, price_ms, ..
                } => tracing::debug!(
                    "{}: runs, {because}; some {price_ms:.2} ms of a core",
                    effect.name
                ),
            }
        }
    }
}
