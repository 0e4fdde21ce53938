//! Logs of CAN frames are replayed: frames of which the client had packets sent again too. The logs are made without a bus
//! and without time: each packet in its frames, one after the other.

use crate::replay::{replay, small};
use crate::support::client::packet;
use crate::support::line::{Line, MemoryLine};
use crate::support::{EPOCH, PATIENCE, attitude, later, on_memory};
use skyloop::config::Clock;
use skyloop::link::capture::replay::load;
use skyloop::link::capture::{Record, candump};
use skyloop_protocols::can::{Lane, Node, Side};
use skyloop_protocols::packet::reseal;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{Command, Direction, Reply};
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

/// Two frames, and packets 1 to 3 of the first twice: at once, and after the header of the second.
fn exchange() -> Exchange {
    let (_emulator, mut line) = on_memory(small(), Clock::Stepped);
    let mut exchange = Vec::new();
    let say = |line: &mut MemoryLine, exchange: &mut Exchange, command: Command, i: u16| {
        let packet = packet(&command, i, later(EPOCH, f64::from(i) / 10.0));
        line.send(&packet);
        exchange.push((Direction::In, packet));
    };
    let hear = |line: &mut MemoryLine, exchange: &mut Exchange, packets: u32| {
        for _ in 0..packets {
            let packet = line.recv(PATIENCE).expect("the packet comes");
            exchange.push((Direction::Out, packet));
        }
    };
    let again = Command::Resend {
        frame: 0,
        first: 1,
        count: 3,
    };
    for i in 0..2 {
        say(
            &mut line,
            &mut exchange,
            Command::Attitude(attitude(i)),
            i as u16,
        );
        hear(&mut line, &mut exchange, 1);
        let (_, last) = exchange.last().unwrap();
        let Ok((_, Reply::FrameHeader(header))) = Reply::decode(last) else {
            panic!("a frame begins with its header");
        };
        hear(&mut line, &mut exchange, header.packets() - 1);
        say(&mut line, &mut exchange, again, i as u16);
        hear(&mut line, &mut exchange, 3);
    }
    exchange
}

/// What comes of an exchange: the first difference, whole frames, frames of which packets are missing.
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
        let octets = &mut altered[place].1;
        octets[100] ^= 1;
        reseal(octets);
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
    let (emulator, mut line) = on_memory(small(), Clock::Stepped);
    let mut exchange = Vec::new();
    let mut counts = SequenceCounts::new();
    let mut say = |line: &mut MemoryLine, exchange: &mut Exchange, command: Command| {
        let packet = packet(&command, counts.next(command.apid()), EPOCH);
        line.send(&packet);
        exchange.push((Direction::In, packet));
    };
    let hear = |line: &mut MemoryLine, exchange: &mut Exchange, packets: u32| {
        for _ in 0..packets {
            let packet = line.recv(PATIENCE).expect("the packet comes");
            exchange.push((Direction::Out, packet));
        }
    };
    // Its packets; nothing follows them.
    let whole = |line: &mut MemoryLine, exchange: &mut Exchange| {
        hear(line, exchange, 1);
        let Reply::FrameHeader(header) = Reply::decode(&exchange.last().unwrap().1).unwrap().1
        else {
            panic!("a frame begins with its header");
        };
        let more = header.packets() - 1;
        hear(line, exchange, more);
        emulator.shot();
        1 + more
    };
    let grant = |packets| Command::Credit { packets };
    say(&mut line, &mut exchange, grant(1000));
    say(&mut line, &mut exchange, Command::Attitude(attitude(0)));
    let packets = whole(&mut line, &mut exchange);
    exchange.remove(2 + 4);
    say(&mut line, &mut exchange, Command::Reset);
    hear(&mut line, &mut exchange, 1);
    say(&mut line, &mut exchange, grant(5));
    say(&mut line, &mut exchange, Command::Attitude(attitude(1)));
    hear(&mut line, &mut exchange, 5);
    emulator.shot();
    // Enough for the next one (as long, a few more), and not for the rest of the one before too.
    say(&mut line, &mut exchange, grant(5 + packets + 2));
    say(&mut line, &mut exchange, Command::Attitude(attitude(2)));
    whole(&mut line, &mut exchange);
    say(&mut line, &mut exchange, Command::Reset);
    hear(&mut line, &mut exchange, 1);
    say(&mut line, &mut exchange, grant(4));
    say(&mut line, &mut exchange, Command::Attitude(attitude(3)));
    hear(&mut line, &mut exchange, 4);
    // Two of the four were still queued when it came.
    let reset = exchange.len();
    say(&mut line, &mut exchange, Command::Reset);
    exchange[reset - 2..].rotate_right(1);
    hear(&mut line, &mut exchange, 1);
    emulator.shot();
    say(&mut line, &mut exchange, Command::Attitude(attitude(4)));
    whole(&mut line, &mut exchange);

    let folder = tempfile::tempdir().unwrap();
    assert_eq!(replayed(folder.path(), &exchange), (None, 2, 3));
    // One pixel of the frame that was given up.
    let given_up = exchange.iter_mut().rev().find(|(_, packet)| {
        let reply = Reply::decode(packet);
        matches!(reply, Ok((_, Reply::PixelBlock(block))) if (block.frame, block.index) == (1, 2))
    });
    let octets = &mut given_up.unwrap().1;
    octets[100] ^= 1;
    reseal(octets);
    let difference = replayed(folder.path(), &exchange).0.unwrap();
    assert!(
        difference.contains("PixelBlock 2 of frame 1: pixel"),
        "{difference}"
    );
}
