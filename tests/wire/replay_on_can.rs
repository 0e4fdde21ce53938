//! Replay of CAN logs, including packets sent again. The logs are made without a bus and without
//! time: each packet in its frames, one after the other.

use crate::replay::{replay, small};
use crate::support::client::packet;
use crate::support::line::{Line, MemoryLine};
use crate::support::{EPOCH, TIMEOUT, attitude, later, on_memory};
use skyloop::config::Clock;
use skyloop::link::capture::replay::load;
use skyloop::link::capture::{Record, candump};
use skyloop_protocols::can::{Lane, Node, Side};
use skyloop_protocols::packet::reseal;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{Command, Direction, Reply, WireTime};
use std::path::Path;
use std::time::Duration;

type Exchange = Vec<(Direction, Vec<u8>)>;

/// Log of a bus that carries the packets of an exchange one by one.
fn log(exchange: &Exchange) -> String {
    let mut ends = [
        Node::new(Side::Emulator, true),
        Node::new(Side::Client, true),
    ];
    let (mut text, mut us) = (String::new(), 1_500_000_000_000_000);
    for (direction, packet) in exchange {
        let from = usize::from(*direction == Direction::In);
        ends[from].send(packet, us).unwrap();
        let idle = |node: &Node| {
            [Lane::Plain, Lane::Long]
                .into_iter()
                .all(|lane| node.is_idle(lane))
        };
        while !ends.iter().all(idle) {
            us += 100;
            for (sender, direction) in [(0, Direction::Out), (1, Direction::In)] {
                while let Some(frame) = ends[sender].next_frame(us) {
                    ends[1 - sender].receive(&frame, us);
                    text += &candump::line(&Record {
                        at: Duration::from_micros(us),
                        direction,
                        link: 0,
                        exchange: 0,
                        first: false,
                        made: None,
                        item: frame,
                    });
                }
            }
        }
    }
    text
}

/// A client's end, and the packets that have passed it.
struct Recorded {
    line: MemoryLine,
    counts: SequenceCounts,
    exchange: Exchange,
}

impl Recorded {
    fn new(line: MemoryLine) -> Recorded {
        Recorded {
            line,
            counts: SequenceCounts::new(),
            exchange: Vec::new(),
        }
    }

    fn send(&mut self, command: Command) {
        self.send_at(command, EPOCH);
    }

    fn send_at(&mut self, command: Command, time: WireTime) {
        let packet = packet(&command, self.counts.next(command.apid()), time);
        self.line.send(&packet);
        self.exchange.push((Direction::In, packet));
    }

    fn receive(&mut self, packets: u32) {
        for _ in 0..packets {
            let packet = self.line.recv(TIMEOUT).expect("the packet comes");
            self.exchange.push((Direction::Out, packet));
        }
    }

    /// Receives a whole frame. Returns its number of packets.
    fn frame(&mut self) -> u32 {
        self.receive(1);
        let (_, first) = self.exchange.last().unwrap();
        let Ok((_, Reply::FrameHeader(header))) = Reply::decode(first) else {
            panic!("a frame begins with its header");
        };
        let packets = header.packets();
        self.receive(packets - 1);
        packets
    }
}

/// Two frames, and packets 1 to 3 of the first twice: at once, and after the header of the second.
fn exchange() -> Exchange {
    let (_emulator, line) = on_memory(small(), Clock::Stepped);
    let mut client = Recorded::new(line);
    let again = Command::Resend {
        frame: 0,
        first: 1,
        count: 3,
    };
    for i in 0..2 {
        let time = later(EPOCH, f64::from(i) / 10.0);
        client.send_at(Command::Attitude(attitude(i)), time);
        client.frame();
        client.send_at(again, time);
        client.receive(3);
    }
    client.exchange
}

/// The result of a replay: first difference, whole frames, frames with missing packets.
fn replayed(folder: &Path, exchange: &Exchange) -> (Option<String>, usize, usize) {
    let file = folder.join("run.log");
    std::fs::write(&file, log(exchange)).unwrap();
    let torn = load(&file, &NATIVE).unwrap().torn;
    let progress = replay(&file, small());
    let whole = progress.frames.iter().filter(|frame| frame.whole).count();
    (progress.difference, whole, torn)
}

#[test]
fn frames_with_resent_packets_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let original = exchange();
    assert_eq!(replayed(folder.path(), &original), (None, 2, 0));

    // The log has only the second copy of packet 2.
    let mut lost = original.clone();
    lost.remove(1 + 2);
    assert_eq!(replayed(folder.path(), &lost), (None, 2, 0));

    // Of the copies, one is altered.
    let copies: Vec<usize> = (0..original.len())
        .filter(|at| original[*at].1 == original[3].1)
        .collect();
    assert_eq!(copies.len(), 3, "sent once and resent twice");
    for copy in copies {
        let mut altered = original.clone();
        let bytes = &mut altered[copy].1;
        bytes[100] ^= 1;
        reseal(bytes);
        let (difference, ..) = replayed(folder.path(), &altered);
        let difference = difference.expect("it differs");
        assert!(
            difference.contains("PixelBlock 1 of frame 0: pixel (column "),
            "{difference}"
        );
    }

    // Without the Resend commands, the resent packets are unexplained.
    let without_resend = original.into_iter().filter(|(direction, packet)| {
        let resend = |packet| matches!(Command::decode(packet), Ok((_, Command::Resend { .. })));
        *direction == Direction::Out || !resend(packet)
    });
    let without_resend: Exchange = without_resend.collect();
    assert_eq!(replayed(folder.path(), &without_resend), (None, 1, 0));
    let file = folder.path().join("run.log");
    assert_eq!(load(&file, &NATIVE).unwrap().doubled, 1);
}

/// A frame with a lost packet, one abandoned for lack of credit, and one ended by a Reset with
/// packets still queued: their existing packets are compared, and the following frames are whole.
#[test]
fn frames_with_missing_packets_are_compared_in_part() {
    let (emulator, line) = on_memory(small(), Clock::Stepped);
    let mut client = Recorded::new(line);
    let grant = |packets| Command::Credit { packets };
    client.send(grant(1000));
    client.send(Command::Attitude(attitude(0)));
    let packets = client.frame();
    emulator.exposed();
    client.exchange.remove(2 + 4);
    client.send(Command::Reset);
    client.receive(1);
    client.send(grant(5));
    client.send(Command::Attitude(attitude(1)));
    client.receive(5);
    emulator.exposed();
    // Enough for the next frame (of equal length, plus a few), not for the rest of the previous one
    // too.
    client.send(grant(5 + packets + 2));
    client.send(Command::Attitude(attitude(2)));
    client.frame();
    emulator.exposed();
    client.send(Command::Reset);
    client.receive(1);
    client.send(grant(4));
    client.send(Command::Attitude(attitude(3)));
    client.receive(4);
    // Two of the four were still queued at the Reset.
    let reset = client.exchange.len();
    client.send(Command::Reset);
    client.exchange[reset - 2..].rotate_right(1);
    client.receive(1);
    emulator.exposed();
    client.send(Command::Attitude(attitude(4)));
    client.frame();
    emulator.exposed();

    let mut exchange = client.exchange;
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(replayed(folder.path(), &exchange), (None, 2, 3));
    // One pixel of the abandoned frame.
    let abandoned = exchange.iter_mut().rev().find(|(_, packet)| {
        let reply = Reply::decode(packet);
        matches!(reply, Ok((_, Reply::PixelBlock(block))) if (block.frame, block.index) == (1, 2))
    });
    let bytes = &mut abandoned.unwrap().1;
    bytes[100] ^= 1;
    reseal(bytes);
    let difference = replayed(folder.path(), &exchange).0.unwrap();
    assert!(
        difference.contains("PixelBlock 2 of frame 1: pixel"),
        "{difference}"
    );
}
