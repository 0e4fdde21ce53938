//! What is known of frames that have not come whole: limits, counts, gaps, errors.

use std::time::Duration;

use thiserror::Error;

/// What a header may ask for.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Most pixels of a frame.
    pub pixels: usize,
    /// Most octets of label text.
    pub label_bytes: usize,
    /// Most packets kept that came before their header.
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

/// What happened to frame packets that was not plain progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AssemblyCounts {
    /// Packets that had come before.
    pub duplicates: u64,
    /// Packets that came after a later one of their kind.
    pub out_of_order: u64,
    /// Packets that contradict their frame's header, or ask for more than the limits.
    pub refused: u64,
    /// Whole frames whose pixels leave gaps or do not have their FrameEnd's CRC-32.
    pub bad_pixels: u64,
    /// Frames given up incomplete.
    pub incomplete: u64,
    /// Missing packets that came after they were asked for.
    pub recovered: u64,
}

impl AssemblyCounts {
    /// Adds those of another link.
    pub(crate) fn add_all(&mut self, other: &Self) {
        self.duplicates += other.duplicates;
        self.out_of_order += other.out_of_order;
        self.refused += other.refused;
        self.bad_pixels += other.bad_pixels;
        self.incomplete += other.incomplete;
        self.recovered += other.recovered;
    }
}

/// Packets of a frame by their numbers: 0 is its header, then come its pixels, its labels, its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Run {
    /// The frame's number.
    pub frame: u32,
    /// The first packet.
    pub first: u32,
    /// How many.
    pub count: u32,
}

/// Which missing packets to ask for.
#[derive(Clone, Copy, Debug)]
pub struct Demand {
    /// The attitude whose frames are wanted; none: all.
    pub attitude: Option<u32>,
    /// A packet is missing if a later one came so long before.
    pub wait: Duration,
    /// What was asked for before is missing too.
    pub again: bool,
    /// All that has not come is missing: nothing comes any more.
    pub silent: bool,
    /// Most runs.
    pub runs: usize,
    /// Most packets.
    pub packets: usize,
}

/// Why a frame packet is no use.
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
    /// Whether all of a frame came, and is no use.
    #[must_use]
    pub fn is_damaged_frame(&self) -> bool {
        matches!(self, Self::BadPixels { .. } | Self::Gap { .. })
    }
}

/// What came so far of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// The frame's number.
    pub frame: u32,
    /// Pixel blocks that came, and how many there are.
    pub blocks: (u32, u32),
    /// Label parts that came, and how many there are.
    pub label_parts: (u16, u16),
    /// Whether its FrameEnd came.
    pub end: bool,
}
