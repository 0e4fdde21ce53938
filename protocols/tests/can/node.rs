//! Packets between two nodes.

use super::bus::{Bus, Damage, ack_packet, attitude, bytes, command_packet, parameters};
use super::isotp::counted;
use skyloop_protocols::Command;
use skyloop_protocols::can::{Counts, Parameters};
use skyloop_protocols::crc::crc16;
use std::collections::HashSet;

/// Random bytes and their CRC.
fn sealed(length: usize, mark: u64) -> Vec<u8> {
    let mut packet = bytes(length, mark);
    packet.extend_from_slice(&crc16(&packet).to_be_bytes());
    packet
}

fn is_sealed(packet: &[u8]) -> bool {
    packet
        .split_last_chunk()
        .is_some_and(|(before, crc)| crc16(before) == u16::from_be_bytes(*crc))
}

fn is_attitude(packet: &[u8]) -> bool {
    packet.starts_with(&[0x19, 0x01])
}

#[test]
fn packets_of_any_length_pass_in_both_directions_at_once() {
    for fd in [false, true] {
        let mut bus = Bus::perfect(fd);
        let packets = |mark| (1..=1400).map(move |length| bytes(length, mark));
        for packet in packets(1) {
            bus.push(0, packet);
        }
        for (number, packet) in (0..).zip(packets(2)) {
            bus.push(1, packet);
            bus.push(1, attitude(number, number % 2 == 0));
        }
        bus.run();
        assert_eq!(bus.received[1], packets(1).collect::<Vec<_>>());
        let all = bus.received[0].iter().cloned();
        let (plain, long): (Vec<_>, Vec<_>) = all.partition(|packet| is_attitude(packet));
        assert_eq!(long, packets(2).collect::<Vec<_>>());
        let attitudes = (0..1400).map(|number| attitude(number, number % 2 == 0));
        assert_eq!(plain, attitudes.collect::<Vec<_>>());
        assert_eq!([bus.counts(0), bus.counts(1)], [Counts::default(); 2]);
    }
}

#[test]
fn short_forms_lose_only_their_time() {
    let mut bus = Bus::perfect(false);
    let packets = 0xDEAD_BEEF;
    let commands = [
        Command::Ping,
        Command::Reset,
        Command::SingleShot,
        Command::Pause,
        Command::Resume,
        Command::Credit { packets },
    ];
    let counted = || (0..).map(|at| (at, 16_378 + at)).zip(&commands);
    for ((_, count), command) in counted() {
        bus.push(1, command_packet(command, count, 0x7397_DF7B_0000_0001));
        bus.push(0, ack_packet(count, 77, 5));
    }
    bus.run();
    assert_eq!(bus.frames, 12);
    let received = bus.received[0].iter().zip(&bus.received[1]);
    for (((at, count), command), (found, ack)) in counted().zip(received) {
        assert_eq!(*found, command_packet(command, count, 0));
        assert_eq!(*ack, ack_packet(count, at, 0));
    }
}

/// Over a bad channel, every delivered packet with a right CRC was sent.
#[test]
fn a_bad_channel_delivers_only_sent_packets() {
    let blocks = Parameters {
        block_size: 8,
        ..Parameters::CLASSIC
    };
    for (seed, [drop, repeat, swap]) in
        (1..).zip([[60, 0, 0], [0, 60, 0], [0, 0, 60], [90, 90, 90]])
    {
        for parameters in [Parameters::CLASSIC, blocks, Parameters::FD] {
            bad_channel(parameters, Damage { drop, repeat, swap }, seed);
        }
    }
}

fn bad_channel(parameters: Parameters, damage: Damage, seed: u64) {
    let mut bus = Bus::new(parameters, damage, seed);
    let mut sent: [HashSet<Vec<u8>>; 2] = Default::default();
    for number in 0..300 {
        let limit = if number % 3 == 0 { 1380 } else { 100 };
        let length = 1 + bus.random.below(limit);
        for (from, packet) in [
            (0, sealed(length, number)),
            (1, sealed(length, number)),
            (1, attitude(number as u32, true)),
        ] {
            sent[from].insert(packet.clone());
            bus.push(from, packet);
        }
    }
    bus.run();
    for (received, sent) in bus.received.iter().zip([&sent[1], &sent[0]]) {
        let delivered: Vec<_> = received.iter().filter(|packet| is_sealed(packet)).collect();
        for packet in &delivered {
            assert!(
                sent.contains(*packet),
                "{damage:?}: not sent: {packet:02x?}"
            );
        }
        let count = delivered.len();
        let some_lost = count < sent.len() || damage.drop == 0;
        assert!(count > 30 && some_lost, "{damage:?}: {count} delivered");
    }
    let counts = [bus.counts(0), bus.counts(1)];
    let sum = |of: fn(&Counts) -> u32| counts.iter().map(of).sum::<u32>();
    let occurred = [
        sum(|c| c.incomplete),
        sum(|c| c.ignored),
        sum(|c| c.sequence_errors),
        if damage.drop == 0 {
            1
        } else {
            sum(|c| c.timeouts)
        },
    ];
    assert!(
        occurred.iter().all(|count| *count > 0),
        "{damage:?} {counts:?}"
    );
    assert_eq!(sum(|c| c.oversize), 0, "{damage:?}");
}

/// A channel that loses one in `drop` frames.
fn lossy(fd: bool, drop: usize, seed: u64) -> Bus {
    let damage = Damage {
        drop,
        ..Damage::default()
    };
    Bus::new(parameters(fd), damage, seed)
}

/// Every packet is either delivered or counted as lost.
#[test]
fn lost_packets_are_counted() {
    for fd in [false, true] {
        let mut bus = lossy(fd, 40, 9);
        for number in 0..500 {
            bus.push(0, sealed(200, number));
        }
        bus.run();
        let lost = 500 - bus.received[1].len() as u32;
        let (emulator, client) = (bus.counts(0), bus.counts(1));
        // A lost first frame or flow control counts as unsent, a lost consecutive frame as
        // incomplete. Both together may count twice, never zero times.
        let is_counted = lost <= emulator.unsent + client.incomplete;
        assert!(lost > 20 && is_counted, "{lost} {emulator:?} {client:?}");
    }
}

#[test]
fn silence_of_the_other_end_times_out() {
    let mut bus = lossy(false, 1, 1);
    for number in 0..10 {
        bus.push(0, sealed(200, number));
        bus.push(1, attitude(number as u32, true));
    }
    bus.run();
    // Ten messages, each dropped 1 s after its first frame.
    let now = bus.now_us;
    assert!((10_000_000..10_100_000).contains(&now), "{now}");
    assert_eq!(counted(bus.counts(0)), "timeouts: 10, unsent: 10");
}

#[test]
fn neither_lane_starves() {
    let mut bus = Bus::perfect(false);
    // 1000 attitudes, and one long packet: 201 frames.
    for number in 0..1000 {
        bus.push(1, attitude(number, true));
    }
    bus.push(1, bytes(1400, 1));
    bus.run();
    let long = bus.received[0]
        .iter()
        .position(|packet| !is_attitude(packet));
    assert_eq!(long, Some(201), "one frame of it after each attitude");

    // An attitude during a long packet is sent at once.
    let mut bus = Bus::perfect(false);
    bus.push(1, bytes(1400, 1));
    for _ in 0..50 {
        bus.feed();
        bus.step();
    }
    bus.push(1, attitude(1, true));
    bus.feed();
    (0..16).for_each(|_| assert!(bus.step()));
    assert_eq!(bus.received[0], [attitude(1, true)]);
    bus.run();
    assert_eq!(bus.received[0].len(), 2);
}
