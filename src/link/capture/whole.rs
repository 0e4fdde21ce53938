//! What can be compared of a recording made on the bus, and in which order. What stands on a bus was queued before it:
//! packets that a client asked for again stand among others than where they are sent, and those of a frame that a Reset ends
//! still come after it. What the bus lost is not there.

use super::Record;
use super::difference::sealed;
use bytes::Bytes;
use skyloop_protocols::packet::HEADER_LENGTH;
use skyloop_protocols::{Command, Direction, FrameHeader, Personality, Reply};
use std::collections::{BTreeMap, BTreeSet};

/// Packets of a frame.
pub fn due(header: &FrameHeader) -> u32 {
    header.packets()
}

/// Where a packet belongs: in order of frames, and of the packets of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Its frame.
    pub frame: u32,
    /// Header, pixels, labels, end.
    part: u8,
    /// Its number among those.
    number: u32,
}

impl Place {
    /// Behind all others.
    const LAST: Place = Place {
        frame: u32::MAX,
        part: u8::MAX,
        number: u32::MAX,
    };
}

/// Where a packet belongs in its frame; none for an answer.
pub fn place_of(personality: &Personality, packet: &[u8]) -> Option<Place> {
    let sealed = sealed(packet);
    let (_, reply) = (personality.decode_reply)(&sealed).ok()?;
    let (part, number) = match &reply {
        Reply::FrameHeader(_) => (0, 0),
        Reply::PixelBlock(block) => (1, block.index),
        Reply::Windows(block) => (1, block.index),
        Reply::Compressed(block) => (1, block.index),
        Reply::Labels(labels) => (2, labels.part.into()),
        Reply::Objects(objects) => (2, objects.part.into()),
        Reply::FrameEnd(_) => (3, 0),
        Reply::Status(_) | Reply::Ack(_) | Reply::Nack(_) | Reply::Challenge(_) => return None,
    };
    // The first field of all packets of frames.
    let frame = packet.get(HEADER_LENGTH..)?.first_chunk()?;
    Some(Place {
        frame: u32::from_be_bytes(*frame),
        part,
        number,
    })
}

/// What can be compared of a recording made on the bus.
pub struct OnTheBus {
    /// What was received, and the packets of frames, each once and where it was sent first at the latest.
    pub events: Vec<Record<Bytes>>,
    /// Packets that came again otherwise than the first time.
    pub altered: BTreeMap<Place, Vec<Bytes>>,
    /// Frames of which packets are missing: given up, or lost on the bus.
    pub torn: usize,
    /// Frames that are left out, as packets of them are there twice although nobody asked.
    pub doubled: usize,
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

/// Sorts out what can be compared.
pub fn sorted_out(personality: &Personality, events: Vec<Record<Bytes>>) -> OnTheBus {
    let mut frames: BTreeMap<u32, Found> = BTreeMap::new();
    let mut asked = BTreeSet::new();
    let mut resets = Vec::new();
    let mut altered: BTreeMap<Place, Vec<Bytes>> = BTreeMap::new();
    for (at, event) in events.iter().enumerate() {
        if event.direction == Direction::In {
            match (personality.decode_command)(&event.item) {
                Ok((_, Command::Resend { frame, .. })) => {
                    asked.insert(frame);
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
            found.due = Some(due(&header));
        }
        match found.places.get(&place) {
            None => {
                found.places.insert(place, at);
            }
            Some(before) => {
                found.twice = true;
                if events[*before].item != event.item {
                    altered.entry(place).or_default().push(event.item.clone());
                }
            }
        }
    }
    let all = frames.len();
    frames.retain(|frame, found| !found.twice || asked.contains(frame));
    altered.retain(|place, _| frames.contains_key(&place.frame));
    let whole = |found: &&Found| found.due == u32::try_from(found.places.len()).ok();
    let moments = moments(&events, &frames, &resets);
    let kept = events.into_iter().zip(moments);
    let mut kept: Vec<_> = kept
        .filter_map(|(event, moment)| Some((moment?, event)))
        .collect();
    kept.sort_by_key(|(moment, _)| *moment);
    OnTheBus {
        events: kept.into_iter().map(|(_, event)| event).collect(),
        altered,
        torn: frames.len() - frames.values().filter(whole).count(),
        doubled: all - frames.len(),
    }
}

/// When it happened, in order: after which event of the recording, and what first of that.
type Moment = (usize, Option<Place>);

/// When the emulator took or sent each event; none of those that are left out.
fn moments(
    events: &[Record<Bytes>],
    frames: &BTreeMap<u32, Found>,
    resets: &[usize],
) -> Vec<Option<Moment>> {
    let mut moments = vec![None; events.len()];
    for found in frames.values() {
        // It sends a packet before those behind it: one that stands later was lost there, and sent again.
        let mut next = usize::MAX;
        for (place, at) in found.places.iter().rev() {
            next = next.min(*at);
            moments[*at] = Some((next, Some(*place)));
        }
    }
    // A Reset ends the frame under way: what is there of it had been sent. What was received keeps its order.
    let mut earliest = 0;
    for (at, _) in events
        .iter()
        .enumerate()
        .filter(|(_, event)| event.direction == Direction::In)
    {
        if resets.contains(&at) {
            let begun = frames.values().filter_map(|found| {
                let first = found.places.values().min()?;
                (*first < at).then_some(found.places.values().max()?)
            });
            earliest = begun.copied().max().unwrap_or(0).max(earliest);
        }
        // Behind all packets of that moment: those have a place, and in that order come first.
        earliest = earliest.max(at);
        moments[at] = Some((earliest, Some(Place::LAST)));
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::{FrameEnd, LabelPart, MAX_PACKET, WireTime, personality::NATIVE};
    use std::time::Duration;

    fn event(direction: Direction, item: &[u8]) -> Record<Bytes> {
        Record {
            at: Duration::ZERO,
            direction,
            link: 0,
            exchange: 0,
            first: false,
            made: None,
            item: Bytes::copy_from_slice(item),
        }
    }

    /// The header, from the golden vectors' own codec, of a frame with `parts` parts of labels and no pixels.
    fn header(frame: u32, parts: u16) -> Record<Bytes> {
        let golden = skyloop_protocols::FrameHeader {
            frame,
            attitude_sequence: 0,
            width: 8,
            height: 8,
            bits: 12,
            packing: skyloop_protocols::Packing::Bits12,
            pixel_level: skyloop_protocols::PixelLevel::None,
            label_level: skyloop_protocols::LabelLevel::Text,
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
    fn torn_frames_are_counted_and_doubled_ones_left_out() {
        // Without its header; with a part there twice for which nobody asked; whole.
        let events = vec![
            part(1, 0, 1, b'a'),
            header(2, 1),
            part(2, 0, 1, b'a'),
            part(2, 0, 1, b'a'),
            header(3, 1),
            part(3, 0, 1, b'a'),
            end(3),
        ];
        let found = sorted_out(&NATIVE, events.clone());
        let left = [0, 4, 5, 6].map(|at: usize| events[at].clone());
        assert_eq!(
            (found.torn, found.doubled, &found.events[..]),
            (1, 1, &left[..])
        );
        assert!(found.altered.is_empty());
    }

    #[test]
    fn what_stands_behind_a_reset_was_sent_before_it() {
        let events = vec![
            header(1, 3),
            command(&Command::Reset),
            command(&Command::Ping),
            part(1, 0, 3, b'a'),
            part(1, 1, 3, b'b'),
            command(&Command::Ping),
            header(2, 1),
            part(2, 0, 1, b'a'),
            end(2),
        ];
        let found = sorted_out(&NATIVE, events.clone());
        let order = [0, 3, 4, 1, 2, 5, 6, 7, 8].map(|at: usize| events[at].clone());
        assert_eq!((found.events, found.torn), (order.to_vec(), 1));
    }

    #[test]
    fn what_was_sent_again_stands_where_it_was_sent_first() {
        // Part 1 was lost on the way to the log, part 0 was not; the next frame has begun meanwhile.
        let events = vec![
            header(1, 3),
            part(1, 0, 3, b'a'),
            part(1, 2, 3, b'c'),
            end(1),
            resend(1),
            header(2, 0),
            end(2),
            part(1, 0, 3, b'a'),
            part(1, 1, 3, b'b'),
        ];
        let found = sorted_out(&NATIVE, events.clone());
        let order = [0, 1, 8, 2, 3, 4, 5, 6].map(|at: usize| events[at].clone());
        assert_eq!(found.events, order);
        assert_eq!((found.torn, found.altered.len()), (0, 0));
    }

    #[test]
    fn what_came_again_otherwise_is_kept() {
        let other = part(1, 0, 1, b'b');
        let events = vec![header(1, 1), part(1, 0, 1, b'a'), resend(1), other.clone()];
        let found = sorted_out(&NATIVE, events.clone());
        assert_eq!(found.events, events[..3]);
        let altered: Vec<_> = found.altered.into_values().collect();
        assert_eq!(altered, [vec![other.item]]);
    }
}
