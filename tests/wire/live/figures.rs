//! Prometheus metrics of a live run.

use super::{quick, rest};
use crate::support::client::Client;
use crate::support::line::{MemoryLine, UdpLine};
use crate::support::{
    EPOCH, Running, attitude, await_that, bad_attitude, fetched, options, with_metrics,
};
use skyloop::config::Clock;
use skyloop::link::{self, Roles};
use skyloop::metrics::{self, Metrics};
use skyloop_protocols::Reason;
use std::collections::BTreeMap;

#[test]
fn metrics_of_an_idle_run_agree_with_its_status() {
    let metrics = Metrics::default();
    let serving = metrics::serve("0", vec![metrics.clone()]).unwrap();
    let empty = fetched(serving.address());
    assert_eq!(empty["skyloop_frames_total"], 0.0);
    let wire = link::open("udp://127.0.0.1:0", &options(60.0)).unwrap();
    let line = UdpLine::to(&wire.address);
    let links = vec![(wire, Roles::ALL)];
    let mut config = quick(20.0);
    config.run.latency_s = Some(1000.0);
    let emulator = Running::prepared(config, Clock::External, links, |server| {
        server.set_metrics(metrics);
    });
    let mut client = Client::new(line);
    // A refusal, so that some counter is not 0.
    client.point(attitude(1), EPOCH);
    client.point(bad_attitude(2), EPOCH);
    client.refused(Reason::QuaternionNotUnit, &[]);
    let mut frames: Vec<_> = (0..6).map(|_| client.frame()).collect();
    frames.extend(rest(&emulator, &mut client));
    let status = client.status();
    let all = frames.len() as f64;
    // Metrics are updated ten times a second.
    let mut found = BTreeMap::new();
    await_that("metrics of all frames", || {
        found = fetched(serving.address());
        let of = |name: &str| found.get(name).copied();
        let dropped = of("skyloop_frames_incomplete_total").unwrap_or_default();
        let commands = f64::from(status.counters.commands);
        of("skyloop_frames_total") == Some(all + dropped)
            && of("skyloop_commands_total") == Some(commands)
    });
    for (name, count) in status.counters.iter() {
        let found = found[&format!("skyloop_{name}_total")];
        assert_eq!(found, f64::from(count), "{name}");
    }
    assert!(found["skyloop_bad_attitude_total"] == 1.0);
    // Some frames may be dropped.
    let dropped = f64::from(status.counters.frames_dropped);
    assert_eq!(found["skyloop_frames_total"], all + dropped);
    assert_eq!(found["skyloop_frames_incomplete_total"], dropped);
    // After the first attitude, the client's clock is the emulator's.
    let last = &frames[frames.len() - 1];
    let offset_s = last.end.clock_offset_s;
    assert_eq!(offset_s, last.label()["timing"]["clock_offset_s"]);
    assert_eq!(found["skyloop_clock_offset_seconds"], offset_s);
    for stage in ["first_pixel", "last_pixel", "first_octet", "last_octet"] {
        let of = |name: &str| found[&format!("skyloop_latency_seconds_{name}")];
        let count = of(&format!("count{{stage=\"{stage}\"}}"));
        let bucket = of(&format!("bucket{{stage=\"{stage}\",le=\"+Inf\"}}"));
        assert_eq!((count, bucket), (all, all), "{stage}");
        // The sum agrees with the times in the frames' ends.
        let times = frames.iter().map(|frame| frame.end.timing);
        let reported = times.map(|times| match stage {
            "first_pixel" => times.first_pixel_s.into(),
            "last_pixel" => times.last_pixel_s.into(),
            "first_octet" => times.first_octet_s.into(),
            _ => f64::from(times.last_octet_s),
        });
        let reported: f64 = reported.sum();
        let sum = of(&format!("sum{{stage=\"{stage}\"}}"));
        match stage {
            // Frames report the handover to the link; metrics have the later time of sending.
            "last_octet" => assert!(sum >= reported - 1e-6, "{sum} {reported}"),
            _ => assert!(
                (sum - reported).abs() < 1e-6 * all,
                "{stage}: {sum} {reported}"
            ),
        }
    }
    assert!((1.0..1000.0).contains(&found["skyloop_deadline_spare_seconds"]));
    let (stats, _) = emulator.measured();
    assert_eq!(stats.latencies.frames as f64, all + dropped);
}

#[test]
fn metrics_are_updated_without_frames() {
    let (wire, port) = link::loopback("memory", &options(60.0)).unwrap();
    let (_emulator, serving) = with_metrics(quick(20.0), Clock::Wall, wire);
    let mut client = Client::new(MemoryLine(port));
    client.point(bad_attitude(1), EPOCH);
    client.refused(Reason::QuaternionNotUnit, &[]);
    await_that("the metrics", || {
        let found = fetched(serving.address());
        found.get("skyloop_bad_attitude_total") == Some(&1.0)
            && found["skyloop_frames_total"] == 0.0
            && found["skyloop_clock_sync"] == 0.0
    });
}
