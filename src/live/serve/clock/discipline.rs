//! Follows the client's clock by its time stamps. They arrive late by a varying transit time, and
//! never early.

use hifitime::Epoch;
use std::collections::VecDeque;

/// Number of time stamps in the window. The one with the shortest transit time counts.
const WINDOW: usize = 16;
/// Share of the found offset that each time stamp corrects.
const GAIN: f64 = 0.25;
/// A larger offset is no transit time: the client's clock was stepped, or the stamp is wrong, s.
const JUMP_S: f64 = 0.25;
/// Offsets that differ by no more than this are alike, s.
const SIMILAR_S: f64 = 0.1;
/// A step is accepted after offsets have been alike for this long, s.
pub(crate) const CONFIRM_S: f64 = 0.25;

/// Estimate of the client's clock.
#[derive(Debug, Default)]
pub(super) struct Discipline {
    /// Latest offsets: the client's time minus the undisciplined scene time, s.
    ahead: VecDeque<f64>,
    /// Sum of all corrections, steps included, s.
    offset_s: f64,
    /// The first of several similar offsets, s, and its time.
    candidate: Option<(f64, Epoch)>,
}

/// Consequence of a time stamp.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Correction {
    /// Advance the scene time by this much, s.
    Slew(f64),
    /// It is off by this much, s: late, wrong, or the first after a clock step.
    Doubt(f64),
    /// The client's clock was stepped: its time becomes the scene time.
    Jump,
}

/// Whether the offset is too large for a transit time: a clock step, or a wrong time stamp.
pub(super) fn is_clock_step(stamp: Epoch, own: Epoch) -> bool {
    (stamp - own).to_seconds().abs() > JUMP_S
}

impl Discipline {
    /// Evaluates a time stamp that arrived at scene time `own`.
    pub fn observe(&mut self, stamp: Epoch, own: Epoch) -> Correction {
        let ahead_s = (stamp - own).to_seconds();
        if is_clock_step(stamp, own) {
            let similar = self
                .candidate
                .filter(|(first_s, _)| (ahead_s - first_s).abs() <= SIMILAR_S);
            let (_, since) = *self.candidate.insert(similar.unwrap_or((ahead_s, own)));
            if (own - since).to_seconds() < CONFIRM_S {
                return Correction::Doubt(ahead_s);
            }
            *self = Discipline {
                offset_s: self.offset_s + ahead_s,
                ..Discipline::default()
            };
            return Correction::Jump;
        }
        self.candidate = None;
        if self.ahead.len() >= WINDOW {
            self.ahead.pop_front();
        }
        self.ahead.push_back(ahead_s + self.offset_s);
        let max_ahead_s = self.ahead.iter().copied().fold(f64::MIN, f64::max);
        let by_s = GAIN * (max_ahead_s - self.offset_s);
        self.offset_s += by_s;
        Correction::Slew(by_s)
    }

    /// Client's clock minus this machine's, s, relative to the first observation.
    pub fn offset_s(&self) -> f64 {
        self.offset_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_orbit::time::seconds;

    /// The offset, s, after 10 s of stamps every 20 ms from a clock with a rate error of `drift`
    /// and a transit time of up to `wire_s`; and the final error of the scene time.
    fn track(drift: f64, wire_s: f64) -> (f64, f64) {
        let start = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let (mut discipline, mut offset_s) = (Discipline::default(), 0.0);
        for n in 1..=500u32 {
            let sent_s = f64::from(n) * 0.02;
            // A varying delay, from 0.
            let late_s = wire_s * (f64::from(n) * 0.618_033_988_75).fract();
            let stamp = start + seconds(sent_s * (1.0 + drift));
            let own = start + seconds(sent_s + late_s + offset_s);
            match discipline.observe(stamp, own) {
                Correction::Slew(by_s) => offset_s += by_s,
                other => panic!("{other:?}"),
            }
        }
        (discipline.offset_s(), offset_s - 10.0 * drift)
    }

    #[test]
    fn rate_error_is_tracked_under_jitter() {
        for drift in [0.0, 1e-3, -1e-3, 5e-5] {
            let (offset_s, off_s) = track(drift, 0.005);
            // X-Val: the window is 0.32 s long, in which a clock 1e-3 slow loses 0.32 ms; the
            // shortest of 16 delays is some 5 ms / 16.
            assert!(off_s.abs() < 1e-3, "{drift}: {off_s}");
            assert!((offset_s - 10.0 * drift).abs() < 1e-3);
        }
        let (_, off_s) = track(0.0, 0.0);
        assert!(off_s.abs() < 1e-9);
    }

    #[test]
    fn clock_step_is_accepted_after_it_has_lasted() {
        let own = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let mut discipline = Discipline::default();
        for hours in [1.0, -1.0] {
            let by_s = 3600.0 * hours;
            for n in 0..4 {
                let now = own + seconds(0.08 * f64::from(n));
                // X-Val: 0, 80, 160 and 240 ms: not sure yet.
                let found = discipline.observe(now + seconds(by_s), now);
                assert!(
                    matches!(found, Correction::Doubt(ahead_s) if (ahead_s - by_s).abs() < 1e-6)
                );
            }
            let now = own + seconds(0.26);
            assert_eq!(
                discipline.observe(now + seconds(by_s), now),
                Correction::Jump
            );
        }
        assert!(discipline.offset_s().abs() < 1e-6);
    }

    #[test]
    fn late_and_wrong_stamps_are_no_clock_step() {
        let start = Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0);
        let receive = |discipline: &mut Discipline, stamp_s: f64, own_s: f64| {
            discipline.observe(start + seconds(stamp_s), start + seconds(own_s))
        };
        // Every second stamp 0.3 s late; a burst of half a second; wrong stamps, all different.
        let mut discipline = Discipline::default();
        for n in 0..100 {
            let own_s = 0.02 * f64::from(n);
            let late_s = if n % 2 == 0 { 0.0 } else { 0.3 };
            let found = receive(&mut discipline, own_s - late_s, own_s);
            assert_eq!(
                matches!(found, Correction::Slew(_)),
                n % 2 == 0,
                "{found:?}"
            );
        }
        for n in 0..25 {
            let found = receive(&mut discipline, 2.0 + 0.02 * f64::from(n), 2.5);
            assert!(!matches!(found, Correction::Jump));
        }
        for n in 0..100 {
            let own_s = 3.0 + 0.02 * f64::from(n);
            let wrong_s = f64::from(n % 7) - 3.5;
            let found = receive(&mut discipline, own_s + wrong_s, own_s);
            assert!(matches!(found, Correction::Doubt(_)), "{found:?}");
        }
        assert_eq!(discipline.offset_s(), 0.0);
    }
}
