//! Selection of the parts of each frame to send: all pixels, windows, or labels alone.

pub use crate::generated::codes::{LabelLevel, PixelLevel};
pub use crate::generated::commands::{Output, Positions};

/// Largest number of columns and rows of a window: such a window of 16-bit pixels fits a packet.
pub const MAX_WINDOW: u8 = 25;
/// Largest number of listed positions.
pub const MAX_POSITIONS: usize = 64;

impl Default for Output {
    /// Whole frames with label text.
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
    /// The usual combinations by name: whole frames with label text, the same compressed, windows
    /// with objects, objects alone.
    pub const PRESETS: [(&'static str, PixelLevel, LabelLevel); 4] = [
        ("frame", PixelLevel::Frame, LabelLevel::Text),
        ("compressed", PixelLevel::Compressed, LabelLevel::Text),
        ("windows", PixelLevel::Windows, LabelLevel::Objects),
        ("labels", PixelLevel::None, LabelLevel::Objects),
    ];

    /// The combination called `name`, with default numbers.
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
}

impl Positions {
    /// Positions with column and row of each centre; `None` above [`MAX_POSITIONS`].
    pub fn new(centres: &[[u16; 2]]) -> Option<Self> {
        let mut at = [[0; 2]; MAX_POSITIONS];
        at.get_mut(..centres.len())?.copy_from_slice(centres);
        let count = centres.len() as u8;
        Some(Self { count, at })
    }

    /// Column and row of each centre. Empty: windows around the brightest stars.
    pub fn centres(&self) -> &[[u16; 2]] {
        self.at.get(..usize::from(self.count)).unwrap_or_default()
    }
}
