//! The plan of one frame: the decision about every effect, in physical order.

use crate::effect::{Assess, Assessment, Decision, EFFECTS, Effect, ErrorBound, LazyBound, Pass};
use crate::fidelity::{Choice, Fidelity};
use crate::scene::{EffectSet, Scene, View, two_figures};
use rayon::prelude::*;
use std::borrow::Cow;

/// The decision about one effect.
pub struct Step<'s> {
    /// The effect.
    pub effect: &'static Effect,
    /// The decision.
    pub decision: Decision<'s>,
    /// Error bound from its assessment: for an effect that shapes images, before these are formed.
    assessed: LazyBound<'s>,
    /// Change of the randomly drawn electrons without the effect, e-.
    drawn_e: f64,
}

/// The effects of a frame, with their passes.
pub struct Plan<'s> {
    /// One step for each effect, in the order of [`EFFECTS`].
    pub steps: Vec<Step<'s>>,
    /// The pass for the sum of all area sources, if all of them run.
    pub together: Pass<'s>,
    scene: &'s Scene,
}

/// The effects of this view's frame: those that shape images if needed, and all others unless
/// switched off.
pub fn simulated(view: &View, fidelity: &Fidelity, choice: &Choice) -> EffectSet {
    simulated_at(view, fidelity, choice).0
}

/// All effects that are not switched off.
pub fn allowed(choice: &Choice) -> EffectSet {
    let effects = EFFECTS.iter();
    let allowed = effects.filter(|effect| switched_off(effect, choice).is_none());
    allowed.fold(EffectSet::default(), |set, effect| set.with(effect.id))
}

/// [`simulated`], and the estimated time of the effects that shape images, ms on one core.
pub(crate) fn simulated_at(view: &View, fidelity: &Fidelity, choice: &Choice) -> (EffectSet, f64) {
    let mut estimated_ms = 0.0;
    let mut simulated = EffectSet::default();
    simulated.noise = choice.noise;
    for effect in EFFECTS {
        let runs = match &effect.assess {
            Assess::Images(assess, _) => {
                switched_off(effect, choice).is_none() && {
                    let assessment = assess(view, &simulated, fidelity);
                    let runs = refusal(&assessment, fidelity, choice).is_none();
                    estimated_ms += if runs { assessment.estimated_ms } else { 0.0 };
                    runs
                }
            }
            Assess::Pixels(_) => !choice.off.contains(&effect.name),
        };
        if runs {
            simulated = simulated.with(effect.id);
        }
    }
    (simulated, estimated_ms)
}

/// Why an effect is switched off, if it is.
fn switched_off(effect: &Effect, choice: &Choice) -> Option<&'static str> {
    if choice.off.contains(&effect.name) {
        Some("it is switched off")
    } else if effect.random && !choice.noise {
        Some("noise is switched off")
    } else {
        None
    }
}

/// Why an effect with that assessment does not run, if it does not.
fn refusal(
    assessment: &Assessment<'_>,
    fidelity: &Fidelity,
    choice: &Choice,
) -> Option<Cow<'static, str>> {
    if choice.all || !assessment.is_within(fidelity) {
        return None;
    }
    Some(if assessment.is_none() {
        assessment.because.clone()
    } else {
        format!("within the tolerance: {}", assessment.because).into()
    })
}

/// The error bound without `effect`, from the formed images and the bound of its assessment.
fn changed(effect: &Effect, scene: &Scene, assessed: ErrorBound) -> ErrorBound {
    match &effect.assess {
        Assess::Images(_, change) if assessed != ErrorBound::default() => change(scene, &assessed),
        _ => assessed,
    }
}

impl<'s> Plan<'s> {
    /// Assesses every effect.
    pub fn new(scene: &'s Scene, fidelity: &Fidelity, choice: &Choice) -> Plan<'s> {
        let step = |effect: &'static Effect| {
            if let Some(why) = switched_off(effect, choice) {
                return Step {
                    effect,
                    decision: Decision::Off { why },
                    assessed: ErrorBound::default().into(),
                    drawn_e: 0.0,
                };
            }
            let (assessment, pass) = match &effect.assess {
                // The plan of a cancelled frame is not used.
                _ if scene.is_cancelled() => {
                    (Assessment::none("the frame is cancelled"), Pass::idle())
                }
                Assess::Images(assess, _) => {
                    let assessment = assess(&scene.view, &scene.simulated, fidelity);
                    (assessment.into_owned(), Pass::Images)
                }
                Assess::Pixels(assess) => assess(scene, fidelity),
            };
            let decision = match refusal(&assessment, fidelity, choice) {
                Some(why) => Decision::Skip { why },
                None => Decision::Run {
                    pass,
                    because: if choice.all && assessment.is_within(fidelity) {
                        format!("effects.all is set; else not: {}", assessment.because).into()
                    } else {
                        assessment.because
                    },
                    estimated_ms: assessment.estimated_ms,
                },
            };
            Step {
                effect,
                decision,
                assessed: assessment.error,
                drawn_e: assessment.drawn_e,
            }
        };
        Plan {
            together: Pass::Tile(Box::new(|tile| {
                scene
                    .areas_light
                    .add_to(tile.level, tile.first, tile.electrons);
            })),
            // One task for each effect: their times differ.
            steps: EFFECTS.par_iter().with_max_len(1).map(step).collect(),
            scene,
        }
    }

    /// Error bound without the effect of a step; none if it is switched off, because the scene
    /// lacks its result. Computed on demand: labels need it for skipped effects only. For an effect
    /// that runs it may take as long as forming the images.
    pub fn error(&self, step: &Step<'_>) -> Option<ErrorBound> {
        let is_off = matches!(step.decision, Decision::Off { .. });
        (!is_off).then(|| changed(step.effect, self.scene, *step.assessed))
    }

    /// Change of the randomly drawn electrons (e-), if it is the only reason why the effect runs.
    pub fn needed_for_e(&self, step: &Step<'_>) -> Option<f64> {
        let fidelity = &self.scene.fidelity;
        let runs = matches!(step.decision, Decision::Run { .. });
        (runs && step.drawn_e > fidelity.skip_e && step.assessed.is_within(fidelity))
            .then_some(step.drawn_e)
    }

    /// Logs which effects run, and why.
    pub(crate) fn log(&self) {
        for step in &self.steps {
            let (effect, decision) = (step.effect, &step.decision);
            match decision {
                Decision::Off { why } => tracing::debug!("{}: skipped, {why}", effect.name),
                Decision::Skip { why } => {
                    let error = self.error(step).unwrap_or_default();
                    tracing::debug!("{}: skipped, {why}; leaves out {error}", effect.name);
                }
                Decision::Run {
                    because,
                    estimated_ms,
                    ..
                } => tracing::debug!(
                    "{}: runs, {because}; some {} ms of a core",
                    effect.name,
                    two_figures(*estimated_ms)
                ),
            }
        }
    }
}
