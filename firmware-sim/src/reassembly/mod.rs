//! Reassembles frames from packets that may be lost, repeated or reordered.
//!
//! Memory is bounded: two frames in flight, each within [`Limits`], and a few early packets of
//! frames without a header.

mod arrivals;
mod early;
mod partial;
mod progress;

use std::collections::VecDeque;
use std::time::Instant;

use skyloop_protocols::{FrameHeader, Header, PixelLevel, Reply, WireTime};

use self::early::Early;
use self::partial::{Memory, Partial};
pub use self::progress::{AssemblyCounts, AssemblyError, Demand, Limits, Progress, Run};
use crate::received::{Content, ReceivedFrame};

const MAX_IN_FLIGHT: usize = 2;
/// Completed or dropped frames remembered, to recognize late duplicates of their packets.
const REMEMBERED: usize = 16;

/// Reassembles frames.
#[derive(Debug, Default)]
pub struct Assembler {
    limits: Limits,
    in_flight: VecDeque<Partial>,
    spare: Memory,
    early: Early,
    /// Completed or dropped frames with their exposure time, because a restarted emulator restarts
    /// its counter.
    done: VecDeque<(u32, WireTime)>,
    counts: AssemblyCounts,
}

impl Assembler {
    /// An empty assembler.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// Counters of irregular packets so far.
    #[must_use]
    pub fn counts(&self) -> AssemblyCounts {
        self.counts
    }

    /// Takes one packet received at `now`, with its decoded reply. Returns the frame that it
    /// completes. Other replies are ignored.
    ///
    /// # Errors
    /// [`AssemblyError`]: the packet or the frame is unusable; it is counted.
    pub fn accept(
        &mut self,
        packet: &[u8],
        header: &Header,
        reply: &Reply<'_>,
        now: Instant,
    ) -> Result<Option<ReceivedFrame>, AssemblyError> {
        let frame = match reply {
            Reply::FrameHeader(opening) => opening.frame,
            Reply::PixelBlock(block) => block.frame,
            Reply::Windows(block) => block.frame,
            Reply::Compressed(block) => block.frame,
            Reply::Labels(part) => part.frame,
            Reply::Objects(part) => part.frame,
            Reply::FrameEnd(end) => end.frame,
            _ => return Ok(None),
        };
        if self.done.contains(&(frame, header.time)) {
            self.counts.duplicates += 1;
            return Ok(None);
        }
        let known = self
            .in_flight
            .iter_mut()
            .find(|partial| partial.header.frame == frame);
        let taken = match (known, reply) {
            (Some(partial), _) => partial.take(reply, now, &mut self.counts),
            (None, Reply::FrameHeader(opening)) => self.open(header.time, opening, now),
            (None, _) => {
                self.counts.refused += self.early.store(frame, packet, self.limits.early);
                Ok(())
            }
        };
        taken.inspect_err(|_| self.counts.refused += 1)?;
        self.finish(frame)
    }

    /// Reuses the memory of a frame for the next one.
    pub(crate) fn recycle(&mut self, frame: ReceivedFrame) {
        self.spare = Memory {
            pixels: match frame.content {
                Content::Frame(pixels) => pixels,
                Content::None | Content::Windows(_) => Vec::new(),
            },
            labels: frame.sealed_labels,
        };
    }

    /// Drops all frames in flight. Returns their progress.
    pub fn abandon(&mut self) -> Vec<Progress> {
        let mut dropped = Vec::new();
        while let Some(partial) = self.in_flight.pop_front() {
            self.counts.incomplete += 1;
            self.remember(&partial);
            dropped.push(partial.progress());
        }
        self.early.clear();
        dropped
    }

    /// Whether no frame is in flight.
    #[must_use]
    pub(crate) fn is_idle(&self) -> bool {
        self.in_flight.is_empty() && self.early.is_empty()
    }

    /// Whether this frame has arrived in part.
    #[must_use]
    pub(crate) fn is_in_flight(&self, frame: u32) -> bool {
        let partial = |partial: &Partial| partial.header.frame == frame;
        self.early.has(frame) || self.in_flight.iter().any(partial)
    }

    /// Whether a frame, possibly of this attitude, has arrived in part.
    #[must_use]
    pub(crate) fn has_begun(&self, attitude: u32) -> bool {
        let shows = |partial: &Partial| partial.header.attitude_sequence == attitude;
        !self.early.is_empty() || self.in_flight.iter().any(shows)
    }

    /// Missing packets to request now; they are recorded as requested.
    pub(crate) fn missing_runs(&mut self, now: Instant, demand: &Demand) -> Vec<Run> {
        let header = |frame| Run {
            frame,
            first: 0,
            count: 1,
        };
        let headers = self.early.due_headers(now, demand.wait, demand.again);
        let mut runs: Vec<Run> = headers.into_iter().map(header).take(demand.runs).collect();
        for partial in &mut self.in_flight {
            let attitude = partial.header.attitude_sequence;
            let requested: u32 = runs.iter().map(|run| run.count).sum();
            let left = Demand {
                runs: demand.runs.saturating_sub(runs.len()),
                packets: demand.packets.saturating_sub(requested as usize),
                ..*demand
            };
            if demand.attitude.is_none_or(|only| only == attitude) {
                runs.extend(partial.missing_runs(now, &left));
            }
        }
        runs
    }

    /// Expects the header of a frame known from another link.
    pub(crate) fn expect_header(&mut self, frame: u32) {
        let done = self.done.iter().any(|(number, _)| *number == frame);
        if !done && !self.is_in_flight(frame) {
            self.early.expect_header(frame);
        }
    }

    /// Forgets an expected frame without packets.
    pub(crate) fn forget(&mut self, frame: u32) {
        self.early.forget(frame);
    }

    /// Stops requests for this frame, whose packets are unavailable.
    pub(crate) fn stop_requests(&mut self, frame: u32) {
        self.early.take(frame);
        let known = self.in_flight.iter_mut();
        for partial in known.filter(|partial| partial.header.frame == frame) {
            partial.unavailable = true;
        }
    }

    fn open(
        &mut self,
        mid_exposure: WireTime,
        header: &FrameHeader,
        now: Instant,
    ) -> Result<(), AssemblyError> {
        let frame = header.frame;
        let size = usize::from(header.window_size);
        let (what, pixels) = match header.pixel_level {
            PixelLevel::None => ("width * height", 0),
            PixelLevel::Windows => (
                "pixels in windows",
                size * size * usize::from(header.windows),
            ),
            PixelLevel::Frame | PixelLevel::Compressed => {
                ("width * height", header.pixels() as usize)
            }
        };
        let labels = header.label_bytes as usize;
        for (what, requested, limit) in [
            (what, pixels, self.limits.pixels),
            ("label text", labels, self.limits.label_bytes),
        ] {
            if requested > limit {
                return Err(AssemblyError::TooLarge {
                    frame,
                    what,
                    requested,
                    limit,
                });
            }
        }
        if self.in_flight.len() >= MAX_IN_FLIGHT
            && let Some(oldest) = self.in_flight.pop_front()
        {
            self.counts.incomplete += 1;
            self.remember(&oldest);
        }
        let mut partial = Partial::new(*header, mid_exposure, std::mem::take(&mut self.spare), now);
        let (early, requested) = self.early.take(frame);
        self.counts.recovered += u64::from(requested);
        for packet in early {
            // Only decodable packets are stored.
            let taken = match Reply::decode(&packet) {
                Ok((_, reply)) => partial.take(&reply, now, &mut self.counts),
                Err(_) => Ok(()),
            };
            self.counts.out_of_order += 1;
            self.counts.refused += u64::from(taken.is_err());
        }
        self.in_flight.push_back(partial);
        Ok(())
    }

    fn finish(&mut self, frame: u32) -> Result<Option<ReceivedFrame>, AssemblyError> {
        let whole = |partial: &Partial| partial.header.frame == frame && partial.is_whole();
        let index = self.in_flight.iter().position(whole);
        let Some(partial) = index.and_then(|index| self.in_flight.remove(index)) else {
            return Ok(None);
        };
        self.remember(&partial);
        let finished = partial.finish();
        self.counts.bad_pixels += u64::from(finished.is_err());
        finished.map(Some)
    }

    fn remember(&mut self, partial: &Partial) {
        if self.done.len() >= REMEMBERED {
            self.done.pop_front();
        }
        self.done
            .push_back((partial.header.frame, partial.mid_exposure));
    }
}
