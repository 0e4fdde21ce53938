//! Links that play a recording: received packets are repeated in order, and sent packets are
//! compared with the recorded ones.
//!
//! The emulator's behaviour depends only on the order of packets. Each received packet is held back
//! until the emulator has sent all that was recorded before it, and the reverse. No clock is used.

use super::Record;
use super::difference::{describe, first};
use super::place::{Position, position_of, sealed};
pub use super::recording::{Recording, load};
use super::silence::Silence;
use crate::error::LinkError;
use crate::inbox::{Inbound, InboxSender, Observer, inbox};
use crate::lock::lock;
use crate::outbox::{FAULT_REFUSED, Outbound, Outbox};
use crate::tally::Tally;
use crate::wire::Wire;
use bytes::Bytes;
use skyloop_firmware_sim::roles::Roles;
use skyloop_protocols::crc::Crc32;
use skyloop_protocols::packet::{CRC_LENGTH, HEADER_LENGTH, identify};
use skyloop_protocols::{Direction, FaultKind, Personality, Reply};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// A frame that was reproduced as recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Same {
    /// Frame number.
    pub frame: u32,
    /// Index of its link.
    pub link: usize,
    /// Sequence number of its attitude.
    pub attitude: u32,
    /// Number of its packets.
    pub packets: u32,
    /// CRC-32 of the payloads of its packets, in order: header fields, pixels, labels.
    pub crc32: u32,
    /// Whether the recording has all its packets.
    pub whole: bool,
}

/// Progress of a replay.
#[derive(Debug, Default)]
pub struct Progress {
    /// Frames; the last one may be incomplete.
    pub frames: Vec<Same>,
    /// Sent packets that equal the recorded ones.
    pub packets: u32,
    /// The first difference.
    pub difference: Option<String>,
}

struct State {
    events: Vec<Record<Bytes>>,
    on_the_bus: bool,
    /// Index of the next event.
    at: usize,
    /// Whether the next event is already in the inbox.
    fed: bool,
    /// Number of rendered frames, and whether another is being rendered.
    made: u32,
    making: bool,
    ends: Vec<End>,
    progress: Progress,
    /// Frame packets recorded on the bus and not yet sent.
    ahead: BTreeSet<Position>,
    /// Frame packets already sent, as recorded (on the bus).
    sent: BTreeMap<Position, Bytes>,
    /// Packets that were recorded again with other contents.
    altered: BTreeMap<Position, Vec<Bytes>>,
    silence: Silence,
    personality: &'static Personality,
}

/// One link.
struct End {
    /// Input of the received packets; `None` once the replay is over.
    input: Option<InboxSender>,
    /// Whether the emulator has polled the empty queue since the last packet.
    has_polled: bool,
    /// APID and sequence count of the packet taken last.
    taken: Option<(u16, u16)>,
    /// Remaining recorded packets of each frame.
    left: BTreeMap<u32, u32>,
    /// The current frame: index in the progress, columns, number of packets, CRC of the payloads.
    frame: usize,
    width: u16,
    due: u32,
    crc: Crc32,
}

/// A replay in progress.
#[derive(Clone)]
pub struct Replay {
    state: Arc<Mutex<State>>,
    over: Arc<AtomicBool>,
}

/// One link of a replay.
#[derive(Clone)]
struct Played {
    replay: Replay,
    link: usize,
}

impl Replay {
    /// Links that play `recording`.
    pub fn of(
        recording: Recording,
        personality: &'static Personality,
    ) -> (Vec<(Wire, Roles)>, Replay) {
        let Recording {
            links,
            events,
            on_the_bus,
            altered,
            ..
        } = recording;
        let mut left = vec![BTreeMap::new(); links.len()];
        let mut ahead = BTreeSet::new();
        let sent = |event: &&Record<Bytes>| event.direction == Direction::Out;
        for event in events.iter().filter(sent) {
            let Some(position) = position_of(personality, &event.item) else {
                continue;
            };
            if let Some(left) = left.get_mut(event.link as usize) {
                *left.entry(position.frame).or_default() += 1;
            }
            ahead.insert(position);
        }
        let (mut ends, mut outputs) = (Vec::new(), Vec::new());
        for left in left {
            let tally = Arc::new(Tally::default());
            let (input, output) = inbox(tally.clone());
            outputs.push((output, tally));
            ends.push(End {
                input: Some(input),
                has_polled: true,
                taken: None,
                left,
                frame: 0,
                width: 1,
                due: 0,
                crc: Crc32::new(),
            });
        }
        let replay = Replay {
            state: Arc::new(Mutex::new(State {
                events,
                on_the_bus,
                at: 0,
                fed: false,
                made: 0,
                making: false,
                ends,
                progress: Progress::default(),
                ahead,
                sent: BTreeMap::new(),
                altered,
                silence: Silence::from(Instant::now()),
                personality,
            })),
            over: Arc::new(AtomicBool::new(false)),
        };
        replay.feed(&mut lock(&replay.state));
        let wires = outputs.into_iter().zip(links).enumerate();
        let wires = wires.map(|(link, ((mut output, tally), roles))| {
            let played = Played {
                replay: replay.clone(),
                link,
            };
            output.observe(Box::new(played.clone()));
            let address = format!("recording://{link}");
            (Wire::new(address, output, played, tally), roles)
        });
        (wires.collect(), replay)
    }

    /// Set at the end of the recording or at a difference.
    pub fn over(&self) -> &AtomicBool {
        &self.over
    }

    /// How long the emulator has been idle without a packet taken or sent.
    pub fn idle(&self) -> Duration {
        lock(&self.state).silence.idle()
    }

    /// Time since the last packet taken or sent, idle or not.
    pub fn still(&self) -> Duration {
        lock(&self.state).silence.duration(Instant::now())
    }

    /// Ends a stalled replay: the missing next packet is the difference.
    pub fn give_up(&self) {
        let mut state = lock(&self.state);
        if state.progress.difference.is_none() {
            let missing = match state.events.get(state.at) {
                Some(event) => describe(state.personality, &event.item),
                None => "the end".to_string(),
            };
            state.progress.difference = Some(format!("{missing} was recorded, and nothing comes"));
        }
        self.end(&mut state);
    }

    /// Takes the progress.
    pub fn progress(&self) -> Progress {
        std::mem::take(&mut lock(&self.state).progress)
    }

    /// Queues the next event if it was received. A packet that followed an empty poll waits for an
    /// empty poll; one that followed more frames waits for those frames.
    fn feed(&self, state: &mut State) {
        let Some(event) = state.events.get(state.at) else {
            self.end(state);
            return;
        };
        let Some(end) = state.ends.get(event.link as usize) else {
            return;
        };
        if event.direction == Direction::Out || state.fed || (event.first && !end.has_polled) {
            return;
        }
        let is_early = match event.made {
            Some(made) => state.made < made,
            None => state.making,
        };
        if is_early {
            return;
        }
        let inbound = Inbound {
            exchange: event.exchange,
            packet: event.item.clone(),
            arrived: Instant::now(),
        };
        if let Some(input) = &end.input {
            // A closed emulator needs no packet.
            let _ = input.push(inbound);
        }
        state.fed = true;
    }

    fn advance(&self, state: &mut State) {
        state.at += 1;
        state.fed = false;
        state.silence.restart(Instant::now());
        self.feed(state);
    }

    /// Whether a packet equals the recorded one. A difference ends the replay.
    fn compare(&self, state: &mut State, link: usize, recorded: &[u8], packet: &[u8]) -> bool {
        let counted = state.on_the_bus.then(|| with_count_of(packet, recorded));
        let packet = counted.as_deref().unwrap_or(packet);
        let width = state.ends[link].width;
        let Some(words) = first(state.personality, width, recorded, packet) else {
            return true;
        };
        let name = describe(state.personality, recorded);
        state.progress.difference = Some(format!("{name}: {words}"));
        self.end(state);
        false
    }

    fn end(&self, state: &mut State) {
        for end in &mut state.ends {
            end.input = None;
        }
        self.over.store(true, Ordering::Relaxed);
    }
}

impl Observer for Played {
    fn taken(&self, inbound: &Inbound, _: bool) {
        let mut state = lock(&self.replay.state);
        state.ends[self.link].has_polled = false;
        state.ends[self.link].taken = identify(&inbound.packet);
        self.replay.advance(&mut state);
    }

    fn empty(&self) {
        let mut state = lock(&self.replay.state);
        state.ends[self.link].has_polled = true;
        state.silence.polled(Instant::now());
        if state.making {
            // Another thread of the emulator is rendering.
            state.silence.clear_idle();
        }
        self.replay.feed(&mut state);
    }

    fn making(&self, is: bool) {
        // Every link reports it: count it once.
        if self.link > 0 {
            return;
        }
        let mut state = lock(&self.replay.state);
        state.making = is;
        state.made = state.made.wrapping_add(u32::from(!is));
        self.replay.feed(&mut state);
    }

    fn holds_frame(&self) -> bool {
        let state = lock(&self.replay.state);
        let rest = state.events.get(state.at..).unwrap_or_default();
        let mut received = rest.iter().filter(|event| event.direction == Direction::In);
        let next = received.next().and_then(|event| event.made);
        state.progress.difference.is_none() && next.is_some_and(|made| made <= state.made)
    }
}

impl Outbox for Played {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let Outbound::Packet { packet, .. } = &what else {
            return Ok(None);
        };
        let (replay, link) = (&self.replay, self.link);
        let mut state = lock(&replay.state);
        if state.progress.difference.is_some() {
            return Ok(None);
        }
        let position = position_of(state.personality, packet);
        let frame = position.map(|position| position.frame);
        let left = frame.and_then(|frame| state.ends[link].left.get(&frame).copied());
        if state.on_the_bus && position.is_none() {
            // On the bus, short answers overtake frame packets: they are not compared.
            return Ok(None);
        }
        let before = position.and_then(|position| state.sent.get(&position).cloned());
        if let Some(recorded) = before {
            // A packet resent on request may be anywhere in a recording of the bus.
            replay.compare(&mut state, link, &recorded, packet);
            return Ok(None);
        }
        let Some(event) = state.events.get(state.at).cloned() else {
            return Ok(None);
        };
        if event.direction == Direction::In || event.link as usize != link {
            // Wait: the next event is a received packet, or a packet sent over another link.
            return Ok(Some(what));
        }
        if frame.is_some() && left.unwrap_or(0) == 0 {
            // The recorded emulator dropped this frame. Report a full queue to drop it again.
            state.silence.clear_idle();
            return Ok(Some(what));
        }
        if position.is_some_and(|position| state.on_the_bus && !state.ahead.contains(&position)) {
            // The bus recording lacks this packet, but has others of its frame.
            return Ok(None);
        }
        let altered = position.and_then(|position| state.altered.get(&position).cloned());
        let mut versions = [event.item].into_iter().chain(altered.unwrap_or_default());
        if !versions.all(|recorded| replay.compare(&mut state, link, &recorded, packet)) {
            return Ok(None);
        }
        if let (true, Some(position)) = (state.on_the_bus, position) {
            let recorded = state.events[state.at].item.clone();
            state.ahead.remove(&position);
            state.sent.insert(position, recorded);
        }
        state.record(link, packet, frame);
        replay.advance(&mut state);
        Ok(None)
    }

    /// Gives the recorded answer: the recording does not state whether faults were possible.
    fn injects(&self, _: FaultKind) -> Result<(), Cow<'static, str>> {
        let state = lock(&self.replay.state);
        match state.refusal(self.link) {
            None => Ok(()),
            Some(detail) => {
                let why = detail.strip_prefix(FAULT_REFUSED).unwrap_or(&detail);
                Err(why.to_string().into())
            }
        }
    }
}

impl State {
    /// Why the recorded emulator refused the last packet of this link; `None` if it did not.
    fn refusal(&self, link: usize) -> Option<String> {
        let taken = self.ends[link].taken?;
        let own = |e: &&Record<Bytes>| e.direction == Direction::Out && e.link as usize == link;
        let mut answers = self.events.get(self.at..)?.iter().filter(own);
        answers.find_map(|event| {
            // Only the first answer counts, since sequence counts wrap around.
            match (self.personality.decode_reply)(&event.item).ok()?.1 {
                Reply::Ack(ack) if (ack.apid, ack.sequence_count) == taken => Some(None),
                Reply::Nack(nack) if (nack.apid, nack.sequence_count) == taken => {
                    Some(Some(nack.detail.to_string()))
                }
                _ => None,
            }
        })?
    }

    /// Records a packet that equals the recorded one.
    fn record(&mut self, link: usize, packet: &[u8], frame: Option<u32>) {
        self.progress.packets += 1;
        let Some(frame) = frame else { return };
        let end = &mut self.ends[link];
        if let Some(left) = end.left.get_mut(&frame) {
            *left -= 1;
        }
        if let Ok((_, Reply::FrameHeader(header))) = (self.personality.decode_reply)(packet) {
            // The header of a known frame was resent on request.
            let known = |same: &Same| (same.frame, same.link) == (frame, link);
            if !self.progress.frames.iter().any(known) {
                (end.width, end.due, end.crc) = (header.width, header.packets(), Crc32::new());
                end.frame = self.progress.frames.len();
                self.progress.frames.push(Same {
                    frame,
                    link,
                    attitude: header.attitude_sequence,
                    packets: 0,
                    crc32: 0,
                    whole: false,
                });
            }
        }
        let Some(same) = self.progress.frames.get_mut(end.frame) else {
            return;
        };
        if (same.frame, same.link, same.whole) != (frame, link, false) {
            return;
        }
        let payload = packet.len().saturating_sub(CRC_LENGTH);
        let payload = packet.get(HEADER_LENGTH..payload).unwrap_or(&[]);
        end.crc = end.crc.update(payload);
        same.packets += 1;
        same.crc32 = end.crc.finish();
        same.whole = same.packets == end.due;
    }
}

/// The packet with the sequence count of another.
fn with_count_of(packet: &[u8], other: &[u8]) -> Vec<u8> {
    const COUNT: std::ops::Range<usize> = 2..4;
    let mut packet = packet.to_vec();
    if let (Some(to), Some(from)) = (packet.get_mut(COUNT), other.get(COUNT)) {
        to.copy_from_slice(from);
    }
    sealed(&packet)
}
