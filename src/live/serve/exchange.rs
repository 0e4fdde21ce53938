//! State of one client on a link.

use bytes::Bytes;
use skyloop_protocols::credit::CreditAccount;
use skyloop_protocols::sequence::GapDetector;
use skyloop_protocols::{Output, Positions, Withheld};
use std::collections::VecDeque;
use std::time::Instant;

/// Number of frames whose packets can be sent again: the present one and the one before.
const RESENDABLE_FRAMES: usize = 2;

/// State of one client on a link, from its first packet to its replacement.
#[derive(Debug, Default)]
pub(super) struct Exchange {
    pub number: u32,
    /// Whether the client has sent a valid packet. Before that it gets no frames.
    pub has_client: bool,
    /// Set if the client took nothing for too long: it gets no frames.
    pub muted: Option<Mute>,
    /// Why the client did not get the last frame completely.
    pub withheld: Withheld,
    /// Whether a Status has reported that reason.
    pub is_in_status: bool,
    /// Whether the client has sent a valid Trigger.
    pub triggered: bool,
    pub credit: CreditAccount,
    /// The first grant of credit, packets.
    pub window: Option<u32>,
    /// The largest single grant since, packets.
    pub step: u32,
    pub gaps: GapDetector,
    /// Content of each frame.
    pub output: Output,
    /// Positions of windows; none: around the brightest stars.
    pub positions: Option<Positions>,
    /// The last frames, for Resend.
    pub sent_frames: VecDeque<SentPackets>,
    /// Packets in and out that faults had lost when the exchange began.
    pub lost_to_faults: [u32; 2],
    /// Number of Resets, so that a frame in progress detects one.
    pub resets: u32,
    /// Answers that wait for room in the link's queue, oldest first.
    pub answers: VecDeque<Bytes>,
    /// Whether answers had to be dropped.
    pub overrun: bool,
    /// When the client sent Reset, until the link is informed.
    pub release: Option<Instant>,
}

/// Why a client gets no frames until it takes data again.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mute {
    pub why: Withheld,
    /// Bytes that had left the link.
    pub bytes: u32,
    /// Whether the client has sent a packet since.
    pub has_sent: bool,
}

/// The packets of a frame as they were sent.
#[derive(Debug)]
pub(super) struct SentPackets {
    pub frame: u32,
    pub packets: Vec<Bytes>,
}

impl Exchange {
    /// The exchange of another client.
    pub fn open(number: u32, output: Output, lost_to_faults: [u32; 2]) -> Exchange {
        Exchange {
            number,
            lost_to_faults,
            output,
            ..Exchange::default()
        }
    }

    /// Restarts the exchange of the same client at its Reset; waiting answers remain.
    pub fn reset(&mut self, output: Output, lost_to_faults: [u32; 2], now: Instant) {
        let before = std::mem::take(self);
        *self = Exchange {
            has_client: true,
            resets: before.resets.wrapping_add(1),
            // A Reset does not change the state of the link.
            muted: before
                .muted
                .filter(|mute| matches!(mute.why, Withheld::NoProof | Withheld::NotRead)),
            answers: before.answers,
            overrun: before.overrun,
            release: Some(now),
            ..Exchange::open(before.number, output, lost_to_faults)
        };
    }

    /// Makes room for the packets of another frame.
    pub fn begin_frame(&mut self, frame: u32) {
        while self.sent_frames.len() >= RESENDABLE_FRAMES {
            self.sent_frames.pop_front();
        }
        self.sent_frames.push_back(SentPackets {
            frame,
            packets: Vec::new(),
        });
    }

    /// The packets of a frame, if they can be sent again.
    pub fn packets_of(&self, frame: u32) -> Option<&[Bytes]> {
        let mut sent = self.sent_frames.iter();
        let sent = sent.find(|sent| sent.frame == frame && !sent.packets.is_empty())?;
        Some(&sent.packets)
    }
}
