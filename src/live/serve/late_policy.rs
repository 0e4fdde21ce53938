//! Policy for frames that would be late: send them late, drop them, or render them more coarsely.
//! It reads no clock.
//!
//! A frame is ready when it is rendered and the device's delay is over; then it is transmitted.
//! Both durations are estimated by the last frame with the same tolerances. A level that was too
//! slow is retried after a few exposures, and after each failure the interval doubles: one outlier
//! costs little, and a level that is always too slow is rarely tried.

use skyloop_base::range::nearest;
use skyloop_config::{Delay, OnOverrun};
use skyloop_render::camera::RATE_HZ;
use skyloop_render::fidelity::{Coarser, Fidelity};
use std::time::Duration;

/// Exposures before a level that was too slow is retried: the first time, and at most.
const RETRY_AFTER: [u32; 2] = [4, 256];

/// Maximum number of frames in flight on a link: one that is sent, and the newest, which waits.
const MAX_IN_FLIGHT: usize = 2;
/// Maximum number of frames that the device holds in addition, by its delay.
const MAX_HELD: usize = 16;

/// The policy, and the estimates.
#[derive(Debug)]
pub(crate) struct LatePolicy {
    policy: OnOverrun,
    /// The configured tolerances, then coarser and coarser ones.
    levels: Vec<Level>,
    /// Number of dropped exposures.
    pub dropped: u32,
    /// Whether exposures were dropped since the last frame.
    newly_dropped: bool,
    /// From the moment when a frame is ready until its last byte has left.
    transmission: Estimate,
    /// Output delay of the device; 0 for the stepped clock.
    pub delay: Delay,
}

/// Tolerances, and the render time with them.
#[derive(Debug)]
struct Level {
    fidelity: Fidelity,
    render: Estimate,
}

impl Level {
    fn untried(fidelity: Fidelity) -> Level {
        Level {
            fidelity,
            render: Estimate::default(),
        }
    }
}

/// Estimate of a duration by its last measurement.
#[derive(Debug, Default)]
struct Estimate {
    /// The last measurement, s; none yet.
    took_s: Option<f64>,
    /// The allowed duration at that time, s.
    allowed_s: f64,
    /// Exposures since then.
    since: u32,
    /// Exposures before a retry; 0: it was in time.
    retry_after: u32,
}

impl Estimate {
    /// Whether it is measured again, regardless of the last duration.
    fn is_due(&self) -> bool {
        self.took_s.is_none() || self.since >= self.retry_after.max(RETRY_AFTER[0])
    }

    /// Whether it may take at most `s`, or is to be retried.
    fn fits(&self, s: f64) -> bool {
        self.is_due() || self.took_s.is_none_or(|took_s| took_s <= s)
    }

    /// The expected duration, s.
    fn expected_s(&self) -> f64 {
        let took_s = self.took_s.filter(|_| !self.is_due());
        took_s.unwrap_or(0.0)
    }

    fn learn(&mut self, took: Duration) {
        let (took_s, [first, max]) = (took.as_secs_f64(), RETRY_AFTER);
        self.retry_after = if took_s <= self.allowed_s {
            0
        } else {
            self.retry_after.saturating_mul(2).clamp(first, max)
        };
        (self.took_s, self.since) = (Some(took_s), 0);
    }

    /// Counts an exposure without a measurement.
    fn pass(&mut self) {
        self.since = self.since.saturating_add(1);
    }
}

/// Decision about an exposure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Decision {
    /// Render it.
    Render {
        /// Level of tolerances.
        level: usize,
        /// Lateness in its label.
        overrun: Option<&'static str>,
    },
    /// Drop it.
    Drop,
}

impl LatePolicy {
    /// Renders with `fidelity`; with the policy `coarsen`, each of `steps` adds a level. Returns
    /// the steps that are no coarser than the level before.
    pub fn new(
        policy: OnOverrun,
        fidelity: Fidelity,
        steps: &[Coarser],
    ) -> (LatePolicy, Vec<Coarser>) {
        let steps = match policy {
            OnOverrun::Coarsen => steps,
            OnOverrun::Late | OnOverrun::Drop => &[],
        };
        let (mut last, mut idle) = (fidelity, Vec::new());
        let mut levels = vec![Level::untried(fidelity)];
        for step in steps {
            let coarser = step.than(&last);
            if coarser == last {
                idle.push(*step);
            } else {
                levels.push(Level::untried(coarser));
            }
            last = coarser;
        }
        let policy = LatePolicy {
            policy,
            levels,
            dropped: 0,
            newly_dropped: false,
            transmission: Estimate::default(),
            delay: Delay::default(),
        };
        (policy, idle)
    }

    /// Decides about an exposure. Its frame is late after `spare_s` (none: never) and leaves the
    /// device no earlier than after `held_s`. Both are negative if that is past.
    pub fn decide(&mut self, spare_s: Option<f64>, held_s: f64) -> Decision {
        let Some(spare_s) = spare_s else {
            return self.render(0, None);
        };
        let is_held_beyond = held_s > spare_s;
        let (spare_s, held_s) = (spare_s.max(0.0), held_s.max(0.0));
        let ready_s = spare_s - self.transmission.expected_s();
        let is_held_too_long = is_held_beyond || held_s > ready_s.max(0.0);
        let in_time = |level: &Level| !is_held_too_long && level.render.fits(ready_s);
        let (level, overrun) = match (self.levels.iter().position(in_time), self.policy) {
            (Some(0), _) => (0, None),
            (Some(level), _) => (level, Some("coarsen")),
            (None, OnOverrun::Drop) => {
                self.pass(None);
                self.dropped = self.dropped.wrapping_add(1);
                self.newly_dropped = true;
                return Decision::Drop;
            }
            (None, OnOverrun::Late | OnOverrun::Coarsen) => {
                // A frame that is held need not be coarser than the time until its release allows.
                let last = self.levels.len().saturating_sub(1);
                let is_held = |level: &Level| level.render.fits(held_s);
                let held = self.levels.iter().position(is_held);
                let level = held.filter(|_| is_held_too_long).unwrap_or(last);
                (level, Some("late"))
            }
        };
        if let Some(Level { render, .. }) = self.levels.get_mut(level) {
            render.allowed_s = ready_s.max(held_s);
            self.transmission.allowed_s = spare_s - render.expected_s().max(held_s);
        }
        self.render(level, overrun)
    }

    fn render(&mut self, level: usize, overrun: Option<&'static str>) -> Decision {
        self.pass(Some(level));
        let dropped = std::mem::take(&mut self.newly_dropped).then_some("drop");
        Decision::Render {
            level,
            overrun: overrun.or(dropped),
        }
    }

    /// Counts an exposure for all levels but the one that is measured.
    fn pass(&mut self, measured: Option<usize>) {
        let others = self.levels.iter_mut().enumerate();
        for (_, level) in others.filter(|(i, _)| Some(*i) != measured) {
            level.render.pass();
        }
        // Each rendered frame measures the transmission, at any level.
        if measured.is_none() {
            self.transmission.pass();
        }
    }

    pub fn drops(&self) -> bool {
        self.policy == OnOverrun::Drop
    }

    pub fn fidelity(&self, level: usize) -> Option<Fidelity> {
        self.levels.get(level).map(|level| level.fidelity)
    }

    pub fn coarser_than(&self, level: usize) -> Vec<Fidelity> {
        let coarser = self.levels.iter().skip(level + 1);
        coarser.map(|level| level.fidelity).collect()
    }

    pub fn learn_transmission(&mut self, took: Duration) {
        self.transmission.learn(took);
    }

    pub fn learn(&mut self, level: usize, took: Duration) {
        if let Some(level) = self.levels.get_mut(level) {
            level.render.learn(took);
        }
    }

    /// Why no frame leaves before its deadline, `latency_s` after the end of its exposure, because
    /// the device holds each of them longer.
    pub fn never_in_time(&self, latency_s: f64) -> Option<String> {
        let delay_s = self.delay.delay_s;
        let dropped = if self.drops() {
            ", so that run.on_overrun = \"drop\" leaves all of them out"
        } else {
            ""
        };
        (delay_s >= latency_s).then(|| {
            format!(
                "run.delay_s = {delay_s}: no frame leaves before its deadline, {latency_s} s after its exposure's end{dropped}"
            )
        })
    }

    /// Number of frames that the device holds at a rate, by its delay.
    fn held(&self, rate_hz: f64) -> f64 {
        (self.delay.delay_s + self.delay.jitter_s) * nearest(rate_hz, RATE_HZ)
    }

    /// Errors: the device holds more than [`MAX_HELD`] frames at this rate.
    pub fn check_held(&self, rate_hz: f64) -> Result<(), String> {
        let held = self.held(rate_hz);
        if held <= MAX_HELD as f64 {
            return Ok(());
        }
        Err(format!(
            "run.delay_s and run.jitter_s: {} s at {rate_hz} Hz hold back {held:.0} frames: at most {MAX_HELD}; shorten them",
            self.delay.delay_s + self.delay.jitter_s
        ))
    }

    /// Maximum number of frames in flight on a link, at a rate; none: Triggers come at any rate.
    pub fn max_in_flight(&self, rate_hz: Option<f64>) -> usize {
        let held = rate_hz.map_or(MAX_HELD, |rate_hz| self.held(rate_hz).ceil() as usize);
        MAX_IN_FLIGHT + held.min(MAX_HELD)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_render::fidelity::{Tolerance, Value};

    const LATE: Decision = render(0, Some("late"));
    const FINEST: Decision = render(0, None);

    const fn render(level: usize, overrun: Option<&'static str>) -> Decision {
        Decision::Render { level, overrun }
    }

    fn coarsened(level: usize) -> Decision {
        render(level, Some("coarsen"))
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    impl LatePolicy {
        fn of(policy: OnOverrun) -> LatePolicy {
            LatePolicy::new(policy, Fidelity::REALTIME, &[fast(), wing_e(1.0)]).0
        }

        /// Decides about a frame that is late after `spare` ms and held for `held` ms.
        fn at(&mut self, spare: i32, held: i32) -> Decision {
            let [spare_s, held_s] = [spare, held].map(|ms| f64::from(ms) / 1e3);
            self.decide(Some(spare_s), held_s)
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
        Coarser::Tolerance(Tolerance::named("wing_e").unwrap(), Value::Number(wing_e))
    }

    #[test]
    fn late_frames_are_sent_and_labelled_late() {
        let mut overrun = LatePolicy::of(OnOverrun::Late);
        assert_eq!(overrun.at(0, 0), FINEST, "no estimate yet");
        overrun.took([50]);
        assert_eq!([overrun.at(50, 0), overrun.at(49, 0)], [FINEST, LATE]);
        let single_shot = overrun.decide(None, 0.0);
        assert_eq!(single_shot, FINEST);
        assert_eq!((overrun.dropped, overrun.fidelity(1)), (0, None));
    }

    #[test]
    fn exposures_are_dropped_until_a_retry() {
        let mut overrun = LatePolicy::of(OnOverrun::Drop);
        overrun.took([200]);
        let decisions = std::iter::repeat_with(|| overrun.at(100, 0));
        let dropped = decisions.take_while(|decision| *decision == Decision::Drop);
        assert_eq!((dropped.count(), overrun.dropped), (4, 4));
        overrun.took([10]);
        assert_eq!(overrun.at(100, 0), FINEST);
        // The first frame after dropped exposures is labelled so.
        overrun.took([101]);
        assert_eq!(overrun.at(100, 0), Decision::Drop);
        overrun.took([99]);
        assert_eq!(overrun.at(100, 0), render(0, Some("drop")));
        assert_eq!(overrun.at(100, 0), FINEST);
    }

    #[test]
    fn frames_are_coarsened_in_configured_order() {
        let mut overrun = LatePolicy::of(OnOverrun::Coarsen);
        overrun.took([200]);
        assert_eq!(overrun.at(100, 0), coarsened(1));
        assert_eq!(overrun.fidelity(1), Some(Fidelity::FAST));
        overrun.learn(1, ms(150));
        assert_eq!(overrun.at(100, 0), coarsened(2));
        assert_eq!(overrun.fidelity(2).unwrap().wing_e, 1.0);
        overrun.learn(2, ms(120));
        assert_eq!(overrun.at(100, 0), render(2, Some("late")), "the coarsest");
        // With more time, the finest level that fits.
        overrun.learn(2, ms(90));
        assert_eq!(overrun.at(160, 0), coarsened(1));
        // A level that was too slow is retried.
        overrun.learn(1, ms(90));
        let mut next = (0..12).map(|_| overrun.at(100, 0));
        assert!(next.any(|decision| decision == FINEST));
        assert_eq!(overrun.dropped, 0);
    }

    #[test]
    fn retry_interval_doubles_and_one_outlier_costs_little() {
        for policy in [OnOverrun::Coarsen, OnOverrun::Drop] {
            let mut overrun = LatePolicy::of(policy);
            let mut tried = Vec::new();
            for n in 0..2000 {
                if let Decision::Render { level, .. } = overrun.at(100, 0) {
                    overrun.learn(level, if level == 0 { ms(115) } else { ms(60) });
                    tried.extend((level == 0).then_some(n));
                }
            }
            let apart: Vec<i32> = tried.windows(2).map(|two| two[1] - two[0] - 1).collect();
            // X-Val: doubled each time up to 256: 4 + ... + 256 = 508 and 8 frames, then five times
            // 256 and one.
            assert_eq!(apart, [4, 8, 16, 32, 64, 128, 256, 256, 256, 256, 256, 256]);
            // A frame in time resets the interval.
            let is_tried = |decision| matches!(decision, Decision::Render { level: 0, .. });
            while !is_tried(overrun.at(100, 0)) {}
            overrun.took([90]);
            assert_eq!(overrun.at(100, 0), FINEST);
            overrun.took([101]);
            let next = [(); 5].map(|()| is_tried(overrun.at(100, 0)));
            assert_eq!(next, [false, false, false, false, true]);
        }
    }

    #[test]
    fn one_long_transmission_drops_few_exposures() {
        let mut overrun = LatePolicy::of(OnOverrun::Drop);
        overrun.took([10]);
        assert_eq!(overrun.at(100, 80), FINEST);
        overrun.learn_transmission(ms(95));
        assert_eq!([(); 4].map(|()| overrun.at(100, 80)), [Decision::Drop; 4]);
        assert_eq!(overrun.at(100, 80), render(0, Some("drop")));
        overrun.learn_transmission(ms(5));
        assert_eq!(overrun.at(100, 80), FINEST);
    }

    #[test]
    fn frame_held_too_long_is_late_at_any_level() {
        for (policy, decision) in [
            (OnOverrun::Late, LATE),
            (OnOverrun::Coarsen, LATE),
            (OnOverrun::Drop, Decision::Drop),
        ] {
            // Before the first frame, too, and when both times are past.
            let mut overrun = LatePolicy::of(policy);
            assert_eq!(overrun.at(100, 101), decision);
            assert_eq!(overrun.at(-5, -4), decision);
            overrun.took([90]);
            assert_eq!(overrun.at(100, 101), decision);
        }
        // Rendering and holding overlap; transmission follows both.
        let mut overrun = LatePolicy::of(OnOverrun::Coarsen);
        overrun.took([70]);
        assert_eq!(overrun.at(100, 80), FINEST);
        overrun.learn_transmission(ms(25));
        assert_eq!([overrun.at(100, 80), overrun.at(100, 75)], [LATE, FINEST]);
        overrun.took([90]);
        assert_eq!(overrun.at(100, 75), coarsened(1));
        // Held for too long, with the finest not ready by then: the first level that is, else the
        // last.
        let mut overrun = LatePolicy::of(OnOverrun::Coarsen);
        overrun.took([150, 100]);
        assert_eq!(overrun.at(100, 101), render(1, Some("late")));
        overrun.took([150, 140, 130]);
        assert_eq!(overrun.at(100, 101), render(2, Some("late")));
    }

    /// The tolerances of all levels from `fidelity` on, and the ineffective steps.
    fn levels(fidelity: Fidelity, steps: &[Coarser]) -> (Vec<Fidelity>, Vec<String>) {
        let (overrun, idle) = LatePolicy::new(OnOverrun::Coarsen, fidelity, steps);
        let levels = overrun.levels.iter().map(|level| level.fidelity).collect();
        (levels, idle.iter().map(|step| step.to_string()).collect())
    }

    #[test]
    fn steps_start_from_the_runs_fidelity_and_ineffective_ones_are_listed() {
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
        // Without an effective step a late frame is late. Unused steps are not listed.
        for (policy, idle_steps) in [
            (OnOverrun::Coarsen, 1),
            (OnOverrun::Late, 0),
            (OnOverrun::Drop, 0),
        ] {
            let (mut overrun, idle) = LatePolicy::new(policy, Fidelity::FAST, &[fast()]);
            assert_eq!((overrun.levels.len(), idle.len()), (1, idle_steps));
            overrun.took([200]);
            let late = if policy == OnOverrun::Drop {
                Decision::Drop
            } else {
                LATE
            };
            assert_eq!(overrun.at(100, 0), late);
        }
    }
}
