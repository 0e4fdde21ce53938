//! The plan of one frame: the decision about every effect, in physical order.

use crate::effect::{Cost, EFFECTS, Effect, Judge, Loss, Need, Pass, Verdict};
use crate::fidelity::{Choice, Fidelity};
use crate::scene::{EffectSet, Scene, View, two_figures};
use rayon::prelude::*;
use std::borrow::Cow;

/// The decision about one effect.
pub struct Step<'s> {
    /// The effect.
    pub effect: &'static Effect,
    /// The decision.
    pub verdict: Verdict<'s>,
    /// Error bound by its assessment; of an effect that shapes images, before they were formed.
    asked: Cost<'s>,
    /// Change of the drawn electrons without it, e-.
    drawn_e: f64,
}

/// What a frame is rendered with.
pub struct Plan<'s> {
    /// One step an effect, in the order of [`EFFECTS`].
    pub steps: Vec<Step<'s>>,
    /// The pass for all area sources together, if all of them run.
    pub together: Pass<'s>,
    scene: &'s Scene,
}

/// The effects of this view's frame: those that shape images if they are needed, and all others
/// unless they are switched off.
pub fn simulated(view: &View, fidelity: &Fidelity, choice: &Choice) -> EffectSet {
    simulated_at(view, fidelity, choice).0
}

/// All effects that are not switched off.
pub fn allowed(choice: &Choice) -> EffectSet {
    let effects = EFFECTS.iter();
    let allowed = effects.filter(|effect| switched_off(effect, choice).is_none());
    allowed.fold(EffectSet::default(), |set, effect| set.with(effect.id))
}

/// [`simulated`], and the estimated time of those that shape images, ms on one core.
pub fn simulated_at(view: &View, fidelity: &Fidelity, choice: &Choice) -> (EffectSet, f64) {
    let mut price_ms = 0.0;
    let mut simulated = EffectSet::default();
    simulated.noise = choice.noise;
    for effect in EFFECTS {
        let runs = match &effect.judge {
            Judge::Images(judge, _) => {
                switched_off(effect, choice).is_none() && {
                    let need = judge(view, &simulated, fidelity);
                    let runs = refusal(&need, fidelity, choice).is_none();
                    price_ms += if runs { need.price_ms } else { 0.0 };
                    runs
                }
            }
            Judge::Pixels(_) => !choice.off.contains(&effect.name),
        };
        if runs {
            simulated = simulated.with(effect.id);
        }
    }
    (simulated, price_ms)
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
fn refusal(need: &Need<'_>, fidelity: &Fidelity, choice: &Choice) -> Option<Cow<'static, str>> {
    if choice.all || !need.is_within(fidelity) {
        return None;
    }
    Some(if need.is_none() {
        need.because.clone()
    } else {
        format!("within the tolerance: {}", need.because).into()
    })
}

/// The error bound without `effect`, assessed as `asked`, now that the images are formed.
fn changed(effect: &Effect, scene: &Scene, asked: Loss) -> Loss {
    match &effect.judge {
        Judge::Images(_, change) if asked != Loss::default() => change(scene, &asked),
        _ => asked,
    }
}

impl<'s> Plan<'s> {
    /// Assesses every effect.
    pub fn new(scene: &'s Scene, fidelity: &Fidelity, choice: &Choice) -> Plan<'s> {
        let step = |effect: &'static Effect| {
            if let Some(why) = switched_off(effect, choice) {
                return Step {
                    effect,
                    verdict: Verdict::Off { why },
                    asked: Loss::default().into(),
                    drawn_e: 0.0,
                };
            }
            let (need, pass) = match &effect.judge {
                // Its plan is not used.
                _ if scene.is_cancelled() => (Need::none("the frame is cancelled"), Pass::idle()),
                Judge::Images(judge, _) => {
                    let need = judge(&scene.view, &scene.simulated, fidelity);
                    (need.told(), Pass::Images)
                }
                Judge::Pixels(judge) => judge(scene, fidelity),
            };
            let verdict = match refusal(&need, fidelity, choice) {
                Some(why) => Verdict::Skip { why },
                None => Verdict::Run {
                    pass,
                    because: if choice.all && need.is_within(fidelity) {
                        format!("effects.all is set; else not: {}", need.because).into()
                    } else {
                        need.because
                    },
                    price_ms: need.price_ms,
                },
            };
            Step {
                effect,
                verdict,
                asked: need.error,
                drawn_e: need.drawn_e,
            }
        };
        Plan {
            together: Pass::Tile(Box::new(|tile| {
                let areas = scene.areas_together();
                areas.add_to(tile.level, tile.first, tile.electrons);
            })),
            // One by one: their times differ.
            steps: EFFECTS.par_iter().with_max_len(1).map(step).collect(),
            scene,
        }
    }

    /// Error bound without the effect of a step; none if it is switched off, because its result is
    /// not in the scene. Computed on demand: labels give it for skipped effects. For effects that
    /// run it may take as long as forming the images, and no frame needs it.
    pub fn error(&self, step: &Step<'_>) -> Option<Loss> {
        let is_off = matches!(step.verdict, Verdict::Off { .. });
        (!is_off).then(|| changed(step.effect, self.scene, *step.asked))
    }

    /// The drawn electrons that need an effect which no pixel's expectation needs, e-; none
    /// otherwise.
    pub fn needed_for_e(&self, step: &Step<'_>) -> Option<f64> {
        let fidelity = self.scene.fidelity();
        let runs = matches!(step.verdict, Verdict::Run { .. });
        (runs && step.drawn_e > fidelity.skip_e && step.asked.is_within(fidelity))
            .then_some(step.drawn_e)
    }

    /// Logs which effects run, and why.
    pub fn log(&self) {
        for step in &self.steps {
            let (effect, verdict) = (step.effect, &step.verdict);
            match verdict {
                Verdict::Off { why } => tracing::debug!("{}: skipped, {why}", effect.name),
                Verdict::Skip { why } => {
                    let error = self.error(step).unwrap_or_default();
                    tracing::debug!("{}: skipped, {why}; leaves out {error}", effect.name);
                }
                Verdict::Run {
                    because, price_ms, ..
                } => tracing::debug!(
                    "{}: runs, {because}; some {} ms of a core",
                    effect.name,
                    two_figures(*price_ms)
                ),
            }
        }
    }
}
