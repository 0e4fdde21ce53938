//! Division of a frame into packets: pixels into blocks, label text into parts; and the inverse.
//!
//! Every block but the last holds [`pixels_per_block`] pixels. Every part but the last holds
//! [`LABEL_TEXT_PER_PART`] bytes. Pixels are in row order from pixel (0, 0).

use crate::error::EncodeError;
use crate::generated::codes::Packing;
use crate::generated::frames::{
    CompressedBlock, LabelPart, ObjectPart, ObjectRecord, PixelBlock, WindowBlock,
};
use crate::packet::MAX_PAYLOAD;

/// Bytes of label text in every part but the last.
pub const LABEL_TEXT_PER_PART: usize = MAX_PAYLOAD - LabelPart::FIELDS_LENGTH;

/// Bytes of one object's record.
pub const OBJECT_LENGTH: usize = ObjectRecord::FIELDS_LENGTH;
/// Records in every `Objects` part but the last.
pub const OBJECTS_PER_PART: usize = (MAX_PAYLOAD - ObjectPart::FIELDS_LENGTH) / OBJECT_LENGTH;
/// Largest number of compressed bytes in a `Compressed` packet.
pub const COMPRESSED_DATA: usize = MAX_PAYLOAD - CompressedBlock::FIELDS_LENGTH;

const BLOCK_DATA: usize = MAX_PAYLOAD - PixelBlock::FIELDS_LENGTH;
const MAX_12_BIT: u16 = 0xFFF;

/// Pixels of a full block; an even number when packed to 12 bits.
pub const fn pixels_per_block(packing: Packing) -> usize {
    match packing {
        Packing::Bits12 => BLOCK_DATA / 3 * 2,
        Packing::Bits16 => BLOCK_DATA / 2,
    }
}

/// Bytes of `count` packed pixels. A pair of 12-bit pixels takes three bytes, an odd last one two;
/// each 16-bit pixel takes two.
pub const fn packed_length(packing: Packing, count: usize) -> usize {
    match packing {
        Packing::Bits12 => count / 2 * 3 + count % 2 * 2,
        Packing::Bits16 => count * 2,
    }
}

/// Bytes of one window: its position and its pixels.
pub const fn window_length(packing: Packing, size: u8) -> usize {
    4 + packed_length(packing, size as usize * size as usize)
}

/// Number of windows of `size` columns and rows in a full `Windows` packet; 0 above
/// [`MAX_WINDOW`](crate::output::MAX_WINDOW).
pub const fn windows_per_block(packing: Packing, size: u8) -> usize {
    (MAX_PAYLOAD - WindowBlock::FIELDS_LENGTH) / window_length(packing, size)
}

/// Number of parts for `objects` records.
pub const fn object_parts(objects: u16) -> u16 {
    objects.div_ceil(OBJECTS_PER_PART as u16)
}

/// Number of blocks of a frame with `pixels` pixels.
pub const fn blocks_in_frame(pixels: u32, packing: Packing) -> u32 {
    pixels.div_ceil(pixels_per_block(packing) as u32)
}

/// Number of parts of a label text with `bytes` bytes; `None` if it exceeds 16 bits.
pub const fn label_parts(bytes: u32) -> Option<u16> {
    match bytes.div_ceil(LABEL_TEXT_PER_PART as u32) {
        parts @ 0..=0xFFFF => Some(parts as u16),
        _ => None,
    }
}

/// The pixels of one block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockSlice<'a> {
    /// Number of the block in its frame.
    pub index: u32,
    /// Index of the first pixel in the frame: row * width + column.
    pub first_pixel: u32,
    /// The pixels, DN.
    pub pixels: &'a [u16],
}

/// Splits a frame's pixels into blocks, in index order.
pub fn blocks(pixels: &[u16], packing: Packing) -> impl ExactSizeIterator<Item = BlockSlice<'_>> {
    let size = pixels_per_block(packing);
    // Width and height are 16-bit numbers, so indices fit 32 bits.
    let blocks = pixels.chunks(size).enumerate();
    blocks.map(move |(index, pixels)| BlockSlice {
        index: index as u32,
        first_pixel: (index * size) as u32,
        pixels,
    })
}

/// Splits a frame's label text into the texts of its parts, in part order.
pub fn label_texts(text: &[u8]) -> impl ExactSizeIterator<Item = &[u8]> {
    text.chunks(LABEL_TEXT_PER_PART)
}

/// Packs pixels into `data`: two bytes each, big-endian, or 12 bits each, first bit first
/// (`AAAAAAAA AAAABBBB BBBBBBBB`). The four bits after an odd last pixel are 0.
///
/// # Errors
/// `data` is not [`packed_length`] bytes long, or a pixel is above 4095 in 12-bit packing.
pub fn pack(packing: Packing, pixels: &[u16], data: &mut [u8]) -> Result<(), EncodeError> {
    if data.len() != packed_length(packing, pixels.len()) {
        return Err(EncodeError::Inconsistent {
            what: "number of pixels and length of their octets",
        });
    }
    match packing {
        Packing::Bits12 => pack12(pixels, data),
        Packing::Bits16 => {
            pack16(pixels, data);
            Ok(())
        }
    }
}

/// Unpacks as many pixels as `data` and `pixels` allow and returns their number.
pub fn unpack(packing: Packing, data: &[u8], pixels: &mut [u16]) -> usize {
    match packing {
        Packing::Bits12 => unpack12(data, pixels),
        Packing::Bits16 => unpack16(data, pixels),
    }
}

fn pack16(pixels: &[u16], data: &mut [u8]) {
    for (bytes, pixel) in data.as_chunks_mut::<2>().0.iter_mut().zip(pixels) {
        *bytes = pixel.to_be_bytes();
    }
}

fn pack12(pixels: &[u16], data: &mut [u8]) -> Result<(), EncodeError> {
    if pixels.iter().fold(0, |all, pixel| all | pixel) > MAX_12_BIT {
        return Err(EncodeError::PixelTooLarge);
    }
    let (pairs, last) = pixels.as_chunks::<2>();
    let (triples, tail) = data.as_chunks_mut::<3>();
    for (bytes, [a, b]) in triples.iter_mut().zip(pairs) {
        *bytes = [(a >> 4) as u8, (a << 4 | b >> 8) as u8, *b as u8];
    }
    if let (Some(pixel), Some(bytes)) = (last.first(), tail.first_chunk_mut()) {
        *bytes = (pixel << 4).to_be_bytes();
    }
    Ok(())
}

fn unpack16(data: &[u8], pixels: &mut [u16]) -> usize {
    let bytes = data.as_chunks::<2>().0;
    for (pixel, bytes) in pixels.iter_mut().zip(bytes) {
        *pixel = u16::from_be_bytes(*bytes);
    }
    bytes.len().min(pixels.len())
}

fn unpack12(data: &[u8], pixels: &mut [u16]) -> usize {
    let (triples, tail) = data.as_chunks::<3>();
    let (pairs, last) = pixels.as_chunks_mut::<2>();
    for (pair, [a, b, c]) in pairs.iter_mut().zip(triples) {
        let (a, b, c) = (u16::from(*a), u16::from(*b), u16::from(*c));
        *pair = [a << 4 | b >> 4, (b & 0xF) << 8 | c];
    }
    let whole = 2 * pairs.len().min(triples.len());
    // An odd last pixel is in the two bytes after the last triple, or at the start of the next one.
    let rest = triples.get(pairs.len()).map_or(tail, |triple| triple);
    let is_reached = pairs.len() <= triples.len();
    match (last.first_mut(), rest.first_chunk()) {
        (Some(pixel), Some(bytes)) if is_reached => {
            *pixel = u16::from_be_bytes(*bytes) >> 4;
            whole + 1
        }
        _ => whole,
    }
}

/// Whether the bits after an odd last pixel of 12 bits are 0.
pub(crate) fn is_padded(packing: Packing, count: usize, data: &[u8]) -> bool {
    match (packing, count % 2, data.last()) {
        (Packing::Bits12, 1, Some(last)) => last & 0xF == 0,
        _ => true,
    }
}

/// Whether part `part` of `parts` has the right length: only the last may be shorter than `full`.
pub(crate) const fn has_valid_part_length(
    part: u16,
    parts: u16,
    length: usize,
    full: usize,
) -> bool {
    let last = part as u32 + 1 == parts as u32;
    part < parts && length > 0 && (last || length == full)
}
