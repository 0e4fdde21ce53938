//! Frames cut into packets at any output level, like the emulator's.

use std::time::Instant;

use skyloop_firmware_sim::reassembly::{Assembler, AssemblyError};
use skyloop_firmware_sim::received::ReceivedFrame;
use skyloop_firmware_sim::time::to_wire;
use skyloop_protocols::crc::Crc32;
use skyloop_protocols::pixels::{
    COMPRESSED_DATA, OBJECT_LENGTH, OBJECTS_PER_PART, blocks, label_parts, label_texts,
    object_parts, pack, packed_length, windows_per_block,
};
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{
    CompressedBlock, FrameEnd, FrameHeader, LabelLevel, LabelPart, MAX_PACKET, ObjectPart,
    ObjectRecord, Output, Packing, PixelBlock, PixelLevel, Reply, WindowBlock, WireTime, rice,
};

use super::{Field, Noise, Star};

#[derive(Default)]
pub struct Sender(SequenceCounts);

impl Sender {
    pub fn reply(&mut self, reply: &Reply<'_>, time: WireTime) -> Vec<u8> {
        let mut buffer = [0; MAX_PACKET];
        let count = self.0.next(reply.apid());
        let length = reply.encode(count, time, &mut buffer).unwrap();
        buffer[..length].to_vec()
    }

    pub fn end(&mut self, frame: u32, pixels: &[u16], time: WireTime) -> Vec<u8> {
        let end = FrameEnd {
            frame,
            pixels_crc32: Crc32::new().update_pixels(pixels).finish(),
            ..FrameEnd::default()
        };
        self.reply(&Reply::FrameEnd(end), time)
    }
}

pub struct Exposed {
    pub field: Field,
    pub frame: u32,
    pub attitude: u32,
    pub stars: Vec<Star>,
    pub pixels: Vec<u16>,
    pub text: String,
}

impl Exposed {
    pub fn new(field: Field, frame: u32, stars: Vec<Star>, pixels: Vec<u16>) -> Self {
        let text = labels(&field, frame, &stars);
        Self {
            field,
            frame,
            attitude: frame,
            stars,
            pixels,
            text,
        }
    }

    /// Packets of the frame, with windows around `positions` or around the brightest stars.
    pub fn packets(
        &self,
        sender: &mut Sender,
        output: &Output,
        positions: &[[u16; 2]],
        time: WireTime,
    ) -> Vec<Vec<u8>> {
        let corners = self.corners(output, positions);
        let header = self.header(output, corners.len());
        let mut packets = vec![sender.reply(&Reply::FrameHeader(header), time)];
        match output.pixels {
            PixelLevel::None => {}
            PixelLevel::Windows => self.windows(&header, &corners, |windows| {
                packets.push(sender.reply(&Reply::Windows(windows), time));
            }),
            PixelLevel::Frame => self.blocks(&header, |block| {
                packets.push(sender.reply(&Reply::PixelBlock(block), time));
            }),
            PixelLevel::Compressed => self.compressed(|block| {
                packets.push(sender.reply(&Reply::Compressed(block), time));
            }),
        }
        let (frame, parts) = (self.frame, header.label_parts);
        let records = self.records(output.objects);
        let data: Vec<&[u8]> = match output.labels {
            LabelLevel::None => Vec::new(),
            LabelLevel::Text => label_texts(self.text.as_bytes()).collect(),
            LabelLevel::Objects => records.chunks(OBJECTS_PER_PART * OBJECT_LENGTH).collect(),
        };
        for (part, data) in (0..).zip(data) {
            let reply = if output.labels == LabelLevel::Text {
                Reply::Labels(LabelPart {
                    frame,
                    part,
                    parts,
                    text: data,
                })
            } else {
                Reply::Objects(ObjectPart {
                    frame,
                    part,
                    parts,
                    data,
                })
            };
            packets.push(sender.reply(&reply, time));
        }
        packets.push(sender.end(frame, &self.pixels, time));
        packets
    }

    pub fn header(&self, output: &Output, windows: usize) -> FrameHeader {
        let has_windows = output.pixels == PixelLevel::Windows;
        let records = self.records(output.objects).len();
        let (label_bytes, label_parts) = match output.labels {
            LabelLevel::None => (0, 0),
            LabelLevel::Objects => (records, object_parts((records / OBJECT_LENGTH) as u16)),
            LabelLevel::Text => {
                let bytes = self.text.len();
                (bytes, label_parts(bytes as u32).unwrap())
            }
        };
        let mut header = FrameHeader {
            frame: self.frame,
            attitude_sequence: self.attitude,
            width: self.field.width as u16,
            height: self.field.height as u16,
            bits: self.field.bits,
            packing: Packing::for_bits(self.field.bits),
            pixel_level: output.pixels,
            label_level: output.labels,
            window_size: if has_windows { output.window_size } else { 0 },
            windows: if has_windows { windows as u16 } else { 0 },
            blocks: 0,
            label_parts,
            label_bytes: label_bytes as u32,
            exposure_start: WireTime(1),
            exposure_end: WireTime(2),
            seed: 1,
            gain_e_per_dn: self.field.gain_e_per_dn,
            offset_dn: self.field.offset_dn,
        };
        match header.blocks_due() {
            Some(blocks) => header.blocks = blocks,
            None => self.compressed(|_| header.blocks += 1),
        }
        header
    }

    /// First pixels of the windows.
    fn corners(&self, output: &Output, positions: &[[u16; 2]]) -> Vec<[u16; 2]> {
        let stars = self.stars.iter().take(output.windows.into());
        let stars = stars.map(|star| [star.x.round() as u16, star.y.round() as u16]);
        let centres: Vec<[u16; 2]> = match positions {
            [] => stars.collect(),
            listed => listed.to_vec(),
        };
        let size = u16::from(output.window_size);
        let last = [self.field.width, self.field.height].map(|end| end as u16 - size);
        let shifted = |at: u16, last: u16| at.saturating_sub(size / 2).min(last);
        let centres = centres.into_iter();
        centres
            .map(|[x, y]| [shifted(x, last[0]), shifted(y, last[1])])
            .collect()
    }

    fn blocks(&self, header: &FrameHeader, mut send: impl FnMut(PixelBlock<'_>)) {
        for block in blocks(&self.pixels, header.packing) {
            let mut data = vec![0; packed_length(header.packing, block.pixels.len())];
            pack(header.packing, block.pixels, &mut data).unwrap();
            send(PixelBlock {
                frame: self.frame,
                index: block.index,
                first_pixel: block.first_pixel,
                count: block.pixels.len() as u16,
                packing: header.packing,
                data: &data,
            });
        }
    }

    fn windows(
        &self,
        header: &FrameHeader,
        corners: &[[u16; 2]],
        mut send: impl FnMut(WindowBlock<'_>),
    ) {
        let (size, packing) = (header.window_size, header.packing);
        let n = usize::from(size);
        let max = windows_per_block(packing, size);
        for (index, corners) in corners.chunks(max).enumerate() {
            let mut data = Vec::new();
            for [column, row] in corners {
                let rows = usize::from(*row)..usize::from(*row) + n;
                let first = rows.map(|row| row * self.field.width + usize::from(*column));
                let pixels = first.flat_map(|first| self.pixels[first..first + n].to_vec());
                data.extend(column.to_be_bytes());
                data.extend(row.to_be_bytes());
                let mut packed = vec![0; packed_length(packing, n * n)];
                pack(packing, &pixels.collect::<Vec<_>>(), &mut packed).unwrap();
                data.extend(packed);
            }
            send(WindowBlock {
                frame: self.frame,
                index: index as u32,
                first: (index * max) as u16,
                count: corners.len() as u8,
                size,
                packing,
                data: &data,
            });
        }
    }

    fn compressed(&self, mut send: impl FnMut(CompressedBlock<'_>)) {
        let (mut index, mut first) = (0, 0);
        while first < self.pixels.len() {
            let mut code = [0; COMPRESSED_DATA];
            let (count, length) = rice::encode(&self.pixels[first..], self.field.bits, &mut code);
            assert!(count > 0);
            send(CompressedBlock {
                frame: self.frame,
                index,
                first_pixel: first as u32,
                count: count as u16,
                data: &code[..length],
            });
            (index, first) = (index + 1, first + count);
        }
    }

    fn records(&self, max: u16) -> Vec<u8> {
        let stars = self.stars.iter().enumerate().take(max.into());
        let record = |(index, star): (usize, &Star)| {
            let snr = self.field.snr(*star);
            let mut id = [0; 16];
            let name = format!("HIP {index}");
            id[..name.len()].copy_from_slice(name.as_bytes());
            let record = ObjectRecord {
                is_rso: false,
                in_frame: true,
                visible: snr >= 3.0,
                id,
                x_px: star.x,
                y_px: star.y,
                dx_px: 0.0,
                dy_px: 0.0,
                mag: f32::NAN,
                snr: snr as f32,
                electrons: star.electrons as f32,
            };
            record.to_bytes()
        };
        stars.flat_map(record).collect()
    }
}

/// Label line of some stars, with more fields than the score uses.
fn labels(field: &Field, frame: u32, stars: &[Star]) -> String {
    let object = |(index, star): (usize, &Star)| {
        let Star { x, y, electrons } = star;
        let snr = field.snr(*star);
        let visible = snr >= 3.0;
        format!(
            "{{\"kind\":\"star\",\"id\":\"HIP {index}\",\"names\":[\"β Test\"],\"x_px\":{x},\"y_px\":{y},\
             \"electrons\":{electrons},\"snr\":{snr},\"in_frame\":true,\"visible\":{visible}}}"
        )
    };
    let objects: Vec<String> = stars.iter().enumerate().map(object).collect();
    format!("{{\"frame\":{frame},\"objects\":[{}]}}", objects.join(","))
}

/// Feeds packets. Returns complete frames and errors.
pub fn feed(
    assembler: &mut Assembler,
    packets: &[Vec<u8>],
) -> (Vec<ReceivedFrame>, Vec<AssemblyError>) {
    let (mut frames, mut errors) = (Vec::new(), Vec::new());
    for packet in packets {
        let (header, reply) = Reply::decode(packet).unwrap();
        match assembler.accept(packet, &header, &reply, Instant::now()) {
            Ok(frame) => frames.extend(frame),
            Err(error) => errors.push(error),
        }
    }
    (frames, errors)
}

pub fn shuffle(packets: &mut [Vec<u8>], noise: &mut Noise) {
    for index in (1..packets.len()).rev() {
        packets.swap(index, noise.bits() as usize % (index + 1));
    }
}

pub fn now() -> WireTime {
    let now = hifitime::Epoch::now().ok().and_then(to_wire);
    now.unwrap_or_default()
}
