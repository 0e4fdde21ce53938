//! The page of metrics and counters.

use super::page::{code, head, prose, row};
use skyloop::metrics::{Metrics, Snapshot, serve};
use skyloop::timing::{FrameTimes, Latencies};
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::TcpStream;

/// The description of the packets, which has the counters.
const PACKETS: &str = include_str!("../../protocols/schema/packets.toml");

/// The page of a run with several cameras, several links, a frame, and all counters.
fn served(counters: Vec<(&'static str, u32)>) -> String {
    let mut latencies = Latencies::default();
    latencies.add(&FrameTimes {
        spare_s: 0.0,
        whole: true,
        ..FrameTimes::incomplete(1)
    });
    let mut snapshot = Snapshot::of(&latencies);
    snapshot.withheld = vec![("", 1)];
    snapshot.link = Some(String::new());
    snapshot.counters = counters;
    snapshot.attitude_age_s = Some(0.0);
    snapshot.exposure_s = Some([0.0; 3]);
    snapshot.clock_offset_s = Some(0.0);
    snapshot.sync = Some(0);
    snapshot.deadline_spare_s = Some(0.0);
    let metrics = Metrics::of_head("");
    metrics.publish(snapshot);
    let server = serve("0", vec![metrics]).unwrap();
    let mut stream = TcpStream::connect(server.address()).unwrap();
    stream
        .write_all(b"GET /metrics HTTP/1.1\r\nHost: here\r\nConnection: close\r\n\r\n")
        .unwrap();
    let mut page = String::new();
    stream.read_to_string(&mut page).unwrap();
    page
}

/// Names of the labels of a metric's samples.
fn labels(page: &str, metric: &str) -> String {
    let samples = page
        .lines()
        .filter_map(|line| line.strip_prefix(metric)?.split_once('{'));
    let samples = samples.filter(|(rest, _)| ["", "_bucket"].contains(rest));
    let labels =
        samples.flat_map(|(_, labels)| labels.split(',').filter_map(|one| one.split_once('=')));
    let names: BTreeSet<&str> = labels.map(|(name, _)| name).collect();
    names.into_iter().map(code).collect::<Vec<_>>().join(", ")
}

pub fn packets() -> toml::Table {
    PACKETS.parse().unwrap()
}

fn text<'t>(entry: &'t toml::Value, key: &str) -> &'t str {
    entry[key].as_str().unwrap()
}

pub fn metric_table(packets: &toml::Table) -> String {
    let counters = packets["counters"].as_array().unwrap().iter();
    let counters = counters.map(|one| (&*text(one, "name").to_string().leak(), 1));
    let page = served(counters.collect());
    let lines = page.lines().filter_map(|line| line.strip_prefix("# "));
    let lines: Vec<&str> = lines.collect();
    // Counters have a table of their own.
    let metrics = lines
        .chunks(2)
        .filter(|pair| !pair[0].contains(" The counter "));
    let rows = metrics.map(|pair| {
        let [_, name, help] = words(pair[0]);
        let [_, _, kind] = words(pair[1]);
        row(&[&code(name), kind, &labels(&page, name), &prose(help)])
    });
    head(&["Metric", "Type", "Labels", "Meaning"]) + &rows.collect::<String>()
}

/// Two words of a line, and the rest.
fn words(line: &str) -> [&str; 3] {
    let words: Vec<&str> = line.splitn(3, ' ').collect();
    words.try_into().unwrap()
}

pub fn counter_table(packets: &toml::Table) -> String {
    let rows = packets["counters"].as_array().unwrap().iter().map(|one| {
        let name = text(one, "name");
        let metric = code(&format!("skyloop_{name}_total"));
        row(&[&code(name), &metric, &prose(text(one, "doc"))])
    });
    head(&["Counter", "Metric", "Meaning"]) + &rows.collect::<String>()
}
