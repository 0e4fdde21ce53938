//! A received frame: pixels are open, labels are sealed until the detections are fixed.

use std::time::Instant;

use skyloop_protocols::{FrameEnd, FrameHeader, LabelLevel, ObjectPart, ObjectRecord, WireTime};
use thiserror::Error;

use crate::detector::{Detections, DetectorSettings, detect, detect_windows};
use crate::image::Image;

/// Pixels of a received frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Content {
    /// None.
    #[default]
    None,
    /// Windows only.
    Windows(Vec<Cutout>),
    /// All pixels, DN, row by row from pixel (0, 0): `width * height` values with the FrameEnd's
    /// CRC-32.
    Frame(Vec<u16>),
}

/// A window of a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Cutout {
    /// Column of its first pixel in the frame.
    pub column: u16,
    /// Row of its first pixel in the frame.
    pub row: u16,
    /// Columns and rows.
    pub size: u16,
    /// DN, row by row.
    pub pixels: Vec<u16>,
}

/// A received frame, its labels still sealed.
#[derive(Clone, Debug)]
pub struct ReceivedFrame {
    /// Header.
    pub header: FrameHeader,
    /// FrameEnd: CRC-32 of the pixels, and times.
    pub end: FrameEnd,
    /// Middle of the exposure.
    pub mid_exposure: WireTime,
    /// Its pixels.
    pub content: Content,
    /// Bytes of the pixels in their packets, packed or compressed.
    pub pixel_bytes: u64,
    /// Arrival time of the header.
    pub header_at: Instant,
    /// Arrival time of the last packet with pixels; without pixels, of the last one with labels.
    pub last_data_at: Instant,
    /// Arrival time of the last packet.
    pub completed_at: Instant,
    /// Label text or object records, read only through [`ReceivedFrame::labels`] and
    /// [`ReceivedFrame::objects`].
    pub(crate) sealed_labels: Vec<u8>,
}

/// Reason why labels stay sealed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum SealError {
    #[error(
        "labels of frame {frame} need its own detections, not those of frame {detected}: detect in this frame first"
    )]
    OtherFrame { frame: u32, detected: u32 },
    #[error("labels of frame {frame} are not UTF-8 at byte {byte}")]
    NotText { frame: u32, byte: usize },
}

impl ReceivedFrame {
    pub(crate) fn with_labels_of(mut self, other: Self) -> Self {
        self.header.label_level = other.header.label_level;
        self.header.label_parts = other.header.label_parts;
        self.header.label_bytes = other.header.label_bytes;
        self.sealed_labels = other.sealed_labels;
        self.header_at = self.header_at.min(other.header_at);
        self
    }

    /// All pixels of the frame; empty unless all were sent.
    #[must_use]
    pub fn pixels(&self) -> &[u16] {
        match &self.content {
            Content::Frame(pixels) => pixels,
            Content::None | Content::Windows(_) => &[],
        }
    }

    /// Its windows; empty unless windows were sent.
    #[must_use]
    pub fn windows(&self) -> &[Cutout] {
        match &self.content {
            Content::Windows(windows) => windows,
            Content::None | Content::Frame(_) => &[],
        }
    }

    /// Detector input of a whole frame; empty unless all pixels were sent.
    #[must_use]
    pub fn image(&self) -> Image<'_> {
        let (width, height) = (self.header.width.into(), self.header.height.into());
        self.image_of(width, height, self.pixels())
    }

    fn image_of<'a>(&self, width: usize, height: usize, pixels: &'a [u16]) -> Image<'a> {
        Image {
            frame: self.header.frame,
            width,
            height,
            pixels,
            gain_e_per_dn: self.header.gain_e_per_dn,
            offset_dn: self.header.offset_dn,
            // The decoder limits it to 1 to 16 bits.
            full_scale_dn: (u16::MAX)
                .checked_shr(u32::from(16 - self.header.bits.min(16)))
                .unwrap_or(0),
        }
    }

    /// Detects stars in the received pixels.
    #[must_use]
    pub fn detect(&self, settings: &DetectorSettings) -> Detections {
        if let Content::Windows(windows) = &self.content {
            let images = windows.iter().map(|window| {
                let size = window.size.into();
                let image = self.image_of(size, size, &window.pixels);
                ([window.column, window.row], image)
            });
            detect_windows(self.header.frame, images, settings)
        } else {
            detect(&self.image(), settings)
        }
    }

    /// Whether all pixels of the frame within two pixels of this position were received.
    #[must_use]
    pub fn shows(&self, x_px: f64, y_px: f64) -> bool {
        const AROUND: f64 = 2.0;
        let within = |at: f64, first: u16, size: u16, end: u16| {
            let (first, last) = (f64::from(first), f64::from(first) + f64::from(size) - 1.0);
            let limit = |at: f64| at.clamp(0.0, f64::from(end) - 1.0);
            (first..=last).contains(&limit(at - AROUND))
                && (first..=last).contains(&limit(at + AROUND))
        };
        let (width, height) = (self.header.width, self.header.height);
        match &self.content {
            Content::None => false,
            Content::Frame(_) => true,
            Content::Windows(windows) => windows.iter().any(|window| {
                within(x_px, window.column, window.size, width)
                    && within(y_px, window.row, window.size, height)
            }),
        }
    }

    /// Label text: JSON in one line; empty if no text was sent. Needs the detections of this frame.
    pub fn labels(&self, detections: &Detections) -> Result<&str, SealError> {
        let bytes = self.opened(detections, LabelLevel::Text)?;
        std::str::from_utf8(bytes).map_err(|error| SealError::NotText {
            frame: self.header.frame,
            byte: error.valid_up_to(),
        })
    }

    /// Labelled objects, brightest first; empty if none were sent in numeric form. Needs the
    /// detections of this frame.
    pub fn objects(&self, detections: &Detections) -> Result<Vec<ObjectRecord>, SealError> {
        let all = ObjectPart {
            frame: self.header.frame,
            part: 0,
            parts: 1,
            data: self.opened(detections, LabelLevel::Objects)?,
        };
        Ok(all.objects().collect())
    }

    /// The labels of this level, or nothing.
    fn opened(&self, detections: &Detections, level: LabelLevel) -> Result<&[u8], SealError> {
        if detections.frame() != self.header.frame {
            return Err(SealError::OtherFrame {
                frame: self.header.frame,
                detected: detections.frame(),
            });
        }
        let is_theirs = self.header.label_level == level;
        Ok(if is_theirs { &self.sealed_labels } else { &[] })
    }
}
