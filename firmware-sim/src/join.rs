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
    pub(crate) fn new(links: impl Iterator<Item = Roles>) -> Self {
        Self {
            wanted: links.fold(Roles::NONE, Roles::with),
            waiting: VecDeque::new(),
            done: VecDeque::new(),
            duplicates: 0,
            incomplete: 0,
        }
    }

    /// Takes what one link, which brings `brought`, has whole; gives the frame that it completes.
    pub(crate) fn join(
        &mut self,
        frame: ReceivedFrame,
        brought: Roles,
    ) -> Result<Option<ReceivedFrame>, AssemblyError> {
        let key = (frame.header.frame, frame.mid_exposure);
        if !brought.and(self.wanted).bring_frames() {
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
            Some(other) => self.merge(other, frame, brought)?,
        };
        if !self.wanted.without(half.has).bring_frames() {
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
            self.incomplete += 1;
            return Err(AssemblyError::Contradiction {
                frame: frame.header.frame,
                what: "what came over another link",
                number: 0,
            });
        }
        let notices = brought.without(half.has);
        let has = half.has.with(brought);
        let frame = if notices.pixels {
            frame.with_labels_of(half.frame)
        } else if notices.labels {
            half.frame.with_labels_of(frame)
        } else {
            self.duplicates += 1;
            half.frame
        };
        Ok(Half { frame, has })
    }

    pub(crate) fn has(&self, frame: u32) -> bool {
        let same = |half: &Half| half.frame.header.frame == frame;
        self.waiting.iter().any(same)
    }

    /// Whether this frame waits for what a link brings.
    pub(crate) fn lacks(&self, frame: u32, brings: Roles) -> bool {
        let waits = |half: &Half| {
            half.frame.header.frame == frame && brings.without(half.has).bring_frames()
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
