//! Limits, counters, requests and errors of the reassembly.

use std::time::Duration;

use thiserror::Error;

/// Limits of a frame header.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Maximum number of pixels of a frame.
    pub pixels: usize,
    /// Maximum length of the label text, bytes.
    pub label_bytes: usize,
    /// Maximum number of stored packets without their header.
    pub early: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            pixels: 8192 * 8192,
            label_bytes: 1 << 24,
            early: 1024,
        }
    }
}

/// Counters of irregular frame packets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AssemblyCounts {
    /// Repeated packets.
    pub duplicates: u64,
    /// Packets received after a later one of their kind.
    pub out_of_order: u64,
    /// Packets that contradict their frame's header, or exceed the limits.
    pub refused: u64,
    /// Complete frames with gaps, or with a wrong CRC-32.
    pub bad_pixels: u64,
    /// Frames dropped incomplete.
    pub incomplete: u64,
    /// Missing packets received after a request.
    pub recovered: u64,
}

impl AssemblyCounts {
    pub(crate) fn add_all(&mut self, other: &Self) {
        self.duplicates += other.duplicates;
        self.out_of_order += other.out_of_order;
        self.refused += other.refused;
        self.bad_pixels += other.bad_pixels;
        self.incomplete += other.incomplete;
        self.recovered += other.recovered;
    }
}

/// A run of packets of a frame, by their numbers: header 0, then pixels, labels, end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The frame's number.
    pub frame: u32,
    /// The first packet.
    pub first: u32,
    /// Number of packets.
    pub count: u32,
}

/// Which missing packets to request.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// Attitude of the requested frames; none: all frames.
    pub attitude: Option<u32>,
    /// Wait after a later packet until a packet counts as missing.
    pub wait: Duration,
    /// Includes packets requested before.
    pub again: bool,
    /// Includes packets after the last one received.
    pub silent: bool,
    /// Maximum number of runs.
    pub runs: usize,
    /// Maximum number of packets.
    pub packets: usize,
}

/// Error of a frame packet or a frame.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum AssemblyError {
    #[error("frame {frame}: {what} is {requested}, at most {limit} are taken")]
    TooLarge {
        frame: u32,
        what: &'static str,
        requested: usize,
        limit: usize,
    },
    #[error("frame {frame}: {what} {number} does not fit the frame's header")]
    Contradiction {
        frame: u32,
        what: &'static str,
        number: u32,
    },
    #[error(
        "frame {frame}: the pixels' CRC-32 is {found:#010x}, its FrameEnd says {expected:#010x}"
    )]
    BadPixels {
        frame: u32,
        found: u32,
        expected: u32,
    },
    #[error("frame {frame}: compressed block {block} begins at pixel {first}, not at {expected}")]
    Gap {
        frame: u32,
        block: u32,
        first: u32,
        expected: u32,
    },
}

impl AssemblyError {
    /// Whether the frame is complete but damaged.
    #[must_use]
    pub(crate) fn is_damaged_frame(&self) -> bool {
        matches!(self, Self::BadPixels { .. } | Self::Gap { .. })
    }
}

/// Received parts of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// The frame's number.
    pub frame: u32,
    /// Received and all pixel blocks.
    pub blocks: (u32, u32),
    /// Received and all label parts.
    pub label_parts: (u16, u16),
    /// Whether its FrameEnd has been received.
    pub end: bool,
}
