//! A recording, read from its file for a replay.

use super::pcapng::Packets;
use super::whole::{OnTheBus, Place, sorted_out};
use super::{CaptureError, Record, candump, pcapng};
use crate::link::{LinkUrl, Roles};
use bytes::Bytes;
use skyloop_protocols::Personality;
use std::collections::BTreeMap;
use std::path::Path;

/// A recording.
#[derive(Debug, Default)]
pub struct Recording {
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
    let octets = std::fs::read(file).map_err(|source| CaptureError::Read {
        file: file.display().to_string(),
        source,
    })?;
    if pcapng::is_pcapng(&octets) {
        let Packets { links, records } = pcapng::read(file, &octets)?;
        let roles = |link: &String| match LinkUrl::parse(link) {
            Ok(url) => url.roles().unwrap_or(Roles::ALL),
            // A loopback.
            Err(_) => Roles::ALL,
        };
        return Ok(Recording {
            links: links.iter().map(roles).collect(),
            events: records,
            ..Recording::default()
        });
    }
    match String::from_utf8(octets) {
        Ok(text) if text.trim_start().starts_with('(') => {
            let events = candump::packets(&candump::read(file, &text)?);
            let OnTheBus {
                events,
                altered,
                torn,
                doubled,
            } = sorted_out(personality, events);
            Ok(Recording {
                links: vec![Roles::ALL],
                events,
                on_the_bus: true,
                altered,
                torn,
                doubled,
            })
        }
        _ => Err(CaptureError::Format {
            file: file.display().to_string(),
            reason: "neither pcapng nor a log of candump: record one with --capture".to_string(),
        }),
    }
}
