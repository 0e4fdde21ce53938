//! What is done where a frame would be late: it comes late, it is left out, or it is rendered more coarsely. It asks no clock.
//!
//! What a frame will take is what the last one by the same tolerances took, and what the last one took on its way. What has not been tried for a while is trusted to take less and less
//! than it did, so that it is tried again: a frame that takes twice too long every 11th exposure.

use crate::config::OnOverrun;
use crate::fidelity::{Coarser, Fidelity};
use std::time::Duration;

/// What is left of an estimate at each frame that does not renew it.
const FADES: f64 = 15.0 / 16.0;

/// The policy, and what frames take.
#[derive(Debug)]
pub struct Overrun {
    policy: OnOverrun,
    /// As it is configured first, then coarser and coarser.
    levels: Vec<Level>,
    /// Exposures that were left out.
    pub dropped: u32,
    /// Since the last frame.
    newly_dropped: bool,
    /// From the moment that all of a frame could have left to its last octet's leaving, s, of the last one.
    way_s: f64,
}

/// Tolerances, and what a frame by them takes, s, if there was one.
#[derive(Debug)]
struct Level {
    fidelity: Fidelity,
    took_s: Option<f64>,
}

impl Level {
    fn untried(fidelity: Fidelity) -> Level {
        Level {
            fidelity,
            took_s: None,
        }
    }
}

/// What is to be done with an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Rendered.
    Shoot {
        /// By which of the levels.
        level: usize,
        /// What its label says.
        overrun: Option<&'static str>,
    },
    /// Left out.
    Drop,
}

impl Overrun {
    /// Renders by `fidelity`, and where that would be late and so it is configured by what each of `steps` makes of what stands before it. Those that make nothing
    /// coarser are no levels: they are told of.
    pub fn new(
        policy: OnOverrun,
        fidelity: Fidelity,
        steps: &[Coarser],
    ) -> (Overrun, Vec<Coarser>) {
        let steps = match policy {
            OnOverrun::Coarsen => steps,
            OnOverrun::Late | OnOverrun::Drop => &[],
        };
        let (mut last, mut idle) = (fidelity, Vec::new());
        let mut levels = vec![Level::untried(fidelity)];
        for step in steps {
            let coarser = step.than(&last);
            match coarser == last {
                true => idle.push(*step),
                false => levels.push(Level::untried(coarser)),
            }
            last = coarser;
        }
        let overrun = Overrun {
            policy,
            levels,
            dropped: 0,
            newly_dropped: false,
            way_s: 0.0,
        };
        (overrun, idle)
    }

    /// What is to be done with an exposure whose frame is late after this time, none: never, and leaves the device no sooner than when it is `held` no more.
    pub fn decide(&mut self, spare: Option<Duration>, held: Duration) -> Verdict {
        let Some(spare_s) = spare.map(|spare| spare.as_secs_f64()) else {
            return self.shoot(0, None);
        };
        let (spare_s, held_s) = (spare_s - self.way_s, held.as_secs_f64());
        let is_held_too_long = held_s > spare_s.max(0.0);
        let is_ready_by = |level: &Level, s: f64| level.took_s.is_none_or(|took_s| took_s <= s);
        let in_time = |level: &Level| !is_held_too_long && is_ready_by(level, spare_s);
        match (self.levels.iter().position(in_time), self.policy) {
            (Some(0), _) => self.shoot(0, None),
            (Some(level), _) => self.shoot(level, Some("coarsen")),
            (None, OnOverrun::Drop) => {
                self.fade(None);
                self.dropped = self.dropped.wrapping_add(1);
                self.newly_dropped = true;
                Verdict::Drop
            }
            (None, OnOverrun::Late | OnOverrun::Coarsen) => {
                // What is held anyway need not be coarser than there is time for meanwhile.
                let last = self.levels.len().saturating_sub(1);
                let is_held = |level: &Level| is_ready_by(level, held_s);
                let level = self.levels.iter().position(is_held).unwrap_or(last);
                self.shoot(level, Some("late"))
            }
        }
    }

    fn shoot(&mut self, level: usize, overrun: Option<&'static str>) -> Verdict {
        self.fade(Some(level));
        let dropped = std::mem::take(&mut self.newly_dropped).then_some("drop");
        Verdict::Shoot {
            level,
            overrun: overrun.or(dropped),
        }
    }

    /// All estimates but that of a level, which is about to be renewed.
    fn fade(&mut self, renewed: Option<usize>) {
        let others = self.levels.iter_mut().enumerate();
        for (_, level) in others.filter(|(i, _)| Some(*i) != renewed) {
            level.took_s = level.took_s.map(|took_s| took_s * FADES);
        }
        if renewed.is_none() {
            self.way_s *= FADES;
        }
    }

    /// The tolerances of a level.
    pub fn fidelity(&self, level: usize) -> Option<Fidelity> {
        self.levels.get(level).map(|level| level.fidelity)
    }

    /// A frame took so long to leave, once all of it could.
    pub fn learn_way(&mut self, took: Duration) {
        self.way_s = took.as_secs_f64();
    }

    /// A frame by a level took so long.
    pub fn learn(&mut self, level: usize, took: Duration) {
        if let Some(level) = self.levels.get_mut(level) {
            level.took_s = Some(took.as_secs_f64());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fidelity::{Knob, Value};

    const NOT_HELD: Duration = Duration::ZERO;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn of(policy: OnOverrun) -> Overrun {
        Overrun::new(policy, Fidelity::REALTIME, &[fast(), wing_e(1.0)]).0
    }

    fn fast() -> Coarser {
        Coarser::Preset("fast", Fidelity::FAST)
    }

    fn wing_e(wing_e: f64) -> Coarser {
        Coarser::Knob(Knob::named("wing_e").unwrap(), Value::Number(wing_e))
    }

    fn shoot(level: usize, overrun: impl Into<Option<&'static str>>) -> Verdict {
        let overrun = overrun.into();
        Verdict::Shoot { level, overrun }
    }

    #[test]
    fn late_frames_come_late_and_say_so() {
        let mut overrun = of(OnOverrun::Late);
        assert_eq!(
            overrun.decide(Some(ms(0)), NOT_HELD),
            shoot(0, None),
            "nothing is known yet"
        );
        overrun.learn(0, ms(50));
        assert_eq!(overrun.decide(Some(ms(50)), NOT_HELD), shoot(0, None));
        assert_eq!(overrun.decide(Some(ms(49)), NOT_HELD), shoot(0, "late"));
        assert_eq!(
            overrun.decide(None, NOT_HELD),
            shoot(0, None),
            "a single shot"
        );
        assert_eq!((overrun.dropped, overrun.fidelity(1)), (0, None));
    }

    #[test]
    fn exposures_are_left_out_until_a_frame_may_be_in_time_again() {
        let mut overrun = of(OnOverrun::Drop);
        overrun.learn(0, ms(200));
        let tried = |overrun: &mut Overrun| {
            let verdicts = std::iter::repeat_with(|| overrun.decide(Some(ms(100)), NOT_HELD));
            verdicts
                .take_while(|verdict| *verdict == Verdict::Drop)
                .count()
        };
        // X-Val: by hand, (15/16)^n <= 1/2 from n = 11 on.
        assert_eq!((tried(&mut overrun), overrun.dropped), (11, 11));
        overrun.learn(0, ms(10));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(0, None));
        // The first frame after those that were left out has said so.
        overrun.learn(0, ms(101));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), Verdict::Drop);
        overrun.learn(0, ms(99));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(0, "drop"));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(0, None));
    }

    #[test]
    fn frames_are_coarsened_in_the_order_that_is_configured() {
        let mut overrun = of(OnOverrun::Coarsen);
        overrun.learn(0, ms(200));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(1, "coarsen"));
        assert_eq!(overrun.fidelity(1), Some(Fidelity::FAST));
        overrun.learn(1, ms(150));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(2, "coarsen"));
        assert_eq!(
            overrun.fidelity(2).map(|fidelity| fidelity.wing_e),
            Some(1.0)
        );
        overrun.learn(2, ms(120));
        assert_eq!(
            overrun.decide(Some(ms(100)), NOT_HELD),
            shoot(2, "late"),
            "the coarsest"
        );
        // With more time the finest that fits.
        overrun.learn(2, ms(90));
        assert_eq!(overrun.decide(Some(ms(160)), NOT_HELD), shoot(1, "coarsen"));
        // What was too slow is tried again.
        overrun.learn(1, ms(90));
        let next: Vec<Verdict> = (0..12)
            .map(|_| overrun.decide(Some(ms(100)), NOT_HELD))
            .collect();
        assert!(next.contains(&shoot(0, None)), "{next:?}");
        assert_eq!(overrun.dropped, 0);
    }

    #[test]
    fn what_a_device_holds_back_for_too_long_is_late_however_coarse_it_is() {
        for (policy, verdict) in [
            (OnOverrun::Late, shoot(0, "late")),
            (OnOverrun::Coarsen, shoot(0, "late")),
            (OnOverrun::Drop, Verdict::Drop),
        ] {
            // Before the first frame, too.
            let mut overrun = of(policy);
            assert_eq!(overrun.decide(Some(ms(100)), ms(101)), verdict);
            overrun.learn(0, ms(90));
            assert_eq!(overrun.decide(Some(ms(100)), ms(101)), verdict);
        }
        // What is rendered meanwhile takes no time besides; the way comes after both.
        let mut overrun = of(OnOverrun::Coarsen);
        overrun.learn(0, ms(70));
        assert_eq!(overrun.decide(Some(ms(100)), ms(80)), shoot(0, None));
        overrun.learn_way(ms(25));
        assert_eq!(overrun.decide(Some(ms(100)), ms(80)), shoot(0, "late"));
        assert_eq!(overrun.decide(Some(ms(100)), ms(75)), shoot(0, None));
        overrun.learn(0, ms(90));
        assert_eq!(overrun.decide(Some(ms(100)), ms(75)), shoot(1, "coarsen"));
    }

    /// The settings of all levels, and the steps that are none, from `fidelity` on.
    fn levels(fidelity: Fidelity, steps: &[Coarser]) -> (Vec<Fidelity>, Vec<String>) {
        let (overrun, idle) = Overrun::new(OnOverrun::Coarsen, fidelity, steps);
        let levels = (0..).map_while(|level| overrun.fidelity(level)).collect();
        (levels, idle.iter().map(|step| step.to_string()).collect())
    }

    #[test]
    fn steps_are_of_the_setting_that_the_run_has() {
        for fidelity in [Fidelity::FAST, Fidelity::REALTIME, Fidelity::REFERENCE] {
            let coarser = Fidelity {
                wing_e: 0.5,
                ..fidelity
            };
            let (levels, idle) = levels(fidelity, &[wing_e(0.5)]);
            assert_eq!(levels, [fidelity, coarser]);
            assert_eq!(idle.len(), 0);
        }
    }

    #[test]
    fn what_makes_nothing_coarser_is_no_level_and_is_told() {
        let fastest = Fidelity {
            wing_e: 0.5,
            ..Fidelity::FAST
        };
        let reference = Coarser::Preset("reference", Fidelity::REFERENCE);
        let steps = [reference, fast(), wing_e(0.1), wing_e(0.5), fast()];
        assert_eq!(
            levels(Fidelity::FAST, &steps),
            (
                vec![Fidelity::FAST, fastest],
                ["\"reference\"", "\"fast\"", "\"wing_e = 0.1\"", "\"fast\""]
                    .map(str::to_string)
                    .to_vec()
            )
        );
        // With no step left a late frame is late.
        let (mut overrun, idle) = Overrun::new(OnOverrun::Coarsen, Fidelity::FAST, &[fast()]);
        assert_eq!(idle.len(), 1);
        overrun.learn(0, ms(200));
        assert_eq!(overrun.decide(Some(ms(100)), NOT_HELD), shoot(0, "late"));
        // Nobody asks for steps that are not taken.
        for policy in [OnOverrun::Late, OnOverrun::Drop] {
            let (overrun, idle) = Overrun::new(policy, Fidelity::FAST, &[fast()]);
            assert_eq!((overrun.levels.len(), idle.len()), (1, 0));
        }
    }
}
