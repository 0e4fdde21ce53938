//! Links that play a recording: received packets come again in their order, and sent packets are
//! compared with the recorded ones.
//!
//! The run of the emulator depends only on the order of packets: each one is held back until the
//! emulator has sent what was recorded before it, and sending waits for what it took before. No
//! clock is used.

use super::Record;
use super::difference::{called, first};
use super::place::{Place, place_of, sealed};
pub use super::recording::{Recording, load};
use super::silence::Silence;
use crate::error::LinkError;
use crate::inbox::{Inbound, Intake, Observer, inbox};
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

/// A frame that came again as it was recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Same {
    /// Its number.
    pub frame: u32,
    /// Over which link it went.
    pub link: usize,
    /// That of its attitude.
    pub attitude: u32,
    /// Its packets.
    pub packets: u32,
    /// CRC-32 of the payloads of its packets, in order: header fields, digits, labels.
    pub crc32: u32,
    /// Whether the recording has all of its packets.
    pub whole: bool,
}

/// How far a replay has come.
#[derive(Debug, Default)]
pub struct Progress {
    /// Frames, the last one perhaps still under way.
    pub frames: Vec<Same>,
    /// Packets sent and equal to the recorded ones.
    pub packets: u32,
    /// The first difference.
    pub difference: Option<String>,
}

/// What the two ends of the link share.
struct State {
    events: Vec<Record<Bytes>>,
    on_the_bus: bool,
    /// The next event.
    at: usize,
    /// Whether the next event is a packet that waits in the inbox.
    fed: bool,
    /// Frames that the emulator has made, and whether it makes another.
    made: u32,
    making: bool,
    ends: Vec<End>,
    progress: Progress,
    /// Packets of frames that were recorded on the bus, and have not been sent yet.
    ahead: BTreeSet<Place>,
    /// Packets of frames that have been sent, as they were recorded (on the bus).
    sent: BTreeMap<Place, Bytes>,
    /// Packets that were recorded a second time, otherwise.
    altered: BTreeMap<Place, Vec<Bytes>>,
    silence: Silence,
    personality: &'static Personality,
}

/// One link.
struct End {
    /// Where what was received comes in again; none once the replay is over.
    intake: Option<Intake>,
    /// Whether the emulator has looked for a packet in vain since the last.
    looked: bool,
    /// The packet that it took last: APID and sequence count.
    taken: Option<(u16, u16)>,
    /// Packets that the recording still has of each frame.
    left: BTreeMap<u32, u32>,
    /// The current frame: its place in the progress, its columns, its packets, the CRC of their
    /// payloads.
    frame: usize,
    width: u16,
    due: u32,
    crc: Crc32,
}

/// A replay under way.
#[derive(Clone)]
pub struct Replay {
    state: Arc<Mutex<State>>,
    over: Arc<AtomicBool>,
}

/// A replay as one of the links sees it.
#[derive(Clone)]
struct Played {
    replay: Replay,
    link: usize,
}

impl Replay {
    /// The links that play `recording`.
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
            let Some(place) = place_of(personality, &event.item) else {
                continue;
            };
            if let Some(left) = left.get_mut(event.link as usize) {
                *left.entry(place.frame).or_default() += 1;
            }
            ahead.insert(place);
        }
        let (mut ends, mut inboxes) = (Vec::new(), Vec::new());
        for left in left {
            let tally = Arc::new(Tally::default());
            let (intake, inbox) = inbox(tally.clone());
            inboxes.push((inbox, tally));
            ends.push(End {
                intake: Some(intake),
                looked: true,
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
        let wires = inboxes.into_iter().zip(links).enumerate();
        let wires = wires.map(|(link, ((mut inbox, tally), roles))| {
            let played = Played {
                replay: replay.clone(),
                link,
            };
            inbox.observe(Box::new(played.clone()));
            let address = format!("recording://{link}");
            (Wire::new(address, inbox, played, tally), roles)
        });
        (wires.collect(), replay)
    }

    /// Set when everything has been played, or a difference was found.
    pub fn over(&self) -> &AtomicBool {
        &self.over
    }

    /// How long the emulator has had nothing to do, and nothing has been taken or sent.
    pub fn idle(&self) -> Duration {
        lock(&self.state).silence.idle()
    }

    /// How long nothing has been taken or sent, whatever the emulator does.
    pub fn still(&self) -> Duration {
        lock(&self.state).silence.lasts(Instant::now())
    }

    /// Ends a replay that stands still: what should have come next is the difference.
    pub fn give_up(&self) {
        let mut state = lock(&self.state);
        if state.progress.difference.is_none() {
            let missing = match state.events.get(state.at) {
                Some(event) => called(state.personality, &event.item),
                None => "the end".to_string(),
            };
            state.progress.difference = Some(format!("{missing} was recorded, and nothing comes"));
        }
        self.end(&mut state);
    }

    /// What came of it.
    pub fn progress(&self) -> Progress {
        std::mem::take(&mut lock(&self.state).progress)
    }

    /// Queues the next event if it was received. One that came after a poll in vain waits for such
    /// a poll; one that came after more frames, for those.
    fn feed(&self, state: &mut State) {
        let Some(event) = state.events.get(state.at) else {
            self.end(state);
            return;
        };
        let Some(end) = state.ends.get(event.link as usize) else {
            return;
        };
        if event.direction == Direction::Out || state.fed || (event.first && !end.looked) {
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
        if let Some(intake) = &end.intake {
            // The emulator that has gone needs no packet.
            let _ = intake.push(inbound);
        }
        state.fed = true;
    }

    fn advance(&self, state: &mut State) {
        state.at += 1;
        state.fed = false;
        state.silence.broken(Instant::now());
        self.feed(state);
    }

    /// Whether a packet is the recorded one; else that is the difference, and the end.
    fn compare(&self, state: &mut State, link: usize, recorded: &[u8], packet: &[u8]) -> bool {
        let counted = state.on_the_bus.then(|| counted_as(packet, recorded));
        let packet = counted.as_deref().unwrap_or(packet);
        let width = state.ends[link].width;
        let Some(words) = first(state.personality, width, recorded, packet) else {
            return true;
        };
        let name = called(state.personality, recorded);
        state.progress.difference = Some(format!("{name}: {words}"));
        self.end(state);
        false
    }

    fn end(&self, state: &mut State) {
        for end in &mut state.ends {
            end.intake = None;
        }
        self.over.store(true, Ordering::Relaxed);
    }
}

impl Observer for Played {
    fn taken(&self, inbound: &Inbound, _: bool) {
        let mut state = lock(&self.replay.state);
        state.ends[self.link].looked = false;
        state.ends[self.link].taken = identify(&inbound.packet);
        self.replay.advance(&mut state);
    }

    fn empty(&self) {
        let mut state = lock(&self.replay.state);
        state.ends[self.link].looked = true;
        state.silence.looked(Instant::now());
        if state.making {
            // It has work, though not for this thread.
            state.silence.excused();
        }
        self.replay.feed(&mut state);
    }

    fn making(&self, is: bool) {
        // All links tell it, one after another.
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
        let place = place_of(state.personality, packet);
        let frame = place.map(|place| place.frame);
        let left = frame.and_then(|frame| state.ends[link].left.get(&frame).copied());
        if state.on_the_bus && place.is_none() {
            // Short answers overtake there.
            return Ok(None);
        }
        let before = place.and_then(|place| state.sent.get(&place).cloned());
        if let Some(recorded) = before {
            // Sent again, on the client's request: on the bus that may have stood anywhere.
            replay.compare(&mut state, link, &recorded, packet);
            return Ok(None);
        }
        let Some(event) = state.events.get(state.at).cloned() else {
            return Ok(None);
        };
        if event.direction == Direction::In || event.link as usize != link {
            // The recorded emulator took a packet first, or sent over another link.
            return Ok(Some(what));
        }
        if frame.is_some() && left.unwrap_or(0) == 0 {
            // The recorded emulator gave this frame up here, and so will this one.
            state.silence.excused();
            return Ok(Some(what));
        }
        if place.is_some_and(|place| state.on_the_bus && !state.ahead.contains(&place)) {
            // The recording on the bus lacks this packet, though it has others of its frame.
            return Ok(None);
        }
        let altered = place.and_then(|place| state.altered.get(&place).cloned());
        let mut versions = [event.item].into_iter().chain(altered.unwrap_or_default());
        if !versions.all(|recorded| replay.compare(&mut state, link, &recorded, packet)) {
            return Ok(None);
        }
        if let (true, Some(place)) = (state.on_the_bus, place) {
            let recorded = state.events[state.at].item.clone();
            state.ahead.remove(&place);
            state.sent.insert(place, recorded);
        }
        state.book(link, packet, frame);
        replay.advance(&mut state);
        Ok(None)
    }

    /// As the recorded run answered: the recording does not say whether there were faults.
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
    /// Why the recorded emulator refused the last packet of this link; none if it did not.
    fn refusal(&self, link: usize) -> Option<String> {
        let taken = self.ends[link].taken?;
        let own = |e: &&Record<Bytes>| e.direction == Direction::Out && e.link as usize == link;
        let mut answers = self.events.get(self.at..)?.iter().filter(own);
        answers.find_map(|event| {
            // The first answer to it: sequence counts come again.
            match (self.personality.decode_reply)(&event.item).ok()?.1 {
                Reply::Ack(ack) if (ack.apid, ack.sequence_count) == taken => Some(None),
                Reply::Nack(nack) if (nack.apid, nack.sequence_count) == taken => {
                    Some(Some(nack.detail.to_string()))
                }
                _ => None,
            }
        })?
    }

    /// Books a packet that came as recorded.
    fn book(&mut self, link: usize, packet: &[u8], frame: Option<u32>) {
        self.progress.packets += 1;
        let Some(frame) = frame else { return };
        let end = &mut self.ends[link];
        if let Some(left) = end.left.get_mut(&frame) {
            *left -= 1;
        }
        if let Ok((_, Reply::FrameHeader(header))) = (self.personality.decode_reply)(packet) {
            // Else it is sent again, on the client's request.
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
fn counted_as(packet: &[u8], other: &[u8]) -> Vec<u8> {
    const COUNT: std::ops::Range<usize> = 2..4;
    let mut packet = packet.to_vec();
    if let (Some(to), Some(from)) = (packet.get_mut(COUNT), other.get(COUNT)) {
        to.copy_from_slice(from);
    }
    sealed(&packet)
}
