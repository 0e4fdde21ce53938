//! The page in Prometheus' text format, version 0.0.4.

use super::Snapshot;
use super::page::{Of, Page, number};
use std::sync::Arc;

/// A camera's snapshot, and its name if it is not the first.
pub(super) type Camera = (Option<Arc<str>>, Arc<Snapshot>);

/// Name of a metric without `skyloop_`, help, and value of a link, if known.
type Metric = (&'static str, &'static str, fn(&Snapshot) -> Option<String>);

const FRAMES: [Metric; 3] = [
    (
        "frames_total",
        "Frames to send, complete or not; exposures without a frame count in exposures_missed.",
        |of| Some(of.frames.to_string()),
    ),
    (
        "deadlines_missed_total",
        "Frames that were late or incomplete; exposures without a frame count in exposures_missed.",
        |of| Some(of.missed.to_string()),
    ),
    (
        "frames_incomplete_total",
        "Frames that were not sent completely.",
        |of| Some(of.incomplete.to_string()),
    ),
];

const REQUESTS: [Metric; 2] = [
    (
        "link_frames_requested_total",
        "Requests for frames: delivered, withheld, or in flight.",
        |of| Some(of.requested.to_string()),
    ),
    (
        "link_frames_delivered_total",
        "Frames whose last packet was sent.",
        |of| Some(of.delivered.to_string()),
    ),
];

const LAST_FRAME: [Metric; 6] = [
    (
        "exposure_start_timestamp_seconds",
        "Start of the last frame's exposure, since 1970.",
        |of| Some(number(of.exposure_s?[0])),
    ),
    (
        "exposure_mid_timestamp_seconds",
        "Middle of the last frame's exposure, since 1970.",
        |of| Some(number(of.exposure_s?[1])),
    ),
    (
        "exposure_end_timestamp_seconds",
        "End of the last frame's exposure, since 1970.",
        |of| Some(number(of.exposure_s?[2])),
    ),
    (
        "attitude_age_seconds",
        "Age of the last frame's attitude in the middle of its exposure.",
        |of| of.attitude_age_s.map(number),
    ),
    (
        "clock_offset_seconds",
        "The client's clock minus the emulator's.",
        |of| of.clock_offset_s.map(number),
    ),
    (
        "deadline_spare_seconds",
        "Time from the last frame's end to its deadline; negative: missed, -Inf: incomplete.",
        |of| of.deadline_spare_s.map(number),
    ),
];

/// The page of all cameras; the first has no name. Omits unknown values, and counters with the name
/// of a metric.
pub(super) fn page(cameras: &[Camera]) -> String {
    let mut page = Page::default();
    let cameras: Vec<Of<'_>> = cameras
        .iter()
        .map(|(head, of)| (head.iter().map(|head| ("head", &**head)).collect(), &**of))
        .collect();
    let mut links: Vec<Of<'_>> = Vec::new();
    for (labels, of) in &cameras {
        for of in std::iter::once(*of).chain(&of.further) {
            let mut labels = labels.clone();
            labels.extend(of.link.iter().map(|link| ("link", link.as_str())));
            links.push((labels, of));
        }
    }
    families(&mut page, &links, "counter", &FRAMES);
    request_counters(&mut page, &links);
    let latency = "skyloop_latency_seconds";
    let help = "Time from the trigger of a frame to a stage, of complete frames; bounds of buckets are exact to 0.5 %.";
    if links.iter().any(|(_, of)| !of.stages.is_empty()) && page.begin(latency, "histogram", help) {
        for (labels, of) in &links {
            let stages = of.stages.iter();
            stages.for_each(|stage| page.histogram(latency, labels, stage));
        }
    }
    families(&mut page, &links, "gauge", &LAST_FRAME);
    let help = "State of the clock that follows the client: 0 free, 1 waiting, 2 locked, 3 holdover, 4 paused.";
    page.family(&cameras, ("skyloop_clock_sync", "gauge", help), |of| {
        of.sync
    });
    let names = cameras.iter().flat_map(|(_, of)| &of.counters);
    for (name, _) in names {
        let help = format!("The counter {name} of Status, modulo 2^32.");
        let metric = format!("skyloop_{name}_total");
        page.family(&cameras, (&metric, "counter", &help), |of| {
            let count = of.counters.iter().find(|(other, _)| other == name);
            count.map(|(_, count)| *count)
        });
    }
    if page.begin(
        "skyloop_build_info",
        "gauge",
        "Version of the running program.",
    ) {
        let version = [("version", env!("CARGO_PKG_VERSION"))];
        page.sample("skyloop_build_info", &version, 1);
    }
    page.text
}

/// Adds metrics that have a sample of each link.
fn families(page: &mut Page, links: &[Of<'_>], kind: &str, metrics: &[Metric]) {
    for (name, help, value) in metrics {
        page.family(links, (&format!("skyloop_{name}"), kind, help), value);
    }
}

/// How the requests for the frames of each link ended.
fn request_counters(page: &mut Page, links: &[Of<'_>]) {
    families(page, links, "counter", &REQUESTS);
    let name = "skyloop_link_frames_withheld_total";
    let help = "Requests whose frame was not sent completely, by cause.";
    if links.iter().any(|(_, of)| !of.withheld.is_empty()) && page.begin(name, "counter", help) {
        for (labels, of) in links {
            for (cause, count) in &of.withheld {
                let labels = [&labels[..], &[("cause", *cause)]].concat();
                page.sample(name, &labels, count);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::{FrameTimes, Latencies};
    use std::collections::BTreeMap;
    use std::time::Duration;

    type Labels = BTreeMap<String, String>;

    /// A parsed metric: its type, and its samples by name and labels.
    #[derive(Debug, Default)]
    struct Family {
        kind: String,
        samples: Vec<(String, Labels, f64)>,
    }

    /// Parses a page strictly; panics if the format does not allow it.
    fn read(text: &str) -> BTreeMap<String, Family> {
        assert!(text.ends_with('\n'));
        let mut families: BTreeMap<String, Family> = BTreeMap::new();
        let (mut current, mut helped) = (String::new(), String::new());
        for line in text.lines() {
            if let Some(help) = line.strip_prefix("# HELP ") {
                let (name, help) = help.split_once(' ').unwrap();
                assert!(is_name(name) && !help.is_empty() && !help.contains('\\'));
                helped = name.to_string();
            } else if let Some(kind) = line.strip_prefix("# TYPE ") {
                let (name, kind) = kind.split_once(' ').unwrap();
                assert_eq!(name, helped);
                assert!(["counter", "gauge", "histogram"].contains(&kind), "{line}");
                current = name.to_string();
                let family = Family {
                    kind: kind.to_string(),
                    ..Family::default()
                };
                assert!(
                    families.insert(current.clone(), family).is_none(),
                    "{name} twice"
                );
            } else {
                let (name, labels, value) = sample(line);
                let family = families.get_mut(&current).unwrap();
                let rest = name
                    .strip_prefix(&current)
                    .unwrap_or_else(|| panic!("{line}"));
                let suffixes: &[&str] = match family.kind.as_str() {
                    "histogram" => &["_bucket", "_sum", "_count"],
                    _ => &[""],
                };
                assert!(suffixes.contains(&rest), "{line}");
                let twice = family
                    .samples
                    .iter()
                    .any(|(n, l, _)| (n, l) == (&name, &labels));
                assert!(!twice, "{line} twice");
                family.samples.push((name, labels, value));
            }
        }
        families.iter().for_each(check);
        families
    }

    fn is_name(name: &str) -> bool {
        let mut letters = name.chars();
        let first = letters.next().unwrap();
        let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
        (letter(first) || first == ':')
            && letters.all(|c| letter(c) || c == ':' || c.is_ascii_digit())
    }

    fn sample(line: &str) -> (String, Labels, f64) {
        let (name, value) = line.rsplit_once(' ').unwrap();
        let (name, labels) = match name.split_once('{') {
            None => (name, ""),
            Some((name, labels)) => (name, labels.strip_suffix('}').unwrap()),
        };
        assert!(is_name(name), "{line}");
        let label = |label: &str| {
            let (key, value) = label.split_once('=').unwrap();
            let value = value.strip_prefix('"').unwrap().strip_suffix('"').unwrap();
            assert!(is_name(key) && !key.contains(':'));
            assert!(!value.contains(['"', '\\']));
            (key.to_string(), value.to_string())
        };
        let labels = labels.split(',').filter(|text| !text.is_empty()).map(label);
        (name.to_string(), labels.collect(), parse_number(value))
    }

    fn parse_number(text: &str) -> f64 {
        match text {
            "+Inf" => f64::INFINITY,
            "-Inf" => f64::NEG_INFINITY,
            "NaN" => f64::NAN,
            _ => {
                let plain = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
                assert!(text.chars().all(plain), "{text}");
                text.parse().unwrap()
            }
        }
    }

    /// Counters end in `_total` and do not fall below 0; buckets rise with their bounds to the
    /// count.
    fn check((name, family): (&String, &Family)) {
        assert!(!family.samples.is_empty(), "{name}");
        if family.kind == "counter" {
            assert!(name.ends_with("_total"), "{name}");
            assert!(family.samples.iter().all(|(_, _, value)| *value >= 0.0));
        }
        if family.kind != "histogram" {
            return;
        }
        let mut series: BTreeMap<Labels, Vec<(f64, f64)>> = BTreeMap::new();
        for (sample, labels, value) in &family.samples {
            let mut labels = labels.clone();
            let le = labels.remove("le");
            assert_eq!(le.is_some(), sample.ends_with("_bucket"), "{sample}");
            let buckets = series.entry(labels).or_default();
            buckets.extend(le.map(|le| (parse_number(&le), *value)));
        }
        for (labels, buckets) in series {
            let rising = |pair: &[(f64, f64)]| pair[0].0 < pair[1].0 && pair[0].1 <= pair[1].1;
            assert!(buckets.windows(2).all(rising), "{labels:?} {buckets:?}");
            let (last, all) = *buckets.last().unwrap();
            assert_eq!(last, f64::INFINITY);
            let value = |suffix: &str| {
                let name = format!("{name}{suffix}");
                let found = family
                    .samples
                    .iter()
                    .find(|(n, l, _)| *n == name && *l == labels);
                found.unwrap().2
            };
            assert_eq!(value("_count"), all);
            assert!(value("_sum") >= 0.0);
        }
    }

    fn value(families: &BTreeMap<String, Family>, name: &str) -> f64 {
        let [(_, labels, value)] = &families[name].samples[..] else {
            panic!("{name}: {:?}", families[name]);
        };
        assert!(labels.is_empty());
        *value
    }

    /// A hundred frames whose last bytes leave after 1 to 100 ms, and an incomplete one.
    fn run() -> Latencies {
        let mut all = Latencies::default();
        for number in 0..=100 {
            all.add(&FrameTimes {
                frame: number,
                attitude_age_s: 0.01,
                first_pixel: Duration::from_micros(150),
                last_pixel: Duration::from_micros(700),
                first_byte: Duration::from_micros(900),
                last_byte: number * Duration::from_millis(1),
                spare_s: 0.0905 - f64::from(number) * 1e-3,
                whole: number > 0,
            });
        }
        all
    }

    #[test]
    fn a_run_reads_back() {
        let snapshot = Snapshot {
            counters: vec![("attitudes", 7), ("bad_crc", u32::MAX)],
            attitude_age_s: Some(0.0125),
            clock_offset_s: Some(-1e-9),
            deadline_spare_s: Some(-0.5),
            ..Snapshot::of(&run())
        };
        let families = read(&page(&[(None, snapshot.into())]));
        for (name, expected) in [
            ("skyloop_frames_total", 101.0),
            // X-Val: by hand: 91 to 100 ms are late, and one is incomplete.
            ("skyloop_deadlines_missed_total", 11.0),
            ("skyloop_frames_incomplete_total", 1.0),
            ("skyloop_attitudes_total", 7.0),
            ("skyloop_bad_crc_total", 4_294_967_295.0),
            ("skyloop_attitude_age_seconds", 0.0125),
            ("skyloop_clock_offset_seconds", -1e-9),
            ("skyloop_deadline_spare_seconds", -0.5),
        ] {
            assert_eq!(value(&families, name), expected, "{name}");
        }
        let latency = &families["skyloop_latency_seconds"].samples;
        let find = |suffix: &str, stage: &str, le: Option<&str>| {
            let name = format!("skyloop_latency_seconds_{suffix}");
            let le = le.map(str::to_string);
            let is = |(n, l, _): &&(String, Labels, f64)| {
                *n == name && l["stage"] == stage && l.get("le") == le.as_ref()
            };
            latency.iter().find(is).unwrap().2
        };
        for stage in ["first_pixel", "last_pixel", "first_octet", "last_octet"] {
            assert_eq!(find("count", stage, None), 100.0);
        }
        // X-Val: by hand: the sum of 1 to 100 ms, and how many are within each bound; one on a
        // bound may be counted with the next.
        assert!((find("sum", "last_octet", None) - 5.05).abs() < 1e-9);
        for (le, exact) in [
            ("0.0005", 0.0),
            ("0.01", 10.0),
            ("0.05", 50.0),
            ("0.1", 100.0),
        ] {
            let found = find("bucket", "last_octet", Some(le));
            assert!((exact - 1.0..=exact).contains(&found), "{le}: {found}");
        }
        assert_eq!(find("bucket", "first_pixel", Some("0.0001")), 0.0);
        assert_eq!(find("bucket", "first_pixel", Some("0.0002")), 100.0);
        let build = &families["skyloop_build_info"].samples[0];
        assert_eq!(build.1["version"], env!("CARGO_PKG_VERSION"));
        assert_eq!(build.2, 1.0);
    }

    #[test]
    fn unknown_values_and_duplicate_names_are_omitted() {
        let families = read(&page(&[(None, Snapshot::default().into())]));
        assert!(!families.contains_key("skyloop_clock_offset_seconds"));
        assert!(!families.contains_key("skyloop_latency_seconds"));
        let snapshot = Snapshot {
            counters: vec![("frames", 9), ("attitudes", 1), ("attitudes", 2)],
            ..Snapshot::of(&run())
        };
        let families = read(&page(&[(None, snapshot.into())]));
        assert_eq!(value(&families, "skyloop_frames_total"), 101.0);
        assert_eq!(value(&families, "skyloop_attitudes_total"), 1.0);
    }

    #[test]
    fn further_cameras_have_their_names() {
        let first = Snapshot {
            counters: vec![("attitudes", 7)],
            ..Snapshot::of(&run())
        };
        let second = Snapshot {
            counters: vec![("attitudes", 5)],
            attitude_age_s: Some(0.5),
            ..Snapshot::of(&Latencies::default())
        };
        let third = Snapshot::default();
        let cameras: [Camera; 3] = [
            (None, first.into()),
            (Some("starboard".into()), second.into()),
            (Some("a \\ and \"b\"\n\u{1b}\u{202e}".into()), third.into()),
        ];
        let page = page(&cameras);
        // X-Val: Prometheus' text format: backslash, quotation mark and line feed of a label's
        // value are escaped.
        let hard = r#"skyloop_frames_total{head="a \\ and \"b\"\n\\u001b\\u202e"} 0"#;
        assert!(page.contains(&format!("{hard}\n")), "{page}");
        let page = page.replace(r#"a \\ and \"b\"\n\\u001b\\u202e"#, "port");
        let families = read(&page);
        let of = |name: &str| -> Vec<(Option<&str>, f64)> {
            let samples = families[name].samples.iter();
            samples
                .map(|(_, labels, value)| (labels.get("head").map(String::as_str), *value))
                .collect()
        };
        assert_eq!(
            of("skyloop_frames_total"),
            [(None, 101.0), (Some("starboard"), 0.0), (Some("port"), 0.0)]
        );
        assert_eq!(
            of("skyloop_attitudes_total"),
            [(None, 7.0), (Some("starboard"), 5.0)]
        );
        assert_eq!(
            of("skyloop_attitude_age_seconds"),
            [(Some("starboard"), 0.5)]
        );
        assert_eq!(families["skyloop_build_info"].samples.len(), 1);
    }

    #[test]
    fn all_numbers_can_be_written() {
        for hard in [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            5e-324,
            -0.0,
        ] {
            let snapshot = Snapshot {
                clock_offset_s: Some(hard),
                ..Snapshot::default()
            };
            let found = value(
                &read(&page(&[(None, snapshot.into())])),
                "skyloop_clock_offset_seconds",
            );
            assert!(found == hard || (found.is_nan() && hard.is_nan()), "{hard}");
        }
        let mut longest = Latencies::default();
        longest.add(&FrameTimes {
            last_byte: Duration::MAX,
            spare_s: 0.0,
            whole: true,
            ..FrameTimes::incomplete(1)
        });
        read(&page(&[(None, Snapshot::of(&longest).into())]));
    }
}
