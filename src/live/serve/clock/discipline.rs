//! How a clock follows the times that a client tells: they come late by what the wire takes, each by another time, and never early.

use hifitime::Epoch;
use std::collections::VecDeque;

/// Times that are looked at together: the one among them that came least late counts.
const WINDOW: usize = 16;
/// The share of what is found that each time told corrects: a single one that is wrong moves little.
const GAIN: f64 = 0.25;
/// What is off by more than this has not come late: the client's clock has been set, or the time is wrong, s.
const JUMP_S: f64 = 0.25;
/// Times are off alike that differ by no more than this, s.
const ALIKE_S: f64 = 0.1;
/// It has been set where all that it tells for so long is off alike, s.
pub const SURE_S: f64 = 0.25;

/// What is known of the client's clock.
#[derive(Debug, Default)]
pub(super) struct Discipline {
    /// What the client's clock was ahead of ours as it was first heard, of the latest times told, s.
    ahead: VecDeque<f64>,
    /// What has been corrected so far, jumps included, s.
    offset_s: f64,
    /// The first time of those that are off alike: by how much, s, and when.
    doubted: Option<(f64, Epoch)>,
}

/// What is to be done about a time that was told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Correction {
    /// The scene's time is set ahead by so much, s.
    Slew(f64),
    /// It is off by so much (s): late or wrong, or the first of a clock that was set.
    Doubt(f64),
    /// The client's clock has jumped: its time is the scene's from here on.
    Jump,
}

/// Whether a time that is told when it is `own` has not just come late: the client's clock has been set, or the time is wrong.
pub(super) fn is_set(told: Epoch, own: Epoch) -> bool {
    (told - own).to_seconds().abs() > JUMP_S
}

impl Discipline {
    /// A time was told when the scene's was `own`.
    pub fn hear(&mut self, told: Epoch, own: Epoch) -> Correction {
        let ahead_s = (told - own).to_seconds();
        if is_set(told, own) {
            let alike = self
                .doubted
                .filter(|(first_s, _)| (ahead_s - first_s).abs() <= ALIKE_S);
            let (_, since) = *self.doubted.insert(alike.unwrap_or((ahead_s, own)));
            if (own - since).to_seconds() < SURE_S {
                return Correction::Doubt(ahead_s);
            }
            *self = Discipline {
                offset_s: self.offset_s + ahead_s,
                ..Discipline::default()
            };
            return Correction::Jump;
        }
        self.doubted = None;
        if self.ahead.len() >= WINDOW {
            self.ahead.pop_front();
        }
        self.ahead.push_back(ahead_s + self.offset_s);
        let least_late = self.ahead.iter().copied().fold(f64::MIN, f64::max);
        let by_s = GAIN * (least_late - self.offset_s);
        self.offset_s += by_s;
        Correction::Slew(by_s)
    }

    /// What the client's clock is ahead of ours, s, counted from when it was first heard.
    pub fn offset_s(&self) -> f64 {
        self.offset_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_orbit::time::seconds;

    /// The offset that is found, s, after 10 s of times told every 20 ms by a clock that runs `drift` too fast, over a wire that takes up to
    /// `wire_s`; and what the scene's time is off by then.
    fn followed(drift: f64, wire_s: f64) -> (f64, f64) {
        let start = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let (mut discipline, mut offset_s) = (Discipline::default(), 0.0);
        for n in 1..=500u32 {
            let sent_s = f64::from(n) * 0.02;
            // Another lateness each time, from 0 on.
            let late_s = wire_s * (f64::from(n) * 0.618_033_988_75).fract();
            let told = start + seconds(sent_s * (1.0 + drift));
            let own = start + seconds(sent_s + late_s + offset_s);
            match discipline.hear(told, own) {
                Correction::Slew(by_s) => offset_s += by_s,
                other => panic!("{other:?}"),
            }
        }
        (discipline.offset_s(), offset_s - 10.0 * drift)
    }

    #[test]
    fn a_clock_that_runs_fast_or_slow_is_followed_through_the_jitter_of_the_wire() {
        for drift in [0.0, 1e-3, -1e-3, 5e-5] {
            let (offset_s, off_s) = followed(drift, 0.005);
            // X-Val: the window is 0.32 s long, in which a clock 1e-3 slow loses 0.32 ms; the least late of 16 is late by 5 ms / 16 or so.
            assert!(off_s.abs() < 1e-3, "{drift}: {off_s}");
            assert!((offset_s - 10.0 * drift).abs() < 1e-3);
        }
        let (_, off_s) = followed(0.0, 0.0);
        assert!(off_s.abs() < 1e-9);
    }

    #[test]
    fn a_clock_that_was_set_is_followed_once_it_is_sure() {
        let own = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let mut discipline = Discipline::default();
        for hours in [1.0, -1.0] {
            let by_s = 3600.0 * hours;
            for n in 0..4 {
                let now = own + seconds(0.08 * f64::from(n));
                // X-Val: 0, 80, 160 and 240 ms: not sure yet.
                let told = discipline.hear(now + seconds(by_s), now);
                assert!(
                    matches!(told, Correction::Doubt(ahead_s) if (ahead_s - by_s).abs() < 1e-6)
                );
            }
            let now = own + seconds(0.26);
            assert_eq!(discipline.hear(now + seconds(by_s), now), Correction::Jump);
        }
        assert!(discipline.offset_s().abs() < 1e-6);
    }

    #[test]
    fn what_comes_late_or_is_wrong_is_no_jump() {
        let start = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let hear = |discipline: &mut Discipline, told_s: f64, own_s: f64| {
            discipline.hear(start + seconds(told_s), start + seconds(own_s))
        };
        // Every second one 0.3 s late; a burst of half a second's times at once; wrong ones, each by another time.
        let mut discipline = Discipline::default();
        for n in 0..100 {
            let own_s = 0.02 * f64::from(n);
            let late_s = if n % 2 == 0 { 0.0 } else { 0.3 };
            let found = hear(&mut discipline, own_s - late_s, own_s);
            assert_eq!(
                matches!(found, Correction::Slew(_)),
                n % 2 == 0,
                "{found:?}"
            );
        }
        for n in 0..25 {
            let found = hear(&mut discipline, 2.0 + 0.02 * f64::from(n), 2.5);
            assert!(!matches!(found, Correction::Jump));
        }
        for n in 0..100 {
            let own_s = 3.0 + 0.02 * f64::from(n);
            let wrong_s = f64::from(n % 7) - 3.5;
            let found = hear(&mut discipline, own_s + wrong_s, own_s);
            assert!(matches!(found, Correction::Doubt(_)), "{found:?}");
        }
        assert_eq!(discipline.offset_s(), 0.0);
    }
}
