//! A recording, read from its file for a replay.
//!
//! On a bus, recorded frames had been queued before. Repeated packets stand where they were
//! repeated, packets of a frame that a Reset ends follow the Reset, and lost ones are missing. So
//! such a recording is sorted first.

use super::place::{Place, place_of};
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
    /// What the recorded run was made from, where the recording says so.
    pub origin: Option<Origin>,
    /// The links of the run.
    pub links: Vec<Roles>,
    /// Their packets.
    pub events: Vec<Record<Bytes>>,
    /// Whether it was made on the bus: packets were queued, and short ones overtook long ones. Then
    /// only frames are compared, without their sequence counts.
    pub on_the_bus: bool,
    /// Packets that came again, on the client's request, otherwise than the first time.
    pub(super) altered: BTreeMap<Place, Vec<Bytes>>,
    /// Frames of which packets are missing in it, on the bus: the others are compared.
    pub torn: usize,
    /// Frames that are not compared: packets of them are there twice without a request.
    pub doubled: usize,
}

/// Reads a recording, whichever format it has.
pub fn load(file: &Path, personality: &Personality) -> Result<Recording, CaptureError> {
    let no_recording = || CaptureError::Format {
        file: path_text(file),
        reason: "neither pcapng nor a log of candump: record one with --capture".to_string(),
    };
    // Before the rest is read.
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
        return Ok(sorted_out(personality, packets));
    }
    let found = pcapng::read(file, &Bytes::from(bytes))?;
    let roles = |link: &String| {
        let address = Address::parse(link);
        // A loopback has no target, and all roles.
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

/// What a recording has of one frame.
#[derive(Default)]
struct Found {
    /// Packets that it should have.
    due: Option<u32>,
    /// Where each of its packets stands first.
    places: BTreeMap<Place, usize>,
    /// Whether packets are there twice.
    twice: bool,
}

/// The comparable part of a recording made on a bus: received packets, and each packet of a frame
/// once, no later than it was first sent.
fn sorted_out(personality: &Personality, events: Vec<Record<Bytes>>) -> Recording {
    let mut frames: BTreeMap<u32, Found> = BTreeMap::new();
    let mut requested = BTreeSet::new();
    let mut resets = Vec::new();
    let mut altered: BTreeMap<Place, Vec<Bytes>> = BTreeMap::new();
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
        let Some(place) = place_of(personality, &event.item) else {
            continue;
        };
        let found = frames.entry(place.frame).or_default();
        if let Ok((_, Reply::FrameHeader(header))) = (personality.decode_reply)(&event.item) {
            found.due = Some(header.packets());
        }
        let before = *found.places.entry(place).or_insert(at);
        found.twice |= before != at;
        if events[before].item != event.item {
            altered.entry(place).or_default().push(event.item.clone());
        }
    }
    let all = frames.len();
    frames.retain(|frame, found| !found.twice || requested.contains(frame));
    altered.retain(|place, _| frames.contains_key(&place.frame));
    let whole = |found: &&Found| found.due == u32::try_from(found.places.len()).ok();
    let moments = moments(&events, &frames, &resets);
    let kept = events.into_iter().zip(moments);
    let mut kept: Vec<_> = kept
        .filter_map(|(event, moment)| Some((moment?, event)))
        .collect();
    kept.sort_by_key(|(moment, _)| *moment);
    Recording {
        origin: None,
        links: vec![Roles::ALL],
        on_the_bus: true,
        events: kept.into_iter().map(|(_, event)| event).collect(),
        altered,
        torn: frames.len() - frames.values().filter(whole).count(),
        doubled: all - frames.len(),
    }
}

/// When an event happened: after which recorded event, and its place among several such.
type Moment = (usize, Place);

/// When the emulator took or sent each event; none of those that are not compared.
fn moments(
    events: &[Record<Bytes>],
    frames: &BTreeMap<u32, Found>,
    resets: &[usize],
) -> Vec<Option<Moment>> {
    let mut moments = vec![None; events.len()];
    for found in frames.values() {
        // Packets are sent in order: one after a later one was lost, and sent again.
        let mut next = usize::MAX;
        for (place, at) in found.places.iter().rev() {
            next = next.min(*at);
            moments[*at] = Some((next, *place));
        }
    }
    // A Reset ends the current frame, whose packets were sent before. Received packets keep their
    // order.
    let mut earliest = 0;
    let received = |at: &usize| events[*at].direction == Direction::In;
    for at in (0..events.len()).filter(received) {
        if resets.contains(&at) {
            let begun = frames.values().filter_map(|found| {
                let first = found.places.values().min()?;
                (*first < at).then_some(found.places.values().max()?)
            });
            earliest = begun.copied().max().unwrap_or(0).max(earliest);
        }
        // After all packets of that moment.
        earliest = earliest.max(at);
        moments[at] = Some((earliest, Place::LAST));
    }
    moments
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
    fn what_is_compared_stands_where_it_was_sent_first() {
        let [ping, reset] = [Command::Ping, Command::Reset].map(|one| command(&one));
        for (case, events, order, torn, doubled) in [
            (
                "without its header; a part twice that nobody requested; whole",
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
                "what follows a Reset was sent before it",
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
                "the log lacks part 1, both come again, and the next frame has begun",
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
            let found = sorted_out(&NATIVE, events.clone());
            let order: Vec<_> = order.iter().map(|at: &usize| events[*at].clone()).collect();
            assert_eq!(found.events, order, "{case}");
            assert_eq!((found.torn, found.doubled), (torn, doubled), "{case}");
            assert!(found.altered.is_empty(), "{case}");
        }
        // What came again otherwise is kept.
        let other = part(1, 0, 1, b'b');
        let events = vec![header(1, 1), part(1, 0, 1, b'a'), resend(1), other.clone()];
        let found = sorted_out(&NATIVE, events.clone());
        assert_eq!(found.events, events[..3]);
        let altered: Vec<_> = found.altered.into_values().collect();
        assert_eq!(altered, [vec![other.item]]);
    }
}
