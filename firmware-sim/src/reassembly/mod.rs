//! Frame packets in, whole frames out, whatever got lost, came twice or came in another order on the way.
//!
//! Memory is bounded: two frames under way, each within [`Limits`], and a few early packets of a frame whose header
//! has not come yet.

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

/// Frames under way at once.
const UNDER_WAY: usize = 2;
/// Finished or given up frames remembered, so that late repeats of their packets are known as such.
const REMEMBERED: usize = 16;

/// Puts frames together.
#[derive(Debug, Default)]
pub struct Assembler {
    limits: Limits,
    in_flight: VecDeque<Partial>,
    /// Memory for the next frame.
    spare: Memory,
    /// Packets whose header has not come yet.
    early: Early,
    /// Frames that are finished or given up, with their exposure: an emulator started anew counts anew.
    done: VecDeque<(u32, WireTime)>,
    counts: AssemblyCounts,
}

impl Assembler {
    /// Nothing received yet.
    #[must_use]
    pub fn new(limits: Limits) -> Self {
        Self {
            limits,
            ..Self::default()
        }
    }

    /// What went other than plainly so far.
    #[must_use]
    pub fn counts(&self) -> AssemblyCounts {
        self.counts
    }

    /// Takes one packet that came `now`, and its decoded reply; gives the frame that it completes. Replies that do not belong
    /// to a frame change nothing.
    ///
    /// # Errors
    /// [`AssemblyError`]: the packet, or the finished frame, is of no use; that is counted.
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
                self.counts.refused += self.early.keep(frame, packet, self.limits.early);
                Ok(())
            }
        };
        taken.inspect_err(|_| self.counts.refused += 1)?;
        self.finish(frame)
    }

    /// Takes a frame back that is not needed any more: the next is put together in its memory.
    pub fn take_back(&mut self, frame: ReceivedFrame) {
        self.spare = Memory {
            pixels: match frame.content {
                Content::Frame(pixels) => pixels,
                Content::None | Content::Windows(_) => Vec::new(),
            },
            labels: frame.sealed_labels,
        };
    }

    /// Gives up all frames under way, and says what had come of them.
    pub fn abandon(&mut self) -> Vec<Progress> {
        let mut given_up = Vec::new();
        while let Some(partial) = self.in_flight.pop_front() {
            self.counts.incomplete += 1;
            self.remember(&partial);
            given_up.push(partial.progress());
        }
        self.early.clear();
        given_up
    }

    /// Whether nothing is under way.
    #[must_use]
    pub fn is_idle(&self) -> bool {
        self.in_flight.is_empty() && self.early.is_empty()
    }

    /// Whether some of this frame has come, and not all.
    #[must_use]
    pub fn is_in_flight(&self, frame: u32) -> bool {
        let partial = |partial: &Partial| partial.header.frame == frame;
        self.early.has(frame) || self.in_flight.iter().any(partial)
    }

    /// Whether some of a frame that may show this attitude has come, and not all.
    #[must_use]
    pub fn has_begun(&self, attitude: u32) -> bool {
        let shows = |partial: &Partial| partial.header.attitude_sequence == attitude;
        !self.early.is_empty() || self.in_flight.iter().any(shows)
    }

    /// The missing packets to ask for now; they are booked as asked for.
    pub fn ask(&mut self, now: Instant, demand: &Demand) -> Vec<Run> {
        let header = |frame| Run {
            frame,
            first: 0,
            count: 1,
        };
        let headers = self.early.ask(now, demand.wait, demand.again);
        let mut runs: Vec<Run> = headers.into_iter().map(header).take(demand.runs).collect();
        for partial in &mut self.in_flight {
            let attitude = partial.header.attitude_sequence;
            let requested: u32 = runs.iter().map(|run| run.count).sum();
            let left = Demand {
                runs: demand.runs.saturating_sub(runs.len()),
                packets: demand.packets.saturating_sub(requested as usize),
                ..*demand
            };
            if demand.attitude.is_none_or(|wanted| wanted == attitude) {
                runs.extend(partial.ask(now, &left));
            }
        }
        runs
    }

    /// A frame of which another link has told: its header is missing, unless it comes soon.
    pub fn look_out_for(&mut self, frame: u32) {
        let done = self.done.iter().any(|(number, _)| *number == frame);
        if !done && !self.is_in_flight(frame) {
            self.early.look_out_for(frame);
        }
    }

    /// A frame that need not come any more, if nothing of it has.
    pub fn dismiss(&mut self, frame: u32) {
        self.early.dismiss(frame);
    }

    /// Asks for nothing more of this frame: its packets are not to be had.
    pub fn forsake(&mut self, frame: u32) {
        self.early.take(frame);
        let known = self.in_flight.iter_mut();
        for partial in known.filter(|partial| partial.header.frame == frame) {
            partial.forsaken = true;
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
        if self.in_flight.len() >= UNDER_WAY
            && let Some(oldest) = self.in_flight.pop_front()
        {
            self.counts.incomplete += 1;
            self.remember(&oldest);
        }
        let mut partial = Partial::new(*header, mid_exposure, std::mem::take(&mut self.spare), now);
        let (early, requested) = self.early.take(frame);
        self.counts.recovered += u64::from(requested);
        for packet in early {
            // Only packets that decoded are kept.
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
        let place = self.in_flight.iter().position(whole);
        let Some(partial) = place.and_then(|place| self.in_flight.remove(place)) else {
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
