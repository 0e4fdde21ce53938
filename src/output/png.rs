//! PNG: 16-bit grey for frames, 8-bit grey for their previews, 8-bit colour for the contact sheet.

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError, RgbImage};
use std::io::{self, Write};

/// Writes raw digital numbers, row 0 at the top; `size` is columns and rows.
pub fn write_grey16(out: &mut impl Write, size: [usize; 2], digits: &[u16]) -> io::Result<()> {
    let bytes: Vec<u8> = digits.iter().flat_map(|dn| dn.to_ne_bytes()).collect();
    encode(out, &bytes, size.map(|n| n as u32), ExtendedColorType::L16)
}

/// Writes grey levels, row 0 at the top; `size` is columns and rows.
pub fn write_grey8(out: &mut impl Write, size: [usize; 2], greys: &[u8]) -> io::Result<()> {
    encode(out, greys, size.map(|n| n as u32), ExtendedColorType::L8)
}

/// Writes a colour picture.
pub fn write_rgb(out: &mut impl Write, picture: &RgbImage) -> io::Result<()> {
    let size = [picture.width(), picture.height()];
    encode(out, picture.as_raw(), size, ExtendedColorType::Rgb8)
}

fn encode(
    out: &mut impl Write,
    bytes: &[u8],
    [width, height]: [u32; 2],
    color: ExtendedColorType,
) -> io::Result<()> {
    // Frames are mostly noise, which no effort compresses further.
    PngEncoder::new_with_quality(out, CompressionType::Fast, FilterType::Sub)
        .write_image(bytes, width, height, color)
        .map_err(|error| match error {
            ImageError::IoError(error) => error,
            other => io::Error::other(other),
        })
}
