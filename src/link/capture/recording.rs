//! Reads a recording for a replay.
//!
//! A CAN bus is recorded behind the outbound queue. So resent packets are at the time of the
//! resend, packets queued before a Reset may follow it, and lost packets are missing. Such a
//! recording is sorted first.

use super::place::{Position, position_of};
use super::{CaptureError, Origin, Record, candump, pcapng};
use bytes::Bytes;
use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::roles::Roles;
use skyloop_orbit::{LARGEST_FILE, path_text};
use skyloop_protocols::{Command, Direction, Personality, Reply};
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::Path;

/// A recording.
#[derive(Debug, Default)]
pub struct Recording {
    /// Settings and inputs of the recorded run, where recorded.
    pub origin: Option<Origin>,
    /// The links of the run.
    pub links: Vec<Roles>,
    /// The packets.
    pub events: Vec<Record<Bytes>>,
    /// Whether it was recorded on a CAN bus, where short packets overtake long ones. Then only
    /// frame packets are compared, without their sequence counts.
    pub on_the_bus: bool,
    /// Packets resent on request with other contents than the first time.
    pub(super) altered: BTreeMap<Position, Vec<Bytes>>,
    /// Number of incomplete frames on the bus. Their recorded packets are compared.
    pub torn: usize,
    /// Number of frames not compared, since packets were recorded twice without a request.
    pub doubled: usize,
}

/// Reads a recording in either format.
pub fn load(file: &Path, personality: &Personality) -> Result<Recording, CaptureError> {
    let no_recording = || CaptureError::Format {
        file: path_text(file),
        reason: "neither pcapng nor a candump log: record one with --capture".to_string(),
    };
    // Checked before the rest is read.
    let check = |head: &[u8]| {
        let is_known = pcapng::is_pcapng(head) || is_candump(head);
        is_known.then_some(()).ok_or(ErrorKind::InvalidData.into())
    };
    let bytes = skyloop_orbit::read_bytes(file, LARGEST_FILE, check);
    let bytes = bytes.map_err(|source| match source.kind() {
        ErrorKind::InvalidData => no_recording(),
        _ => CaptureError::Read {
            file: path_text(file),
            source,
        },
    })?;
    if !pcapng::is_pcapng(&bytes) {
        let text = String::from_utf8(bytes).map_err(|_| no_recording())?;
        let packets = candump::packets(&candump::read(file, &text)?);
        return Ok(sort_bus_recording(personality, packets));
    }
    let found = pcapng::read(file, &Bytes::from(bytes))?;
    let roles = |link: &String| {
        let address = Address::parse(link);
        // The address of a loopback has no target; it has all roles.
        address.map_or(Ok(Roles::ALL), |address| address.roles())
    };
    let roles = |link| roles(link).unwrap_or(Roles::ALL);
    Ok(Recording {
        origin: Origin::of_lines(&found.comments),
        links: found.links.iter().map(roles).collect(),
        events: found.records,
        ..Recording::default()
    })
}

/// Whether a file that begins so may be a log of candump.
fn is_candump(head: &[u8]) -> bool {
    head.trim_ascii_start().starts_with(b"(")
}

/// Recorded packets of one frame.
#[derive(Default)]
struct Found {
    /// Expected number of packets.
    due: Option<u32>,
    /// Index of the first record of each packet.
    positions: BTreeMap<Position, usize>,
    /// Whether a packet was recorded twice.
    twice: bool,
}

/// The comparable part of a bus recording: received packets, and each frame packet once, at the
/// time it was first sent.
fn sort_bus_recording(personality: &Personality, events: Vec<Record<Bytes>>) -> Recording {
    let mut frames: BTreeMap<u32, Found> = BTreeMap::new();
    let mut requested = BTreeSet::new();
    let mut resets = Vec::new();
    let mut altered: BTreeMap<Position, Vec<Bytes>> = BTreeMap::new();
    for (at, event) in events.iter().enumerate() {
        if event.direction == Direction::In {
            match (personality.decode_command)(&event.item) {
                Ok((_, Command::Resend { frame, .. })) => {
                    requested.insert(frame);
                }
                Ok((_, Command::Reset)) => resets.push(at),
                _ => {}
            }
            continue;
        }
        let Some(position) = position_of(personality, &event.item) else {
            continue;
        };
        let found = frames.entry(position.frame).or_default();
        if let Ok((_, Reply::FrameHeader(header))) = (personality.decode_reply)(&event.item) {
            found.due = Some(header.packets());
        }
        let before = *found.positions.entry(position).or_insert(at);
        found.twice |= before != at;
        if events[before].item != event.item {
            altered
                .entry(position)
                .or_default()
                .push(event.item.clone());
        }
    }
    let all = frames.len();
    frames.retain(|frame, found| !found.twice || requested.contains(frame));
    altered.retain(|position, _| frames.contains_key(&position.frame));
    let whole = |found: &&Found| found.due == u32::try_from(found.positions.len()).ok();
    let sort_keys = sort_keys(&events, &frames, &resets);
    let sorted = events.into_iter().zip(sort_keys);
    let mut sorted: Vec<_> = sorted
        .filter_map(|(event, key)| Some((key?, event)))
        .collect();
    sorted.sort_by_key(|(key, _)| *key);
    Recording {
        origin: None,
        links: vec![Roles::ALL],
        on_the_bus: true,
        events: sorted.into_iter().map(|(_, event)| event).collect(),
        altered,
        torn: frames.len() - frames.values().filter(whole).count(),
        doubled: all - frames.len(),
    }
}

/// Sort key of an event: index of the preceding record, then the position in the frame.
type SortKey = (usize, Position);

/// When the emulator took or sent each event; `None` for events that are not compared.
fn sort_keys(
    events: &[Record<Bytes>],
    frames: &BTreeMap<u32, Found>,
    resets: &[usize],
) -> Vec<Option<SortKey>> {
    let mut sort_keys = vec![None; events.len()];
    for found in frames.values() {
        // Packets are sent in order. A packet recorded after a later one was lost and resent.
        let mut next = usize::MAX;
        for (position, at) in found.positions.iter().rev() {
            next = next.min(*at);
            sort_keys[*at] = Some((next, *position));
        }
    }
    // A Reset ends the current frame, so it is placed after all packets of that frame. The order of
    // received packets is unchanged.
    let mut earliest = 0;
    let received = |at: &usize| events[*at].direction == Direction::In;
    for at in (0..events.len()).filter(received) {
        if resets.contains(&at) {
            let begun = frames.values().filter_map(|found| {
                let first = found.positions.values().min()?;
                (*first < at).then_some(found.positions.values().max()?)
            });
            earliest = begun.copied().max().unwrap_or(0).max(earliest);
        }
        // After all packets with that key.
        earliest = earliest.max(at);
        sort_keys[at] = Some((earliest, Position::LAST));
    }
    sort_keys
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::{
        FrameEnd, FrameHeader, LabelLevel, LabelPart, MAX_PACKET, Packing, PixelLevel, WireTime,
    };
    use std::time::Duration;

    fn event(direction: Direction, item: &[u8]) -> Record<Bytes> {
        Record::plain(Duration::ZERO, direction, Bytes::copy_from_slice(item))
    }

    /// The header of a frame with `parts` parts of labels and no pixels.
    fn header(frame: u32, parts: u16) -> Record<Bytes> {
        let golden = FrameHeader {
            frame,
            attitude_sequence: 0,
            width: 8,
            height: 8,
            bits: 12,
            packing: Packing::Bits12,
            pixel_level: PixelLevel::None,
            label_level: LabelLevel::Text,
            window_size: 0,
            windows: 0,
            blocks: 0,
            label_parts: parts,
            label_bytes: 1375 * u32::from(parts),
            exposure_start: WireTime(0),
            exposure_end: WireTime(1),
            seed: 1,
            gain_e_per_dn: 1.0,
            offset_dn: 0.0,
        };
        out(&Reply::FrameHeader(golden))
    }

    fn part(frame: u32, part: u16, parts: u16, letter: u8) -> Record<Bytes> {
        let text = [letter; 1375];
        out(&Reply::Labels(LabelPart {
            frame,
            part,
            parts,
            text: &text,
        }))
    }

    fn end(frame: u32) -> Record<Bytes> {
        out(&Reply::FrameEnd(FrameEnd {
            frame,
            ..FrameEnd::default()
        }))
    }

    fn out(reply: &Reply<'_>) -> Record<Bytes> {
        let mut buffer = [0; MAX_PACKET];
        let length = reply.encode(0, WireTime::default(), &mut buffer).unwrap();
        event(Direction::Out, &buffer[..length])
    }

    fn resend(frame: u32) -> Record<Bytes> {
        command(&Command::Resend {
            frame,
            first: 1,
            count: 1,
        })
    }

    fn command(command: &Command) -> Record<Bytes> {
        let mut buffer = [0; MAX_PACKET];
        let length = command.encode(0, WireTime::default(), &mut buffer).unwrap();
        event(Direction::In, &buffer[..length])
    }

    #[test]
    fn compared_packets_are_sorted_by_first_transmission() {
        let [ping, reset] = [Command::Ping, Command::Reset].map(|one| command(&one));
        for (case, events, order, torn, doubled) in [
            (
                "frame 1 without header, frame 2 with an unrequested double, frame 3 complete",
                vec![
                    part(1, 0, 1, b'a'),
                    header(2, 1),
                    part(2, 0, 1, b'a'),
                    part(2, 0, 1, b'a'),
                    header(3, 1),
                    part(3, 0, 1, b'a'),
                    end(3),
                ],
                vec![0, 4, 5, 6],
                1,
                1,
            ),
            (
                "packets after a Reset were sent before it",
                vec![
                    header(1, 3),
                    reset,
                    ping.clone(),
                    part(1, 0, 3, b'a'),
                    part(1, 1, 3, b'b'),
                    ping,
                    header(2, 1),
                    part(2, 0, 1, b'a'),
                    end(2),
                ],
                vec![0, 3, 4, 1, 2, 5, 6, 7, 8],
                1,
                0,
            ),
            (
                "part 1 is missing, both parts are resent, after the start of the next frame",
                vec![
                    header(1, 3),
                    part(1, 0, 3, b'a'),
                    part(1, 2, 3, b'c'),
                    end(1),
                    resend(1),
                    header(2, 0),
                    end(2),
                    part(1, 0, 3, b'a'),
                    part(1, 1, 3, b'b'),
                ],
                vec![0, 1, 8, 2, 3, 4, 5, 6],
                0,
                0,
            ),
        ] {
            let found = sort_bus_recording(&NATIVE, events.clone());
            let order: Vec<_> = order.iter().map(|at: &usize| events[*at].clone()).collect();
            assert_eq!(found.events, order, "{case}");
            assert_eq!((found.torn, found.doubled), (torn, doubled), "{case}");
            assert!(found.altered.is_empty(), "{case}");
        }
        // A resent packet with other contents is stored.
        let other = part(1, 0, 1, b'b');
        let events = vec![header(1, 1), part(1, 0, 1, b'a'), resend(1), other.clone()];
        let found = sort_bus_recording(&NATIVE, events.clone());
        assert_eq!(found.events, events[..3]);
        let altered: Vec<_> = found.altered.into_values().collect();
        assert_eq!(altered, [vec![other.item]]);
    }
}
