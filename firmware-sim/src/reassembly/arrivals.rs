//! State of a known number of packets: missing, requested or received.

use std::ops::Range;

#[derive(Debug)]
pub(super) struct Arrivals {
    packets: Vec<State>,
    missing: usize,
    /// One after the highest received.
    next: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Missing,
    Requested,
    Received,
}

pub(super) struct Arrival {
    /// Whether a later packet arrived before it.
    pub(super) late: bool,
    /// Whether it had been requested.
    pub(super) requested: bool,
}

impl Arrivals {
    pub(super) fn of(packets: usize) -> Self {
        Self {
            packets: vec![State::Missing; packets],
            missing: packets,
            next: 0,
        }
    }

    pub(super) fn missing(&self) -> usize {
        self.missing
    }

    /// One after the highest received.
    pub(super) fn next(&self) -> usize {
        self.next
    }

    /// Whether a packet has been received; `None` if there is no such packet.
    pub(super) fn state(&self, packet: usize) -> Option<bool> {
        self.packets
            .get(packet)
            .map(|packet| *packet == State::Received)
    }

    /// Records a missing packet as received.
    pub(super) fn record(&mut self, packet: usize) -> Arrival {
        let mut requested = false;
        if let Some(state) = self.packets.get_mut(packet) {
            requested = *state == State::Requested;
            *state = State::Received;
            self.missing = self.missing.saturating_sub(1);
        }
        let late = packet < self.next;
        self.next = self.next.max(packet + 1);
        Arrival { late, requested }
    }

    /// Whether a packet below `end` is missing and not requested.
    pub(super) fn has_gap(&self, end: usize) -> bool {
        let below = self.packets.get(..end).unwrap_or(&self.packets);
        self.missing > 0 && below.contains(&State::Missing)
    }

    /// Marks missing packets below `end` as requested, and returns their runs. Requested ones are
    /// included only if `again`. Limited to `runs` runs and `max` packets.
    pub(super) fn request(
        &mut self,
        end: usize,
        again: bool,
        runs: usize,
        mut max: usize,
    ) -> Vec<Range<usize>> {
        let mut found: Vec<Range<usize>> = Vec::new();
        if self.missing == 0 {
            return found;
        }
        for (index, packet) in self.packets.iter_mut().enumerate().take(end) {
            let selected = *packet == State::Missing || again && *packet == State::Requested;
            if !selected {
                continue;
            }
            if max == 0 {
                break;
            }
            let full = found.len() == runs;
            match found.last_mut() {
                Some(run) if run.end == index => run.end += 1,
                _ if full => break,
                _ => found.push(index..index + 1),
            }
            *packet = State::Requested;
            max -= 1;
        }
        found
    }
}
