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
const ALIKE_S: f64 = 0.1;
/// A step is accepted after offsets have been alike for this long, s.
pub const SURE_S: f64 = 0.25;

/// Estimate of the client's clock.
#[derive(Debug, Default)]
pub(super) struct Discipline {
    /// Latest offsets: the client's time minus the undisciplined scene time, s.
    ahead: VecDeque<f64>,
    /// Sum of all corrections, steps included, s.
    offset_s: f64,
    /// The first of the offsets that are alike, s, and when.
    doubted: Option<(f64, Epoch)>,
}

/// What follows from a time stamp.
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
pub(super) fn is_set(stamp: Epoch, own: Epoch) -> bool {
    (stamp - own).to_seconds().abs() > JUMP_S
}

impl Discipline {
    /// Evaluates a time stamp that arrived at scene time `own`.
    pub fn observe(&mut self, stamp: Epoch, own: Epoch) -> Correction {
        let ahead_s = (stamp - own).to_seconds();
        if is_set(stamp, own) {
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

    /// Client's clock minus this machine's, s, relative to the first observation.
    pub fn offset_s(&self) -> f64 {
        self.offset_s
    }
}
