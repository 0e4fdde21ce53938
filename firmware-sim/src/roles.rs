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

    /// Takes option `roles` out of an address: the rest of it, and the roles; all where none are given.
    pub fn split(address: &str) -> Result<(String, Self), String> {
        let Some((place, options)) = address.split_once('?') else {
            return Ok((address.into(), Self::ALL));
        };
        let mut roles = None;
        let mut others = Vec::new();
        for option in options.split('&') {
            match option.strip_prefix("roles=") {
                Some(_) if roles.is_some() => return Err("roles are given twice".into()),
                Some(text) => roles = Some(Self::parse(text)?),
                None => others.push(option),
            }
        }
        let rest = match &others[..] {
            [] => place.into(),
            others => format!("{place}?{}", others.join("&")),
        };
        Ok((rest, roles.unwrap_or(Self::ALL)))
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_are_taken_out_of_an_address() {
        let [truth, frames] = ["truth", "pixels+labels"].map(|text| Roles::parse(text).unwrap());
        assert!(truth.truth && !truth.bring_frames() && frames.pixels && frames.labels);
        for (address, rest, roles) in [
            ("127.0.0.1:5", "127.0.0.1:5", Roles::ALL),
            ("127.0.0.1:5?roles=truth", "127.0.0.1:5", truth),
            ("/dev/x?baud=9600", "/dev/x?baud=9600", Roles::ALL),
            (
                "/dev/x?roles=labels+pixels&baud=9600",
                "/dev/x?baud=9600",
                frames,
            ),
            ("can0?fd=1&roles=truth&load=1", "can0?fd=1&load=1", truth),
        ] {
            assert_eq!(Roles::split(address), Ok((rest.into(), roles)), "{address}");
        }
        for (address, part) in [
            ("x?roles=", "roles= must be"),
            ("x?roles=truth+sound", "roles=truth+sound must be"),
            ("x?roles=truth&roles=labels", "twice"),
        ] {
            let error = Roles::split(address).unwrap_err();
            assert!(error.contains(part), "{error}");
        }
    }
}
