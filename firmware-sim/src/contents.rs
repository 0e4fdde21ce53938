//! Statistics of the frames' content.

use std::fmt;

use skyloop_protocols::PixelLevel;
use skyloop_protocols::pixels::packed_length;

use crate::detector::Detections;
use crate::received::ReceivedFrame;

/// Sums over frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Contents {
    /// Number of windows.
    pub windows: u64,
    /// Labelled objects in numeric form.
    pub objects: u64,
    /// Number of pixels received compressed.
    pub compressed_pixels: u64,
    /// Bytes of compressed pixels.
    pub compressed_bytes: u64,
    /// Bytes of the same pixels in packed form.
    pub packed_bytes: u64,
}

impl Contents {
    /// Adds a frame with its detections.
    pub(crate) fn add(&mut self, frame: &ReceivedFrame, detections: &Detections) {
        let header = &frame.header;
        self.windows += frame.windows().len() as u64;
        self.objects += frame
            .objects(detections)
            .map_or(0, |objects| objects.len() as u64);
        if header.pixel_level == PixelLevel::Compressed {
            let pixels = frame.pixels().len();
            self.compressed_pixels += pixels as u64;
            self.compressed_bytes += frame.pixel_bytes;
            self.packed_bytes += packed_length(header.packing, pixels) as u64;
        }
    }
}

impl fmt::Display for Contents {
    /// Empty, or each kind of content after a semicolon.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.windows > 0 {
            write!(f, "; {} windows", self.windows)?;
        }
        if self.objects > 0 {
            write!(f, "; {} objects", self.objects)?;
        }
        if self.compressed_bytes > 0 {
            let bytes = self.compressed_bytes as f64;
            write!(
                f,
                "; compressed to {:.2} bits a pixel, {:.2} times smaller than packed",
                8.0 * bytes / self.compressed_pixels as f64,
                self.packed_bytes as f64 / bytes
            )?;
        }
        Ok(())
    }
}
