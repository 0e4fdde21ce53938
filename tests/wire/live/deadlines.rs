//! Deadlines, and the times reported by frames.

use super::{quick, rest};
use crate::support::client::{Client, Received};
use crate::support::line::{MemoryLine, UdpLine};
use crate::support::{EPOCH, Running, attitude, await_that, memory_client, options};
use serde_json::Value;
use skyloop::config::{Clock, OnOverrun};
use skyloop::link::{self, Roles};
use skyloop_protocols::{Command, LabelLevel, Output, Overrun, PixelLevel, Reply};
use std::time::Duration;

/// A run with this deadline after each exposure, and its first frames.
fn run(clock: Clock, latency_s: f64) -> (Running, Client<MemoryLine>, Vec<Received>) {
    let mut config = quick(20.0);
    config.run.latency_s = Some(latency_s);
    let (emulator, mut client) = memory_client(config, clock);
    client.window = None;
    client.status();
    client.point(attitude(1), EPOCH);
    let mut frames: Vec<Received> = (0..6).map(|_| client.frame()).collect();
    frames.extend(rest(&emulator, &mut client));
    (emulator, client, frames)
}

/// A time from a frame's label.
fn number(label: &Value, name: &str) -> f64 {
    label["timing"][name].as_f64().unwrap()
}

#[test]
fn with_a_tiny_latency_every_frame_misses_its_deadline() {
    for clock in [Clock::Wall, Clock::External] {
        let (emulator, mut client, frames) = run(clock, 1e-6);
        for frame in &frames {
            assert!(!frame.end.in_time && frame.end.timing.spare_s < 0.0);
            assert!(number(&frame.label(), "spare_ms") < 0.0);
        }
        let status = client.status();
        assert!(status.timing.spare_s < 0.0);
        let (stats, counters) = emulator.measured();
        let missed = counters.deadlines_missed;
        assert_eq!(stats.latencies.missed, u64::from(missed));
        // Frames dropped for a blocked client miss their deadline too.
        assert_eq!(missed, frames.len() as u32 + counters.frames_dropped);
        let first = stats.latencies.first_miss.unwrap();
        assert_eq!(first.frame, 0);
        // Late by its duration minus the allowed microsecond.
        let took_s = f64::from(frames[0].end.timing.last_octet_s);
        assert!(first.late_s.unwrap() >= took_s - 2e-6);
    }
}

#[test]
fn with_a_long_latency_no_deadline_is_missed() {
    let (emulator, mut client, frames) = run(Clock::Wall, 1000.0);
    for frame in &frames {
        assert!(frame.end.in_time);
        let spare_s = frame.end.timing.spare_s;
        assert!((1.0..1000.0).contains(&spare_s), "{spare_s}");
        let label_ms = number(&frame.label(), "spare_ms");
        assert!(
            label_ms >= f64::from(spare_s) * 1e3 * (1.0 - 1e-6),
            "the label is earlier"
        );
    }
    let status = client.status();
    assert!(status.latency_p50_s > 0.0);
    assert!(status.latency_p50_s <= status.latency_p99_s);
    assert!(status.latency_p99_s <= status.latency_max_s);
    let (stats, counters) = emulator.measured();
    // Except frames dropped for a blocked client.
    let dropped = u64::from(counters.frames_dropped);
    assert_eq!(stats.latencies.missed, dropped);
    assert_eq!(u64::from(counters.deadlines_missed), dropped);
    assert_eq!(stats.latencies.frames, frames.len() as u64 + dropped);
    assert_eq!(stats.latencies.incomplete, dropped);
}

#[test]
fn times_of_a_frame_are_ordered_in_its_end_and_its_label() {
    let (emulator, _client, frames) = run(Clock::Wall, 1000.0);
    for frame in &frames {
        let times = frame.end.timing;
        assert!(0.0 <= times.first_pixel_s && times.first_pixel_s <= times.last_pixel_s);
        assert!(0.0 < times.first_octet_s && times.first_octet_s <= times.last_octet_s);
        // The end follows the last pixel, whatever was sent before.
        assert!(times.last_pixel_s <= times.last_octet_s && times.last_pixel_s > 0.0);
        let label = frame.label();
        for (name, seconds) in [
            ("first_pixel_ms", times.first_pixel_s),
            ("last_pixel_ms", times.last_pixel_s),
            ("first_octet_ms", times.first_octet_s),
        ] {
            let ms = number(&label, name);
            assert!((ms - f64::from(seconds) * 1e3).abs() < 1e-3, "{name} {ms}");
        }
        // The label is complete before its own last part is sent.
        let sent = number(&label, "pixels_sent_ms");
        assert!(sent >= f64::from(times.first_octet_s) * 1e3 - 1e-3);
        assert!(sent <= f64::from(times.last_octet_s) * 1e3 + 1e-3);
        assert_eq!(label["timing"]["sync"], "free");
        assert_eq!(label["timing"]["trigger"], 0);
    }
    // The last byte leaves the link after it is handed over.
    let (stats, _) = emulator.measured();
    let longest = frames.iter().map(|frame| frame.end.timing.last_octet_s);
    let longest = longest.fold(0.0, f32::max);
    let left = stats.latencies.last_byte.quantile(1.0).unwrap();
    assert!(left + Duration::from_micros(1) >= Duration::from_secs_f32(longest));
}

#[test]
fn labels_have_the_announced_length_at_every_level() {
    let (_emulator, mut client) = memory_client(quick(20.0), Clock::Wall);
    client.window = None;
    client.point(attitude(1), EPOCH);
    use {LabelLevel as L, PixelLevel as P};
    for pixels in [P::None, P::Windows, P::Frame, P::Compressed] {
        for labels in [L::None, L::Objects, L::Text] {
            let output = Output {
                pixels,
                labels,
                ..Output::default()
            };
            client.done(Command::Output(output));
            // Frames in flight have the previous level.
            let mut parcel = client.parcel();
            await_that("a frame of the level", || {
                let is_it = (parcel.0.pixel_level, parcel.0.label_level) == (pixels, labels);
                if !is_it {
                    parcel = client.parcel();
                }
                is_it
            });
            let (header, packets, end) = parcel;
            let mut bytes = Vec::new();
            for packet in &packets {
                match Reply::decode(packet).unwrap().1 {
                    Reply::Labels(part) => bytes.extend_from_slice(part.text),
                    Reply::Objects(part) => bytes.extend_from_slice(part.data),
                    _ => {}
                }
            }
            assert_eq!(bytes.len(), header.label_bytes as usize, "{output:?}");
            if labels == L::Text {
                let label: Value = serde_json::from_slice(&bytes).unwrap();
                assert!(number(&label, "last_pixel_ms") > 0.0);
                assert_eq!(label["frame"], end.frame);
            }
            assert!(end.timing.first_octet_s <= end.timing.last_octet_s);
        }
    }
}

/// A blocked client misses its own deadlines only.
#[test]
fn blocked_listeners_do_not_change_the_statistics_of_other_links() {
    let mut config = quick(20.0);
    config.run.latency_s = Some(1000.0);
    let (wire, port) = link::loopback("memory", &options(60.0)).unwrap();
    let (labels, listener) = link::loopback("memory", &options(60.0)).unwrap();
    let roles = Roles {
        truth: false,
        pixels: false,
        labels: true,
    };
    let links = vec![(wire, Roles::ALL), (labels, roles)];
    let emulator = Running::at(config, Clock::Wall, links);
    let mut blocked = Client::new(MemoryLine(listener)).unpaced();
    // It takes one packet of a frame.
    blocked.send(Command::Credit { packets: 1 });
    blocked.status();
    let mut client = Client::new(MemoryLine(port)).unpaced();
    client.send(Command::Credit { packets: 1 << 20 });
    client.point(attitude(1), EPOCH);
    // X-Val: half a second, a quarter of the 2 s after which the listener is dropped.
    let frames: Vec<_> = (0..10).map(|_| client.frame()).collect();
    let status = client.status();
    assert!(status.timing.spare_s > 0.0 && status.latency_p99_s > 0.0);
    assert_eq!(status.counters.deadlines_missed, 0);
    rest(&emulator, &mut client);
    let (stats, counters) = emulator.measured();
    // Except frames dropped for a blocked client.
    let own = stats.latencies;
    assert_eq!(own.missed, own.incomplete);
    assert!(own.frames >= frames.len() as u64 && own.missed < own.frames / 2);
    let [(_, other)] = &stats.further[..] else {
        panic!("one further link");
    };
    assert!(other.missed > own.missed && other.last_byte.count() == 0);
    assert_eq!(
        u64::from(counters.deadlines_missed),
        own.missed + other.missed
    );
}

/// Times at a frame's end include packets waiting on the line.
#[test]
fn slow_lines_mark_late_frames_and_may_drop_them() {
    let run = |latency_s: f64, policy: OnOverrun| {
        let mut config = quick(10.0);
        config.run.output.labels = LabelLevel::None;
        config.run.latency_s = Some(latency_s);
        config.run.on_overrun = policy;
        // X-Val: 6144 bytes of pixels alone take 49 ms at 1 Mbit/s.
        let wire = link::open("udp://127.0.0.1:0?rate_mbit=1", &options(60.0)).unwrap();
        let line = UdpLine::to(&wire.address);
        let emulator = Running::start(config, Clock::Wall, wire);
        let mut client = Client::new(line).unpaced();
        client.send(Command::Credit { packets: 1 << 20 });
        client.status();
        client.point(attitude(1), EPOCH);
        let mut frames: Vec<_> = (0..3).map(|_| client.frame()).collect();
        let status = client.status();
        // A frame cut off by the end misses its deadline, so the line must be empty.
        frames.extend(rest(&emulator, &mut client));
        (frames, status, emulator.measured())
    };
    for policy in [OnOverrun::Late, OnOverrun::Drop] {
        let (frames, status, (stats, counters)) = run(0.02, policy);
        for frame in &frames {
            assert!(!frame.end.in_time && frame.end.timing.spare_s < 0.0);
        }
        // The first frame's lateness is not predictable.
        assert_eq!(frames[0].end.overrun, Overrun::Late);
        assert!(counters.deadlines_missed >= 2 && status.timing.spare_s < 0.0);
        match policy {
            OnOverrun::Drop => {
                assert!(stats.dropped > 0);
                let is_first = |frame: &Received| frame.end.overrun == Overrun::Drop;
                assert!(frames.iter().any(is_first), "the first frame after a drop");
            }
            _ => assert_eq!(frames[2].end.overrun, Overrun::Late),
        }
    }
    let (frames, _, (_, counters)) = run(100.0, OnOverrun::Drop);
    for frame in &frames {
        assert!(frame.end.in_time && frame.end.overrun == Overrun::None);
    }
    assert_eq!(counters.deadlines_missed, counters.frames_dropped);
}
