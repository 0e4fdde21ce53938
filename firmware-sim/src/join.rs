//! One frame out of what several links bring of it: pixels from one, labels from another.

use std::collections::VecDeque;

use skyloop_protocols::WireTime;

use crate::reassembly::{AssemblyError, Progress};
use crate::received::ReceivedFrame;
use crate::roles::Roles;

/// Frames of which one part waits for the other.
const WAITING: usize = 4;
/// Joined frames remembered, so that a part that comes again is known.
const REMEMBERED: usize = 16;

/// Joins frames by their numbers.
#[derive(Debug)]
pub(crate) struct Joiner {
    /// What some link brings.
    wanted: Roles,
    waiting: VecDeque<Half>,
    done: VecDeque<(u32, WireTime)>,
    /// Frames and parts of frames that had come over another link.
    pub(crate) duplicates: u64,
    /// Frames of which only one part came, or parts that contradict each other.
    pub(crate) incomplete: u64,
}

/// A frame that lacks a part.
#[derive(Debug)]
struct Half {
    frame: ReceivedFrame,
    /// What of it is in.
    has: Roles,
}

impl Joiner {
    /// For links that bring these.
    pub(crate) fn new(links: impl Iterator<Item = Roles>) -> Self {
        let mut wanted = Roles {
            truth: false,
            pixels: false,
            labels: false,
        };
        for link in links {
            wanted.pixels |= link.pixels;
            wanted.labels |= link.labels;
        }
        Self {
            wanted,
            waiting: VecDeque::new(),
            done: VecDeque::new(),
            duplicates: 0,
            incomplete: 0,
        }
    }

    /// Takes what one link, which brings `brought`, has whole; gives the frame that it completes.
    ///
    /// # Errors
    /// The parts are not of the same frame.
    pub(crate) fn join(
        &mut self,
        frame: ReceivedFrame,
        brought: Roles,
    ) -> Result<Option<ReceivedFrame>, AssemblyError> {
        let key = (frame.header.frame, frame.mid_exposure);
        let brings = brought.pixels && self.wanted.pixels || brought.labels && self.wanted.labels;
        if !brings {
            // Neither pixels nor labels were asked for on this link.
            return Ok(None);
        }
        if self.done.contains(&key) {
            self.duplicates += 1;
            return Ok(None);
        }
        let known = self.waiting.iter().position(|half| half.key() == key);
        let half = match known.and_then(|place| self.waiting.remove(place)) {
            None => Half {
                frame,
                has: brought,
            },
            Some(other) => self.merge(other, frame, brought).inspect_err(|_| {
                self.incomplete += 1;
            })?,
        };
        let whole =
            (half.has.pixels || !self.wanted.pixels) && (half.has.labels || !self.wanted.labels);
        if whole {
            if self.done.len() >= REMEMBERED {
                self.done.pop_front();
            }
            self.done.push_back(key);
            return Ok(Some(half.frame));
        }
        if self.waiting.len() >= WAITING {
            self.waiting.pop_front();
            self.incomplete += 1;
        }
        self.waiting.push_back(half);
        Ok(None)
    }

    fn merge(
        &mut self,
        half: Half,
        frame: ReceivedFrame,
        brought: Roles,
    ) -> Result<Half, AssemblyError> {
        let shows =
            |frame: &ReceivedFrame| (frame.header.attitude_sequence, frame.end.pixels_crc32);
        if shows(&half.frame) != shows(&frame) {
            return Err(AssemblyError::Contradiction {
                frame: frame.header.frame,
                what: "what came over another link",
                number: 0,
            });
        }
        let news = (
            brought.pixels && !half.has.pixels,
            brought.labels && !half.has.labels,
        );
        let merged = match news {
            (true, _) => frame.with_labels_of(half.frame),
            (false, true) => half.frame.with_labels_of(frame),
            (false, false) => {
                self.duplicates += 1;
                half.frame
            }
        };
        Ok(Half {
            frame: merged,
            has: Roles {
                truth: false,
                pixels: half.has.pixels || brought.pixels,
                labels: half.has.labels || brought.labels,
            },
        })
    }

    /// Whether a part of this frame waits.
    pub(crate) fn has(&self, frame: u32) -> bool {
        self.waiting
            .iter()
            .any(|half| half.frame.header.frame == frame)
    }

    /// Whether this frame waits for what a link brings.
    pub(crate) fn lacks(&self, frame: u32, brings: Roles) -> bool {
        let waits = |half: &Half| {
            half.frame.header.frame == frame
                && (brings.pixels && !half.has.pixels || brings.labels && !half.has.labels)
        };
        self.waiting.iter().any(waits)
    }

    /// Whether a part of a frame of this attitude waits.
    pub(crate) fn has_begun(&self, attitude: u32) -> bool {
        let shows = |half: &Half| half.frame.header.attitude_sequence == attitude;
        self.waiting.iter().any(shows)
    }

    /// Gives up what waits, and says what there was of it.
    pub(crate) fn abandon(&mut self) -> Vec<Progress> {
        self.incomplete += self.waiting.len() as u64;
        self.waiting.drain(..).map(|half| half.progress()).collect()
    }
}

impl Half {
    fn key(&self) -> (u32, WireTime) {
        (self.frame.header.frame, self.frame.mid_exposure)
    }

    /// What a part announces has come; of the other part nothing is known.
    fn progress(&self) -> Progress {
        let header = &self.frame.header;
        Progress {
            frame: header.frame,
            blocks: (header.blocks, header.blocks),
            label_parts: (header.label_parts, header.label_parts),
            end: true,
        }
    }
}
