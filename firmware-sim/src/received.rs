//! A received frame: pixels open, labels sealed until the detections are fixed.

use std::time::Instant;

use skyloop_protocols::{FrameHeader, WireTime};
use thiserror::Error;

use crate::detector::Detections;
use crate::image::Image;

/// A frame with all its pixels and its labels, the labels still sealed.
#[derive(Clone, Debug)]
pub struct ReceivedFrame {
    /// The header as it came.
    pub header: FrameHeader,
    /// Middle of the exposure.
    pub mid_exposure: WireTime,
    /// DN, row by row from pixel (0, 0): `width * height` of them.
    pub pixels: Vec<u16>,
    /// When the last pixel block arrived.
    pub last_block: Instant,
    /// The label text as octets, to be read through [`ReceivedFrame::labels`] only.
    pub(crate) sealed_labels: Vec<u8>,
}

/// Why labels stay shut.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum SealError {
    /// The detections are those of another frame.
    #[error(
        "labels of frame {frame} asked for with detections of frame {detected}: detect in this frame first"
    )]
    OtherFrame {
        /// The frame of the labels.
        frame: u32,
        /// The frame of the detections.
        detected: u32,
    },
    /// The text is damaged.
    #[error("labels of frame {frame} are not UTF-8 at octet {octet}")]
    NotText {
        /// The frame's number.
        frame: u32,
        /// The first octet that is wrong.
        octet: usize,
    },
}

impl ReceivedFrame {
    /// What the detector may see.
    #[must_use]
    pub fn image(&self) -> Image<'_> {
        Image {
            frame: self.header.frame,
            width: usize::from(self.header.width),
            height: usize::from(self.header.height),
            pixels: &self.pixels,
            gain_e_per_dn: self.header.gain_e_per_dn,
            offset_dn: self.header.offset_dn,
            // 1 to 16 bits by the decoder.
            full_scale_dn: (u16::MAX)
                .checked_shr(u32::from(16 - self.header.bits.min(16)))
                .unwrap_or(0),
        }
    }

    /// The label text: JSON, one line. It opens for the fixed detections of this frame only.
    ///
    /// # Errors
    /// [`SealError`].
    pub fn labels(&self, detections: &Detections) -> Result<&str, SealError> {
        let frame = self.header.frame;
        if detections.frame() != frame {
            return Err(SealError::OtherFrame {
                frame,
                detected: detections.frame(),
            });
        }
        std::str::from_utf8(&self.sealed_labels).map_err(|error| SealError::NotText {
            frame,
            octet: error.valid_up_to(),
        })
    }
}
