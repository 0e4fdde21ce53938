//! When to ask for missing packets again. It counts time only; what is missing knows the reassembly.
//!
//! A packet is missing when a later one has come and it has not followed soon. How soon goes by the usual time between
//! packets, so that a slow line is not asked for what is still on its way. When nothing comes any more, the packets
//! behind the last may be lost or may stand in a queue that rests: the emulator is asked for its Status, which takes its
//! place behind what has been sent. They are missing when that has come and they have not.

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
const MAX_DOUBLINGS: u32 = 5;
/// Requests whose refusal is known as such.
const REMEMBERED: usize = 64;

/// The client's side of asking again on one link.
#[derive(Debug, Default)]
pub(crate) struct Recovery {
    /// Frame packets that may be under way.
    window: u32,
    /// Time on the line of the longest packet.
    airtime: Duration,
    /// The usual time between frame packets.
    spacing: Option<Duration>,
    heard: Option<Instant>,
    /// When the last round of this silence began.
    round: Option<Instant>,
    /// Rounds of this silence.
    rounds: u32,
    /// Whether the emulator is to be asked for its Status.
    knocks: bool,
    /// Whether a Status has come since the round began and nothing has been asked for.
    accounted: bool,
    /// The last round of this silence in which it was asked for packets.
    served: u32,
    looked: Option<Instant>,
    /// When gaps were last asked for although they had been before.
    again: Option<Instant>,
    /// Sequence counts of the latest requests, and the frames that they were about.
    requests: VecDeque<(u16, u32)>,
    off: bool,
    /// The attitude whose frames are wanted; none: all.
    pub(crate) attitude: Option<u32>,
    /// Requests so far.
    pub(crate) requested: u64,
    /// Requests that were refused: too late.
    pub(crate) refused: u64,
    /// Packets of ours that came damaged at the emulator.
    pub(crate) damaged: u64,
}

impl Recovery {
    pub(crate) fn new(window: u32, airtime: Duration) -> Self {
        Self {
            window,
            airtime,
            ..Self::default()
        }
    }

    /// Books a frame packet; `flowing` if it follows others of its frame.
    pub(crate) fn arrived(&mut self, now: Instant, flowing: bool) {
        if let Some(heard) = self.heard.filter(|_| flowing) {
            let sample = now.saturating_duration_since(heard);
            // A moving average over some eight packets.
            let usual = self.spacing.map(|usual| (usual * 7 + sample) / 8);
            self.spacing = Some(usual.unwrap_or(sample));
        }
        self.heard = Some(now);
        (self.rounds, self.round) = (0, None);
        (self.knocks, self.accounted, self.served) = (false, false, 0);
    }

    /// Books a Status: what the emulator had sent before it has come by now, or is lost.
    pub(crate) fn accounted(&mut self) {
        self.accounted = self.rounds > self.served;
    }

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
        least.max(3 * self.spacing()) * (1 << self.rounds.min(MAX_DOUBLINGS))
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
        let silent = std::mem::take(&mut self.accounted);
        if silent {
            self.served = self.rounds;
        }
        let quiet = since(self.heard.max(self.round)).unwrap_or_default();
        if quiet >= self.silence() {
            (self.round, self.knocks) = (Some(now), true);
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

    /// Whether to grant again, which may be what was lost, and to ask for the emulator's Status: once each round of a
    /// silence.
    pub(crate) fn knocks(&mut self) -> bool {
        std::mem::take(&mut self.knocks)
    }

    pub(crate) fn requested(&mut self, sequence_count: u16, frame: u32) {
        self.requested += 1;
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

    /// Looks every millisecond from `start` on; when there is a knock.
    fn knocks(recovery: &mut Recovery, start: Instant, most: u64) -> Vec<u64> {
        let knocks = |at: &u64| {
            let demand = recovery.demand(start + ms(*at));
            assert!(!demand.is_some_and(|demand| demand.silent), "{at}");
            recovery.knocks()
        };
        (0..most).filter(knocks).collect()
    }

    #[test]
    fn silence_is_knocked_into_ever_more_seldom() {
        let start = Instant::now();
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.arrived(start, false);
        recovery.arrived(start + ms(1), true);
        // 50 ms, then twice as long each; looked at every 10 ms. Without a Status nothing is asked for.
        let rounds = knocks(&mut recovery, start + ms(1), 2000);
        assert_eq!(rounds, [50, 150, 350, 750, 1550]);
        recovery.arrived(start + ms(2100), false);
        let demand = recovery.demand(start + ms(2140)).unwrap();
        assert!(!demand.silent && demand.wait == ms(30), "{demand:?}");
        assert_eq!(knocks(&mut recovery, start + ms(2141), 100), [9]);
    }

    #[test]
    fn packets_behind_the_last_are_asked_for_once_for_each_status() {
        let start = Instant::now();
        let mut recovery = Recovery::new(64, Duration::ZERO);
        let mut at = 0;
        let mut silent = |recovery: &mut Recovery, status: bool| {
            at += 20;
            if status {
                recovery.accounted();
            }
            recovery.demand(start + ms(at)).unwrap().silent
        };
        recovery.arrived(start, false);
        recovery.arrived(start + ms(1), true);
        assert!(!silent(&mut recovery, true), "there is no silence");
        while !recovery.knocks() {
            assert!(!silent(&mut recovery, false));
        }
        // Two came at once.
        assert!(silent(&mut recovery, true) && !silent(&mut recovery, true));
        // They come, and a late Status with them.
        recovery.arrived(start + ms(200), true);
        assert!(!silent(&mut recovery, true));
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
            assert!(knocks(&mut recovery, last, 2900).is_empty());
            assert!(recovery.demand(last + 3 * airtime).is_some() && recovery.knocks());
            assert!(recovery.demand(last + 6 * airtime).unwrap().wait >= 2 * airtime);
        }
    }

    #[test]
    fn a_refused_request_is_known_and_an_emulator_without_any_is_left_alone() {
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.requested(5, 77);
        assert_eq!((recovery.refusal(5), recovery.refusal(6)), (Some(77), None));
        assert_eq!((recovery.requested, recovery.refused), (1, 1));
        recovery.stop();
        assert!(recovery.demand(Instant::now()).is_none());
    }
}
