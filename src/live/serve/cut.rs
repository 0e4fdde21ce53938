//! A shot cut into the packets that a client asked for.

use super::packed::packed;
use super::picture::Picture;
use super::select::{brightest_objects, windows};
use skyloop_firmware_sim::time::to_wire;
use skyloop_link::Roles;
use skyloop_protocols::packet::{CRC_LENGTH, HEADER_LENGTH};
use skyloop_protocols::pixels::{
    COMPRESSED_DATA, LABEL_TEXT_PER_PART, OBJECT_LENGTH, OBJECTS_PER_PART, label_parts,
    object_parts, packed_length, pixels_per_block, windows_per_block,
};
use skyloop_protocols::reply::window_length;
use skyloop_protocols::{
    CompressedBlock, EncodeError, FrameEnd, FrameHeader, LabelLevel, LabelPart, MAX_PACKET,
    ObjectPart, Output, Packing, PixelBlock, PixelLevel, Positions, Reply, WindowBlock, WireTime,
    rice,
};
use std::borrow::Cow;
use std::iter::once;
use std::time::{Duration, Instant};

/// The packets of one frame, one after the other. What the pixels themselves decide (windows, compressed blocks, object records) is worked out as the
/// frame is opened, which then waits for all of it; all pixels and label text open it as soon as the label is done.
pub(super) struct Cut {
    header: FrameHeader,
    /// Of all its packets.
    pub time: WireTime,
    /// First pixel of each window.
    windows: Vec<[u16; 2]>,
    /// First pixel, number of pixels and code of each compressed block.
    compressed: Vec<(u32, u16, Vec<u8>)>,
    /// Octets of the object records.
    records: Vec<u8>,
    /// Packets that have been given.
    given: u32,
}

/// The next packet.
pub(super) enum Next<T> {
    /// As it was encoded.
    Packet(Result<T, EncodeError>),
    /// What it holds is not there yet.
    NotYet,
    /// All have been given.
    Over,
}

impl Cut {
    /// Of `picture`, what `output` asks for and `roles` allow; none while too little of it is known, or why there are no words for it.
    pub fn open(
        picture: &Picture,
        output: &Output,
        positions: Option<&Positions>,
        roles: Roles,
    ) -> Result<Option<Cut>, String> {
        let Some(opening) = &picture.opening else {
            return Ok(None);
        };
        let pixel_level = match roles.pixels {
            true => output.pixels,
            false => PixelLevel::None,
        };
        let label_level = match roles.labels {
            true => output.labels,
            false => LabelLevel::None,
        };
        let decided = matches!(pixel_level, PixelLevel::None | PixelLevel::Frame)
            && label_level != LabelLevel::Objects;
        let shot = picture.shot.as_deref();
        if shot.is_none() && !decided {
            return Ok(None);
        }
        let detector = &opening.camera.detector;
        let instant = |epoch| to_wire(epoch).ok_or("a time beyond the time code");
        let (width, height) = (detector.width as u16, detector.height as u16);
        let packing = Packing::for_bits(detector.bits);
        let size = u16::from(output.window_size).min(width).min(height) as u8;
        let windows = match (pixel_level, shot) {
            (PixelLevel::Windows, Some(shot)) => windows(shot, size, output.windows, positions),
            _ => Vec::new(),
        };
        let compressed = match (pixel_level, shot) {
            (PixelLevel::Compressed, Some(shot)) => compress(&shot.frame.digits, detector.bits),
            _ => Vec::new(),
        };
        let records = match (label_level, shot) {
            (LabelLevel::Objects, Some(shot)) => brightest_objects(shot, output.objects),
            _ => Vec::new(),
        };
        let objects = (records.len() / OBJECT_LENGTH) as u16;
        let (label_bytes, parts) = match label_level {
            LabelLevel::None => (0, Some(0)),
            LabelLevel::Objects => (records.len(), Some(object_parts(objects))),
            LabelLevel::Text => {
                let octets = picture.text_length().unwrap_or_default();
                (octets, u32::try_from(octets).ok().and_then(label_parts))
            }
        };
        let mut header = FrameHeader {
            frame: opening.number,
            attitude_sequence: opening.key.sequence,
            width,
            height,
            bits: detector.bits,
            packing,
            pixel_level,
            label_level,
            window_size: if pixel_level == PixelLevel::Windows {
                size
            } else {
                0
            },
            windows: windows.len() as u16,
            blocks: compressed.len() as u32,
            label_parts: parts.ok_or("more labels than packets can number")?,
            label_bytes: label_bytes as u32,
            exposure_start: instant(opening.exposure.start)?,
            exposure_end: instant(opening.exposure.end)?,
            seed: opening.key.seed,
            gain_e_per_dn: detector.gain_e_per_dn,
            offset_dn: detector.offset_dn,
        };
        if let Some(blocks) = header.blocks_due() {
            header.blocks = blocks;
        }
        Ok(Some(Cut {
            time: instant(opening.exposure.mid)?,
            header,
            windows,
            compressed,
            records,
            given: 0,
        }))
    }

    /// How many packets the frame has.
    pub fn packets(&self) -> u32 {
        self.header.blocks + u32::from(self.header.label_parts) + 2
    }

    /// How many bytes each of its packets has.
    pub fn lengths(&self) -> impl Iterator<Item = usize> {
        let header = &self.header;
        let (packing, size) = (header.packing, header.window_size);
        // Of so many items, with at most so many in a packet, those of one packet.
        let share =
            |all: usize, most: usize, place: usize| all.saturating_sub(place * most).min(most);
        let blocks = (0..header.blocks as usize).map(move |place| match header.pixel_level {
            PixelLevel::Windows => {
                let most = windows_per_block(packing, size);
                let windows = share(self.windows.len(), most, place);
                WindowBlock::FIELDS_LENGTH + windows * window_length(packing, size)
            }
            PixelLevel::Compressed => {
                let code = self.compressed.get(place);
                CompressedBlock::FIELDS_LENGTH + code.map_or(0, |(_, _, code)| code.len())
            }
            _ => {
                let pixels = header.pixels() as usize;
                let pixels = share(pixels, pixels_per_block(packing), place);
                PixelBlock::FIELDS_LENGTH + packed_length(packing, pixels)
            }
        });
        let parts = (0..usize::from(header.label_parts)).map(move |part| {
            let (fields, most) = match header.label_level {
                LabelLevel::Objects => {
                    (ObjectPart::FIELDS_LENGTH, OBJECTS_PER_PART * OBJECT_LENGTH)
                }
                _ => (LabelPart::FIELDS_LENGTH, LABEL_TEXT_PER_PART),
            };
            fields + share(header.label_bytes as usize, most, part)
        });
        let fields = once(FrameHeader::FIELDS_LENGTH).chain(blocks).chain(parts);
        let fields = fields.chain(once(FrameEnd::FIELDS_LENGTH));
        fields.map(|fields| HEADER_LENGTH + fields + CRC_LENGTH)
    }

    /// Whether all packets have been given.
    pub fn is_over(&self) -> bool {
        self.given >= self.packets()
    }

    /// Gives the next packet to `encode`, if what it holds is there; its link has it on its way after a `backlog`.
    pub fn next<T>(
        &mut self,
        picture: &Picture,
        backlog: Duration,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Next<T> {
        if self.is_over() {
            return Next::Over;
        }
        let number = self.given;
        let packet = match number.checked_sub(1) {
            None => Some(encode(&Reply::FrameHeader(self.header))),
            Some(place) => match place.checked_sub(self.header.blocks) {
                None => self.pixels(picture, place, encode),
                // What follows the pixels waits until all of them are there.
                Some(_) if picture.shot.is_none() => None,
                Some(part) if part < u32::from(self.header.label_parts) => {
                    Some(self.labels(picture, part as u16, backlog, encode))
                }
                Some(_) => Some(encode(&Reply::FrameEnd(
                    picture.closing(Instant::now(), backlog),
                ))),
            },
        };
        match packet {
            None => Next::NotYet,
            Some(packet) => {
                self.given += 1;
                Next::Packet(packet)
            }
        }
    }

    /// None while its pixels are not there.
    fn pixels<T>(
        &self,
        picture: &Picture,
        index: u32,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Option<Result<T, EncodeError>> {
        match self.header.pixel_level {
            PixelLevel::Windows => Some(self.window_block(picture, index, encode)),
            PixelLevel::Compressed => Some(self.compressed_block(index, encode)),
            _ => {
                let packing = self.header.packing;
                let size = pixels_per_block(packing);
                let first = index as usize * size;
                let end = (first + size).min(self.header.pixels() as usize);
                let pixels = picture.digits().get(first..end)?;
                let mut octets = [0; MAX_PACKET];
                let data = &mut octets[..packed_length(packing, pixels.len())];
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
        picture: &Picture,
        index: u32,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Result<T, EncodeError> {
        let (packing, size) = (self.header.packing, self.header.window_size);
        let most = windows_per_block(packing, size);
        let windows = self.windows.chunks(most).nth(index as usize);
        let windows = windows.ok_or(NO_SUCH_PACKET)?;
        let (width, side) = (usize::from(self.header.width), usize::from(size));
        let mut data = Vec::with_capacity(windows.len() * window_length(packing, size));
        let mut pixels = Vec::with_capacity(side * side);
        for [column, row] in windows {
            data.extend(column.to_be_bytes());
            data.extend(row.to_be_bytes());
            pixels.clear();
            let rows = picture.digits().chunks(width).skip(usize::from(*row));
            for digits in rows.take(side) {
                let digits = digits.get(usize::from(*column)..).unwrap_or_default();
                pixels.extend(digits.iter().take(side));
            }
            let at = data.len();
            data.resize(at + packed_length(packing, pixels.len()), 0);
            packed(packing, &pixels, &mut data[at..])?;
        }
        encode(&Reply::Windows(WindowBlock {
            frame: self.header.frame,
            index,
            first: (index as usize * most) as u16,
            count: windows.len() as u8,
            size,
            packing,
            data: &data,
        }))
    }

    fn labels<'a, T>(
        &'a self,
        picture: &'a Picture,
        part: u16,
        backlog: Duration,
        encode: impl FnOnce(&Reply<'_>) -> Result<T, EncodeError>,
    ) -> Result<T, EncodeError> {
        let (frame, parts) = (self.header.frame, self.header.label_parts);
        let octets = |[head, tail]: [&'a [u8]; 2], most: usize| {
            let from = usize::from(part) * most;
            piece(head, tail, from, most).ok_or(NO_SUCH_PACKET)
        };
        match self.header.label_level {
            LabelLevel::Objects => encode(&Reply::Objects(ObjectPart {
                frame,
                part,
                parts,
                data: &octets([&self.records, &[]], OBJECTS_PER_PART * OBJECT_LENGTH)?,
            })),
            _ => {
                let text = picture.text(Instant::now(), backlog);
                let text = text.ok_or(NO_SUCH_PACKET)?.map(str::as_bytes);
                encode(&Reply::Labels(LabelPart {
                    frame,
                    part,
                    parts,
                    text: &octets(text, LABEL_TEXT_PER_PART)?,
                }))
            }
        }
    }
}

/// Octets of two texts, one behind the other, from one on and at most so many; none beyond their end.
fn piece<'a>(head: &'a [u8], tail: &'a [u8], from: usize, most: usize) -> Option<Cow<'a, [u8]>> {
    let end = head.len() + tail.len();
    let to = end.min(from.checked_add(most)?);
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

/// The header counts its packets: none is asked for that is not there.
const NO_SUCH_PACKET: EncodeError = EncodeError::Inconsistent {
    what: "the frame's header and the packets of its frame",
};

/// All pixels in blocks that each fit a packet: first pixel, number of pixels and code.
fn compress(digits: &[u16], bits: u8) -> Vec<(u32, u16, Vec<u8>)> {
    /// A block's count has 16 bits.
    const MOST: usize = u16::MAX as usize / rice::BLOCK * rice::BLOCK;
    let mut blocks = Vec::new();
    let mut first = 0;
    while first < digits.len() {
        let mut code = vec![0; COMPRESSED_DATA];
        let some = &digits[first..digits.len().min(first + MOST)];
        let (taken, octets) = rice::encode(some, bits, &mut code);
        if taken == 0 {
            break; // digits of more than `bits` bits, which no detector makes
        }
        code.truncate(octets);
        blocks.push((first as u32, taken as u16, code));
        first += taken;
    }
    blocks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_two_texts_are_those_of_both_together() {
        let octets: Vec<u8> = (0..=255).collect();
        for (head, tail, most) in [
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
            let all = &octets[..head + tail];
            let (head, tail) = all.split_at(head);
            let from = (0..).map(|part| part * most);
            let parts: Vec<_> = from
                .map_while(|from| piece(head, tail, from, most))
                .collect();
            // X-Val: those of one slice.
            let whole: Vec<&[u8]> = all.chunks(most).collect();
            assert_eq!(parts, whole, "{} and {}", head.len(), tail.len());
        }
        assert_eq!(piece(&[1], &[2], usize::MAX, 2), None);
    }
}
