//! A partially received frame.
//!
//! Its packets are numbered: the header is 0, followed by pixels, labels, and the end.

use std::time::Instant;

use skyloop_protocols::crc::Crc32;
use skyloop_protocols::pixels::{
    OBJECT_LENGTH, OBJECTS_PER_PART, pixels_per_block, unpack, windows_per_block,
};
use skyloop_protocols::{
    CompressedBlock, FrameEnd, FrameHeader, LabelLevel, PixelBlock, PixelLevel, Reply, WindowBlock,
    WireTime, rice,
};

use super::arrivals::{Arrival, Arrivals};
use super::progress::{AssemblyCounts, AssemblyError, Demand, Progress, Run};
use crate::received::{Content, Cutout, ReceivedFrame};

#[derive(Debug)]
pub(super) struct Partial {
    pub(super) header: FrameHeader,
    pub(super) mid_exposure: WireTime,
    pixels: Vec<u16>,
    windows: Vec<Cutout>,
    /// First pixel and number of pixels of each compressed block.
    spans: Vec<(u32, u32)>,
    labels: Vec<u8>,
    blocks: Arrivals,
    parts: Arrivals,
    end: Option<FrameEnd>,
    ends: Arrivals,
    pixel_bytes: u64,
    header_at: Instant,
    last_data_at: Instant,
    /// Arrival time of the current packet.
    now: Instant,
    /// A gap not requested yet: when it was found, and the number after that of the highest packet
    /// received by then.
    gap: Option<(Instant, usize)>,
    /// Its missing packets are unavailable.
    pub(super) unavailable: bool,
}

/// Reused buffers of an earlier frame.
#[derive(Debug, Default)]
pub(super) struct Memory {
    pub(super) pixels: Vec<u16>,
    pub(super) labels: Vec<u8>,
}

/// Resizes a reused buffer, without clearing: a complete frame overwrites all of it.
fn resized<T: Clone + Default>(mut memory: Vec<T>, count: usize) -> Vec<T> {
    memory.resize(count, T::default());
    memory
}

impl AssemblyCounts {
    fn add(&mut self, arrival: &Arrival) {
        self.out_of_order += u64::from(arrival.late);
        self.recovered += u64::from(arrival.requested);
    }
}

impl Partial {
    /// A frame whose header, received at `now`, has passed the decoder's checks and the limits.
    pub(super) fn new(
        header: FrameHeader,
        mid_exposure: WireTime,
        memory: Memory,
        now: Instant,
    ) -> Self {
        let blocks = header.blocks as usize;
        let (whole, spans, windows) = match header.pixel_level {
            PixelLevel::None => (0, 0, 0),
            PixelLevel::Windows => (0, 0, header.windows),
            PixelLevel::Frame => (header.pixels(), 0, 0),
            PixelLevel::Compressed => (header.pixels(), blocks, 0),
        };
        Self {
            pixels: resized(memory.pixels, whole as usize),
            windows: vec![Cutout::default(); usize::from(windows)],
            spans: vec![(0, 0); spans],
            labels: resized(memory.labels, header.label_bytes as usize),
            blocks: Arrivals::of(blocks),
            parts: Arrivals::of(usize::from(header.label_parts)),
            end: None,
            ends: Arrivals::of(1),
            pixel_bytes: 0,
            header_at: now,
            last_data_at: now,
            now,
            gap: None,
            unavailable: false,
            header,
            mid_exposure,
        }
    }

    pub(super) fn take(
        &mut self,
        reply: &Reply<'_>,
        now: Instant,
        counts: &mut AssemblyCounts,
    ) -> Result<(), AssemblyError> {
        self.now = now;
        match reply {
            Reply::FrameHeader(again) if self.header != *again => {
                Err(self.contradiction("a second header", 0))
            }
            Reply::FrameHeader(_) => {
                counts.duplicates += 1;
                Ok(())
            }
            Reply::PixelBlock(block) => {
                let place = |frame: &mut Self| frame.place_block(block);
                self.take_pixels("pixel block", block.index, block.data, counts, place)
            }
            Reply::Windows(block) => {
                let place = |frame: &mut Self| frame.place_windows(block);
                self.take_pixels("windows", block.index, block.data, counts, place)
            }
            Reply::Compressed(block) => {
                let place = |frame: &mut Self| frame.place_compressed(block);
                self.take_pixels("compressed block", block.index, block.data, counts, place)
            }
            Reply::Labels(part) => {
                let number = (part.part, part.parts);
                self.take_labels(LabelLevel::Text, number, part.offset(), part.text, counts)
            }
            Reply::Objects(part) => {
                let offset = usize::from(part.part) * OBJECTS_PER_PART * OBJECT_LENGTH;
                let number = (part.part, part.parts);
                self.take_labels(LabelLevel::Objects, number, offset, part.data, counts)
            }
            Reply::FrameEnd(end) => self.take_end(end, counts),
            // No part of a frame.
            _ => Ok(()),
        }
    }

    fn contradiction(&self, what: &'static str, number: u32) -> AssemblyError {
        AssemblyError::Contradiction {
            frame: self.header.frame,
            what,
            number,
        }
    }

    /// Records a packet with pixels; `place` stores them, if they fit.
    fn take_pixels(
        &mut self,
        what: &'static str,
        index: u32,
        data: &[u8],
        counts: &mut AssemblyCounts,
        place: impl FnOnce(&mut Self) -> bool,
    ) -> Result<(), AssemblyError> {
        let refused = self.contradiction(what, index);
        match self.blocks.state(index as usize) {
            Some(true) => counts.duplicates += 1,
            Some(false) if place(self) => {
                self.pixel_bytes += data.len() as u64;
                counts.add(&self.blocks.record(index as usize));
                self.last_data_at = self.now;
            }
            _ => return Err(refused),
        }
        Ok(())
    }

    fn place_block(&mut self, block: &PixelBlock<'_>) -> bool {
        let left = self.pixels.len().saturating_sub(block.first_pixel as usize);
        let expected = left.min(pixels_per_block(self.header.packing));
        self.header.pixel_level == PixelLevel::Frame
            && block.packing == self.header.packing
            && usize::from(block.count) == expected
            && block.place(&mut self.pixels)
    }

    fn place_windows(&mut self, block: &WindowBlock<'_>) -> bool {
        let header = &self.header;
        let (first, size) = (usize::from(block.first), block.size);
        let left = self.windows.len().saturating_sub(first);
        let expected = left.min(windows_per_block(header.packing, size));
        let inside = |at: u16, end: u16| u32::from(at) + u32::from(size) <= u32::from(end);
        let fits = header.pixel_level == PixelLevel::Windows
            && (block.packing, size) == (header.packing, header.window_size)
            && usize::from(block.count) == expected
            && block.windows().all(|window| {
                inside(window.column, header.width) && inside(window.row, header.height)
            });
        let cutouts = self.windows.iter_mut().skip(first);
        for (cutout, window) in cutouts.zip(block.windows()).take(usize::from(fits) * left) {
            let mut pixels = vec![0; usize::from(size) * usize::from(size)];
            unpack(block.packing, window.data, &mut pixels);
            *cutout = Cutout {
                column: window.column,
                row: window.row,
                size: size.into(),
                pixels,
            };
        }
        fits
    }

    fn place_compressed(&mut self, block: &CompressedBlock<'_>) -> bool {
        let (first, count) = (block.first_pixel as usize, usize::from(block.count));
        let pixels = self.pixels.get_mut(first..first.saturating_add(count));
        let span = self.spans.get_mut(block.index as usize);
        let (Some(pixels), Some(span)) = (pixels, span) else {
            return false;
        };
        *span = (block.first_pixel, block.count.into());
        rice::decode(block.data, self.header.bits, pixels).is_ok()
    }

    fn take_labels(
        &mut self,
        level: LabelLevel,
        (part, parts): (u16, u16),
        offset: usize,
        bytes: &[u8],
        counts: &mut AssemblyCounts,
    ) -> Result<(), AssemblyError> {
        let refused = self.contradiction("label part", part.into());
        let end = offset + bytes.len();
        let is_last = part.checked_add(1) == Some(parts);
        let due = (self.header.label_level, self.header.label_parts);
        if (level, parts) != due || is_last != (end == self.labels.len()) {
            return Err(refused);
        }
        let part = usize::from(part);
        match (self.parts.state(part), self.labels.get_mut(offset..end)) {
            (Some(true), _) => counts.duplicates += 1,
            (Some(false), Some(target)) => {
                target.copy_from_slice(bytes);
                counts.add(&self.parts.record(part));
                if self.header.blocks == 0 {
                    self.last_data_at = self.now;
                }
            }
            _ => return Err(refused),
        }
        Ok(())
    }

    fn take_end(
        &mut self,
        end: &FrameEnd,
        counts: &mut AssemblyCounts,
    ) -> Result<(), AssemblyError> {
        match self.end {
            Some(before) if before != *end => return Err(self.contradiction("a second end", 0)),
            Some(_) => counts.duplicates += 1,
            None => {
                self.end = Some(*end);
                counts.add(&self.ends.record(0));
            }
        }
        Ok(())
    }

    pub(super) fn missing_runs(&mut self, now: Instant, demand: &Demand) -> Vec<Run> {
        if self.unavailable {
            return Vec::new();
        }
        let blocks = self.header.blocks as usize;
        let before_end = blocks + usize::from(self.header.label_parts);
        let all = before_end + 1;
        // One after the highest packet received, header excluded.
        let next = match (self.parts.next(), self.ends.next()) {
            (_, 1) => all,
            (0, _) => self.blocks.next(),
            (parts, _) => blocks + parts,
        };
        let end = match self.gap {
            _ if demand.silent => all,
            _ if demand.again => next,
            // Only packets before the gap's end: later ones may just be slow.
            Some((since, end)) if now.saturating_duration_since(since) >= demand.wait => end,
            Some(_) => return Vec::new(),
            None => {
                self.gap = Some((now, next)).filter(|_| self.missing_below(next));
                return Vec::new();
            }
        };
        self.gap = None;
        let mut runs = Vec::new();
        let mut left = demand.packets;
        for (arrivals, before) in [
            (&mut self.blocks, 0),
            (&mut self.parts, blocks),
            (&mut self.ends, before_end),
        ] {
            let max_runs = demand.runs.saturating_sub(runs.len());
            let end = end.saturating_sub(before);
            for run in arrivals.request(end, demand.again, max_runs, left) {
                left = left.saturating_sub(run.len());
                runs.push(Run {
                    frame: self.header.frame,
                    first: (1 + before + run.start) as u32,
                    count: run.len() as u32,
                });
            }
        }
        runs
    }

    /// Whether a packet below `next` is missing and not requested.
    fn missing_below(&self, next: usize) -> bool {
        let blocks = self.header.blocks as usize;
        self.blocks.has_gap(next) || self.parts.has_gap(next.saturating_sub(blocks))
    }

    pub(super) fn is_whole(&self) -> bool {
        self.blocks.missing() == 0 && self.parts.missing() == 0 && self.end.is_some()
    }

    pub(super) fn progress(&self) -> Progress {
        // Missing packets do not exceed these counts.
        let (blocks, parts) = (self.header.blocks, self.header.label_parts);
        Progress {
            frame: self.header.frame,
            blocks: (blocks - self.blocks.missing() as u32, blocks),
            label_parts: (parts - self.parts.missing() as u16, parts),
            end: self.end.is_some(),
        }
    }

    pub(super) fn finish(self) -> Result<ReceivedFrame, AssemblyError> {
        let frame = self.header.frame;
        let end = self.end.unwrap_or_default();
        let content = match self.header.pixel_level {
            PixelLevel::None => Content::None,
            PixelLevel::Windows => Content::Windows(self.windows),
            PixelLevel::Frame | PixelLevel::Compressed => {
                // A block at the end of the frame closes the last gap.
                let last = (!self.spans.is_empty()).then_some((self.header.pixels(), 0));
                let spans = self.spans.iter().copied().chain(last);
                let mut expected = 0;
                for (block, (first, count)) in (0..).zip(spans) {
                    if first != expected {
                        return Err(AssemblyError::Gap {
                            frame,
                            block,
                            first,
                            expected,
                        });
                    }
                    expected += count;
                }
                let crc32 = end.pixels_crc32;
                let found = Crc32::new().update_pixels(&self.pixels).finish();
                if found != crc32 {
                    return Err(AssemblyError::BadPixels {
                        frame,
                        found,
                        expected: crc32,
                    });
                }
                Content::Frame(self.pixels)
            }
        };
        Ok(ReceivedFrame {
            header: self.header,
            end,
            mid_exposure: self.mid_exposure,
            content,
            pixel_bytes: self.pixel_bytes,
            header_at: self.header_at,
            last_data_at: self.last_data_at,
            completed_at: self.now,
            sealed_labels: self.labels,
        })
    }
}
