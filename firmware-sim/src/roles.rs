//! What a link is for: `roles=truth+pixels+labels` in its address.

use skyloop_protocols::{LabelLevel, PixelLevel};

/// What a link carries besides answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Roles {
    /// Attitudes and the camera's commands, to the emulator.
    pub truth: bool,
    /// Pixels, from it.
    pub pixels: bool,
    /// Labels, from it.
    pub labels: bool,
}

impl Roles {
    /// One link for all.
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

    /// Reads names joined by `+`: `pixels+labels`.
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

    /// What frames of these levels bring.
    pub(crate) fn brought(pixels: PixelLevel, labels: LabelLevel) -> Self {
        Self {
            truth: false,
            pixels: pixels != PixelLevel::None,
            labels: labels != LabelLevel::None,
        }
    }

    /// These and the others.
    pub(crate) fn with(self, other: Self) -> Self {
        Self {
            truth: self.truth || other.truth,
            pixels: self.pixels || other.pixels,
            labels: self.labels || other.labels,
        }
    }

    /// These that the others are not.
    pub(crate) fn without(self, other: Self) -> Self {
        Self {
            truth: self.truth && !other.truth,
            pixels: self.pixels && !other.pixels,
            labels: self.labels && !other.labels,
        }
    }

    /// Those of both.
    pub(crate) fn and(self, other: Self) -> Self {
        self.without(self.without(other))
    }

    /// Whether anything of a frame is carried.
    #[must_use]
    pub fn bring_frames(&self) -> bool {
        self.pixels || self.labels
    }
}

impl std::fmt::Display for Roles {
    /// As an address has them: `truth+labels`.
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
