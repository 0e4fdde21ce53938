//! When to ask for missing packets again. It counts time only; what is missing knows the reassembly.
//!
//! A packet is missing when a later one has come and it has not followed soon, or when nothing comes any more. How soon
//! goes by the usual time between packets, so that a slow line is not asked for what is still on its way.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::reassembly::Demand;

/// Runs asked for at once.
const RUNS: usize = 8;
/// How long a packet may follow a later one at least: reordered, not lost.
const LATE: Duration = Duration::from_millis(30);
/// Nothing comes any more after this long at least.
const SILENCE: Duration = Duration::from_millis(50);
/// The same before the usual time between packets is known.
const FIRST_SILENCE: Duration = Duration::from_millis(300);
/// The silence before the next round doubles so often at most.
const MOST_DOUBLINGS: u32 = 5;
/// Requests whose refusal is known as such.
const REMEMBERED: usize = 64;

/// The client's side of asking again on one link.
#[derive(Debug)]
pub(crate) struct Recovery {
    /// Frame packets that may be under way.
    window: u32,
    /// Time on the line of the longest packet.
    airtime: Duration,
    /// The usual time between frame packets.
    spacing: Option<Duration>,
    /// When the last frame packet came.
    heard: Option<Instant>,
    /// When it was last asked in silence.
    asked_in_silence: Option<Instant>,
    /// Rounds of asking in this silence.
    rounds: u32,
    looked: Option<Instant>,
    /// When gaps were last asked for although they had been before.
    again: Option<Instant>,
    /// Sequence counts of the latest requests, and the frames that they were about.
    requests: VecDeque<(u16, u32)>,
    off: bool,
    /// The attitude whose frames are wanted; none: all.
    pub(crate) attitude: Option<u32>,
    /// Requests so far.
    pub(crate) asked: u64,
    /// Requests that were refused: too late.
    pub(crate) refused: u64,
}

impl Recovery {
    pub(crate) fn new(window: u32, airtime: Duration) -> Self {
        Self {
            window,
            airtime,
            spacing: None,
            heard: None,
            asked_in_silence: None,
            rounds: 0,
            looked: None,
            again: None,
            requests: VecDeque::new(),
            off: false,
            attitude: None,
            asked: 0,
            refused: 0,
        }
    }

    /// Books a frame packet; `flowing` if it follows others of its frame.
    pub(crate) fn arrived(&mut self, now: Instant, flowing: bool) {
        if let Some(heard) = self.heard.filter(|_| flowing) {
            let sample = now.saturating_duration_since(heard);
            // A moving average over some eight packets.
            self.spacing = Some(
                self.spacing
                    .map_or(sample, |usual| (usual * 7 + sample) / 8),
            );
        }
        self.heard = Some(now);
        (self.rounds, self.asked_in_silence) = (0, None);
    }

    /// When the last frame packet came.
    pub(crate) fn heard(&self) -> Option<Instant> {
        self.heard
    }

    /// The time between frame packets, on a line that is slow or that others share.
    pub(crate) fn spacing(&self) -> Duration {
        self.spacing.unwrap_or_default().max(self.airtime)
    }

    fn late(&self) -> Duration {
        LATE.max(2 * self.spacing())
    }

    fn silence(&self) -> Duration {
        let least = match self.spacing {
            Some(_) => SILENCE,
            None => FIRST_SILENCE,
        };
        least.max(3 * self.spacing()) * (1 << self.rounds.min(MOST_DOUBLINGS))
    }

    /// How long to wait for packets before looking again, while a frame is under way.
    pub(crate) fn pause(&self) -> Duration {
        self.late() / 3
    }

    /// What to ask for now, while a frame is under way; none: it is too early to look.
    pub(crate) fn demand(&mut self, now: Instant) -> Option<Demand> {
        let since = |at: Option<Instant>| at.map(|at| now.saturating_duration_since(at));
        if self.off || since(self.looked).is_some_and(|since| since < self.pause()) {
            return None;
        }
        self.looked = Some(now);
        let quiet = since(self.heard.max(self.asked_in_silence)).unwrap_or_default();
        let silent = quiet >= self.silence();
        if silent {
            self.asked_in_silence = Some(now);
            self.rounds += 1;
        }
        // By then an answer would have come, behind a whole window.
        let round_trip = (self.late() + self.spacing() * self.window) * 2;
        let again = silent || since(Some(*self.again.get_or_insert(now))) >= Some(round_trip);
        if again {
            self.again = Some(now);
        }
        Some(Demand {
            attitude: self.attitude,
            wait: self.late(),
            again,
            silent,
            runs: RUNS,
            packets: self.window as usize,
        })
    }

    /// Whether it is the time to ask for the emulator's account too: each second round of a silence.
    pub(crate) fn is_long_silent(&self) -> bool {
        self.rounds > 0 && self.rounds.is_multiple_of(2)
    }

    /// Books a request.
    pub(crate) fn requested(&mut self, sequence_count: u16, frame: u32) {
        self.asked += 1;
        if self.requests.len() >= REMEMBERED {
            self.requests.pop_front();
        }
        self.requests.push_back((sequence_count, frame));
    }

    /// The frame that a refused command asked for, if it was a request.
    pub(crate) fn refusal(&mut self, sequence_count: u16) -> Option<u32> {
        let mut requests = self.requests.iter();
        let request = requests.find(|(count, _)| *count == sequence_count);
        let (_, frame) = request?;
        self.refused += 1;
        Some(*frame)
    }

    /// Asks no more: the emulator does not know how.
    pub(crate) fn stop(&mut self) {
        self.off = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    #[test]
    fn silence_is_asked_into_ever_more_seldom() {
        let start = Instant::now();
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.arrived(start, false);
        recovery.arrived(start + ms(1), true);
        let rounds: Vec<u64> = (0..2000)
            .filter(|at| {
                let demand = recovery.demand(start + ms(1 + at));
                demand.is_some_and(|demand| demand.silent)
            })
            .collect();
        // 50 ms, then twice as long each; looked at every 10 ms.
        assert_eq!(rounds, [50, 150, 350, 750, 1550]);
        recovery.arrived(start + ms(2100), false);
        let demand = recovery.demand(start + ms(2140)).unwrap();
        assert!(!demand.silent && demand.wait == ms(30), "{demand:?}");
        assert!(recovery.demand(start + ms(2151)).unwrap().silent);
    }

    #[test]
    fn a_slow_line_is_not_asked_for_what_is_on_its_way() {
        // 1,400 octets at 9,600 baud.
        let airtime = ms(1458);
        let start = Instant::now();
        for (known, packets) in [(airtime, 1), (Duration::ZERO, 3)] {
            let mut recovery = Recovery::new(64, known);
            for packet in 0..packets {
                recovery.arrived(start + airtime * packet, packet > 0);
            }
            let last = start + airtime * (packets - 1);
            for at in 0..2900 {
                let demand = recovery.demand(last + ms(at));
                assert!(!demand.is_some_and(|demand| demand.silent), "{at}");
            }
            assert!(recovery.demand(last + 3 * airtime).unwrap().silent);
            assert!(recovery.demand(last + 6 * airtime).unwrap().wait >= 2 * airtime);
        }
    }

    #[test]
    fn a_refused_request_is_known_and_an_emulator_without_any_is_left_alone() {
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.requested(5, 77);
        assert_eq!((recovery.refusal(5), recovery.refusal(6)), (Some(77), None));
        assert_eq!((recovery.asked, recovery.refused), (1, 1));
        recovery.stop();
        assert!(recovery.demand(Instant::now()).is_none());
    }
}
