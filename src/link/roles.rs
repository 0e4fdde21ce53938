//! What a link is for.

use super::{LinkError, LinkUrl};

/// What a link carries besides answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Roles {
    /// Attitudes and the camera's commands come in.
    pub truth: bool,
    /// Pixels go out.
    pub pixels: bool,
    /// Labels go out.
    pub labels: bool,
}

impl Roles {
    /// One link for all.
    pub const ALL: Roles = Roles {
        truth: true,
        pixels: true,
        labels: true,
    };

    /// Of option `roles`, such as `roles=pixels+labels`; all where it is not given.
    pub fn of(url: &LinkUrl) -> Result<Roles, LinkError> {
        let Some(text) = url.value("roles") else {
            return Ok(Roles::ALL);
        };
        let mut roles = Roles {
            truth: false,
            pixels: false,
            labels: false,
        };
        for name in text.split('+') {
            match name {
                "truth" => roles.truth = true,
                "pixels" => roles.pixels = true,
                "labels" => roles.labels = true,
                _ => {
                    return Err(url.refuse(format!(
                        "roles = {text:?} must be truth, pixels or labels, or several joined by +"
                    )));
                }
            }
        }
        Ok(roles)
    }

    /// Whether anything of a frame goes out.
    pub fn brings_frames(&self) -> bool {
        self.pixels || self.labels
    }
}

impl std::fmt::Display for Roles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let names = [
            (self.truth, "truth"),
            (self.pixels, "pixels"),
            (self.labels, "labels"),
        ];
        let names: Vec<&str> = names
            .into_iter()
            .filter_map(|(has, name)| has.then_some(name))
            .collect();
        f.write_str(&names.join(" + "))
    }
}
