//! Joins the parts of one frame from several links: pixels from one, labels from another.

use std::collections::VecDeque;

use skyloop_protocols::WireTime;

use crate::reassembly::{AssemblyError, Progress};
use crate::received::ReceivedFrame;
use crate::roles::Roles;

/// Maximum number of incomplete frames.
const WAITING: usize = 4;
/// Number of joined frames remembered, to recognize duplicates.
const REMEMBERED: usize = 16;

#[derive(Debug)]
pub(crate) struct Joiner {
    wanted: Roles,
    waiting: VecDeque<Half>,
    done: VecDeque<(u32, WireTime)>,
    /// Frames and parts already received over another link.
    pub(crate) duplicates: u64,
    /// Frames with one part only, and contradictory parts.
    pub(crate) incomplete: u64,
}

/// A frame with a missing part.
#[derive(Debug)]
struct Half {
    frame: ReceivedFrame,
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

    /// Adds the parts of a frame from a link that carries `brought`. Returns the frame once it is
    /// complete.
    pub(crate) fn join(
        &mut self,
        frame: ReceivedFrame,
        brought: Roles,
    ) -> Result<Option<ReceivedFrame>, AssemblyError> {
        let key = (frame.header.frame, frame.mid_exposure);
        if !brought.and(self.wanted).bring_frames() {
            // Neither pixels nor labels were requested on this link.
            return Ok(None);
        }
        if self.done.contains(&key) {
            self.duplicates += 1;
            return Ok(None);
        }
        let known = self.waiting.iter().position(|half| half.key() == key);
        let half = match known.and_then(|index| self.waiting.remove(index)) {
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
        let new_parts = brought.without(half.has);
        let has = half.has.with(brought);
        let frame = if new_parts.pixels {
            frame.with_labels_of(half.frame)
        } else if new_parts.labels {
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

    /// Whether this frame is held and lacks a part that the link carries.
    pub(crate) fn lacks(&self, frame: u32, brings: Roles) -> bool {
        let waits = |half: &Half| {
            half.frame.header.frame == frame && brings.without(half.has).bring_frames()
        };
        self.waiting.iter().any(waits)
    }

    /// Whether a part of a frame of this attitude is held.
    pub(crate) fn has_begun(&self, attitude: u32) -> bool {
        let shows = |half: &Half| half.frame.header.attitude_sequence == attitude;
        self.waiting.iter().any(shows)
    }

    /// Drops incomplete frames. Returns their progress.
    pub(crate) fn abandon(&mut self) -> Vec<Progress> {
        self.incomplete += self.waiting.len() as u64;
        self.waiting.drain(..).map(|half| half.progress()).collect()
    }
}

impl Half {
    fn key(&self) -> (u32, WireTime) {
        (self.frame.header.frame, self.frame.mid_exposure)
    }

    /// A held part is complete; nothing is known about the other one.
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
