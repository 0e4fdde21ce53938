//! PNG: 16-bit grey for frames, 8-bit grey for their previews, 8-bit colour for the contact sheet.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError, RgbImage};
use skyloop_orbit::Mark;
use std::io::{self, Write};

/// The mark of a PNG written by skyloop. The first byte, 0x89, is not valid UTF-8.
pub const MARK: Mark = &["\u{fffd}PNG", "tEXtSoftware\0skyloop"];

/// Type and data of a text chunk that names the program (PNG specification, third edition,
/// 11.3.3).
const SOFTWARE: &[u8] = b"tEXtSoftware\0skyloop";
/// Bytes of a chunk's type.
const CHUNK_TYPE: usize = 4;
/// Bytes of the signature and the header chunk.
const HEAD: usize = 33;

/// Writes raw digital numbers, row 0 at the top; `size` is columns and rows.
pub(crate) fn write_grey16(out: &mut impl Write, size: [usize; 2], dn: &[u16]) -> io::Result<()> {
    let bytes: Vec<u8> = dn.iter().flat_map(|dn| dn.to_ne_bytes()).collect();
    encode(out, &bytes, size.map(|n| n as u32), ExtendedColorType::L16)
}

/// Writes grey levels, row 0 at the top; `size` is columns and rows.
pub(crate) fn write_grey8(out: &mut impl Write, size: [usize; 2], greys: &[u8]) -> io::Result<()> {
    encode(out, greys, size.map(|n| n as u32), ExtendedColorType::L8)
}

/// Writes a colour picture.
pub(crate) fn write_rgb(out: &mut impl Write, picture: &RgbImage) -> io::Result<()> {
    let size = [picture.width(), picture.height()];
    encode(out, picture.as_raw(), size, ExtendedColorType::Rgb8)
}

fn encode(
    out: &mut impl Write,
    bytes: &[u8],
    [width, height]: [u32; 2],
    color: ExtendedColorType,
) -> io::Result<()> {
    let mut encoded = Vec::new();
    // Frames are mostly noise, which does not compress further.
    PngEncoder::new_with_quality(&mut encoded, CompressionType::Fast, FilterType::Sub)
        .write_image(bytes, width, height, color)
        .map_err(|error| match error {
            ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })?;
    let (head, rest) = encoded.split_at_checked(HEAD).unwrap_or((&encoded, &[]));
    out.write_all(head)?;
    // A chunk: length, type, data, CRC-32 of type and data (PNG specification, third edition,
    // 5.3).
    let length = (SOFTWARE.len() - CHUNK_TYPE) as u32;
    out.write_all(&length.to_be_bytes())?;
    out.write_all(SOFTWARE)?;
    out.write_all(&crc32fast::hash(SOFTWARE).to_be_bytes())?;
    out.write_all(rest)
}
