//! Floods, invalid packets and a bad line: all are counted, and frames continue.

use super::{TIMEOUT, frame_of, quick, whole_frame};
use crate::support::client::{Client, counted, moved};
use crate::support::line::{Line, MemoryLine};
use crate::support::{
    EPOCH, Running, attitude, await_that, fault, later, memory_client, on_udp, options,
};
use skyloop::config::Clock;
use skyloop::link;
use skyloop::link::fault::{FaultLog, Plan, wrap};
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{AttitudeSource, Command, Direction, FaultKind, Reason, Reply};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Intended rate of a flood, attitudes a second; slower machines take longer.
const FLOOD_HZ: f64 = 100_000.0;
const FLOOD: u32 = 200_000;

#[test]
fn floods_are_handled_or_counted_and_frames_continue() {
    let (_emulator, line) = on_udp(quick(20.0), Clock::Wall, 60.0);
    let socket = line.0.try_clone().unwrap();
    // Credit is lost in a flood too.
    let mut client = Client::new(line).unpaced();
    client.point(attitude(1), EPOCH);
    client.frame();
    let over = AtomicBool::new(false);
    let ((sent, took), frames) = std::thread::scope(|scope| {
        let flood = scope.spawn(|| {
            let (mut counts, mut sent) = (SequenceCounts::new(), 0u32);
            let began = Instant::now();
            // The client's own attitude has the first count.
            counts.next(Command::Attitude(attitude(0)).apid());
            while sent < FLOOD {
                assert!(began.elapsed() < 3 * TIMEOUT, "{sent} attitudes left");
                let since_s = began.elapsed().as_secs_f64();
                if f64::from(sent) > since_s * FLOOD_HZ {
                    std::thread::yield_now();
                    continue;
                }
                let command = Command::Attitude(attitude(sent + 2));
                let count = counts.next(command.apid());
                let time = later(EPOCH, 0.001 + since_s);
                let packet = crate::support::client::packet(&command, count, time);
                socket.send(&packet).unwrap();
                sent += 1;
            }
            over.store(true, Ordering::Relaxed);
            (sent, began.elapsed())
        });
        let mut frames = 0;
        while !over.load(Ordering::Relaxed) {
            // A slow reader may lose some packets.
            let packet = client.line.recv(Duration::from_millis(100));
            let reply = packet
                .as_deref()
                .and_then(|packet| Reply::decode(packet).ok());
            frames += u32::from(matches!(reply, Some((_, Reply::FrameEnd(_)))));
        }
        (flood.join().unwrap(), frames)
    });
    let Client { line, counts, .. } = client;
    let mut client = Client::new(line);
    (client.window, client.counts) = (None, counts);
    whole_frame(&mut client);
    // The next datagram reports how many the system dropped before it.
    await_that("the flood has passed", || {
        let counters = client.counters();
        counters.attitudes + counters.overflows > sent
    });
    let counters = client.counters();
    println!("{sent} attitudes in {took:?}, {frames} frames meanwhile: {counters:?}");
    assert_eq!(counters.attitudes + counters.overflows, sent + 1);
    assert_eq!(counters.time_backwards + counters.refused, 0);
    assert!(frames > 0);
    // The newest received attitude is used.
    await_that("a newer attitude is used", || {
        client.frame().header.attitude_sequence >= 2
    });
    client.point(attitude(u32::MAX), later(EPOCH, 100.0));
    frame_of(&mut client, u32::MAX);
}

#[test]
fn wall_clock_frames_continue_after_clock_steps_of_the_client() {
    const HOUR_S: f64 = 3600.0;
    let (_emulator, mut client) = memory_client(quick(20.0), Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.frame();
    // Backwards: refused with a remedy; the earlier attitude stays valid.
    client.point(attitude(2), later(EPOCH, -HOUR_S));
    client.refused(Reason::TimeBackwards, &["Reset"]);
    let seen = client.status().next_frame;
    let mut frame = client.frame();
    while frame.header.frame <= seen {
        frame = client.frame();
    }
    assert_eq!(frame.header.attitude_sequence, 1);
    assert_ne!(frame.end.attitude_source, AttitudeSource::Future);
    // Forwards: the attitude is of the future, and is marked so.
    client.point(attitude(3), later(EPOCH, HOUR_S));
    let frame = frame_of(&mut client, 3);
    assert_eq!(frame.end.attitude_source, AttitudeSource::Future);
    let age_s = frame.end.timing.attitude_age_s;
    assert!(age_s < -HOUR_S as f32 + 100.0, "{age_s}");
    let counters = client.counters();
    counted(&counters, &[("time_backwards", 1), ("attitudes", 2)]);
    assert!(counters.attitudes_future >= 1);
    // The remedy.
    client.done(Command::Reset);
    client.forget();
    client.point(attitude(4), EPOCH);
    let frame = client.frame();
    assert_eq!(frame.header.attitude_sequence, 4);
    assert_eq!(frame.end.attitude_source, AttitudeSource::Extrapolated);
}

/// Sends packets during a fault, and discards the replies up to its end.
fn burst(client: &mut Client<MemoryLine>, kind: FaultKind, direction: Direction, value: f64) {
    client.send(fault(kind, direction, value, 0.0));
    for sequence in 0..40 {
        // All times are equal, so none runs backwards.
        client.send(Command::Attitude(attitude(sequence)));
        let (ping, _) = client.prepare(&Command::Ping, EPOCH);
        client.line.send(&ping);
        while client.line.recv(Duration::from_millis(1)).is_some() {}
    }
    // The Ack of a Fault is never damaged.
    let off = client.send(fault(kind, direction, 0.0, 0.0));
    await_that("the line is good again", || {
        let packet = client.line.recv(Duration::from_millis(100));
        let reply = packet.as_deref().map(Reply::decode);
        matches!(reply, Some(Ok((_, Reply::Ack(ack)))) if ack.sequence_count == off)
    });
}

#[test]
fn bursts_of_faults_are_counted_and_frames_continue_after_them() {
    let (wire, port) = link::loopback("memory", &options(60.0)).unwrap();
    let book = Arc::new(Mutex::new(FaultLog::default()));
    let wire = wrap(wire, &Plan::default(), &NATIVE, &book).unwrap();
    let _emulator = Running::start(quick(20.0), Clock::Wall, wire);
    let mut client = Client::new(MemoryLine(port)).unpaced();
    client.point(attitude(1), EPOCH);
    client.frame();
    let mut before = client.counters();
    use Direction::{In, Out};
    use FaultKind::{BitFlips, Down, Drop, Truncate};
    for (kind, direction, value, counted) in [
        (BitFlips, In, 0.005, &["bad_crc", "sequence_gaps"][..]),
        (Drop, In, 0.5, &["sequence_gaps"]),
        (Truncate, In, 0.5, &["bad_length"]),
        (BitFlips, Out, 0.001, &[]),
        (Drop, Out, 0.5, &[]),
        (Down, In, 1.0, &["sequence_gaps", "reconnects"]),
    ] {
        let injected = book.lock().unwrap().total();
        burst(&mut client, kind, direction, value);
        // Faults on outbound packets affect only the client; the record has both directions.
        let booked = book.lock().unwrap();
        assert!(booked.total() > injected, "{kind:?}: {}", booked.summary());
        drop(booked);
        let Client { line, counts, .. } = client;
        client = Client::new(line);
        (client.window, client.counts) = (None, counts);
        whole_frame(&mut client);
        let after = client.counters();
        let moved = moved(&before, &after);
        for name in counted {
            let has_moved = moved.iter().any(|(found, _)| found == name);
            assert!(has_moved, "{kind:?}: {moved:?}");
        }
        assert!(after.frames_rendered > before.frames_rendered);
        before = after;
    }
}

/// Number of whole frames in this time, s.
fn frames_in(client: &mut Client<impl Line>, seconds: f64) -> u32 {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    let mut frames = 0;
    while Instant::now() < until {
        whole_frame(client);
        frames += 1;
    }
    frames
}

/// Foreign packets are read at a bounded rate, and the kernel keeps them out of the client's
/// socket, so that the frame rate hardly falls. Both rates are from one run.
#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_floods_of_foreign_packets_cost_few_frames() {
    const SECONDS: f64 = 1.5;
    let (_emulator, line) = on_udp(quick(1e4), Clock::Wall, 60.0);
    let foreign = line.another();
    let mut client = Client::new(line);
    client.point(attitude(1), EPOCH);
    whole_frame(&mut client);
    let quiet = frames_in(&mut client, SECONDS);
    let over = AtomicBool::new(false);
    let (sent, flooded) = std::thread::scope(|scope| {
        let flood = scope.spawn(|| {
            let began = Instant::now();
            let mut sent = 0_u32;
            while !over.load(Ordering::Relaxed) {
                if f64::from(sent) > began.elapsed().as_secs_f64() * FLOOD_HZ {
                    std::thread::yield_now();
                    continue;
                }
                let _ = foreign.0.send(&[0; 126]);
                sent += 1;
            }
            f64::from(sent) / began.elapsed().as_secs_f64()
        });
        let flooded = frames_in(&mut client, SECONDS);
        over.store(true, Ordering::Relaxed);
        (flood.join().unwrap(), flooded)
    });
    println!("{quiet} frames in {SECONDS} s, {flooded} in a flood of {sent:.0} packets/s");
    assert!(sent > 20_000.0, "no flood: {sent:.0} packets/s");
    // Sending the flood takes one core; with two, rendering has the other.
    assert!(2 * flooded > quiet, "{quiet} frames fall to {flooded}");
}
