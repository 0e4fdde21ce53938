//! Packets that came before their frame's header: a bounded number of them, kept until it comes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// The packets of one frame.
#[derive(Debug)]
struct Headless {
    frame: u32,
    since: Instant,
    /// Whether the header was asked for.
    asked: bool,
    packets: Vec<Vec<u8>>,
}

/// Frames without a header, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Early {
    frames: VecDeque<Headless>,
    count: usize,
}

impl Early {
    pub(super) fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Whether packets of this frame have come.
    pub(super) fn has(&self, frame: u32) -> bool {
        self.frames.iter().any(|early| early.frame == frame)
    }

    /// Keeps a packet; says how many had to go for it, so that `most` are kept.
    pub(super) fn keep(&mut self, frame: u32, packet: &[u8], most: usize) -> u64 {
        let known = self.frames.iter_mut().find(|early| early.frame == frame);
        match known {
            Some(early) => early.packets.push(packet.to_vec()),
            None => self.frames.push_back(Headless {
                frame,
                since: Instant::now(),
                asked: false,
                packets: vec![packet.to_vec()],
            }),
        }
        self.count += 1;
        let mut gone = 0;
        while self.count > most
            && let Some(oldest) = self.frames.front_mut()
        {
            oldest.packets.remove(0);
            if oldest.packets.is_empty() {
                self.frames.pop_front();
            }
            self.count -= 1;
            gone += 1;
        }
        gone
    }

    /// Gives the packets of a frame out, and whether its header was asked for.
    pub(super) fn take(&mut self, frame: u32) -> (Vec<Vec<u8>>, bool) {
        let place = self.frames.iter().position(|early| early.frame == frame);
        let Some(early) = place.and_then(|place| self.frames.remove(place)) else {
            return (Vec::new(), false);
        };
        self.count -= early.packets.len();
        (early.packets, early.asked)
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// The frames whose header to ask for: not asked for and missed for `wait`, or all if `again`.
    pub(super) fn ask(&mut self, now: Instant, wait: Duration, again: bool) -> Vec<u32> {
        let due = |early: &&mut Headless| {
            again || !early.asked && now.saturating_duration_since(early.since) >= wait
        };
        let due = self.frames.iter_mut().filter(due);
        due.map(|early| {
            early.asked = true;
            early.frame
        })
        .collect()
    }
}
