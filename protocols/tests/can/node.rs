//! Whole packets between two nodes.

use crate::bus::{Bus, attitude, command_packet, octets, reply_packet};
use skyloop_protocols::can::Counts;
use skyloop_protocols::{Ack, Command, Reply};

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
        Command::Credit {
            packets: 0xDEAD_BEEF,
        },
    ];
    for (count, command) in (16_382..).zip(&commands) {
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
    assert_eq!(bus.frames, 8);
    for (at, command) in commands.iter().enumerate() {
        let count = 16_382 + at as u16;
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
