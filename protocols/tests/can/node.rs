//! Whole packets between two nodes.

use crate::bus::{Bus, Damage, attitude, command_packet, octets, reply_packet};
use skyloop_protocols::can::{Counts, Parameters};
use skyloop_protocols::crc::crc16;
use skyloop_protocols::{Ack, Command, Reply};
use std::collections::HashSet;

/// Random octets and their CRC.
fn sealed(length: usize, mark: u64) -> Vec<u8> {
    let mut packet = octets(length, mark);
    packet.extend_from_slice(&crc16(&packet).to_be_bytes());
    packet
}

fn is_sealed(packet: &[u8]) -> bool {
    packet
        .split_last_chunk()
        .is_some_and(|(before, crc)| crc16(before) == u16::from_be_bytes(*crc))
}

/// Attitudes among other packets.
fn is_attitude(packet: &[u8]) -> bool {
    packet.starts_with(&[0x19, 0x01])
}

#[test]
fn packets_of_any_length_pass_both_ways_at_once() {
    for fd in [false, true] {
        let mut bus = Bus::perfect(fd);
        let packets = |mark| (1..=1400).map(move |length| octets(length, mark));
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
fn short_forms_lose_their_time_only() {
    let mut bus = Bus::perfect(false);
    let commands = [
        Command::Ping,
        Command::Reset,
        Command::SingleShot,
        Command::Pause,
        Command::Resume,
        Command::Credit {
            packets: 0xDEAD_BEEF,
        },
    ];
    for (count, command) in (16_378..).zip(&commands) {
        bus.push(1, command_packet(command, count, 0x7397_DF7B_0000_0001));
        bus.push(
            0,
            reply_packet(
                &Reply::Ack(Ack {
                    apid: 0x102,
                    sequence_count: count,
                }),
                77,
                5,
            ),
        );
    }
    bus.run();
    assert_eq!(bus.frames, 12);
    for (at, command) in commands.iter().enumerate() {
        let count = 16_378 + at as u16;
        assert_eq!(bus.received[0][at], command_packet(command, count, 0));
        let ack = Ack {
            apid: 0x102,
            sequence_count: count,
        };
        assert_eq!(
            bus.received[1][at],
            reply_packet(&Reply::Ack(ack), at as u16, 0)
        );
    }
}

/// What a channel does, and what must not come of it. Octets in the channel are random, but a CRC keeps out what is
/// damaged; so what is delivered was sent.
#[test]
fn what_a_bad_channel_delivers_was_sent() {
    let lossy = Damage {
        drop: 60,
        ..Damage::default()
    };
    let repeating = Damage {
        repeat: 60,
        ..Damage::default()
    };
    let swapping = Damage {
        swap: 60,
        ..Damage::default()
    };
    let all = Damage {
        drop: 90,
        repeat: 90,
        swap: 90,
        corrupt: 0,
    };
    for (seed, damage) in [(1, lossy), (2, repeating), (3, swapping), (4, all)] {
        for parameters in [
            Parameters::CLASSIC,
            Parameters {
                block_size: 8,
                ..Parameters::CLASSIC
            },
            Parameters::FD,
        ] {
            let mut bus = Bus::new([parameters; 2], damage, seed);
            let mut sent: [HashSet<Vec<u8>>; 2] = Default::default();
            for number in 0..300 {
                let length =
                    1 + bus.random.below(if number % 3 == 0 { 1380 } else { 100 }) as usize;
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
            for (to, sent) in [(0, &sent[1]), (1, &sent[0])] {
                let good = bus.received[to].iter().filter(|packet| is_sealed(packet));
                let mut delivered = 0;
                for packet in good {
                    delivered += 1;
                    assert!(sent.contains(packet), "{damage:?}: not sent: {packet:02x?}");
                }
                assert!(
                    delivered > 30 && (delivered < sent.len() || damage.drop == 0),
                    "{damage:?} {delivered}"
                );
            }
            let counts = [bus.counts(0), bus.counts(1)];
            let sum = |of: fn(&Counts) -> u32| counts.iter().map(of).sum::<u32>();
            assert!(sum(|c| c.incomplete) > 0, "{damage:?} {counts:?}");
            assert!(sum(|c| c.ignored) > 0, "{damage:?} {counts:?}");
            assert!(sum(|c| c.sequence_errors) > 0, "{damage:?} {counts:?}");
            assert!(
                damage.drop == 0 || sum(|c| c.timeouts) > 0,
                "{damage:?} {counts:?}"
            );
            assert!(sum(|c| c.oversize) == 0);
        }
    }
}

/// Every packet handed over is delivered, or counted where it was given up.
#[test]
fn what_is_lost_is_counted() {
    let damage = Damage {
        drop: 40,
        ..Damage::default()
    };
    for fd in [false, true] {
        let parameters = if fd {
            Parameters::FD
        } else {
            Parameters::CLASSIC
        };
        let mut bus = Bus::new([parameters; 2], damage, 9);
        for number in 0..500 {
            bus.push(0, sealed(200, number));
        }
        bus.run();
        let lost = 500 - bus.received[1].len() as u32;
        let (emulator, client) = (bus.counts(0), bus.counts(1));
        // A lost first frame or flow control: unsent. A lost consecutive frame: incomplete; the flow control of such a
        // message being lost too, both. A message is never lost without either.
        assert!(
            lost > 20 && lost <= emulator.unsent + client.incomplete,
            "{lost} {emulator:?} {client:?}"
        );
    }
}

#[test]
fn silence_of_the_other_end_ends_in_time() {
    let mut bus = Bus::new(
        [Parameters::CLASSIC; 2],
        Damage {
            drop: 1,
            ..Damage::default()
        },
        1,
    );
    for number in 0..10 {
        bus.push(0, sealed(200, number));
        bus.push(1, attitude(number as u32, true));
    }
    bus.run();
    // Ten messages, each given up 1 s after its first frame.
    assert!(
        (10_000_000..10_100_000).contains(&bus.now_us),
        "{}",
        bus.now_us
    );
    assert_eq!(
        bus.counts(0),
        Counts {
            timeouts: 10,
            unsent: 10,
            ..Counts::default()
        }
    );
}

#[test]
fn neither_lane_starves() {
    let mut bus = Bus::perfect(false);
    // More attitudes than the bus carries, and one long packet: 201 frames.
    for number in 0..1000 {
        bus.push(1, attitude(number, true));
    }
    bus.push(1, octets(1400, 1));
    bus.run();
    let long = bus.received[0]
        .iter()
        .position(|packet| !is_attitude(packet))
        .expect("delivered");
    assert_eq!(long, 201, "one frame of it after each attitude");

    // And an attitude amid a long packet goes at once.
    let mut bus = Bus::perfect(false);
    bus.push(1, octets(1400, 1));
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
