//! Packets received before their frame's header: a bounded number is stored until it arrives.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Maximum number of expected frames without any packet.
const MAX_EXPECTED: usize = 4;

#[derive(Debug)]
struct Headerless {
    frame: u32,
    since: Instant,
    requested: bool,
    packets: Vec<Vec<u8>>,
}

#[derive(Debug, Default)]
pub(super) struct Early {
    frames: VecDeque<Headerless>,
    count: usize,
}

impl Early {
    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    pub(super) fn has(&self, frame: u32) -> bool {
        self.frames.iter().any(|early| early.frame == frame)
    }

    /// Stores a packet, and drops the oldest ones above `max`. Returns the number dropped.
    pub(super) fn store(&mut self, frame: u32, packet: &[u8], max: usize) -> u64 {
        self.of(frame).packets.push(packet.to_vec());
        self.count += 1;
        let mut gone = 0;
        while self.count > max
            && let Some(oldest) = self.frames.front_mut()
        {
            if !oldest.packets.is_empty() {
                oldest.packets.remove(0);
                self.count -= 1;
                gone += 1;
            }
            if oldest.packets.is_empty() {
                self.frames.pop_front();
            }
        }
        gone
    }

    /// Expects the header of a frame known from another link. The oldest expected frames without
    /// packets are dropped.
    pub(super) fn expect_header(&mut self, frame: u32) {
        self.of(frame);
        let empty = |early: &Headerless| early.packets.is_empty();
        if self.frames.iter().filter(|early| empty(early)).count() > MAX_EXPECTED
            && let Some(oldest) = self.frames.iter().position(empty)
        {
            self.frames.remove(oldest);
        }
    }

    /// Forgets a frame without packets.
    pub(super) fn forget(&mut self, frame: u32) {
        let stays = |early: &Headerless| early.frame != frame || !early.packets.is_empty();
        self.frames.retain(stays);
    }

    fn of(&mut self, frame: u32) -> &mut Headerless {
        let known = self.frames.iter().position(|early| early.frame == frame);
        let index = known.unwrap_or_else(|| {
            self.frames.push_back(Headerless {
                frame,
                since: Instant::now(),
                requested: false,
                packets: Vec::new(),
            });
            self.frames.len() - 1
        });
        &mut self.frames[index]
    }

    /// Removes the packets of a frame. Returns them and whether its header was requested.
    pub(super) fn take(&mut self, frame: u32) -> (Vec<Vec<u8>>, bool) {
        let index = self.frames.iter().position(|early| early.frame == frame);
        let Some(early) = index.and_then(|index| self.frames.remove(index)) else {
            return (Vec::new(), false);
        };
        self.count -= early.packets.len();
        (early.packets, early.requested)
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Frames whose header to request: missing for `wait` and not requested, or all if `again`.
    pub(super) fn due_headers(&mut self, now: Instant, wait: Duration, again: bool) -> Vec<u32> {
        let due = |early: &&mut Headerless| {
            again || !early.requested && now.saturating_duration_since(early.since) >= wait
        };
        let due = self.frames.iter_mut().filter(due);
        due.map(|early| {
            early.requested = true;
            early.frame
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expected_frames_are_limited() {
        let mut early = Early::default();
        early.store(7, b"block", 10);
        for frame in 100..10_000 {
            early.expect_header(frame);
        }
        assert_eq!(early.frames.len(), 1 + MAX_EXPECTED);
        assert!(early.has(7) && early.has(9_999) && !early.has(100));
        assert_eq!(early.take(7).0, [b"block"]);
    }
}
