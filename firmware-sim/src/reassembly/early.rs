//! Packets that came before their frame's header: a bounded number of them, kept until it comes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Frames of which nothing has come that are looked out for.
const LOOKED_OUT_FOR: usize = 4;

/// The packets of one frame.
#[derive(Debug)]
struct Headless {
    frame: u32,
    since: Instant,
    /// Whether the header was asked for.
    requested: bool,
    packets: Vec<Vec<u8>>,
}

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
        self.of(frame).packets.push(packet.to_vec());
        self.count += 1;
        let mut gone = 0;
        while self.count > most
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

    /// A frame of which another link has told: its header is missing. Of those of which nothing comes, the oldest go.
    pub(super) fn look_out_for(&mut self, frame: u32) {
        self.of(frame);
        let empty = |early: &Headless| early.packets.is_empty();
        if self.frames.iter().filter(|early| empty(early)).count() > LOOKED_OUT_FOR
            && let Some(oldest) = self.frames.iter().position(empty)
        {
            self.frames.remove(oldest);
        }
    }

    /// A frame that need not come: forgets it if nothing of it has.
    pub(super) fn dismiss(&mut self, frame: u32) {
        let kept = |early: &Headless| early.frame != frame || !early.packets.is_empty();
        self.frames.retain(kept);
    }

    fn of(&mut self, frame: u32) -> &mut Headless {
        let known = self.frames.iter().position(|early| early.frame == frame);
        let place = known.unwrap_or_else(|| {
            self.frames.push_back(Headless {
                frame,
                since: Instant::now(),
                requested: false,
                packets: Vec::new(),
            });
            self.frames.len() - 1
        });
        &mut self.frames[place]
    }

    /// Gives the packets of a frame out, and whether its header was asked for.
    pub(super) fn take(&mut self, frame: u32) -> (Vec<Vec<u8>>, bool) {
        let place = self.frames.iter().position(|early| early.frame == frame);
        let Some(early) = place.and_then(|place| self.frames.remove(place)) else {
            return (Vec::new(), false);
        };
        self.count -= early.packets.len();
        (early.packets, early.requested)
    }

    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// The frames whose header to ask for: not asked for and missed for `wait`, or all if `again`.
    pub(super) fn ask(&mut self, now: Instant, wait: Duration, again: bool) -> Vec<u32> {
        let due = |early: &&mut Headless| {
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
    fn what_never_comes_is_looked_out_for_in_few_frames() {
        let mut early = Early::default();
        early.keep(7, b"block", 10);
        for frame in 100..10_000 {
            early.look_out_for(frame);
        }
        assert_eq!(early.frames.len(), 1 + LOOKED_OUT_FOR);
        assert!(early.has(7) && early.has(9_999) && !early.has(100));
        assert_eq!(early.take(7).0, [b"block"]);
    }
}
