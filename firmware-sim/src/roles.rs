//! Roles of a link: `roles=truth+pixels+labels` in its address.

use skyloop_protocols::{LabelLevel, PixelLevel};

/// Content of a link, apart from replies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roles {
    /// Attitudes and camera commands, to the emulator.
    pub truth: bool,
    /// Pixels, from the emulator.
    pub pixels: bool,
    /// Labels, from the emulator.
    pub labels: bool,
}

impl Roles {
    /// All roles on one link.
    pub const ALL: Self = Self {
        truth: true,
        pixels: true,
        labels: true,
    };
    pub(crate) const NONE: Self = Self {
        truth: false,
        pixels: false,
        labels: false,
    };

    /// Parses names joined by `+`: `pixels+labels`.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut roles = Self::NONE;
        for name in text.split('+') {
            match name {
                "truth" if !roles.truth => roles.truth = true,
                "pixels" if !roles.pixels => roles.pixels = true,
                "labels" if !roles.labels => roles.labels = true,
                _ => {
                    return Err(format!(
                        "roles={text} must be truth, pixels or labels, or several joined by +, each once"
                    ));
                }
            }
        }
        Ok(roles)
    }

    /// Content of frames with these levels.
    pub(crate) fn brought(pixels: PixelLevel, labels: LabelLevel) -> Self {
        Self {
            truth: false,
            pixels: pixels != PixelLevel::None,
            labels: labels != LabelLevel::None,
        }
    }

    /// Union.
    pub(crate) fn with(self, other: Self) -> Self {
        Self {
            truth: self.truth || other.truth,
            pixels: self.pixels || other.pixels,
            labels: self.labels || other.labels,
        }
    }

    /// Difference.
    pub(crate) fn without(self, other: Self) -> Self {
        Self {
            truth: self.truth && !other.truth,
            pixels: self.pixels && !other.pixels,
            labels: self.labels && !other.labels,
        }
    }

    /// Intersection.
    pub(crate) fn and(self, other: Self) -> Self {
        self.without(self.without(other))
    }

    /// Whether the link carries pixels or labels.
    #[must_use]
    pub fn bring_frames(&self) -> bool {
        self.pixels || self.labels
    }
}

impl std::fmt::Display for Roles {
    /// In the form of an address: `truth+labels`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = [
            (self.truth, "truth"),
            (self.pixels, "pixels"),
            (self.labels, "labels"),
        ];
        let has = names.into_iter().filter(|(has, _)| *has);
        let names: Vec<&str> = has.map(|(_, name)| name).collect();
        f.write_str(&names.join("+"))
    }
}
