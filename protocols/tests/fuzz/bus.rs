//! CAN: plain frames, a node with random events, two nodes with a bad channel between them.

use crate::bytes::{decode, golden};
use crate::common::{Random, hex};
use crate::harness::{Seen, Target};
use skyloop_protocols::can::form::Frames;
use skyloop_protocols::can::frame::padded_length;
use skyloop_protocols::can::{CanFrame, Counts, Node, Parameters, Side};
use skyloop_protocols::crc::crc16;
use skyloop_protocols::{Command, MAX_PACKET};

/// Reads an input byte by byte; 0 after its end.
struct Script<'a>(&'a [u8]);

impl Script<'_> {
    fn take(&mut self) -> u8 {
        let Some((first, rest)) = self.0.split_first() else {
            return 0;
        };
        self.0 = rest;
        *first
    }

    /// A time step, µs: mostly small, at most 2 s.
    fn time(&mut self) -> u64 {
        match self.take() {
            byte @ 0..=0xEF => u64::from(byte % 16) * 10,
            byte => u64::from(byte - 0xEF) * 125_000,
        }
    }

    fn parameters(&mut self) -> Parameters {
        let byte = self.take();
        Parameters {
            block_size: [0, 1, 3, 255][usize::from(byte >> 2 & 3)],
            st_min: [0, 1, 0xF1, 0x80][usize::from(byte >> 4 & 3)],
            padding: (byte & 0x40 != 0).then_some(0xCC),
            frame_bytes: 8 + usize::from(byte >> 3),
            ..if byte & 1 == 1 {
                Parameters::FD
            } else {
                Parameters::CLASSIC
            }
        }
    }
}

fn note(counts: Counts, seen: &mut Seen) {
    let Counts {
        ignored,
        incomplete,
        timeouts,
        malformed,
        ..
    } = counts;
    let size = |count: u32| count.checked_ilog2();
    seen.note([ignored, incomplete, timeouts, malformed].map(size));
    seen.note([counts.sequence_errors, counts.oversize, counts.unsent].map(size));
}

/// Nine bytes a frame: identifier, data; both sides receive it.
pub const FORM: Target = Target {
    name: "can-form",
    seeds: || {
        let script = |packet: Vec<u8>| {
            let mut frames = Frames::of(&packet, 3)?;
            let frames = std::iter::from_fn(|| frames.next(false));
            Some(
                frames
                    .flat_map(|frame| [vec![frame.id as u8], frame.data[..8].to_vec()].concat())
                    .collect(),
            )
        };
        golden().into_iter().filter_map(script).collect()
    },
    run: |input, seen| {
        let mut nodes = [Side::Emulator, Side::Client].map(|side| Node::new(side, false));
        for (at, record) in input.chunks(9).enumerate() {
            let Some((id, data)) = record.split_first() else {
                continue;
            };
            // 0x100 to 0x11F and 0x210, mostly with their valid lengths.
            let (id, max) = match id {
                0x00..=0x0F => (0x100 | u32::from(*id), 8),
                0x10 => (0x110, 7),
                0x1F => (0x210, 4),
                _ => (0x100 | u32::from(id & 0x1F), usize::from(id >> 5)),
            };
            let data = &data[..max.min(data.len())];
            let frame = CanFrame::new(id, false, data).expect("valid");
            for node in &mut nodes {
                if let Some(packet) = node.receive(&frame, at as u64 * 100) {
                    let packet = packet.to_vec();
                    decode(&packet, seen);
                    // A received valid command can be sent as plain frames.
                    assert!(Command::decode(&packet).is_err() || Frames::of(&packet, 0).is_some());
                }
            }
        }
        nodes.iter().for_each(|node| note(node.counts(), seen));
    },
};

/// Records of one event: event and length, time step, data.
pub const RECEIVER: Target = Target {
    name: "isotp",
    seeds: || {
        let first = ["1014030a11181f26", "212d343b42495057", "225e656c737a8188"];
        let others = "03aabbcc 300000 310000 320000 30017f 0008030a11181f262d34cccc \
                      1578112233445566 1000ffffffff1122 21 300000cccccccccc";
        let record = |text: &str| {
            let data = hex(text);
            [vec![data.len() as u8 % 16 * 4, 0], data].concat()
        };
        let all = first.into_iter().chain(others.split(' '));
        let mut seeds: Vec<Vec<u8>> = all.map(|text| [vec![0], record(text)].concat()).collect();
        seeds.push([vec![0], first.map(record).concat()].concat());
        let flow = record("300000");
        seeds.push([vec![0, 3, 0, 20, 0, 0], flow, vec![1, 0, 1, 0]].concat());
        seeds
    },
    run: |input, seen| {
        let mut script = Script(input);
        let mut node = Node::with(Side::Emulator, script.parameters());
        let mut now = 0;
        while !script.0.is_empty() {
            let event = script.take();
            now += script.time();
            match event % 4 {
                0 => {
                    let bytes = padded_length(usize::from(event >> 2));
                    let data: Vec<u8> = (0..bytes).map(|_| script.take()).collect();
                    let frame = CanFrame::new(0x120, bytes > 8, &data).expect("valid");
                    if let Some(packet) = node.receive(&frame, now) {
                        assert!((1..=MAX_PACKET).contains(&packet.len()));
                        seen.note(("message", packet.len().ilog2()));
                    }
                }
                1 => {
                    if let Some(frame) = node.next_frame(now) {
                        assert!(frame.is_valid());
                        seen.note(("sends", frame.data[0] >> 4, frame.len));
                    }
                }
                2 => {
                    let next = node.wake_at();
                    now = next.map_or(now, |next| next.max(now));
                    let has_frame = node.next_frame(now).is_some();
                    let sleeps = node.wake_at().is_none_or(|then| then > now);
                    assert!(has_frame || sleeps, "woken without a frame");
                }
                _ => {
                    let length = usize::from(script.take()) * 6;
                    let accepted = node.send(&vec![0x55; length], now).is_ok();
                    seen.note(("takes", accepted));
                }
            }
        }
        note(node.counts(), seen);
    },
};

/// Settings of both ends, six packets each, then a byte for every frame: its fault in the channel.
pub const CHANNEL: Target = Target {
    name: "isotp-channel",
    seeds: || {
        let mut random = Random(5);
        // Settings and packets; every other input has a channel without faults.
        let byte = |number: u8, at| if at < 14 { 1 } else { number % 2 };
        let mut script = |number| {
            (0..200)
                .map(|at| byte(number, at) * random.next() as u8)
                .collect()
        };
        (0..8).map(&mut script).collect()
    },
    run: channel,
};

/// Distinct bytes for each mark, and their CRC.
fn sealed(length: usize, mark: u8) -> Vec<u8> {
    let mut packet: Vec<u8> = (0..length)
        .map(|at| (at as u8).wrapping_mul(31).wrapping_add(mark))
        .collect();
    packet.push(mark);
    packet.extend_from_slice(&crc16(&packet).to_be_bytes());
    packet
}

fn is_sealed(packet: &[u8]) -> bool {
    packet
        .split_last_chunk()
        .is_some_and(|(before, crc)| crc16(before) == u16::from_be_bytes(*crc))
}

fn channel(input: &[u8], seen: &mut Seen) {
    let mut script = Script(input);
    let mut nodes = [
        Node::with(Side::Emulator, script.parameters()),
        Node::with(Side::Client, script.parameters()),
    ];
    let mut queues: [Vec<Vec<u8>>; 2] = Default::default();
    for number in 0..12_u8 {
        let length = 1 + usize::from(script.take()) * if number < 6 { 1 } else { 5 };
        queues[usize::from(number % 2)].push(sealed(length, number));
    }
    let sent = queues.clone();
    let mut held: [Option<CanFrame>; 2] = [None; 2];
    let (mut now, mut delivered, mut is_bad) = (0, 0, false);
    // Every round sends a frame or expires a timer, so the number of rounds is bounded.
    for round in 0.. {
        assert!(round < 20_000, "no end");
        let mut silent = true;
        for from in 0..2 {
            let to = 1 - from;
            if let Some(packet) = queues[from].last()
                && nodes[from].send(packet, now).is_ok()
            {
                queues[from].pop();
            }
            let Some(mut frame) = nodes[from].next_frame(now) else {
                continue;
            };
            silent = false;
            now += 100;
            let fate = script.take();
            let mut frames = vec![frame];
            match fate >> 4 {
                1 => frames.clear(),
                2 => frames.push(frame),
                3 => held[to] = frames.pop(),
                4 => {
                    frame.data[usize::from(fate & 7) % usize::from(frame.len).max(1)] ^= fate;
                    frames = vec![frame];
                }
                5 => now += 200_000 * u64::from(fate & 0xF),
                _ => frames.extend(held[to].take()),
            }
            is_bad |= (1..=5).contains(&(fate >> 4));
            for frame in frames {
                if let Some(packet) = nodes[to].receive(&frame, now)
                    && is_sealed(packet)
                {
                    delivered += 1;
                    assert!(sent[from].iter().any(|one| one == packet), "never sent");
                }
            }
        }
        if silent {
            match nodes.iter().filter_map(Node::wake_at).min() {
                Some(wake) => {
                    assert!(wake > now, "woken without a frame");
                    now = wake;
                }
                None if queues.iter().all(Vec::is_empty) => break,
                None => {}
            }
        }
    }
    assert!(is_bad || delivered == 12, "a good channel delivers all");
    seen.note(("delivered", delivered));
    nodes.iter().for_each(|node| note(node.counts(), seen));
}
