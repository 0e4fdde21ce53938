//! Why frames are not whole in time, as far as the flight computer can tell.

use std::time::Duration;

use skyloop_protocols::packet::MAX_PAYLOAD;
use skyloop_protocols::pixels::{COMPRESSED_DATA, packed_length};
use skyloop_protocols::{FrameHeader, MAX_PACKET, PixelLevel};
use thiserror::Error;

use crate::roles::Roles;

/// A link as the flight computer has it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Its name, for people.
    pub name: String,
    /// What it is for here.
    pub roles: Roles,
}

/// Why no frame is whole in time.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum Cause {
    #[error(
        "{what} come on {} (here roles={}) and not on {} (here roles={}): roles= must be the same at both ends; {}",
        on.name, on.roles, off.name, off.roles, remedy(*what, on, off)
    )]
    Elsewhere { what: Roles, on: Named, off: Named },
    #[error(
        "nothing of a frame has come on {} (here roles={}): give the emulator's end of it the same roles=",
        link.name, link.roles
    )]
    Silent { link: Named },
    #[error(
        "asked for {what}, but no link brings pixels: here {}; give one the role pixels, and the emulator's end of it too",
        roles_of(links)
    )]
    NoPixels {
        what: &'static str,
        links: Vec<Named>,
    },
    #[error(
        "a frame of {bytes} octets takes {:.1} s on this line and is waited for {} s: {}",
        takes.as_secs_f64(), timeout.as_secs_f64(),
        if *all_pixels {
            "choose --output windows or labels, or a longer --timeout"
        } else {
            "ask for fewer --windows and --objects, or choose a longer --timeout"
        }
    )]
    Slow {
        bytes: usize,
        takes: Duration,
        timeout: Duration,
        all_pixels: bool,
    },
}

fn roles_of(links: &[Named]) -> String {
    let named = |link: &Named| format!("{} roles={}", link.name, link.roles);
    links.iter().map(named).collect::<Vec<_>>().join(", ")
}

fn remedy(what: Roles, on: &Named, off: &Named) -> String {
    let (all, rest) = (on.roles.with(what), off.roles.without(what));
    let without = match rest {
        Roles::NONE => format!("leave {} out", off.name),
        rest => format!("{} roles={rest}", off.name),
    };
    let give = &on.name;
    format!("give {give} roles={all} and {without}, or change the emulator's links")
}

impl Cause {
    /// Of a frame that the line, by `airtime`, cannot carry within `timeout`.
    pub(crate) fn slow(
        header: &FrameHeader,
        airtime: impl Fn(usize) -> Duration,
        timeout: Duration,
    ) -> Option<Self> {
        let bytes = octets(header);
        let takes = airtime(bytes);
        (takes > timeout).then_some(Self::Slow {
            bytes,
            takes,
            timeout,
            all_pixels: matches!(
                header.pixel_level,
                PixelLevel::Frame | PixelLevel::Compressed
            ),
        })
    }
}

/// Octets of a frame's packets, without the few fields before the data of each.
fn octets(header: &FrameHeader) -> usize {
    /// Column and row of a window.
    const PLACE: usize = 4;
    let size = usize::from(header.window_size);
    let blocks = header.blocks as usize;
    let pixels = match header.pixel_level {
        PixelLevel::None => 0,
        PixelLevel::Windows => {
            usize::from(header.windows) * (PLACE + packed_length(header.packing, size * size))
        }
        PixelLevel::Frame => packed_length(header.packing, header.pixels() as usize),
        // The last block may hold little.
        PixelLevel::Compressed => blocks.saturating_sub(1) * COMPRESSED_DATA,
    };
    let packets = header.packets() as usize;
    pixels + header.label_bytes as usize + packets * (MAX_PACKET - MAX_PAYLOAD)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, roles: &str) -> Named {
        Named {
            name: name.into(),
            roles: Roles::parse(roles).unwrap(),
        }
    }

    #[test]
    fn links_with_other_roles_are_named_with_the_remedy() {
        let pixels = Roles::parse("pixels").unwrap();
        let cause = |off: &str| {
            let (on, off) = (named("udp://A", "labels"), named("/dev/B", off));
            let what = pixels;
            Cause::Elsewhere { what, on, off }.to_string()
        };
        assert_eq!(
            cause("truth+pixels"),
            "pixels come on udp://A (here roles=labels) and not on /dev/B (here roles=truth+pixels): roles= must be the \
             same at both ends; give udp://A roles=pixels+labels and /dev/B roles=truth, or change the emulator's links"
        );
        assert!(cause("pixels").contains("and leave /dev/B out"));
    }
}
