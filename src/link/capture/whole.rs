//! Which frames of a recording made on the bus can be compared: those whose packets are all there, each once.

use super::Record;
use super::difference::sealed;
use bytes::Bytes;
use skyloop_protocols::packet::HEADER_LENGTH;
use skyloop_protocols::{Command, Direction, FrameHeader, Personality, Reply};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Frames of a recording that are not compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct LeftOut {
    /// The client has asked for packets of them again: on the bus those stand among others, where they do not come again.
    pub resent: usize,
    /// Packets of them are missing, or there twice.
    pub torn: usize,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reasons = [
            (self.resent, "the client had packets of them sent again"),
            (self.torn, "packets of them are missing"),
        ];
        let told = reasons.iter().filter(|(frames, _)| *frames > 0);
        let told: Vec<String> = told
            .map(|(frames, why)| format!("{frames} because {why}"))
            .collect();
        f.write_str(&told.join(", "))
    }
}

/// Packets of a frame.
pub fn due(header: &FrameHeader) -> u32 {
    1 + header.blocks + u32::from(header.label_parts)
}

/// The frame that a packet belongs to: the first field of all packets that take credit.
pub fn frame_of(personality: &Personality, packet: &[u8]) -> Option<u32> {
    let sealed = sealed(packet);
    let (_, reply) = (personality.decode_reply)(&sealed).ok()?;
    if !reply.takes_credit() {
        return None;
    }
    let field = packet.get(HEADER_LENGTH..)?.first_chunk()?;
    Some(u32::from_be_bytes(*field))
}

/// The events without the answers and without the frames that are left out.
pub fn whole_frames(
    personality: &Personality,
    events: Vec<Record<Bytes>>,
) -> (Vec<Record<Bytes>>, LeftOut) {
    let mut missing = BTreeMap::new();
    let mut again = BTreeSet::new();
    for event in &events {
        if event.direction == Direction::In {
            let command = (personality.decode_command)(&event.item);
            if let Ok((_, Command::Resend { frame, .. })) = command {
                again.insert(frame);
            }
            continue;
        }
        let Some(frame) = frame_of(personality, &event.item) else {
            continue;
        };
        let missing = missing.entry(frame).or_insert(0_i64);
        *missing -= 1;
        if let Ok((_, Reply::FrameHeader(header))) = (personality.decode_reply)(&event.item) {
            *missing += i64::from(due(&header));
        }
    }
    let mut left_out = LeftOut::default();
    missing.retain(|frame, missing| {
        // What had not been sent yet when it was asked for came once.
        match (*missing, again.contains(frame)) {
            (0, _) => return true,
            (_, true) => left_out.resent += 1,
            (_, false) => left_out.torn += 1,
        }
        false
    });
    let kept = |event: &Record<Bytes>| {
        event.direction == Direction::In
            || frame_of(personality, &event.item).is_some_and(|frame| missing.contains_key(&frame))
    };
    (events.into_iter().filter(kept).collect(), left_out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::{LabelPart, MAX_PACKET, WireTime, personality::NATIVE};
    use std::time::Duration;

    fn event(direction: Direction, item: &[u8]) -> Record<Bytes> {
        Record {
            at: Duration::ZERO,
            direction,
            link: 0,
            exchange: 0,
            first: false,
            item: Bytes::copy_from_slice(item),
        }
    }

    /// Parts of frames without their headers; of one, parts were asked for again.
    #[test]
    fn frames_that_are_left_out_are_counted_with_the_reason() {
        let mut buffer = [0; MAX_PACKET];
        let mut events = Vec::new();
        for frame in [1, 1, 2] {
            let part = Reply::Labels(LabelPart {
                frame,
                part: 0,
                parts: 1,
                text: b"{}",
            });
            let length = part.encode(0, WireTime::default(), &mut buffer).unwrap();
            events.push(event(Direction::Out, &buffer[..length]));
        }
        let resend = Command::Resend {
            frame: 1,
            first: 1,
            count: 1,
        };
        let length = resend.encode(0, WireTime::default(), &mut buffer).unwrap();
        events.push(event(Direction::In, &buffer[..length]));
        let (kept, left_out) = whole_frames(&NATIVE, events);
        assert_eq!(kept.len(), 1, "the command");
        let told = "1 because the client had packets of them sent again, 1 because packets of them are missing";
        assert_eq!(left_out.to_string(), told);
        assert_eq!(LeftOut::default().to_string(), "");
    }
}
