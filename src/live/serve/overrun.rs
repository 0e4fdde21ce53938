//! What is done where a frame would be late: it comes late, it is left out, or it is rendered more coarsely. It asks no clock.
//!
//! A frame is there when it is rendered and the device holds it no more; then it takes its way over the line. What it will take is what the last one by the same
//! tolerances took, and what the last one took on its way. What was too slow is tried again after a few frames, and each time that it is too slow once more after twice as many:
//! one hiccup costs little, and what never is in time is seldom tried.

use skyloop_config::OnOverrun;
use skyloop_render::fidelity::{Coarser, Fidelity};
use std::time::Duration;

/// After so many exposures what was too slow is tried again, the first time and at most.
const TRIED_AGAIN: [u32; 2] = [4, 256];

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
    /// From the moment that all of a frame could have left to its last octet's leaving.
    way: Estimate,
}

/// Tolerances, and what a frame by them takes.
#[derive(Debug)]
struct Level {
    fidelity: Fidelity,
    takes: Estimate,
}

impl Level {
    fn untried(fidelity: Fidelity) -> Level {
        Level {
            fidelity,
            takes: Estimate::default(),
        }
    }
}

/// What something takes, by the last time that it was done.
#[derive(Debug, Default)]
struct Estimate {
    /// That, s; none: it was never done.
    took_s: Option<f64>,
    /// What it might take then, s.
    allowed_s: f64,
    /// Exposures since then.
    since: u32,
    /// After how many it is tried again where that is too long; 0: it was in time.
    patience: u32,
}

impl Estimate {
    /// Whether it is to be tried again, whatever it took.
    fn is_due(&self) -> bool {
        self.took_s.is_none() || self.since >= self.patience.max(TRIED_AGAIN[0])
    }

    /// Whether it may be done within `s`.
    fn fits(&self, s: f64) -> bool {
        self.is_due() || self.took_s.is_none_or(|took_s| took_s <= s)
    }

    /// What it is reckoned to take, s.
    fn reckoned_s(&self) -> f64 {
        let took_s = self.took_s.filter(|_| !self.is_due());
        took_s.unwrap_or(0.0)
    }

    fn learn(&mut self, took: Duration) {
        let (took_s, [first, most]) = (took.as_secs_f64(), TRIED_AGAIN);
        self.patience = match took_s <= self.allowed_s {
            true => 0,
            false => self.patience.saturating_mul(2).clamp(first, most),
        };
        (self.took_s, self.since) = (Some(took_s), 0);
    }

    /// An exposure goes by without it.
    fn pass(&mut self) {
        self.since = self.since.saturating_add(1);
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
            way: Estimate::default(),
        };
        (overrun, idle)
    }

    /// What is to be done with an exposure whose frame is late after this time, none: never, and leaves the device no sooner than when it is `held` no more.
    pub fn decide(&mut self, spare: Option<Duration>, held: Duration) -> Verdict {
        let Some(spare_s) = spare.map(|spare| spare.as_secs_f64()) else {
            return self.shoot(0, None);
        };
        let held_s = held.as_secs_f64();
        let ready_s = spare_s - self.way.reckoned_s();
        let is_held_too_long = held_s > ready_s.max(0.0);
        let in_time = |level: &Level| !is_held_too_long && level.takes.fits(ready_s);
        let (level, overrun) = match (self.levels.iter().position(in_time), self.policy) {
            (Some(0), _) => (0, None),
            (Some(level), _) => (level, Some("coarsen")),
            (None, OnOverrun::Drop) => {
                self.pass(None);
                self.dropped = self.dropped.wrapping_add(1);
                self.newly_dropped = true;
                return Verdict::Drop;
            }
            (None, OnOverrun::Late | OnOverrun::Coarsen) => {
                // What is held anyway need not be coarser than there is time for meanwhile.
                let last = self.levels.len().saturating_sub(1);
                let is_held = |level: &Level| level.takes.fits(held_s);
                let held = self.levels.iter().position(is_held);
                let level = held.filter(|_| is_held_too_long).unwrap_or(last);
                (level, Some("late"))
            }
        };
        if let Some(Level { takes, .. }) = self.levels.get_mut(level) {
            takes.allowed_s = ready_s.max(held_s);
            self.way.allowed_s = spare_s - takes.reckoned_s().max(held_s);
        }
        self.shoot(level, overrun)
    }

    fn shoot(&mut self, level: usize, overrun: Option<&'static str>) -> Verdict {
        self.pass(Some(level));
        let dropped = std::mem::take(&mut self.newly_dropped).then_some("drop");
        Verdict::Shoot {
            level,
            overrun: overrun.or(dropped),
        }
    }

    /// An exposure goes by without all but a level, which is about to be renewed.
    fn pass(&mut self, renewed: Option<usize>) {
        let others = self.levels.iter_mut().enumerate();
        for (_, level) in others.filter(|(i, _)| Some(*i) != renewed) {
            level.takes.pass();
        }
        // Frames that are made renew it, sooner or later.
        if renewed.is_none() {
            self.way.pass();
        }
    }

    /// Whether exposures are left out whose frames would be late.
    pub fn leaves_out(&self) -> bool {
        self.policy == OnOverrun::Drop
    }

    /// The tolerances of a level.
    pub fn fidelity(&self, level: usize) -> Option<Fidelity> {
        self.levels.get(level).map(|level| level.fidelity)
    }

    /// The tolerances of all coarser levels.
    pub fn coarser_than(&self, level: usize) -> Vec<Fidelity> {
        let coarser = self.levels.iter().skip(level + 1);
        coarser.map(|level| level.fidelity).collect()
    }

    /// A frame took so long to leave, once all of it could.
    pub fn learn_way(&mut self, took: Duration) {
        self.way.learn(took);
    }

    /// A frame by a level took so long.
    pub fn learn(&mut self, level: usize, took: Duration) {
        if let Some(level) = self.levels.get_mut(level) {
            level.takes.learn(took);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_render::fidelity::{Knob, Value};

    const LATE: Verdict = shoot(0, Some("late"));
    const FINEST: Verdict = shoot(0, None);

    const fn shoot(level: usize, overrun: Option<&'static str>) -> Verdict {
        Verdict::Shoot { level, overrun }
    }

    fn coarsened(level: usize) -> Verdict {
        shoot(level, Some("coarsen"))
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    impl Overrun {
        fn of(policy: OnOverrun) -> Overrun {
            Overrun::new(policy, Fidelity::REALTIME, &[fast(), wing_e(1.0)]).0
        }

        /// Decides about a frame that is late after `spare` ms and held for `held` ms.
        fn at(&mut self, spare: u64, held: u64) -> Verdict {
            self.decide(Some(ms(spare)), ms(held))
        }

        /// Frames of the levels took so many ms, the finest first.
        fn took<const N: usize>(&mut self, ms: [u64; N]) {
            for (level, ms) in ms.into_iter().enumerate() {
                self.learn(level, Duration::from_millis(ms));
            }
        }
    }

    fn fast() -> Coarser {
        Coarser::Preset("fast", Fidelity::FAST)
    }

    fn wing_e(wing_e: f64) -> Coarser {
        Coarser::Knob(Knob::named("wing_e").unwrap(), Value::Number(wing_e))
    }

    #[test]
    fn late_frames_come_late_and_say_so() {
        let mut overrun = Overrun::of(OnOverrun::Late);
        assert_eq!(overrun.at(0, 0), FINEST, "nothing is known yet");
        overrun.took([50]);
        assert_eq!([overrun.at(50, 0), overrun.at(49, 0)], [FINEST, LATE]);
        let single_shot = overrun.decide(None, Duration::ZERO);
        assert_eq!(single_shot, FINEST);
        assert_eq!((overrun.dropped, overrun.fidelity(1)), (0, None));
    }

    #[test]
    fn exposures_are_left_out_until_a_frame_may_be_in_time_again() {
        let mut overrun = Overrun::of(OnOverrun::Drop);
        overrun.took([200]);
        let verdicts = std::iter::repeat_with(|| overrun.at(100, 0));
        let dropped = verdicts.take_while(|verdict| *verdict == Verdict::Drop);
        assert_eq!((dropped.count(), overrun.dropped), (4, 4));
        overrun.took([10]);
        assert_eq!(overrun.at(100, 0), FINEST);
        // The first frame after those that were left out has said so.
        overrun.took([101]);
        assert_eq!(overrun.at(100, 0), Verdict::Drop);
        overrun.took([99]);
        assert_eq!(overrun.at(100, 0), shoot(0, Some("drop")));
        assert_eq!(overrun.at(100, 0), FINEST);
    }

    #[test]
    fn frames_are_coarsened_in_the_order_that_is_configured() {
        let mut overrun = Overrun::of(OnOverrun::Coarsen);
        overrun.took([200]);
        assert_eq!(overrun.at(100, 0), coarsened(1));
        assert_eq!(overrun.fidelity(1), Some(Fidelity::FAST));
        overrun.learn(1, ms(150));
        assert_eq!(overrun.at(100, 0), coarsened(2));
        assert_eq!(overrun.fidelity(2).unwrap().wing_e, 1.0);
        overrun.learn(2, ms(120));
        assert_eq!(overrun.at(100, 0), shoot(2, Some("late")), "the coarsest");
        // With more time the finest that fits.
        overrun.learn(2, ms(90));
        assert_eq!(overrun.at(160, 0), coarsened(1));
        // What was too slow is tried again.
        overrun.learn(1, ms(90));
        let mut next = (0..12).map(|_| overrun.at(100, 0));
        assert!(next.any(|verdict| verdict == FINEST));
        assert_eq!(overrun.dropped, 0);
    }

    #[test]
    fn what_never_is_in_time_is_tried_ever_more_seldom_and_one_hiccup_costs_little() {
        for policy in [OnOverrun::Coarsen, OnOverrun::Drop] {
            let mut overrun = Overrun::of(policy);
            let mut tried = Vec::new();
            for n in 0..2000 {
                if let Verdict::Shoot { level, .. } = overrun.at(100, 0) {
                    overrun.learn(level, if level == 0 { ms(115) } else { ms(60) });
                    tried.extend((level == 0).then_some(n));
                }
            }
            let apart: Vec<i32> = tried.windows(2).map(|two| two[1] - two[0] - 1).collect();
            // X-Val: twice as many each time, up to 256; 4 + ... + 256 = 508 and 8 frames, then five times 256 and one.
            assert_eq!(apart, [4, 8, 16, 32, 64, 128, 256, 256, 256, 256, 256, 256]);
            // When it is in time again, that is forgotten.
            let is_tried = |verdict| matches!(verdict, Verdict::Shoot { level: 0, .. });
            while !is_tried(overrun.at(100, 0)) {}
            overrun.took([90]);
            assert_eq!(overrun.at(100, 0), FINEST);
            overrun.took([101]);
            let next = [(); 5].map(|()| is_tried(overrun.at(100, 0)));
            assert_eq!(next, [false, false, false, false, true]);
        }
    }

    #[test]
    fn a_way_that_took_long_once_leaves_few_exposures_out() {
        let mut overrun = Overrun::of(OnOverrun::Drop);
        overrun.took([10]);
        assert_eq!(overrun.at(100, 80), FINEST);
        overrun.learn_way(ms(95));
        assert_eq!([(); 4].map(|()| overrun.at(100, 80)), [Verdict::Drop; 4]);
        assert_eq!(overrun.at(100, 80), shoot(0, Some("drop")));
        overrun.learn_way(ms(5));
        assert_eq!(overrun.at(100, 80), FINEST);
    }

    #[test]
    fn what_a_device_holds_back_for_too_long_is_late_however_coarse_it_is() {
        for (policy, verdict) in [
            (OnOverrun::Late, LATE),
            (OnOverrun::Coarsen, LATE),
            (OnOverrun::Drop, Verdict::Drop),
        ] {
            // Before the first frame, too.
            let mut overrun = Overrun::of(policy);
            assert_eq!(overrun.at(100, 101), verdict);
            overrun.took([90]);
            assert_eq!(overrun.at(100, 101), verdict);
        }
        // What is rendered meanwhile takes no time besides; the way comes after both.
        let mut overrun = Overrun::of(OnOverrun::Coarsen);
        overrun.took([70]);
        assert_eq!(overrun.at(100, 80), FINEST);
        overrun.learn_way(ms(25));
        assert_eq!([overrun.at(100, 80), overrun.at(100, 75)], [LATE, FINEST]);
        overrun.took([90]);
        assert_eq!(overrun.at(100, 75), coarsened(1));
        // Held for too long, and the finest not ready by then: the first that is; if none is, the last.
        let mut overrun = Overrun::of(OnOverrun::Coarsen);
        overrun.took([150, 100]);
        assert_eq!(overrun.at(100, 101), shoot(1, Some("late")));
        overrun.took([150, 140, 130]);
        assert_eq!(overrun.at(100, 101), shoot(2, Some("late")));
    }

    /// The settings of all levels, and the steps that are none, from `fidelity` on.
    fn levels(fidelity: Fidelity, steps: &[Coarser]) -> (Vec<Fidelity>, Vec<String>) {
        let (overrun, idle) = Overrun::new(OnOverrun::Coarsen, fidelity, steps);
        let levels = overrun.levels.iter().map(|level| level.fidelity).collect();
        (levels, idle.iter().map(|step| step.to_string()).collect())
    }

    #[test]
    fn steps_are_of_the_setting_that_the_run_has_and_those_that_are_no_coarser_are_told() {
        let coarser = |fidelity| Fidelity {
            wing_e: 0.5,
            ..fidelity
        };
        for fidelity in [Fidelity::FAST, Fidelity::REALTIME, Fidelity::REFERENCE] {
            let expected = (vec![fidelity, coarser(fidelity)], vec![]);
            assert_eq!(levels(fidelity, &[wing_e(0.5)]), expected);
        }
        let reference = Coarser::Preset("reference", Fidelity::REFERENCE);
        let steps = [reference, fast(), wing_e(0.1), wing_e(0.5), fast()];
        let (found, idle) = levels(Fidelity::FAST, &steps);
        assert_eq!(found, [Fidelity::FAST, coarser(Fidelity::FAST)]);
        let expected = ["\"reference\"", "\"fast\"", "\"wing_e = 0.1\"", "\"fast\""];
        assert_eq!(idle, expected);
        // With no step left a late frame is late. Steps that are not taken are not told.
        for (policy, idle_steps) in [
            (OnOverrun::Coarsen, 1),
            (OnOverrun::Late, 0),
            (OnOverrun::Drop, 0),
        ] {
            let (mut overrun, idle) = Overrun::new(policy, Fidelity::FAST, &[fast()]);
            assert_eq!((overrun.levels.len(), idle.len()), (1, idle_steps));
            overrun.took([200]);
            let late = if policy == OnOverrun::Drop {
                Verdict::Drop
            } else {
                LATE
            };
            assert_eq!(overrun.at(100, 0), late);
        }
    }
}
