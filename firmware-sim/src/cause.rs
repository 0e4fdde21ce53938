//! Reasons for incomplete frames, as far as the flight computer can find them.

use std::time::Duration;

use skyloop_protocols::packet::MAX_PAYLOAD;
use skyloop_protocols::pixels::{COMPRESSED_DATA, packed_length};
use skyloop_protocols::{FrameHeader, MAX_PACKET, PixelLevel};
use thiserror::Error;

use crate::roles::Roles;

/// Name and roles of a link.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Named {
    /// Name for messages.
    pub name: String,
    /// Roles at this end.
    pub roles: Roles,
}

/// Reason for an incomplete frame.
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
        "{what} are requested, but no link carries pixels: here {}; give one the role pixels, and the emulator's end of it too",
        roles_of(links)
    )]
    NoPixels {
        what: &'static str,
        links: Vec<Named>,
    },
    #[error(
        "a frame of {bytes} bytes takes {:.1} s on this line, and the time-out is {} s: {}",
        takes.as_secs_f64(), timeout.as_secs_f64(),
        if *all_pixels {
            "choose --output windows or labels, or a longer --timeout"
        } else {
            "choose fewer --windows and --objects, or a longer --timeout"
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
    /// Cause of a frame that the line, by `airtime`, cannot carry within `timeout`.
    pub(crate) fn slow(
        header: &FrameHeader,
        airtime: impl Fn(usize) -> Duration,
        timeout: Duration,
    ) -> Option<Self> {
        let bytes = frame_bytes(header);
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

/// Bytes of a frame's packets, without the short header fields of each packet.
fn frame_bytes(header: &FrameHeader) -> usize {
    /// Column and row of a window, bytes.
    const POSITION: usize = 4;
    let size = usize::from(header.window_size);
    let blocks = header.blocks as usize;
    let pixels = match header.pixel_level {
        PixelLevel::None => 0,
        PixelLevel::Windows => {
            usize::from(header.windows) * (POSITION + packed_length(header.packing, size * size))
        }
        PixelLevel::Frame => packed_length(header.packing, header.pixels() as usize),
        // The last block may be short.
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
    fn messages_name_both_links_and_a_remedy() {
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
