//! A recording, read from its file for a replay.

use super::pcapng::Packets;
use super::whole::{OnTheBus, Place, sorted_out};
use super::{CaptureError, Origin, Record, candump, pcapng};
use crate::link::{LinkUrl, Roles};
use bytes::Bytes;
use skyloop_orbit::LARGEST_FILE;
use skyloop_orbit::path_text;
use skyloop_protocols::Personality;
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

/// A recording.
#[derive(Debug, Default)]
pub struct Recording {
    /// What the recorded run was made from, where the recording says so.
    pub origin: Option<Origin>,
    /// The links of the run.
    pub links: Vec<Roles>,
    /// Their packets.
    pub events: Vec<Record<Bytes>>,
    /// Whether it was made on the bus and not at the emulator's end: packets were queued between the two, and short ones
    /// overtook long ones. Then only frames are compared, and not their sequence counts.
    pub on_the_bus: bool,
    /// Packets that came again, on the client's request, otherwise than the first time.
    pub(super) altered: BTreeMap<Place, Vec<Bytes>>,
    /// Frames of which packets are missing in it, on the bus: the others are compared.
    pub torn: usize,
    /// Frames that are in it and not compared: packets of them are there twice, and nobody had asked.
    pub doubled: usize,
}

/// Reads a recording, whichever format it has.
pub fn load(file: &Path, personality: &Personality) -> Result<Recording, CaptureError> {
    let no_recording = || CaptureError::Format {
        file: path_text(file),
        reason: "neither pcapng nor a log of candump: record one with --capture".to_string(),
    };
    // Before the rest is read.
    let check = |head: &[u8]| match pcapng::is_pcapng(head) || is_candump(head) {
        true => Ok(()),
        false => Err(ErrorKind::InvalidData.into()),
    };
    let octets = skyloop_orbit::read_bytes(file, LARGEST_FILE, check);
    let octets = octets.map_err(|source| match source.kind() {
        ErrorKind::InvalidData => no_recording(),
        _ => CaptureError::Read {
            file: path_text(file),
            source,
        },
    })?;
    if pcapng::is_pcapng(&octets) {
        let found = pcapng::read(file, &Bytes::from(octets))?;
        let Packets {
            comments,
            links,
            records,
        } = found;
        let roles = |link: &String| match LinkUrl::parse(link) {
            Ok(url) => url.roles().unwrap_or(Roles::ALL),
            // A loopback.
            Err(_) => Roles::ALL,
        };
        return Ok(Recording {
            origin: Origin::of_lines(&comments),
            links: links.iter().map(roles).collect(),
            events: records,
            ..Recording::default()
        });
    }
    match String::from_utf8(octets) {
        Ok(text) => {
            let events = candump::packets(&candump::read(file, &text)?);
            let OnTheBus {
                events,
                altered,
                torn,
                doubled,
            } = sorted_out(personality, events);
            Ok(Recording {
                origin: None,
                links: vec![Roles::ALL],
                events,
                on_the_bus: true,
                altered,
                torn,
                doubled,
            })
        }
        Err(_) => Err(no_recording()),
    }
}

/// Whether a file that begins so may be a log of candump.
fn is_candump(head: &[u8]) -> bool {
    head.trim_ascii_start().starts_with(b"(")
}
