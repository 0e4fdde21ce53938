//! The wall clock: exposures at the emulator's own cadence.

use super::{mid_s, rest, shows, turned, turning, whole_periods};
use crate::support::client::{Client, counted};
use crate::support::{
    EPOCH, attitude, await_that, later, memory_client, on_udp, quick, seconds, system_time,
    udp_client,
};
use skyloop::config::Clock;
use skyloop_protocols::{Attitude, Command, Mode, OrbitState, Reason, WireTime};
use std::time::{Duration, Instant};

#[test]
fn frames_have_the_configured_rate_and_extrapolated_attitudes() {
    const RATE_HZ: f64 = 20.0;
    let (_emulator, mut client) = udp_client(quick(RATE_HZ), Clock::Wall, 60.0);
    let status = client.status();
    assert_eq!((status.mode, status.frame_rate_hz), (Mode::Wall, RATE_HZ));
    client.point(turning(1, turned(0.0)), EPOCH);
    let started = Instant::now();
    let frames: Vec<_> = (0..20).map(|_| client.frame()).collect();
    let took = started.elapsed();
    // Never early; lateness depends on the machine. X-Val: 20 frames at 20 Hz are 19 periods apart,
    // and the first ends one period after the attitude.
    assert!(took >= Duration::from_secs_f64(19.5 / RATE_HZ), "{took:?}");
    for (number, frame) in (0..).zip(&frames) {
        let header = &frame.header;
        assert_eq!((header.frame, header.attitude_sequence), (number, 1));
        whole_periods(EPOCH, frame, RATE_HZ);
        // X-Val: half of 10 ms; both times are whole nanoseconds.
        assert!((seconds(frame.time, header.exposure_end) - 0.005).abs() < 2e-9);
        assert!(shows(frame, turned(mid_s(frame))), "frame {number}");
    }
    // Each frame of one attitude has its own noise, and a later time.
    for two in frames.windows(2) {
        assert!(two[0].pixels != two[1].pixels && two[0].time < two[1].time);
    }
}

#[test]
fn no_frame_precedes_the_first_attitude() {
    let (_emulator, mut client) = memory_client(quick(200.0), Clock::Wall);
    let count = client.send(Command::SingleShot);
    let nack = client.refused(Reason::Busy, &["no attitude yet"]);
    assert_eq!(nack.sequence_count, count);
    // X-Val: 20 periods.
    assert!(client.recv(Duration::from_millis(100)).is_none());
    assert_eq!(client.counters().frames_rendered, 0);
    client.point(attitude(1), EPOCH);
    client.frame();
}

#[test]
fn single_shots_stop_the_cadence_until_a_frame_rate() {
    // A rate so low that no frame follows the cadence.
    let (_emulator, mut client) = memory_client(quick(1e-3), Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.done(Command::Exposure { seconds: 2.0 });
    let requested = Instant::now();
    client.done(Command::SingleShot);
    // One single shot at a time, with its settings fixed.
    client.done(Command::FrameRate { hz: 1e-3 });
    for command in [Command::SingleShot, Command::Exposure { seconds: 0.3 }] {
        client.send(command);
        client.refused(Reason::Busy, &["wait for its frame"]);
    }
    assert_eq!(client.frame().header.frame, 0);
    // The exposure does not start before the command.
    assert!(requested.elapsed() >= Duration::from_secs(2));
    client.done(Command::Exposure { seconds: 0.01 });
    client.point(attitude(2), later(EPOCH, requested.elapsed().as_secs_f64()));
    client.done(Command::SingleShot);
    assert_eq!(client.frame().header.attitude_sequence, 2);
    let more = client.recv(Duration::from_millis(100));
    assert!(more.is_none(), "{more:?}");
    assert_eq!(client.status().next_frame, 2);
    client.done(Command::FrameRate { hz: 50.0 });
    assert_eq!(client.status().frame_rate_hz, 50.0);
    // A blocked client gets no frames of that time.
    let frames = [(); 4].map(|()| client.frame().header.frame);
    let grow = frames.is_sorted_by(|a, b| a < b);
    assert!(frames[0] >= 2 && grow, "{frames:?}");
    let rate = |hz| Command::FrameRate { hz };
    for (command, words) in [
        (rate(0.0), ["FrameRate.hz", "1e-4 to 1e4 Hz"]),
        (rate(1e9), ["FrameRate.hz", "10000"]),
        (rate(f64::NAN), ["FrameRate.hz", "1e-4 to 1e4 Hz"]),
        // 10 ms exposures, 50 of them a second.
        (rate(100.1), ["overlap; at most 100", "Exposure"]),
        (
            Command::Exposure { seconds: 0.0201 },
            ["overlap; at most 0.02", "FrameRate"],
        ),
    ] {
        client.send(command);
        client.refused(Reason::ValueOutOfRange, &words);
    }
}

#[test]
fn repeated_rates_do_not_delay_frames() {
    let (emulator, mut client) = memory_client(quick(10.0), Clock::Wall);
    client.window = None;
    client.point(attitude(1), EPOCH);
    // Every 20 ms, with a period of 100 ms.
    let requested = Instant::now();
    while requested.elapsed() < Duration::from_millis(500) {
        client.done(Command::FrameRate { hz: 10.0 });
        std::thread::sleep(Duration::from_millis(20));
    }
    assert_eq!(emulator.exposed().number, 0);
    assert_eq!(emulator.exposed().number, 1);
}

#[test]
fn commands_are_handled_at_an_excessive_frame_rate() {
    let (emulator, mut client) = memory_client(quick(1e4), Clock::Wall);
    // Unpaced: no frame waits for this client.
    client.window = None;
    client.point(attitude(1), EPOCH);
    client.frame();
    for _ in 0..3 {
        client.status();
    }
    rest(&emulator, &mut client);
    let counters = client.counters();
    assert_eq!(
        counters.frames_rendered,
        counters.frames_delivered + counters.frames_abandoned
    );
    // 10,000 exposures a second: almost all are missed.
    assert!(counters.exposures_missed > counters.frames_rendered);
}

#[test]
fn a_reset_stops_frames_and_restores_the_cadence() {
    let (_emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.frame();
    client.done(Command::FrameRate { hz: 25.0 });
    client.done(Command::Exposure { seconds: 0.02 });
    client.done(Command::Reset);
    client.forget();
    let status = client.status();
    assert_eq!((status.frame_rate_hz, status.exposure_s), (50.0, 0.01));
    assert_eq!(status.packets_sent, 0);
    let frame = client.recv(Duration::from_millis(100));
    assert!(frame.is_none(), "no attitude, no frame");
    // The next attitude sets the time again.
    client.point(attitude(2), later(EPOCH, -5000.0));
    let frame = client.frame();
    // X-Val: whole periods of 20 ms less half an exposure: one period, plus missed ones.
    let periods = whole_periods(later(EPOCH, -5000.0), &frame, 50.0);
    let missed = client.counters().exposures_missed;
    assert!(periods < 1.5 + f64::from(missed), "{periods}");
}

#[test]
fn frames_requested_before_a_reset_are_not_sent_after_it() {
    // A rate so high that a frame is always in rendering.
    let (_emulator, mut client) = memory_client(quick(1e4), Clock::Wall);
    for round in 0..10_u32 {
        client.window = None;
        client.send(Command::Credit { packets: 1 << 20 });
        client.point(attitude(round), later(EPOCH, f64::from(round)));
        client.frame();
        client.send(Command::Reset);
        // With immediate credit, a frame completed after the Reset could be sent.
        client.send(Command::Credit { packets: 1 << 20 });
        client.next(false);
        client.forget();
        let late = client.recv(Duration::from_millis(30));
        assert!(late.is_none(), "round {round}: {late:?}");
    }
}

#[test]
fn attitudes_extrapolated_below_the_ground_are_refused_once() {
    let (_emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    let falling = Attitude {
        state: Some(OrbitState {
            position_m: [6_360_000.0, 0.0, 0.0],
            velocity_m_s: [-90_000.0, 0.0, 0.0],
        }),
        ..attitude(1)
    };
    // After 44 ms it is 4 km lower: at 50 Hz the third exposure is impossible.
    let count = client.point(falling, EPOCH);
    let parts = ["propagated to 2019-06-15T23:35:50."];
    let nack = client.refused(Reason::ValueOutOfRange, &parts);
    assert_eq!(nack.sequence_count, count);
    assert!(nack.detail.ends_with("or left out"), "{}", nack.detail);
    await_that("more exposures have passed", || {
        client.counters().exposures_missed >= 3
    });
    let counters = client.counters();
    counted(&counters, &[("attitudes", 1), ("bad_value", 1)]);
    assert!(counters.frames_rendered <= 2);
    client.forget();
    // A new attitude is refused again.
    client.point(falling, later(EPOCH, 0.5));
    client.refused(Reason::ValueOutOfRange, &[]);
    client.forget();
    // So far ahead that no exposure precedes it.
    client.point(attitude(2), later(EPOCH, 1000.0));
    assert_eq!(client.frame().header.attitude_sequence, 2);
}

#[test]
fn attitudes_extrapolated_beyond_the_time_code_are_refused_once() {
    let (_emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    let count = client.point(attitude(1), later(WireTime(u64::MAX), -0.05));
    let nack = client.refused(Reason::ValueOutOfRange, &["beyond the time code"]);
    assert_eq!(nack.sequence_count, count);
    await_that("more exposures have passed", || {
        client.counters().exposures_missed >= 3
    });
    client.has_counted(&[("bad_value", 1), ("frames_abandoned", 0)]);
}

#[test]
fn exposures_too_long_for_the_rates_are_refused() {
    let (_emulator, mut client) = memory_client(quick(1.0), Clock::Wall);
    let turning = Attitude {
        rates_rad_s: [0.0, 2.0, 0.0],
        ..attitude(1)
    };
    client.point(turning, EPOCH);
    client.done(Command::Exposure { seconds: 0.4 });
    // 1.2 rad in 0.6 s; the limit is 1 rad.
    client.send(Command::Exposure { seconds: 0.6 });
    client.refused(Reason::ValueOutOfRange, &["68.8 deg"]);
}

#[test]
fn new_clients_start_with_the_configured_rate_and_their_own_time() {
    let (_emulator, line) = on_udp(quick(50.0), Clock::Wall, 0.2);
    let mut second = Client::new(line.another());
    let mut first = Client::new(line);
    first.point(attitude(1), later(EPOCH, 5000.0));
    first.frame();
    first.done(Command::FrameRate { hz: 25.0 });
    std::thread::sleep(Duration::from_millis(300));
    assert_eq!(second.status().frame_rate_hz, 50.0);
    second.point(attitude(2), EPOCH);
    let since = seconds(EPOCH, second.frame().time);
    assert!((since - 0.015).abs() < 1.0, "{since}");
}

#[test]
fn clients_on_system_time_get_frames_of_system_time() {
    let (_emulator, mut client) = memory_client(quick(20.0), Clock::Wall);
    let now = system_time();
    // The attitude is three seconds off, but frames have the system time.
    client.point(attitude(1), later(now, -3.0));
    let after = seconds(now, client.frame().time);
    // At 20 Hz the first exposure ends 50 ms after the attitude; a slow machine skips frames.
    assert!((0.04..15.0).contains(&after), "{after}");
}

#[test]
fn the_latest_attitude_is_used() {
    let (emulator, mut client) = memory_client(quick(50.0), Clock::Wall);
    client.point(attitude(1), EPOCH);
    client.frame();
    client.frame();
    client.point(attitude(2), later(EPOCH, 0.001));
    await_that("a frame of the new attitude", || {
        client.frame().header.attitude_sequence == 2
    });
    // The noise key counts the frames of each attitude separately.
    let mut key = emulator.exposed().key;
    for repeat in 0.. {
        assert_eq!((key.sequence, key.repeat), (1, repeat));
        key = emulator.exposed().key;
        if key.sequence == 2 {
            assert!(repeat >= 1);
            break;
        }
    }
    assert_eq!(key.repeat, 0);
    client.send(Command::Attitude(attitude(3)));
    client.refused(Reason::TimeBackwards, &[]);
    assert_eq!(client.frame().header.attitude_sequence, 2);
}
