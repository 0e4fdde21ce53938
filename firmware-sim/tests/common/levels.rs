//! Frames cut into packets at any output level, as an emulator would.

use skyloop_protocols::pixels::{
    COMPRESSED_DATA, OBJECT_LENGTH, OBJECTS_PER_PART, object_parts, pack, packed_length,
    windows_per_block,
};
use skyloop_protocols::{
    CompressedBlock, FrameHeader, LabelLevel, ObjectPart, ObjectRecord, Output, PixelLevel, Reply,
    WindowBlock, WireTime, rice,
};

use super::wire::{Sender, header, labels};
use super::{Field, Star};

/// What is exposed: a frame of a field.
pub struct Exposed<'a> {
    pub field: &'a Field,
    pub frame: u32,
    pub attitude: u32,
    pub stars: &'a [Star],
    pub pixels: &'a [u16],
}

impl Exposed<'_> {
    /// The packets of the frame, windows around `positions` or around the brightest stars.
    pub fn packets(
        &self,
        sender: &mut Sender,
        output: &Output,
        positions: &[[u16; 2]],
        time: WireTime,
    ) -> Vec<Vec<u8>> {
        let mut opening = FrameHeader {
            pixel_level: output.pixels,
            label_level: output.labels,
            ..self.header()
        };
        let text = labels(self.field, self.frame, self.stars);
        let records: Vec<u8> = self
            .objects(output.objects)
            .iter()
            .flat_map(ObjectRecord::to_octets)
            .collect();
        let octets = match output.labels {
            LabelLevel::None => &[],
            LabelLevel::Objects => &records[..],
            LabelLevel::Text => text.as_bytes(),
        };
        opening.label_bytes = octets.len() as u32;
        opening.label_parts = match output.labels {
            LabelLevel::None => 0,
            LabelLevel::Objects => object_parts((octets.len() / OBJECT_LENGTH) as u16),
            LabelLevel::Text => opening.label_parts,
        };
        let places = self.places(output, positions);
        let code = self.compressed();
        match output.pixels {
            PixelLevel::None => opening.blocks = 0,
            PixelLevel::Windows => {
                opening.window_size = output.window_size;
                opening.windows = places.len() as u16;
                opening.blocks = opening.blocks_due().unwrap();
            }
            PixelLevel::Frame => {}
            PixelLevel::Compressed => opening.blocks = code.len() as u32,
        }
        let whole = match output.pixels {
            PixelLevel::Frame => self.pixels,
            _ => &[],
        };
        let mut packets = sender.opened(&opening, whole, "", time);
        if output.pixels == PixelLevel::Windows {
            self.windows(&opening, &places, |windows| {
                packets.push(sender.reply(&Reply::Windows(windows), time));
            });
        }
        if output.pixels == PixelLevel::Compressed {
            for (index, (first_pixel, count, data)) in (0..).zip(&code) {
                let block = CompressedBlock {
                    frame: self.frame,
                    index,
                    first_pixel: *first_pixel,
                    count: *count,
                    data,
                };
                packets.push(sender.reply(&Reply::Compressed(block), time));
            }
        }
        match output.labels {
            LabelLevel::None => {}
            LabelLevel::Objects => {
                for (part, data) in (0..).zip(records.chunks(OBJECTS_PER_PART * OBJECT_LENGTH)) {
                    let part = ObjectPart {
                        frame: self.frame,
                        part,
                        parts: opening.label_parts,
                        data,
                    };
                    packets.push(sender.reply(&Reply::Objects(part), time));
                }
            }
            LabelLevel::Text => packets.extend(sender.texts(&opening, &text, time)),
        }
        packets.push(sender.end(self.frame, self.pixels, time));
        packets
    }

    fn header(&self) -> FrameHeader {
        let text = labels(self.field, self.frame, self.stars);
        header(self.field, self.frame, self.attitude, self.pixels, &text)
    }

    /// First pixels of the windows.
    fn places(&self, output: &Output, positions: &[[u16; 2]]) -> Vec<[u16; 2]> {
        let stars = self.stars.iter().take(output.windows.into());
        let stars = stars.map(|star| [star.x.round() as u16, star.y.round() as u16]);
        let centres: Vec<[u16; 2]> = match positions {
            [] => stars.collect(),
            listed => listed.to_vec(),
        };
        let size = u16::from(output.window_size);
        let (right, bottom) = (
            self.field.width as u16 - size,
            self.field.height as u16 - size,
        );
        let shifted = |at: u16, last: u16| at.saturating_sub(size / 2).min(last);
        centres
            .iter()
            .map(|[x, y]| [shifted(*x, right), shifted(*y, bottom)])
            .collect()
    }

    fn windows(
        &self,
        header: &FrameHeader,
        places: &[[u16; 2]],
        mut send: impl FnMut(WindowBlock<'_>),
    ) {
        let (size, packing) = (header.window_size, header.packing);
        let n = usize::from(size);
        let most = windows_per_block(packing, size);
        for (index, places) in places.chunks(most).enumerate() {
            let mut data = Vec::new();
            for [column, row] in places {
                let rows = usize::from(*row)..usize::from(*row) + n;
                let pixels: Vec<u16> = rows
                    .flat_map(|row| {
                        let first = row * self.field.width + usize::from(*column);
                        self.pixels[first..first + n].iter().copied()
                    })
                    .collect();
                data.extend(column.to_be_bytes());
                data.extend(row.to_be_bytes());
                let mut packed = vec![0; packed_length(packing, n * n)];
                pack(packing, &pixels, &mut packed).unwrap();
                data.extend(packed);
            }
            send(WindowBlock {
                frame: self.frame,
                index: index as u32,
                first: (index * most) as u16,
                count: places.len() as u8,
                size,
                packing,
                data: &data,
            });
        }
    }

    /// First pixel, number of pixels and code of each block.
    fn compressed(&self) -> Vec<(u32, u16, Vec<u8>)> {
        let mut blocks = Vec::new();
        let mut first = 0;
        while first < self.pixels.len() {
            let mut code = [0; COMPRESSED_DATA];
            let (count, length) = rice::encode(&self.pixels[first..], self.field.bits, &mut code);
            assert!(count > 0);
            blocks.push((first as u32, count as u16, code[..length].to_vec()));
            first += count;
        }
        blocks
    }

    fn objects(&self, most: u16) -> Vec<ObjectRecord> {
        let stars = self.stars.iter().enumerate().take(most.into());
        stars
            .map(|(index, star)| {
                let snr = self.field.snr(*star);
                let mut id = [0; 16];
                let name = format!("HIP {index}");
                id[..name.len()].copy_from_slice(name.as_bytes());
                ObjectRecord {
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
                }
            })
            .collect()
    }
}
