//! A frame divided into the packets that its client has selected.

use super::frame_job::FrameJob;
use super::pack::packed;
use super::packet_sizes::{Content, HEADER_AND_END, Packets};
use super::select::{brightest_objects, windows};
use hifitime::Epoch;
use skyloop_firmware_sim::time::to_wire;
use skyloop_link::Roles;
use skyloop_protocols::pixels::{
    COMPRESSED_DATA, LABEL_TEXT_PER_PART, OBJECT_LENGTH, OBJECTS_PER_PART, label_parts,
    object_parts, packed_length, pixels_per_block, windows_per_block,
};
use skyloop_protocols::reply::window_length;
use skyloop_protocols::{
    CompressedBlock, EncodeError, FrameHeader, LabelLevel, LabelPart, MAX_PACKET, ObjectPart,
    Output, Packing, PixelBlock, PixelLevel, Positions, Reply, WindowBlock, WireTime, rice,
};
use skyloop_render::engine::FrameInfo;
use std::borrow::Cow;
use std::time::{Duration, Instant};

/// The packets of one frame, in order. Windows, compressed blocks and object records depend on the
/// pixels, so they need the whole frame; plain pixels and label text need the label alone.
pub(super) struct FramePackets {
    header: FrameHeader,
    /// Time stamp of all its packets.
    pub time: WireTime,
    /// First pixel of each window.
    windows: Vec<[u16; 2]>,
    /// First pixel, number of pixels and code of each compressed block.
    compressed: Vec<(u32, u16, Vec<u8>)>,
    /// Encoded object records.
    records: Vec<u8>,
    /// Number of packets that were encoded.
    encoded: u32,
}

pub(super) enum Next<T> {
    /// Result of the encoder.
    Packet(Result<T, EncodeError>),
    /// Its content is not rendered yet.
    NotYet,
    /// All packets were encoded.
    Over,
}

impl FramePackets {
    /// The packets of a frame, by what `output` selects and `roles` allow; none while too little of
    /// it is rendered. Errors: the protocol cannot represent it.
    pub fn open(
        job: &FrameJob,
        output: &Output,
        positions: Option<&Positions>,
        roles: Roles,
    ) -> Result<Option<FramePackets>, String> {
        let Some(opening) = &job.opening else {
            return Ok(None);
        };
        let output = permitted(output, roles);
        let (pixels, labels) = (output.pixels, output.labels);
        let needs_frame = matches!(pixels, PixelLevel::Windows | PixelLevel::Compressed)
            || labels == LabelLevel::Objects;
        let exposed = job.exposed.as_deref().filter(|_| needs_frame);
        if needs_frame && exposed.is_none() {
            return Ok(None);
        }
        let detector = &opening.camera.detector;
        let (width, height) = (detector.width as u16, detector.height as u16);
        let size = u16::from(output.window_size).min(width).min(height) as u8;
        let (mut selected, mut compressed, mut records) = (Vec::new(), Vec::new(), Vec::new());
        if let Some(exposed) = exposed {
            match pixels {
                PixelLevel::Windows => {
                    selected = windows(exposed, size, output.windows, positions);
                }
                PixelLevel::Compressed => {
                    compressed = compress(&exposed.frame.dn, detector.bits);
                }
                PixelLevel::None | PixelLevel::Frame => {}
            }
            if labels == LabelLevel::Objects {
                records = brightest_objects(exposed, output.objects);
            }
        }
        let label_bytes = match labels {
            LabelLevel::Text => job.text_length().unwrap_or_default(),
            LabelLevel::None | LabelLevel::Objects => records.len(),
        };
        let mut header = header(opening, &output, label_bytes)?;
        if pixels == PixelLevel::Windows {
            header.window_size = size;
        }
        header.windows = selected.len() as u16;
        header.blocks = compressed.len() as u32;
        header.blocks = header.blocks_due().unwrap_or(header.blocks);
        Ok(Some(FramePackets {
            time: wire_time(opening.exposure.mid)?,
            header,
            windows: selected,
            compressed,
            records,
            encoded: 0,
        }))
    }

    pub fn count(&self) -> u32 {
        self.header.blocks + u32::from(self.header.label_parts) + 2
    }

    pub fn sizes(&self) -> Vec<Packets> {
        let header = &self.header;
        let mut sizes = HEADER_AND_END.to_vec();
        match header.pixel_level {
            PixelLevel::None => {}
            PixelLevel::Windows => {
                let content = Content::Windows(header.packing, header.window_size);
                sizes.extend(content.packets(self.windows.len()));
            }
            PixelLevel::Frame => {
                let content = Content::Pixels(header.packing);
                sizes.extend(content.packets(header.pixels() as usize));
            }
            PixelLevel::Compressed => {
                let codes = self.compressed.iter().map(|(_, _, code)| code.len());
                sizes.extend(codes.map(|bytes| Content::Code.packet(bytes)));
            }
        }
        let bytes = header.label_bytes as usize;
        match header.label_level {
            LabelLevel::None => {}
            LabelLevel::Objects => {
                sizes.extend(Content::Objects.packets(bytes / OBJECT_LENGTH));
            }
            LabelLevel::Text => sizes.extend(Content::Text.packets(bytes)),
        }
        sizes
    }

    /// Whether all packets were encoded.
    pub fn is_over(&self) -> bool {
        self.encoded >= self.count()
    }

    /// Passes the next packet to `encode`, if its content is rendered. The packet leaves after a
    /// `backlog`.
    pub fn next<T>(
        &mut self,
        job: &FrameJob,
        backlog: Duration,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Next<T> {
        if self.is_over() {
            return Next::Over;
        }
        let number = self.encoded;
        let packet = match number.checked_sub(1) {
            None => Some(encode(&Reply::FrameHeader(self.header))),
            Some(place) => match place.checked_sub(self.header.blocks) {
                None => self.pixels(job, place, encode),
                // Labels and the end follow the complete pixels.
                Some(_) if job.exposed.is_none() => None,
                Some(part) if part < u32::from(self.header.label_parts) => {
                    Some(self.labels(job, part as u16, backlog, encode))
                }
                Some(_) => Some(encode(&Reply::FrameEnd(
                    job.closing(Instant::now(), backlog),
                ))),
            },
        };
        match packet {
            None => Next::NotYet,
            Some(packet) => {
                self.encoded += 1;
                Next::Packet(packet)
            }
        }
    }

    /// `None` until its pixels are rendered.
    fn pixels<T>(
        &self,
        job: &FrameJob,
        index: u32,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Option<Result<T, EncodeError>> {
        match self.header.pixel_level {
            PixelLevel::Windows => Some(self.window_block(job, index, encode)),
            PixelLevel::Compressed => Some(self.compressed_block(index, encode)),
            _ => {
                let packing = self.header.packing;
                let size = pixels_per_block(packing);
                let first = index as usize * size;
                let end = (first + size).min(self.header.pixels() as usize);
                let pixels = job.dn().get(first..end)?;
                let mut buffer = [0; MAX_PACKET];
                let data = &mut buffer[..packed_length(packing, pixels.len())];
                let block = packed(packing, pixels, data).and_then(|()| {
                    encode(&Reply::PixelBlock(PixelBlock {
                        frame: self.header.frame,
                        index,
                        first_pixel: first as u32,
                        count: pixels.len() as u16,
                        packing,
                        data,
                    }))
                });
                Some(block)
            }
        }
    }

    fn compressed_block<T>(
        &self,
        index: u32,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Result<T, EncodeError> {
        let block = self.compressed.get(index as usize);
        let (first_pixel, count, data) = block.ok_or(NO_SUCH_PACKET)?;
        encode(&Reply::Compressed(CompressedBlock {
            frame: self.header.frame,
            index,
            first_pixel: *first_pixel,
            count: *count,
            data,
        }))
    }

    fn window_block<T>(
        &self,
        job: &FrameJob,
        index: u32,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Result<T, EncodeError> {
        let (packing, size) = (self.header.packing, self.header.window_size);
        let max = windows_per_block(packing, size);
        let windows = self.windows.chunks(max).nth(index as usize);
        let windows = windows.ok_or(NO_SUCH_PACKET)?;
        let (width, side) = (usize::from(self.header.width), usize::from(size));
        let mut data = Vec::with_capacity(windows.len() * window_length(packing, size));
        let mut pixels = Vec::with_capacity(side * side);
        for [column, row] in windows {
            data.extend(column.to_be_bytes());
            data.extend(row.to_be_bytes());
            pixels.clear();
            let rows = job.dn().chunks(width).skip(usize::from(*row));
            for row in rows.take(side) {
                let row = row.get(usize::from(*column)..).unwrap_or_default();
                pixels.extend(row.iter().take(side));
            }
            let at = data.len();
            data.resize(at + packed_length(packing, pixels.len()), 0);
            packed(packing, &pixels, &mut data[at..])?;
        }
        encode(&Reply::Windows(WindowBlock {
            frame: self.header.frame,
            index,
            first: (index as usize * max) as u16,
            count: windows.len() as u8,
            size,
            packing,
            data: &data,
        }))
    }

    fn labels<'a, T>(
        &'a self,
        job: &'a FrameJob,
        part: u16,
        backlog: Duration,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Result<T, EncodeError> {
        let (frame, parts) = (self.header.frame, self.header.label_parts);
        let piece_of = |[head, tail]: [&'a [u8]; 2], max: usize| {
            let from = usize::from(part) * max;
            piece(head, tail, from, max).ok_or(NO_SUCH_PACKET)
        };
        match self.header.label_level {
            LabelLevel::Objects => encode(&Reply::Objects(ObjectPart {
                frame,
                part,
                parts,
                data: &piece_of([&self.records, &[]], OBJECTS_PER_PART * OBJECT_LENGTH)?,
            })),
            _ => {
                let text = job.text(Instant::now(), backlog);
                let text = text.ok_or(NO_SUCH_PACKET)?.map(str::as_bytes);
                encode(&Reply::Labels(LabelPart {
                    frame,
                    part,
                    parts,
                    text: &piece_of(text, LABEL_TEXT_PER_PART)?,
                }))
            }
        }
    }
}

/// The part of an output that a link may carry.
fn permitted(output: &Output, roles: Roles) -> Output {
    let mut output = *output;
    if !roles.pixels {
        output.pixels = PixelLevel::None;
    }
    if !roles.labels {
        output.labels = LabelLevel::None;
    }
    output
}

fn wire_time(epoch: Epoch) -> Result<WireTime, String> {
    to_wire(epoch).ok_or_else(|| "a time beyond the time code".to_string())
}

/// The header of a frame, without windows and compressed blocks.
fn header(opening: &FrameInfo, output: &Output, label_bytes: usize) -> Result<FrameHeader, String> {
    let detector = &opening.camera.detector;
    let label_parts = match output.labels {
        LabelLevel::None => Some(0),
        LabelLevel::Objects => Some(object_parts((label_bytes / OBJECT_LENGTH) as u16)),
        LabelLevel::Text => u32::try_from(label_bytes).ok().and_then(label_parts),
    };
    Ok(FrameHeader {
        frame: opening.number,
        attitude_sequence: opening.key.sequence,
        width: detector.width as u16,
        height: detector.height as u16,
        bits: detector.bits,
        packing: Packing::for_bits(detector.bits),
        pixel_level: output.pixels,
        label_level: output.labels,
        window_size: 0,
        windows: 0,
        blocks: 0,
        label_parts: label_parts.ok_or("more labels than packets can number")?,
        label_bytes: label_bytes as u32,
        exposure_start: wire_time(opening.exposure.start)?,
        exposure_end: wire_time(opening.exposure.end)?,
        seed: opening.key.seed,
        gain_e_per_dn: detector.gain_e_per_dn,
        offset_dn: detector.offset_dn,
    })
}

/// At most `max` bytes of two joined texts from `from` on; none beyond their end.
fn piece<'a>(head: &'a [u8], tail: &'a [u8], from: usize, max: usize) -> Option<Cow<'a, [u8]>> {
    let end = head.len() + tail.len();
    let to = end.min(from.checked_add(max)?);
    let of_tail = |at: usize| at.saturating_sub(head.len());
    let first = head.get(from.min(head.len())..to.min(head.len()))?;
    let second = tail.get(of_tail(from)..of_tail(to))?;
    match (first, second) {
        ([], []) => None,
        (first, []) => Some(Cow::Borrowed(first)),
        ([], second) => Some(Cow::Borrowed(second)),
        (first, second) => Some(Cow::Owned([first, second].concat())),
    }
}

/// A packet beyond the number in the header.
const NO_SUCH_PACKET: EncodeError = EncodeError::Inconsistent {
    what: "the frame's header and the packets of its frame",
};

/// All pixels in blocks that each fit into a packet: first pixel, number of pixels and code.
fn compress(dn: &[u16], bits: u8) -> Vec<(u32, u16, Vec<u8>)> {
    /// The count of a block has 16 bits.
    const MAX: usize = u16::MAX as usize / rice::BLOCK * rice::BLOCK;
    let mut blocks = Vec::new();
    let mut first = 0;
    while first < dn.len() {
        let mut code = vec![0; COMPRESSED_DATA];
        let some = &dn[first..dn.len().min(first + MAX)];
        let (taken, bytes) = rice::encode(some, bits, &mut code);
        if taken == 0 {
            break; // pixel values of more than `bits` bits, which no detector has
        }
        code.truncate(bytes);
        blocks.push((first as u32, taken as u16, code));
        first += taken;
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_two_texts_equal_those_of_the_joined_text() {
        let bytes: Vec<u8> = (0..=255).collect();
        for (head, tail, max) in [
            (0, 0, 5),
            (0, 3, 5),
            (3, 0, 5),
            (5, 1, 5),
            (10, 5, 5),
            (4, 1, 5),
            (9, 8, 5),
            (2, 20, 5),
            (100, 77, 64),
            (128, 128, 64),
            (7, 7, 1),
        ] {
            let all = &bytes[..head + tail];
            let (head, tail) = all.split_at(head);
            let from = (0..).map(|part| part * max);
            let parts: Vec<_> = from
                .map_while(|from| piece(head, tail, from, max))
                .collect();
            // X-Val: chunks of one slice.
            let whole: Vec<&[u8]> = all.chunks(max).collect();
            assert_eq!(parts, whole, "{} and {}", head.len(), tail.len());
        }
        assert_eq!(piece(&[1], &[2], usize::MAX, 2), None);
    }
}
