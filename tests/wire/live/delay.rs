//! A device with a delay: frames are sent in order, none before its delay, and none is lost.

use super::{mid_s, quick, rest};
use crate::support::client::{Client, Received};
use crate::support::line::MemoryLine;
use crate::support::{EPOCH, Running, attitude, await_that, memory_client, options};
use skyloop::config::{Clock, Delay};
use skyloop::engine::Emulator;
use skyloop::link::{self, Roles};
use skyloop::serve::Server;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Reason};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

const RATE_HZ: f64 = 20.0;

/// An emulator that delays its frames, and its client.
fn delayed(rate_hz: f64, delay_s: f64, jitter_s: f64) -> (Running, Client<MemoryLine>) {
    let mut config = quick(rate_hz);
    config.run.delay = Delay { delay_s, jitter_s };
    let (emulator, mut client) = memory_client(config, Clock::Wall);
    client.window = None;
    client.status();
    (emulator, client)
}

/// Requires each frame once, in order, or counted as dropped.
fn assert_in_order(frames: &[Received], dropped: u32) {
    let grow = |two: &[Received]| two[0].header.frame < two[1].header.frame;
    assert!(frames.windows(2).all(grow));
    let last = frames[frames.len() - 1].header.frame;
    assert_eq!(frames.len() as u32 + dropped, last + 1);
}

#[test]
fn no_frame_precedes_its_delay_and_order_is_preserved() {
    // Several periods, and one delay shorter than a period.
    for delay_s in [0.03, 0.12, 0.3] {
        let (emulator, mut client) = delayed(RATE_HZ, delay_s, 0.0);
        let began = Instant::now();
        client.point(attitude(1), EPOCH);
        let mut frames = Vec::new();
        for _ in 0..8 {
            let frame = client.frame();
            // By the local clock: scene time is EPOCH when the attitude arrives.
            let end_s = mid_s(&frame) + super::EXPOSURE_S / 2.0;
            let min = Duration::from_secs_f64(end_s + delay_s);
            assert!(began.elapsed() + Duration::from_micros(1) >= min);
            frames.push(frame);
        }
        // At least one frame is not late, despite delays of the machine.
        await_that("a frame without further delay", || {
            let is_late =
                |frame: &Received| f64::from(frame.end.timing.first_octet_s) - delay_s > 0.02;
            let has_punctual = frames.iter().any(|frame| !is_late(frame));
            if !has_punctual {
                frames.push(client.frame());
            }
            has_punctual
        });
        frames.extend(rest(&emulator, &mut client));
        let counters = emulator.end();
        assert_in_order(&frames, counters.frames_dropped);
        for frame in &frames {
            let times = frame.end.timing;
            assert!(f64::from(times.first_octet_s) >= delay_s * (1.0 - 1e-6));
            assert!(times.last_octet_s >= times.first_octet_s);
        }
    }
}

#[test]
fn jitter_differs_for_each_frame_within_its_bounds() {
    let delay = Delay {
        delay_s: 0.02,
        jitter_s: 0.2,
    };
    let (emulator, mut client) = delayed(RATE_HZ, delay.delay_s, delay.jitter_s);
    client.point(attitude(1), EPOCH);
    let mut frames: Vec<Received> = (0..8).map(|_| client.frame()).collect();
    frames.extend(rest(&emulator, &mut client));
    assert_in_order(&frames, emulator.end().frames_dropped);
    let mut delays = BTreeSet::new();
    for frame in &frames {
        let delay_s = delay.of(0, frame.header.frame).as_secs_f64();
        assert!((0.02..0.22).contains(&delay_s));
        // Order is preserved: a frame may wait for the one before it.
        assert!(f64::from(frame.end.timing.first_octet_s) >= delay_s * (1.0 - 1e-6));
        delays.insert((delay_s * 1e6) as u64);
    }
    assert_eq!(delays.len(), frames.len(), "all different");
    // X-Val: the spread of 8 uniform draws is below a quarter of their range once in 1,500 times.
    let (first, last) = (delays.first().unwrap(), delays.last().unwrap());
    assert!(last - first > 50_000, "{delays:?}");
}

#[test]
fn stepped_frames_have_no_delay() {
    let mut config = quick(RATE_HZ);
    config.run.delay.delay_s = 60.0;
    let (_emulator, mut client) = memory_client(config, Clock::Stepped);
    // With the delay, the client would time out.
    client.good_frame(1);
}

#[test]
fn delayed_frames_are_buffered_at_any_commanded_rate() {
    // X-Val: 2 s at 0.5 Hz are one frame, at 5 Hz ten of them.
    let (emulator, mut client) = delayed(0.5, 2.0, 0.0);
    client.point(attitude(1), EPOCH);
    // X-Val: 10 Hz need 20 frames, above the limit of 16.
    client.send(Command::FrameRate { hz: 10.0 });
    client.refused(
        Reason::ValueOutOfRange,
        &["run.delay_s", "20 frames: at most 16"],
    );
    client.done(Command::FrameRate { hz: 5.0 });
    // X-Val: a buffer for one frame holds three at most: one that is sent, one that waits.
    await_that("seven frames wait at once", || {
        std::thread::sleep(Duration::from_millis(10));
        let counters = client.counters();
        let over = counters.frames_delivered + counters.frames_abandoned;
        counters.frames_rendered - over >= 7
    });
    rest(&emulator, &mut client);
    let counters = emulator.end();
    assert_eq!(counters.frames_abandoned, counters.frames_dropped);
}

#[test]
fn delays_above_the_buffer_are_refused_with_a_remedy() {
    let fits = |clock, delay_s, jitter_s| {
        let mut config = quick(RATE_HZ);
        config.run.delay = Delay { delay_s, jitter_s };
        let (wire, _port) = link::loopback("memory", &options(5.0)).unwrap();
        let output = config.run.output;
        let emulator = Emulator::new(&mut config);
        let mut server = Server::new(emulator, [(wire, Roles::ALL)], output, clock, &NATIVE);
        server.set_run(&config.run);
        server.fits()
    };
    // X-Val: 16 frames at 20 Hz are 0.8 s.
    for clock in [Clock::Wall, Clock::External] {
        assert_eq!(fits(clock, 0.5, 0.3), Ok(()));
        let why = fits(clock, 0.5, 0.36).unwrap_err();
        let words = [
            "run.delay_s",
            "run.jitter_s",
            "at most 16",
            "timing.rate_hz",
        ];
        assert!(words.iter().all(|word| why.contains(word)), "{why}");
    }
    assert_eq!(fits(Clock::Stepped, 60.0, 60.0), Ok(()));
}

/// The delay alone exceeds the deadline, whatever the fidelity: this is predicted.
#[test]
fn delays_beyond_the_deadline_cause_late_or_dropped_frames_but_no_coarser_ones() {
    use skyloop::config::OnOverrun;
    use skyloop::fidelity::{Coarser, Fidelity};
    let run = |policy| {
        // Much longer than a pause of the machine.
        let mut config = quick(5.0);
        config.run.delay.delay_s = 2.0;
        config.run.latency_s = Some(1.9);
        config.run.on_overrun = policy;
        config.run.coarsen = vec![Coarser::Preset("fast", Fidelity::FAST)];
        let (emulator, mut client) = memory_client(config, Clock::Wall);
        client.window = None;
        client.send(Command::Credit { packets: 1 << 20 });
        client.status();
        client.point(attitude(1), EPOCH);
        (emulator, client)
    };
    for policy in [OnOverrun::Late, OnOverrun::Coarsen] {
        let (emulator, mut client) = run(policy);
        for _ in 0..3 {
            let frame = client.frame();
            assert_eq!(frame.end.overrun, skyloop_protocols::Overrun::Late);
            assert_eq!(frame.label()["overrun"], "late", "{policy:?}");
            assert!(!frame.end.in_time);
        }
        assert_eq!(emulator.end().frames_coarsened, 0);
    }
    let (emulator, mut client) = run(OnOverrun::Drop);
    await_that("exposures without a frame", || {
        client.counters().exposures_missed >= 3
    });
    // None is tried: another fidelity does not shorten the delay.
    assert_eq!(emulator.end().frames_rendered, 0);
}

/// Frames abandoned by a Reset miss no deadline.
#[test]
fn frames_abandoned_by_a_reset_miss_no_deadline() {
    let mut config = quick(RATE_HZ);
    config.run.delay.delay_s = 0.25;
    config.run.latency_s = Some(1000.0);
    let (emulator, mut client) = memory_client(config, Clock::Wall);
    client.window = None;
    client.send(Command::Credit { packets: 1 << 20 });
    client.point(attitude(1), EPOCH);
    client.frame();
    // X-Val: 0.25 s at 20 Hz are five delayed frames.
    client.done(Command::Reset);
    let (stats, counters) = emulator.measured();
    assert!(
        counters.frames_abandoned > counters.frames_dropped,
        "{counters:?}"
    );
    assert_eq!(stats.latencies.missed, u64::from(counters.frames_dropped));
}
