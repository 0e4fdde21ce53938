//! Frames cut into packets, as an emulator would.

use skyloop_firmware_sim::time::to_wire;
use skyloop_protocols::crc::Crc32;
use skyloop_protocols::pixels::{
    blocks, blocks_in_frame, label_parts, label_texts, pack, packed_length,
};
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{
    FrameEnd, FrameHeader, LabelLevel, LabelPart, MAX_PACKET, Packing, PixelBlock, PixelLevel,
    Reply, WireTime,
};

use super::{Field, Star};

/// What an emulator sends, numbered.
#[derive(Default)]
pub struct Sender {
    pub counts: SequenceCounts,
}

impl Sender {
    pub fn reply(&mut self, reply: &Reply<'_>, time: WireTime) -> Vec<u8> {
        let mut buffer = [0; MAX_PACKET];
        let length = reply
            .encode(self.counts.next(reply.apid()), time, &mut buffer)
            .unwrap();
        buffer[..length].to_vec()
    }

    /// All packets of one frame, in order.
    pub fn frame(
        &mut self,
        header: &FrameHeader,
        pixels: &[u16],
        labels: &str,
        time: WireTime,
    ) -> Vec<Vec<u8>> {
        let mut packets = self.opened(header, pixels, labels, time);
        packets.push(self.end(header.frame, pixels, time));
        packets
    }

    /// What closes a frame of these pixels.
    pub fn end(&mut self, frame: u32, pixels: &[u16], time: WireTime) -> Vec<u8> {
        let end = FrameEnd {
            frame,
            pixels_crc32: Crc32::new().update_pixels(pixels).finish(),
            ..FrameEnd::default()
        };
        self.reply(&Reply::FrameEnd(end), time)
    }

    /// Header, pixel blocks and label parts of one frame, in order.
    pub fn opened(
        &mut self,
        header: &FrameHeader,
        pixels: &[u16],
        labels: &str,
        time: WireTime,
    ) -> Vec<Vec<u8>> {
        let mut packets = vec![self.reply(&Reply::FrameHeader(*header), time)];
        for block in blocks(pixels, header.packing) {
            let mut data = vec![0; packed_length(header.packing, block.pixels.len())];
            pack(header.packing, block.pixels, &mut data).unwrap();
            let block = PixelBlock {
                frame: header.frame,
                index: block.index,
                first_pixel: block.first_pixel,
                count: block.pixels.len() as u16,
                packing: header.packing,
                data: &data,
            };
            packets.push(self.reply(&Reply::PixelBlock(block), time));
        }
        packets.extend(self.texts(header, labels, time));
        packets
    }

    /// The label parts of one frame, in order.
    pub fn texts(&mut self, header: &FrameHeader, labels: &str, time: WireTime) -> Vec<Vec<u8>> {
        let texts = (0..).zip(label_texts(labels.as_bytes()));
        texts
            .map(|(part, text)| {
                let part = LabelPart {
                    frame: header.frame,
                    part,
                    parts: header.label_parts,
                    text,
                };
                self.reply(&Reply::Labels(part), time)
            })
            .collect()
    }
}

/// The header of a frame of a field.
pub fn header(
    field: &Field,
    frame: u32,
    attitude_sequence: u32,
    pixels: &[u16],
    labels: &str,
) -> FrameHeader {
    let packing = Packing::for_bits(field.bits);
    FrameHeader {
        frame,
        attitude_sequence,
        width: field.width as u16,
        height: field.height as u16,
        bits: field.bits,
        packing,
        pixel_level: PixelLevel::Frame,
        label_level: LabelLevel::Text,
        window_size: 0,
        windows: 0,
        blocks: blocks_in_frame(pixels.len() as u32, packing),
        label_parts: label_parts(labels.len() as u32).unwrap(),
        label_bytes: labels.len() as u32,
        exposure_start: WireTime(1),
        exposure_end: WireTime(2),
        seed: 1,
        gain_e_per_dn: field.gain_e_per_dn,
        offset_dn: field.offset_dn,
    }
}

/// The label line of some stars; it holds more fields than the score needs, as the real ones do.
pub fn labels(field: &Field, frame: u32, stars: &[Star]) -> String {
    let objects: Vec<String> = stars
        .iter()
        .enumerate()
        .map(|(index, star)| {
            let Star { x, y, electrons } = star;
            let snr = field.snr(*star);
            let visible = snr >= 3.0;
            format!(
                "{{\"kind\":\"star\",\"id\":\"HIP {index}\",\"names\":[\"β Test\"],\"x_px\":{x},\"y_px\":{y},\
                 \"electrons\":{electrons},\"snr\":{snr},\"in_frame\":true,\"visible\":{visible}}}"
            )
        })
        .collect();
    format!("{{\"frame\":{frame},\"objects\":[{}]}}", objects.join(","))
}

pub fn now() -> WireTime {
    hifitime::Epoch::now()
        .ok()
        .and_then(to_wire)
        .unwrap_or_default()
}
