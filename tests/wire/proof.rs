//! Proof of address over UDP: frames go only to clients that prove their address, while they are
//! active.

use crate::abandoned::{limited, turning};
use crate::support::client::Client;
use crate::support::line::{Line, UdpLine, is_challenge};
use crate::support::{
    EPOCH, Running, TIMEOUT, attitude, await_that, later, on_memory, on_udp, options, quick,
    role_clients, scene, udp_client,
};
use crate::withheld::balance;
use skyloop::config::Clock;
use skyloop::link::open_all;
use skyloop_protocols::apid::{PIXEL_BLOCK, STATUS};
use skyloop_protocols::credit::CREDITED_APIDS;
use skyloop_protocols::packet::identify;
use skyloop_protocols::{Challenge, Command, MAX_PACKET, Reason, Reply, WireTime};
use std::time::{Duration, Instant};

/// Bytes of a datagram with its headers: IPv4 20 (RFC 791), UDP 8 (RFC 768).
fn on_the_wire(packet: &[u8]) -> usize {
    packet.len() + 28
}

/// A client's line that never returns a Challenge.
pub struct Silent(pub UdpLine);

impl Line for Silent {
    fn send(&mut self, packet: &[u8]) {
        self.0.send(packet);
    }

    fn recv(&mut self, timeout: Duration) -> Option<Vec<u8>> {
        self.0.0.set_read_timeout(Some(timeout)).unwrap();
        let mut buffer = [0; 2048];
        let length = self.0.0.recv(&mut buffer).ok()?;
        Some(buffer[..length].to_vec())
    }
}

/// Traffic to a forged address, whose owner sends and answers nothing. X-Val: RFC 9000, section
/// 8.1: at most three times the bytes sent in its name.
#[test]
fn forged_addresses_get_at_most_three_bytes_per_byte() {
    for clock in [Clock::Stepped, Clock::Wall, Clock::External] {
        let (_emulator, line) = on_udp(scene(), clock, 5.0);
        let mut forged = Client::new(Silent(line));
        let (mut sent, mut received, mut challenges) = (0, 0, 0);
        for sequence in 0..40 {
            let time = later(EPOCH, 0.05 * f64::from(sequence));
            let commands = [
                Command::Credit { packets: 1 << 30 },
                Command::Attitude(attitude(sequence)),
                Command::Ping,
            ];
            for command in commands {
                let (packet, _) = forged.prepare(&command, time);
                forged.line.send(&packet);
                sent += on_the_wire(&packet);
            }
            while let Some(packet) = forged.line.recv(Duration::from_millis(50)) {
                received += on_the_wire(&packet);
                challenges += usize::from(is_challenge(&packet));
                assert!(received <= 3 * sent, "{clock:?}: {received} for {sent}");
            }
        }
        println!("{clock:?}: {received} bytes for {sent}, {challenges} Challenges");
        assert!(challenges > 1, "{clock:?}");
    }
}

#[test]
fn silent_clients_get_no_stream() {
    let (_emulator, mut client) = udp_client(scene(), Clock::Wall, 1.0);
    client.status();
    client.good_frame(1);
    // Credit does not limit the stream.
    client.send(Command::Credit { packets: 1 << 30 });
    // From now on the client returns nothing.
    let mut muted = Silent(client.line);
    let started = Instant::now();
    // Challenges continue within three times the bytes received.
    let mut last = started;
    while last.elapsed() < Duration::from_secs(2) {
        let received = muted.recv(Duration::from_millis(100));
        if received.is_some_and(|packet| !is_challenge(&packet)) {
            last = Instant::now();
        }
        assert!(started.elapsed() < TIMEOUT, "the stream goes on");
    }
    // A client that returns the Challenges gets the stream again.
    let mut client = Client::new(muted.0).unpaced();
    client.await_answer();
}

/// A Challenge of another address or time is refused with that reason on every link.
#[test]
fn wrong_challenges_are_refused_with_a_reason() {
    let challenge = |token| {
        let mut buffer = [0; MAX_PACKET];
        let reply = Reply::Challenge(Challenge { token });
        let length = reply.encode(7, WireTime(0), &mut buffer).unwrap();
        buffer[..length].to_vec()
    };
    let damaged = {
        let mut packet = challenge(1);
        packet[20] ^= 1;
        packet
    };
    const WRONG: &str = "this Challenge is not of this address or time";
    for (packet, reason, detail) in [
        (challenge(0), Reason::ValueOutOfRange, WRONG),
        (challenge(u64::MAX), Reason::ValueOutOfRange, WRONG),
        (damaged, Reason::BadCrc, "damaged on the way"),
    ] {
        let (udp, line) = on_udp(scene(), Clock::Stepped, 5.0);
        let (memory, over_memory) = on_memory(scene(), Clock::Stepped);
        let lines: [Box<dyn Line>; 3] = [
            Box::new(Silent(line.another())),
            Box::new(line),
            Box::new(over_memory),
        ];
        for line in lines {
            let mut client = Client::new(line);
            client.line.send(&packet);
            let nack = client.nack();
            let found = (nack.apid, nack.sequence_count, nack.reason);
            assert_eq!(found, (0x20B, 7, reason), "{}", nack.detail);
            assert!(nack.detail.contains(detail), "{}", nack.detail);
        }
        for emulator in [udp, memory] {
            assert_eq!(emulator.end().unknown_type, 0, "{detail}");
        }
    }
}

#[test]
fn packets_waiting_for_proof_at_the_end_are_counted_as_lost() {
    let (emulator, line) = on_udp(scene(), Clock::Stepped, 60.0);
    let mut client = Client::new(Silent(line));
    client.point(attitude(1), EPOCH);
    for _ in 0..20 {
        client.send(Command::Ping);
    }
    // The first replies arrive; all others wait.
    while client
        .line
        .recv(Duration::from_secs(1))
        .is_some_and(|packet| is_challenge(&packet))
    {}
    std::thread::sleep(Duration::from_secs(1));
    let counters = emulator.end();
    // An Ack and a Status each; the first replies are within three times the bytes sent.
    let lost = counters.lost_outbound;
    assert!((1..40).contains(&lost), "{counters:?}");
}

fn last_challenge(line: &mut Silent) -> Vec<u8> {
    let received = std::iter::from_fn(|| line.recv(Duration::from_millis(100)));
    let challenges = received.filter(|packet| is_challenge(packet));
    challenges.last().expect("a Challenge")
}

/// The proof arrives after the frame is abandoned, after 2 s (ICD, section 5.3).
#[test]
fn frames_abandoned_before_the_proof_are_not_sent_after_it() {
    let (emulator, line) = on_udp(scene(), Clock::Stepped, 60.0);
    let mut muted = Client::new(Silent(line));
    muted.point(attitude(0), EPOCH);
    drop(emulator.exposed());
    let challenge = last_challenge(&mut muted.line);
    muted.line.send(&challenge);
    let late = std::iter::from_fn(|| muted.line.recv(Duration::from_millis(300)));
    let frames =
        late.filter(|packet| !is_challenge(packet) && identify(packet).unwrap().0 != STATUS);
    assert_eq!(frames.count(), 0);
    let mut client = Client::new(muted.line.0);
    // No packet of the frame was sent.
    client.send(Command::Resend {
        frame: 0,
        first: 0,
        count: u32::MAX,
    });
    client.refused(Reason::ValueOutOfRange, &[]);
    client.good_frame(1);
    let withheld = [("address not proved", 1)];
    balance("proved late", emulator, 2, &[(1, &withheld)]);
}

/// A frame of 40 kB takes 3 s at 12.5 kB/s, and the proof holds for 1 s. The packets sent by the
/// client would allow all of it (3 x 15 kB).
#[test]
fn queued_frames_are_removed_when_the_proof_lapses() {
    let url = "udp://127.0.0.1:0?rate_mbit=0.1".to_string();
    let links = open_all(&[url], &options(1.0)).unwrap();
    let line = UdpLine::to(&links[0].0.address);
    let emulator = Running::at(quick(1.0), Clock::Stepped, links);
    let mut client = Client::new(line);
    client.status();
    let mut muted = Client::new(Silent(client.line)).unpaced();
    for _ in 0..300 {
        muted.send(Command::Credit { packets: 1 << 30 });
        std::thread::sleep(Duration::from_millis(1));
    }
    muted.point(attitude(0), EPOCH);
    drop(emulator.exposed());
    let is_of_frame = |packet: &[u8]| CREDITED_APIDS.contains(&identify(packet).unwrap().0);
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_millis(2500) {
        let received = muted.line.recv(Duration::from_millis(50));
        let is_late = begun.elapsed() > Duration::from_millis(1500);
        assert!(!(is_late && received.is_some_and(|packet| is_of_frame(&packet))));
    }
    // It is not resent either.
    muted.send(Command::Resend {
        frame: 0,
        first: 0,
        count: 1,
    });
    let mut received = std::iter::from_fn(|| muted.line.recv(TIMEOUT));
    let answer = received.find(|packet| !is_challenge(packet)).unwrap();
    let (_, reply) = Reply::decode(&answer).unwrap();
    assert!(
        matches!(&reply, Reply::Nack(nack) if nack.reason == Reason::Busy),
        "{reply:?}"
    );
    let withheld = [("address not proved", 1)];
    let counters = balance("proof lapses", emulator, 1, &[(0, &withheld)]);
    assert_eq!(counters.frames_abandoned, 1, "{counters:?}");
    assert!(counters.lost_outbound > 0);
}

/// One client proves its address, a second one on another link proves its own late. The second gets
/// the next frames and not the abandoned one, also after a refusal.
#[test]
fn late_proofs_get_the_next_frames() {
    for is_refused in [false, true] {
        let roles = ["truth+labels", "pixels"];
        let (emulator, [mut client, late]) =
            role_clients(limited(0.3), Clock::Stepped, roles, 60.0);
        let mut late = Client::new(Silent(late.line));
        late.send(Command::Ping);
        client.point(attitude(0), EPOCH);
        client.parcel();
        drop(emulator.exposed());
        let mut expected = vec![(&"address not proved", &1)];
        if is_refused {
            // Above the work limit.
            client.point(turning(1), later(EPOCH, 1.0));
            client.nack();
            expected.push((&"refused", &1));
        }
        let is_pixels = |packet: &Vec<u8>| identify(packet).unwrap().0 == PIXEL_BLOCK;
        let challenge = last_challenge(&mut late.line);
        late.line.send(&challenge);
        await_that("the address is proved", || {
            let received = late.line.recv(Duration::from_millis(50));
            assert!(!received.as_ref().is_some_and(is_pixels));
            received.is_some_and(|packet| identify(&packet).unwrap().0 == STATUS)
        });
        client.point(attitude(2), later(EPOCH, 2.0));
        await_that("pixels arrive", || {
            late.line.recv(TIMEOUT).as_ref().is_some_and(is_pixels)
        });
        client.parcel();
        drop(emulator.exposed());
        let (stats, _) = emulator.measured();
        let frame_counters = &stats.frame_counters[1].1;
        let withheld: Vec<_> = frame_counters.withheld.iter().collect();
        assert_eq!((frame_counters.delivered, withheld), (1, expected));
    }
}

#[test]
fn closed_sockets_free_the_exchange_at_once() {
    // Without an hour of silence.
    let (_emulator, line) = on_udp(scene(), Clock::Wall, 3600.0);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    first.status();
    first.good_frame(1);
    first.send(Command::Credit { packets: 1 << 30 });
    drop(first);
    second.await_answer();
    second.start_anew();
    let before = second.counters();
    second.good_frame(2);
    // Packets for the first client are lost, or were never sent.
    assert!(before.frames_abandoned + before.lost_outbound + before.deadlines_missed > 0);
}
