//! Timing of requests for missing packets; the reassembly finds the packets.
//!
//! A packet counts as missing if it has not arrived soon after a later one. The wait depends on the
//! mean packet interval, so that slow lines get no requests for packets in flight. After a silence,
//! packets after the last one may be lost or queued. The emulator then gets a Ping; its Status is
//! sent after the queued packets. Packets that have not arrived before the Status are missing.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::reassembly::Demand;

/// Maximum number of runs in one request.
const RUNS: usize = 8;
/// Minimum wait for a packet after a later one: it may be reordered.
const LATE: Duration = Duration::from_millis(30);
const SILENCE: Duration = Duration::from_millis(50);
/// Minimum silence before a round while the packet interval is unknown.
const FIRST_SILENCE: Duration = Duration::from_millis(300);
/// Maximum number of doublings of the silence between rounds.
const MAX_DOUBLINGS: u32 = 5;
/// Number of requests remembered to recognize their refusals.
const REMEMBERED: usize = 64;

#[derive(Debug, Default)]
pub(crate) struct Recovery {
    /// Credit window: maximum number of frame packets in flight.
    window: u32,
    /// Transmission time of the longest packet.
    airtime: Duration,
    /// Mean interval of frame packets.
    spacing: Option<Duration>,
    last_packet: Option<Instant>,
    /// Start of the last round in this silence.
    round: Option<Instant>,
    rounds: u32,
    /// Whether to poll the emulator for its Status.
    poll_is_due: bool,
    /// Whether a Status has arrived in this round, before any request.
    status_received: bool,
    /// Last round of this silence with a request for packets.
    served: u32,
    last_check: Option<Instant>,
    /// Time of the last repeated request.
    again: Option<Instant>,
    /// Sequence counts and frames of the latest requests.
    requests: VecDeque<(u16, u32)>,
    off: bool,
    /// Attitude of the requested frames; none: all frames.
    pub(crate) attitude: Option<u32>,
    pub(crate) requested: u64,
    /// Refused requests: too late.
    pub(crate) refused: u64,
    /// Our packets that the emulator received damaged.
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

    /// Records a frame packet; `flowing` if it follows others of its frame.
    pub(crate) fn arrived(&mut self, now: Instant, flowing: bool) {
        if let Some(last_packet) = self.last_packet.filter(|_| flowing) {
            let sample = now.saturating_duration_since(last_packet);
            // Moving average over some eight packets.
            let usual = self.spacing.map(|usual| (usual * 7 + sample) / 8);
            self.spacing = Some(usual.unwrap_or(sample));
        }
        self.last_packet = Some(now);
        (self.rounds, self.round) = (0, None);
        (self.poll_is_due, self.status_received, self.served) = (false, false, 0);
    }

    /// Records a Status: packets sent before it have arrived or are lost.
    pub(crate) fn status_received(&mut self) {
        self.status_received = self.rounds > self.served;
    }

    pub(crate) fn last_packet(&self) -> Option<Instant> {
        self.last_packet
    }

    /// Interval of frame packets: the measured mean, at least the transmission time.
    pub(crate) fn spacing(&self) -> Duration {
        self.spacing.unwrap_or_default().max(self.airtime)
    }

    fn late(&self) -> Duration {
        LATE.max(2 * self.spacing())
    }

    fn silence(&self) -> Duration {
        let min = match self.spacing {
            Some(_) => SILENCE,
            None => FIRST_SILENCE,
        };
        min.max(3 * self.spacing()) * (1 << self.rounds.min(MAX_DOUBLINGS))
    }

    /// Time until the next check while a frame is in flight.
    pub(crate) fn pause(&self) -> Duration {
        self.late() / 3
    }

    /// Packets to request now, while a frame is in flight; none: too early to check.
    pub(crate) fn demand(&mut self, now: Instant) -> Option<Demand> {
        let since = |at: Option<Instant>| at.map(|at| now.saturating_duration_since(at));
        if self.off || since(self.last_check).is_some_and(|since| since < self.pause()) {
            return None;
        }
        self.last_check = Some(now);
        let silent = std::mem::take(&mut self.status_received);
        if silent {
            self.served = self.rounds;
        }
        let quiet = since(self.last_packet.max(self.round)).unwrap_or_default();
        if quiet >= self.silence() {
            (self.round, self.poll_is_due) = (Some(now), true);
            self.rounds += 1;
        }
        // After this time a reply would have arrived, even behind a whole window.
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

    /// Whether to repeat the grant, which may be lost, and to request the emulator's Status: once
    /// per round of a silence.
    pub(crate) fn poll_is_due(&mut self) -> bool {
        std::mem::take(&mut self.poll_is_due)
    }

    pub(crate) fn requested(&mut self, sequence_count: u16, frame: u32) {
        self.requested += 1;
        if self.requests.len() >= REMEMBERED {
            self.requests.pop_front();
        }
        self.requests.push_back((sequence_count, frame));
    }

    /// The frame of a refused request.
    pub(crate) fn refusal(&mut self, sequence_count: u16) -> Option<u32> {
        let mut requests = self.requests.iter();
        let request = requests.find(|(count, _)| *count == sequence_count);
        let (_, frame) = request?;
        self.refused += 1;
        Some(*frame)
    }

    /// Stops requests: the emulator does not support them.
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

    /// Checks every millisecond from `start` on. Returns the times of polls.
    fn polls(recovery: &mut Recovery, start: Instant, max: u64) -> Vec<u64> {
        let polls = |at: &u64| {
            let demand = recovery.demand(start + ms(*at));
            assert!(!demand.is_some_and(|demand| demand.silent), "{at}");
            recovery.poll_is_due()
        };
        (0..max).filter(polls).collect()
    }

    #[test]
    fn polls_in_a_silence_become_rarer() {
        let start = Instant::now();
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.arrived(start, false);
        recovery.arrived(start + ms(1), true);
        // 50 ms, then doubled each time; checked every 10 ms. Without a Status nothing is
        // requested.
        let rounds = polls(&mut recovery, start + ms(1), 2000);
        assert_eq!(rounds, [50, 150, 350, 750, 1550]);
        recovery.arrived(start + ms(2100), false);
        let demand = recovery.demand(start + ms(2140)).unwrap();
        assert!(!demand.silent && demand.wait == ms(30), "{demand:?}");
        assert_eq!(polls(&mut recovery, start + ms(2141), 100), [9]);
    }

    #[test]
    fn packets_after_the_last_are_requested_once_per_status() {
        let start = Instant::now();
        let mut recovery = Recovery::new(64, Duration::ZERO);
        let mut at = 0;
        let mut silent = |recovery: &mut Recovery, status: bool| {
            at += 20;
            if status {
                recovery.status_received();
            }
            recovery.demand(start + ms(at)).unwrap().silent
        };
        recovery.arrived(start, false);
        recovery.arrived(start + ms(1), true);
        assert!(!silent(&mut recovery, true), "there is no silence");
        while !recovery.poll_is_due() {
            assert!(!silent(&mut recovery, false));
        }
        // Two Status packets at once.
        assert!(silent(&mut recovery, true) && !silent(&mut recovery, true));
        // Packets arrive with a late Status.
        recovery.arrived(start + ms(200), true);
        assert!(!silent(&mut recovery, true));
    }

    #[test]
    fn slow_lines_get_no_requests_for_packets_in_flight() {
        // 1,400 bytes at 9,600 baud.
        let airtime = ms(1458);
        let start = Instant::now();
        for (known, packets) in [(airtime, 1), (Duration::ZERO, 3)] {
            let mut recovery = Recovery::new(64, known);
            for packet in 0..packets {
                recovery.arrived(start + airtime * packet, packet > 0);
            }
            let last = start + airtime * (packets - 1);
            assert!(polls(&mut recovery, last, 2900).is_empty());
            assert!(recovery.demand(last + 3 * airtime).is_some() && recovery.poll_is_due());
            assert!(recovery.demand(last + 6 * airtime).unwrap().wait >= 2 * airtime);
        }
    }

    #[test]
    fn refusals_are_recognized_and_requests_can_stop() {
        let mut recovery = Recovery::new(64, Duration::ZERO);
        recovery.requested(5, 77);
        assert_eq!((recovery.refusal(5), recovery.refusal(6)), (Some(77), None));
        assert_eq!((recovery.requested, recovery.refused), (1, 1));
        recovery.stop();
        assert!(recovery.demand(Instant::now()).is_none());
    }
}
