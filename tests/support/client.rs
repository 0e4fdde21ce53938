//! A hand-written flight computer, by the ICD.

use super::line::Line;
use super::{EPOCH, TIMEOUT, attitude, await_that};
use skyloop_protocols::crc::Crc32;
use skyloop_protocols::sequence::{GapDetector, SequenceCounts};
use skyloop_protocols::{
    Attitude, Command, Counters, FrameEnd, FrameHeader, Header, MAX_PACKET, Reason, Reply, Status,
    WireTime,
};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// A client at one end of a line.
pub struct Client<L> {
    pub line: L,
    /// Sequence counts of the next packets.
    pub counts: SequenceCounts,
    gaps: GapDetector,
    /// Size of the credit window in frame packets; none: credit is never granted automatically.
    pub window: Option<u32>,
    granted: bool,
    /// Frame packets received in this exchange.
    pub taken: u32,
    /// Packets received while another kind was awaited.
    early: VecDeque<Vec<u8>>,
}

/// A reassembled frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    pub time: WireTime,
    pub header: FrameHeader,
    pub end: FrameEnd,
    pub pixels: Vec<u16>,
    pub labels: String,
    /// Number of its packets.
    pub packets: u32,
}

impl Received {
    /// The parsed labels.
    pub fn label(&self) -> serde_json::Value {
        serde_json::from_str(&self.labels).expect("labels are JSON")
    }
}

/// A refusal.
#[derive(Debug, Clone, PartialEq)]
pub struct Refused {
    pub apid: u16,
    pub sequence_count: u16,
    pub reason: Reason,
    pub detail: String,
}

/// The packet of a command.
pub fn packet(command: &Command, count: u16, time: WireTime) -> Vec<u8> {
    let mut buffer = [0; MAX_PACKET];
    let length = command.encode(count, time, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

impl<L: Line> Client<L> {
    pub fn new(line: L) -> Client<L> {
        Client {
            line,
            counts: SequenceCounts::new(),
            gaps: GapDetector::new(),
            window: Some(32),
            granted: false,
            taken: 0,
            early: VecDeque::new(),
        }
    }

    /// The next packet of this command, not yet sent, and its sequence count.
    pub fn prepare(&mut self, command: &Command, time: WireTime) -> (Vec<u8>, u16) {
        let count = self.counts.next(command.apid());
        (packet(command, count, time), count)
    }

    /// Sends a command and returns its sequence count.
    pub fn send(&mut self, command: Command) -> u16 {
        self.send_at(command, EPOCH)
    }

    /// Sends an attitude of `time`.
    pub fn point(&mut self, attitude: Attitude, time: WireTime) -> u16 {
        if let (Some(window), false) = (self.window, self.granted) {
            self.granted = true;
            self.send(Command::Credit { packets: window });
        }
        self.send_at(Command::Attitude(attitude), time)
    }

    fn send_at(&mut self, command: Command, time: WireTime) -> u16 {
        let (packet, count) = self.prepare(&command, time);
        self.line.send(&packet);
        count
    }

    /// The next packet within `timeout`.
    pub fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        let packet = self.line.recv(timeout)?;
        let (header, reply) = Reply::decode(&packet).expect("the emulator sends packets only");
        if reply.takes_credit() {
            self.taken += 1;
            if let Some(window) = self
                .window
                .filter(|window| self.taken.is_multiple_of(window / 4))
            {
                self.send(Command::Credit {
                    packets: self.taken + window,
                });
            }
        }
        let missing = self.gaps.missing(header.apid, header.sequence_count);
        assert_eq!(missing, 0, "packets of {:#05x} lost", header.apid);
        Some(packet)
    }

    /// The next packet of a frame (`frame` true), or the next other packet. Stores the rest.
    pub fn next(&mut self, frame: bool) -> Vec<u8> {
        let wanted = |packet: &[u8]| {
            Reply::decode(packet).is_ok_and(|(_, reply)| reply.takes_credit() == frame)
        };
        if let Some(index) = self.early.iter().position(|packet| wanted(packet)) {
            return self.early.remove(index).unwrap();
        }
        let started = Instant::now();
        loop {
            let left = TIMEOUT.saturating_sub(started.elapsed());
            let packet = self.recv(left).expect("a packet in time");
            assert!(!left.is_zero(), "only other packets arrive");
            if wanted(&packet) {
                return packet;
            }
            self.early.push_back(packet);
        }
    }

    /// Makes a received packet the next one again.
    pub fn put_back(&mut self, packet: Vec<u8>) {
        self.early.push_front(packet);
    }

    /// Whether no unexpected packet has arrived.
    pub fn has_nothing_left(&mut self) -> bool {
        let packet = self.recv(Duration::from_millis(5));
        self.early.extend(packet);
        self.early.is_empty()
    }

    /// Drops the stored packets.
    pub fn forget(&mut self) {
        self.early.clear();
    }

    /// Drops all packets in flight and starts as in a new exchange. No frames may come.
    pub fn start_anew(&mut self) {
        self.window = None;
        self.refusals();
        (self.window, self.granted, self.taken) = (Some(32), false, 0);
        self.early.clear();
    }

    /// Sends `command` and receives its Ack.
    pub fn done(&mut self, command: Command) {
        let count = self.send(command);
        let packet = self.next(false);
        if command == Command::Reset {
            (self.granted, self.taken) = (false, 0);
        }
        match Reply::decode(&packet).unwrap().1 {
            Reply::Ack(ack) => assert_eq!((ack.apid, ack.sequence_count), (command.apid(), count)),
            other => panic!("{command:?} was answered with {other:?}"),
        }
    }

    /// Ping: Ack, then Status.
    pub fn status(&mut self) -> Status {
        self.done(Command::Ping);
        let packet = self.next(false);
        match Reply::decode(&packet).unwrap().1 {
            Reply::Status(status) => status,
            other => panic!("a Ping was answered with {other:?}"),
        }
    }

    /// The refusals of all sent packets, on a line without losses. Stores the other packets.
    pub fn refusals(&mut self) -> Vec<Reason> {
        // Refusals arrive before the answers to a later Ping: its Ack, and a Status.
        let ping = self.send(Command::Ping);
        let mut is_answered = false;
        loop {
            let packet = self.recv(TIMEOUT).expect("a Ping is answered");
            match Reply::decode(&packet) {
                Ok((_, Reply::Ack(ack))) if ack.sequence_count == ping => is_answered = true,
                Ok((_, Reply::Status(_))) if is_answered => break,
                _ => self.early.push_back(packet),
            }
        }
        let mut reasons = Vec::new();
        self.early.retain(|packet| match Reply::decode(packet) {
            Ok((_, Reply::Nack(nack))) => {
                reasons.push(nack.reason);
                false
            }
            _ => true,
        });
        reasons
    }

    /// The next answer, a Nack.
    pub fn nack(&mut self) -> Refused {
        let packet = self.next(false);
        match Reply::decode(&packet).unwrap().1 {
            Reply::Nack(nack) => Refused {
                apid: nack.apid,
                sequence_count: nack.sequence_count,
                reason: nack.reason,
                detail: nack.detail.to_string(),
            },
            other => panic!("a refusal was expected, not {other:?}"),
        }
    }

    /// Asserts that the next answer refuses for this reason, with these words in its text.
    #[track_caller]
    pub fn refused(&mut self, reason: Reason, words: &[&str]) -> Refused {
        let nack = self.nack();
        assert_eq!(nack.reason, reason, "{}", nack.detail);
        for word in words {
            assert!(nack.detail.contains(word), "no {word:?} in {}", nack.detail);
        }
        nack
    }

    /// The emulator's counters.
    pub fn counters(&mut self) -> Counters {
        self.status().counters
    }

    /// Asserts that the emulator's counters have these values.
    #[track_caller]
    pub fn has_counted(&mut self, expected: &[(&str, u32)]) {
        counted(&self.counters(), expected);
    }

    /// Pings until the emulator answers: at first another client may hold the exchange.
    pub fn await_answer(&mut self) {
        await_that("this client is answered", || {
            self.send(Command::Ping);
            self.recv(Duration::from_millis(100)).is_some()
        });
    }

    /// Stops the automatic grants of credit.
    pub fn unpaced(mut self) -> Client<L> {
        self.window = None;
        self
    }

    /// Sends a command at `time`, without a Credit before it.
    pub fn send_alone(&mut self, command: &Command, time: WireTime) -> u16 {
        let (packet, count) = self.prepare(command, time);
        self.line.send(&packet);
        count
    }

    /// The next whole frame. Checks the order and consistency of its packets and the CRC-32.
    pub fn frame(&mut self) -> Received {
        self.frame_granting(|_, _| {})
    }

    /// The next whole frame; `grant` gets the number of received packets after each of them.
    pub fn frame_granting(&mut self, mut grant: impl FnMut(&mut Self, u32)) -> Received {
        let packet = self.next(true);
        let (Header { time, .. }, reply) = Reply::decode(&packet).unwrap();
        let Reply::FrameHeader(header) = reply else {
            panic!("a frame starts with its header, not with {reply:?}");
        };
        let mut packets = 1;
        grant(self, packets);
        let mut pixels = vec![0; header.pixels() as usize];
        for index in 0..header.blocks {
            let packet = self.next(true);
            let Ok((_, Reply::PixelBlock(block))) = Reply::decode(&packet) else {
                panic!("block {index} was expected");
            };
            assert_eq!((block.frame, block.index), (header.frame, index));
            assert!(block.place(&mut pixels));
            packets += 1;
            grant(self, packets);
        }
        let mut labels = Vec::new();
        for part in 0..header.label_parts {
            let packet = self.next(true);
            let Ok((_, Reply::Labels(label))) = Reply::decode(&packet) else {
                panic!("label part {part} was expected");
            };
            assert_eq!(
                (label.frame, label.part, label.parts),
                (header.frame, part, header.label_parts)
            );
            labels.extend_from_slice(label.text);
            packets += 1;
            grant(self, packets);
        }
        assert_eq!(labels.len(), header.label_bytes as usize);
        let end = self.end_of(&header);
        packets += 1;
        grant(self, packets);
        assert_eq!(
            Crc32::new().update_pixels(&pixels).finish(),
            end.pixels_crc32
        );
        let labels = String::from_utf8(labels).expect("labels are UTF-8");
        Received {
            time,
            header,
            end,
            pixels,
            labels,
            packets,
        }
    }

    /// The next packet, which is the end of this frame.
    fn end_of(&mut self, header: &FrameHeader) -> FrameEnd {
        let packet = self.next(true);
        let (_, Reply::FrameEnd(end)) = Reply::decode(&packet).unwrap() else {
            panic!("a frame ends with its FrameEnd");
        };
        assert_eq!(end.frame, header.frame);
        end
    }

    /// The next frame of any level: header, raw packets with pixels and labels, end.
    pub fn parcel(&mut self) -> (FrameHeader, Vec<Vec<u8>>, FrameEnd) {
        let first = self.next(true);
        let (_, Reply::FrameHeader(header)) = Reply::decode(&first).unwrap() else {
            panic!("a frame starts with its header");
        };
        let more = header.blocks + u32::from(header.label_parts);
        let packets = (0..more).map(|_| self.next(true)).collect();
        (header, packets, self.end_of(&header))
    }

    /// A frame of the default attitude, in stepped mode.
    pub fn good_frame(&mut self, sequence: u32) -> Received {
        self.point(attitude(sequence), EPOCH);
        let frame = self.frame();
        assert_eq!(frame.header.attitude_sequence, sequence);
        frame
    }
}

/// The counters that differ, with their differences; without `commands`, which also counts Ping and
/// Credit.
pub fn moved(before: &Counters, after: &Counters) -> Vec<(&'static str, u32)> {
    before
        .iter()
        .zip(after.iter())
        .filter(|((name, before), (_, after))| *name != "commands" && before != after)
        .map(|((name, before), (_, after))| (name, after.wrapping_sub(before)))
        .collect()
}

/// Asserts that counters have these values.
#[track_caller]
pub fn counted(counters: &Counters, expected: &[(&str, u32)]) {
    let value = |name: &str| counters.iter().find(|(found, _)| *found == name);
    let found = expected
        .iter()
        .map(|(name, _)| value(name).expect("a counter"));
    let found: Vec<(&str, u32)> = found.collect();
    assert_eq!(found, expected, "{counters:?}");
}
