//! What of each frame is sent: whole, in windows, or its labels alone.

use crate::EncodeError;
use crate::error::DecodeError;
use crate::frame::rule;
use crate::wire::{Reader, Writer, wire_enum};

/// Most columns and rows of a window: one of 16-bit pixels fits a packet.
pub const MAX_WINDOW: u8 = 25;
/// Most listed positions.
pub const MAX_POSITIONS: usize = 64;

wire_enum! {
    /// Which pixels of a frame are sent.
    pub enum PixelLevel: u8 {
        /// None.
        None = 0,
        /// Square windows around the brightest stars, or around listed positions.
        Windows = 1,
        /// All, packed to 12 or 16 bits.
        Frame = 2,
        /// All, losslessly compressed.
        Compressed = 3,
    }
}

wire_enum! {
    /// Which labels of a frame are sent.
    pub enum LabelLevel: u8 {
        /// None.
        None = 0,
        /// The brightest objects in the frame, as numbers.
        Objects = 1,
        /// The whole label text.
        Text = 2,
    }
}

/// What each frame from now on brings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// Which pixels.
    pub pixels: PixelLevel,
    /// Which labels.
    pub labels: LabelLevel,
    /// Columns and rows of a window, 1 to [`MAX_WINDOW`].
    pub window_size: u8,
    /// How many windows around the brightest stars, if no positions are listed.
    pub windows: u8,
    /// How many objects, the brightest first.
    pub objects: u16,
}

impl Default for Output {
    /// Everything.
    fn default() -> Self {
        Self {
            pixels: PixelLevel::Frame,
            labels: LabelLevel::Text,
            window_size: 11,
            windows: 20,
            objects: 12,
        }
    }
}

impl Output {
    /// The usual combinations by name: whole frames with label text, the same compressed, windows with objects,
    /// objects alone.
    pub const PRESETS: [(&'static str, PixelLevel, LabelLevel); 4] = [
        ("frame", PixelLevel::Frame, LabelLevel::Text),
        ("compressed", PixelLevel::Compressed, LabelLevel::Text),
        ("windows", PixelLevel::Windows, LabelLevel::Objects),
        ("labels", PixelLevel::None, LabelLevel::Objects),
    ];

    /// The combination called `name`, with numbers as by default.
    pub fn preset(name: &str) -> Option<Self> {
        let (_, pixels, labels) = Self::PRESETS
            .into_iter()
            .find(|(known, ..)| *known == name)?;
        Some(Self {
            pixels,
            labels,
            ..Self::default()
        })
    }

    /// Refuses windows that fit no packet.
    pub fn check(&self) -> Result<(), DecodeError> {
        rule(
            (1..=MAX_WINDOW).contains(&self.window_size),
            "Output.window_size",
            "must be 1 to 25",
        )
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        Ok(Self {
            pixels: pixel_level(reader)?,
            labels: label_level(reader)?,
            window_size: reader.u8()?,
            windows: reader.u8()?,
            objects: reader.u16()?,
        })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.pixels.code())?;
        writer.u8(self.labels.code())?;
        writer.u8(self.window_size)?;
        writer.u8(self.windows)?;
        writer.u16(self.objects)
    }
}

pub(crate) fn pixel_level(reader: &mut Reader<'_>) -> Result<PixelLevel, DecodeError> {
    PixelLevel::from_code(reader.u8()?).ok_or(DecodeError::BadValue {
        field: "pixels",
        rule: "must be 0 to 3",
    })
}

pub(crate) fn label_level(reader: &mut Reader<'_>) -> Result<LabelLevel, DecodeError> {
    LabelLevel::from_code(reader.u8()?).ok_or(DecodeError::BadValue {
        field: "labels",
        rule: "must be 0 to 2",
    })
}

/// Centres of the windows, instead of the brightest stars.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Positions {
    count: u8,
    at: [[u16; 2]; MAX_POSITIONS],
}

impl Positions {
    /// From column and row of each centre; `None` if there are more than [`MAX_POSITIONS`].
    pub fn new(centres: &[[u16; 2]]) -> Option<Self> {
        let mut at = [[0; 2]; MAX_POSITIONS];
        at.get_mut(..centres.len())?.copy_from_slice(centres);
        let count = centres.len() as u8;
        Some(Self { count, at })
    }

    /// Column and row of each centre; none: the brightest stars again.
    pub fn centres(&self) -> &[[u16; 2]] {
        self.at.get(..usize::from(self.count)).unwrap_or_default()
    }

    pub(crate) fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let count = reader.u8()?;
        let mut at = [[0; 2]; MAX_POSITIONS];
        let listed = at.get_mut(..usize::from(count));
        let listed = listed.ok_or(DecodeError::BadValue {
            field: "Positions.count",
            rule: "must be 64 or fewer",
        })?;
        for [column, row] in listed {
            (*column, *row) = (reader.u16()?, reader.u16()?);
        }
        Ok(Self { count, at })
    }

    pub(crate) fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.u8(self.count)?;
        for [column, row] in self.centres() {
            writer.u16(*column)?;
            writer.u16(*row)?;
        }
        Ok(())
    }
}
