//! Logs of CAN frames are replayed: frames of which the client had packets sent again too. The logs are made without a bus
//! and without time: each packet in its frames, one after the other.

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

/// The packets of an exchange as a log of the bus that they crossed one by one.
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

/// A client's end, and the packets that have crossed it.
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

    fn say(&mut self, command: Command) {
        self.say_at(command, EPOCH);
    }

    fn say_at(&mut self, command: Command, time: WireTime) {
        let packet = packet(&command, self.counts.next(command.apid()), time);
        self.line.send(&packet);
        self.exchange.push((Direction::In, packet));
    }

    /// Takes so many packets.
    fn hear(&mut self, packets: u32) {
        for _ in 0..packets {
            let packet = self.line.recv(TIMEOUT).expect("the packet comes");
            self.exchange.push((Direction::Out, packet));
        }
    }

    /// Takes a whole frame, which nothing follows; how many packets it has.
    fn frame(&mut self) -> u32 {
        self.hear(1);
        let (_, first) = self.exchange.last().unwrap();
        let Ok((_, Reply::FrameHeader(header))) = Reply::decode(first) else {
            panic!("a frame begins with its header");
        };
        let packets = header.packets();
        self.hear(packets - 1);
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
        client.say_at(Command::Attitude(attitude(i)), time);
        client.frame();
        client.say_at(again, time);
        client.hear(3);
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
fn frames_of_which_packets_were_sent_again_are_compared() {
    let folder = tempfile::tempdir().unwrap();
    let as_it_was = exchange();
    assert_eq!(replayed(folder.path(), &as_it_was), (None, 2, 0));

    // The log has only the second one of packet 2.
    let mut lost = as_it_was.clone();
    lost.remove(1 + 2);
    assert_eq!(replayed(folder.path(), &lost), (None, 2, 0));

    // Only one of the two is as it was.
    let places: Vec<usize> = (0..as_it_was.len())
        .filter(|at| as_it_was[*at].1 == as_it_was[3].1)
        .collect();
    assert_eq!(places.len(), 3, "once, and twice again");
    for place in places {
        let mut altered = as_it_was.clone();
        let bytes = &mut altered[place].1;
        bytes[100] ^= 1;
        reseal(bytes);
        let (difference, ..) = replayed(folder.path(), &altered);
        let difference = difference.expect("it differs");
        assert!(
            difference.contains("PixelBlock 1 of frame 0: pixel (column "),
            "{difference}"
        );
    }

    // Without the commands nobody has asked for them, and nothing explains them.
    let unasked = as_it_was.into_iter().filter(|(direction, packet)| {
        let resend = |packet| matches!(Command::decode(packet), Ok((_, Command::Resend { .. })));
        *direction == Direction::Out || !resend(packet)
    });
    let unasked: Exchange = unasked.collect();
    assert_eq!(replayed(folder.path(), &unasked), (None, 1, 0));
    let file = folder.path().join("run.log");
    assert_eq!(load(&file, &NATIVE).unwrap().doubled, 1);
}

/// A frame of which a packet is lost on the bus, one that is given up for want of credit, and one that a Reset ends while
/// packets of it wait for the bus: what there is of them is compared, and those that follow are whole.
#[test]
fn frames_of_which_packets_are_missing_are_compared_as_far_as_they_are_there() {
    let (emulator, line) = on_memory(small(), Clock::Stepped);
    let mut client = Recorded::new(line);
    let grant = |packets| Command::Credit { packets };
    client.say(grant(1000));
    client.say(Command::Attitude(attitude(0)));
    let packets = client.frame();
    emulator.exposed();
    client.exchange.remove(2 + 4);
    client.say(Command::Reset);
    client.hear(1);
    client.say(grant(5));
    client.say(Command::Attitude(attitude(1)));
    client.hear(5);
    emulator.exposed();
    // Enough for the next one (as long, a few more), and not for the rest of the one before too.
    client.say(grant(5 + packets + 2));
    client.say(Command::Attitude(attitude(2)));
    client.frame();
    emulator.exposed();
    client.say(Command::Reset);
    client.hear(1);
    client.say(grant(4));
    client.say(Command::Attitude(attitude(3)));
    client.hear(4);
    // Two of the four were still queued when it came.
    let reset = client.exchange.len();
    client.say(Command::Reset);
    client.exchange[reset - 2..].rotate_right(1);
    client.hear(1);
    emulator.exposed();
    client.say(Command::Attitude(attitude(4)));
    client.frame();
    emulator.exposed();

    let mut exchange = client.exchange;
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(replayed(folder.path(), &exchange), (None, 2, 3));
    // One pixel of the frame that was given up.
    let given_up = exchange.iter_mut().rev().find(|(_, packet)| {
        let reply = Reply::decode(packet);
        matches!(reply, Ok((_, Reply::PixelBlock(block))) if (block.frame, block.index) == (1, 2))
    });
    let bytes = &mut given_up.unwrap().1;
    bytes[100] ^= 1;
    reseal(bytes);
    let difference = replayed(folder.path(), &exchange).0.unwrap();
    assert!(
        difference.contains("PixelBlock 2 of frame 1: pixel"),
        "{difference}"
    );
}
