//! Transmission of one frame over one link.

use super::exchange::Exchange;
use super::frame_packets::FramePackets;
use crate::stats::Pending;
use bytes::Bytes;
use std::time::{Duration, Instant};

/// Evidence that a client takes data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Progress {
    /// Frame packets for which the client has granted credit.
    pub credit: u32,
    /// Bytes that have left the link.
    pub bytes: u32,
}

/// Transmission of one frame over one link.
pub(super) struct Delivery {
    pub frame: u32,
    /// Its entry in the counters of the link.
    pub entry: Pending,
    /// None until enough of the frame is rendered.
    pub packets: Option<FramePackets>,
    /// Position of its first packet in the link's queue.
    pub first_place: u32,
    /// Exchange and number of Resets: if they change, the frame is not delivered.
    pub exchange: u32,
    pub resets: u32,
    /// A packet that waits for room, and whether the link has refused it.
    pub waiting: Option<(Bytes, bool)>,
    /// Since when neither frame packets nor credit have moved.
    pub stall: Stall,
    /// Whether the stall is in the log.
    pub reported: bool,
    /// The link's count of packets removed without proof of address, at this frame's first packet.
    pub unproved: u32,
}

impl Delivery {
    /// A delivery of `frame` to the present client of an exchange.
    pub fn new(frame: u32, entry: Pending, exchange: &Exchange, progress: Progress) -> Delivery {
        Delivery {
            frame,
            entry,
            packets: None,
            first_place: 0,
            exchange: exchange.number,
            resets: exchange.resets,
            waiting: None,
            stall: Stall::at(progress),
            reported: false,
            unproved: 0,
        }
    }

    /// Whether it belongs to this exchange, with no Reset since.
    pub fn is_for(&self, exchange: &Exchange) -> bool {
        (self.exchange, self.resets) == (exchange.number, exchange.resets)
    }

    /// Whether its packets are being sent.
    pub fn has_begun(&self) -> bool {
        self.packets.is_some()
    }
}

/// Since when nothing has moved, neither frame packets nor credit.
pub(super) struct Stall {
    since: Instant,
    progress: Progress,
}

impl Stall {
    pub fn at(progress: Progress) -> Stall {
        Stall {
            since: Instant::now(),
            progress,
        }
    }

    /// Time without progress. Bytes that leave count if they belong to frame packets
    /// (`carries_frames`). New credit does not count on a link that `is_full`: it makes no room.
    pub fn update(&mut self, now: Progress, carries_frames: bool, is_full: bool) -> Duration {
        let bytes_moved = now.bytes != self.progress.bytes && carries_frames;
        let credit_moved = now.credit != self.progress.credit && !is_full;
        if bytes_moved || credit_moved {
            *self = Stall::at(now);
        }
        self.since.elapsed()
    }
}
