//! Times of the stages of frames, and their distribution over a run.

mod first;

use first::maybe_seconds;
pub use first::{Miss, Slow};
use serde::{Serialize, Serializer};
use skyloop_firmware_sim::times::Times;
use std::time::{Duration, Instant};

/// Times of one frame from its trigger: the end of its exposure, or the arrival of its attitude if
/// that is later.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameTimes {
    /// The frame's number.
    pub frame: u32,
    /// Mid-exposure minus the time of its attitude, s.
    pub attitude_age_s: f64,
    /// To the first pixel rendered.
    pub first_pixel: Duration,
    /// To the last pixel rendered.
    pub last_pixel: Duration,
    /// To the first byte passed to a link.
    pub first_byte: Duration,
    /// To the last byte passed to a link.
    pub last_byte: Duration,
    /// Time left until the deadline, s; below 0: late.
    pub spare_s: f64,
    /// Whether the frame was sent completely.
    pub whole: bool,
}

impl FrameTimes {
    /// A frame that was not sent completely.
    #[must_use]
    pub const fn incomplete(frame: u32) -> Self {
        Self {
            frame,
            attitude_age_s: 0.0,
            first_pixel: Duration::ZERO,
            last_pixel: Duration::ZERO,
            first_byte: Duration::ZERO,
            last_byte: Duration::ZERO,
            spare_s: f64::NEG_INFINITY,
            whole: false,
        }
    }

    /// Completes the times of a frame whose last byte left at `last`.
    #[must_use]
    pub fn ended(self, trigger: Instant, deadline: Option<Instant>, last: Instant) -> Self {
        Self {
            last_byte: last.saturating_duration_since(trigger),
            spare_s: deadline.map_or(f64::INFINITY, |deadline| spare_s(deadline, last)),
            whole: true,
            ..self
        }
    }
}

/// Time left until a deadline, s; below 0: late.
#[must_use]
pub(crate) fn spare_s(deadline: Instant, at: Instant) -> f64 {
    match deadline.checked_duration_since(at) {
        Some(left) => left.as_secs_f64(),
        None => -at.duration_since(deadline).as_secs_f64(),
    }
}

/// The times of all frames of a run, each from its trigger.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Latencies {
    /// Number of frames.
    pub frames: u64,
    /// Frames that missed their deadline: late or incomplete.
    pub missed: u64,
    /// Incomplete frames. The times below exclude them.
    pub incomplete: u64,
    /// Exposures without a frame. They count as frames that missed their deadlines.
    pub without_frame: u64,
    /// The first frame that missed its deadline.
    pub first_miss: Option<Miss>,
    /// Frames whose attitude is later than mid-exposure; its age counts as 0.
    pub ahead: u64,
    /// Age of the attitude at mid-exposure.
    #[serde(serialize_with = "summary")]
    pub attitude_age: Times,
    /// To the first pixel rendered.
    #[serde(serialize_with = "summary")]
    pub first_pixel: Times,
    /// To the last pixel rendered.
    #[serde(serialize_with = "summary")]
    pub last_pixel: Times,
    /// To the first byte passed to a link.
    #[serde(rename = "first_octet", serialize_with = "summary")]
    pub first_byte: Times,
    /// To the last byte passed to a link.
    #[serde(rename = "last_octet", serialize_with = "summary")]
    pub last_byte: Times,
    /// Watched limit of the time to the last byte; an incomplete frame is above it.
    #[serde(rename = "watch_above_s", serialize_with = "maybe_seconds")]
    pub watch_above: Option<Duration>,
    /// The first frame above it.
    pub first_above: Option<Slow>,
}

/// The reported quantiles and their names.
const QUANTILES: [(&str, f64); 5] = [
    ("p50", 0.5),
    ("p90", 0.9),
    ("p99", 0.99),
    ("p99.9", 0.999),
    ("max", 1.0),
];

impl Latencies {
    /// Empty; notes the first frame beyond `watch_above`.
    #[must_use]
    pub(crate) fn watching(watch_above: Option<Duration>) -> Self {
        Self {
            watch_above,
            ..Self::default()
        }
    }

    /// Adds one frame. An incomplete frame has no times, and has missed its deadline if it had one.
    /// A time left that is not a number counts as missed.
    pub fn add(&mut self, times: &FrameTimes) {
        self.frames += 1;
        self.incomplete += u64::from(!times.whole);
        let never_late = times.spare_s == f64::INFINITY;
        if times.spare_s < 0.0 || times.spare_s.is_nan() || !times.whole && !never_late {
            self.missed += 1;
            let miss = Miss {
                frame: times.frame,
                late_s: times.whole.then_some(-times.spare_s),
                unexposed: None,
            };
            self.miss(miss);
        }
        let took = times.whole.then_some(times.last_byte);
        self.watch(times.frame, took, None);
        if !times.whole {
            return;
        }
        self.ahead += u64::from(times.attitude_age_s < 0.0);
        // NaN is ignored. Infinity becomes the maximum duration.
        if !times.attitude_age_s.is_nan() {
            let age = Duration::try_from_secs_f64(times.attitude_age_s.max(0.0));
            self.attitude_age.add(age.unwrap_or(Duration::MAX));
        }
        self.first_pixel.add(times.first_pixel);
        self.last_pixel.add(times.last_pixel);
        self.first_byte.add(times.first_byte);
        self.last_byte.add(times.last_byte);
    }

    /// Adds exposures without a frame; `unexposed`: `before it` or `after it`, relative to `frame`.
    pub fn add_without_frame(&mut self, count: u32, frame: u32, unexposed: &'static str) {
        if count == 0 {
            return;
        }
        self.frames += u64::from(count);
        self.missed += u64::from(count);
        self.without_frame += u64::from(count);
        let miss = Miss {
            frame,
            late_s: None,
            unexposed: Some(unexposed),
        };
        self.miss(miss);
        self.watch(frame, None, Some(unexposed));
    }

    /// Notes the missed frame with the lowest number.
    fn miss(&mut self, miss: Miss) {
        let first = self.first_miss.get_or_insert(miss);
        if miss.frame < first.frame {
            *first = miss;
        }
    }

    /// Notes the frame beyond `watch_above` with the lowest number. Incomplete frames are beyond
    /// any limit.
    fn watch(&mut self, frame: u32, took: Option<Duration>, unexposed: Option<&'static str>) {
        let Some(max) = self.watch_above else { return };
        if took.is_none_or(|took| took > max) {
            let slow = Slow {
                frame,
                last_byte: took,
                unexposed,
            };
            let first = self.first_above.get_or_insert(slow);
            if frame < first.frame {
                *first = slow;
            }
        }
    }

    /// The stages after the trigger in their order, with their names.
    #[must_use]
    pub(crate) fn stages(&self) -> [(&'static str, &Times); 4] {
        [
            ("first_pixel", &self.first_pixel),
            ("last_pixel", &self.last_pixel),
            ("first_octet", &self.first_byte),
            ("last_octet", &self.last_byte),
        ]
    }

    /// The rows of the table at a run's end.
    #[must_use]
    pub(crate) fn rows(&self) -> Vec<(String, String)> {
        let mut rows = self.stage_rows();
        rows.push(row("deadlines missed", self.missed_text()));
        rows
    }

    /// The rows of frames without deadlines.
    #[must_use]
    pub(crate) fn stage_rows(&self) -> Vec<(String, String)> {
        let (names, quantiles): (Vec<&str>, Vec<f64>) = QUANTILES.into_iter().unzip();
        let mut rows = vec![row("from the trigger", names.join(" / "))];
        for (stage, times) in self.stages() {
            let name = format!("to the {}", stage.replace('_', " "));
            rows.push(row(&name, text(times, &quantiles)));
        }
        rows.push(row("attitude's age", text(&self.attitude_age, &quantiles)));
        if self.ahead > 0 {
            let value = format!("{} of {}", self.ahead, self.frames);
            rows.push(row("attitudes after mid-exposure", value));
        }
        rows
    }

    /// `3 of 1000 (first: frame 17, late by 4.20 ms)`.
    fn missed_text(&self) -> String {
        let incomplete = match self.incomplete {
            0 => String::new(),
            count => format!(", {count} incomplete"),
        };
        let without = match self.without_frame {
            0 => String::new(),
            count => format!(", {count} without a frame"),
        };
        let first = self.first_miss.map_or(String::new(), |miss| {
            format!(" (first: frame {}, {})", miss.frame, miss.describe())
        });
        format!(
            "{} of {}{incomplete}{without}{first}",
            self.missed, self.frames
        )
    }
}

/// A row of a table.
pub fn row(name: &str, value: String) -> (String, String) {
    (name.to_string(), value)
}

/// Quantiles as text: `1.23 / 4.56 ms`.
pub fn text(times: &Times, quantiles: &[f64]) -> String {
    let ms = |p: &f64| Some(format!("{:.2}", times.quantile(*p)?.as_secs_f64() * 1e3));
    let values: Option<Vec<String>> = quantiles.iter().map(ms).collect();
    values.map_or("none".to_string(), |values| {
        format!("{} ms", values.join(" / "))
    })
}

/// Times in reports, ms.
#[derive(Serialize)]
struct Summary {
    count: u64,
    mean_ms: Option<f64>,
    min_ms: Option<f64>,
    p50_ms: Option<f64>,
    p90_ms: Option<f64>,
    p99_ms: Option<f64>,
    p99_9_ms: Option<f64>,
    max_ms: Option<f64>,
}

fn summary<S: Serializer>(times: &Times, serializer: S) -> Result<S::Ok, S::Error> {
    let in_ms = |time: Duration| time.as_nanos() as f64 / 1e6;
    let ms = |fraction| times.quantile(fraction).map(in_ms);
    let mean = in_ms(times.sum()) / times.count() as f64;
    let summary = Summary {
        count: times.count(),
        mean_ms: (times.count() > 0).then_some(mean),
        min_ms: ms(0.0),
        p50_ms: ms(0.5),
        p90_ms: ms(0.9),
        p99_ms: ms(0.99),
        p99_9_ms: ms(0.999),
        max_ms: ms(1.0),
    };
    summary.serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// A frame with stages 1, 2, 3 and `last_ms` ms after the trigger, and the deadline at 10 ms.
    fn frame(frame: u32, last_ms: u32) -> FrameTimes {
        FrameTimes {
            frame,
            attitude_age_s: 0.05,
            first_pixel: MS,
            last_pixel: 2 * MS,
            first_byte: 3 * MS,
            last_byte: last_ms * MS,
            spare_s: (10.0 - f64::from(last_ms)) * 1e-3,
            whole: true,
        }
    }

    fn value<'a>(rows: &'a [(String, String)], name: &str) -> &'a str {
        &rows.iter().find(|row| row.0 == name).unwrap().1
    }

    #[test]
    fn frame_without_a_deadline_misses_none() {
        let mut all = Latencies::default();
        all.add(&FrameTimes {
            spare_s: f64::INFINITY,
            ..FrameTimes::incomplete(1)
        });
        assert_eq!((all.frames, all.incomplete, all.missed), (1, 1, 0));
        assert!(all.first_miss.is_none());
        all.add(&FrameTimes::incomplete(2));
        assert_eq!((all.frames, all.incomplete, all.missed), (2, 2, 1));
    }

    #[test]
    fn rows_have_each_stage_and_the_first_miss() {
        let mut all = Latencies::default();
        for number in 1..=100 {
            all.add(&frame(
                number,
                if number == 17 || number == 90 { 14 } else { 4 },
            ));
        }
        let rows = all.rows();
        let quantiles = value(&rows, "from the trigger");
        assert_eq!(quantiles, "p50 / p90 / p99 / p99.9 / max");
        // X-Val: by hand: two of a hundred take 14 ms. Inner quantiles are exact to 0.5 %.
        let last: Vec<f64> = value(&rows, "to the last octet")
            .trim_end_matches(" ms")
            .split(" / ")
            .map(|ms| ms.parse().unwrap())
            .collect();
        for (found, exact) in last.iter().zip([4.0, 4.0, 14.0, 14.0, 14.0]) {
            assert!((found / exact - 1.0).abs() < 0.006, "{last:?}");
        }
        let first = value(&rows, "to the first pixel");
        assert_eq!(first, "1.00 / 1.00 / 1.00 / 1.00 / 1.00 ms");
        let age = value(&rows, "attitude's age");
        assert_eq!(age, "50.00 / 50.00 / 50.00 / 50.00 / 50.00 ms");
        let missed = value(&rows, "deadlines missed");
        assert_eq!(missed, "2 of 100 (first: frame 17, late by 4.00 ms)");
        assert!(!rows.iter().any(|row| row.0.contains("mid-exposure")));
    }

    #[test]
    fn incomplete_frame_is_missed_and_has_no_times() {
        let mut all = Latencies::default();
        all.add(&FrameTimes {
            whole: false,
            ..frame(3, 4)
        });
        assert_eq!((all.frames, all.missed, all.incomplete), (1, 1, 1));
        assert!(all.stages().iter().all(|(_, times)| times.count() == 0));
        assert_eq!(all.attitude_age.count(), 0);
        let rows = all.rows();
        assert_eq!(value(&rows, "to the last octet"), "none");
        let missed = value(&rows, "deadlines missed");
        assert_eq!(missed, "1 of 1, 1 incomplete (first: frame 3, incomplete)");
        // A later miss does not replace the first.
        all.add(&frame(4, 12));
        assert_eq!(all.first_miss.unwrap().frame, 3);
        let rows = Latencies::default().rows();
        assert_eq!(value(&rows, "deadlines missed"), "0 of 0");
    }

    #[test]
    fn exposures_without_a_frame_are_missed() {
        let mut all = Latencies::default();
        all.add(&frame(9, 12));
        all.add_without_frame(0, 3, "before it");
        assert_eq!(all.first_miss.unwrap().frame, 9);
        all.add_without_frame(2, 7, "before it");
        all.add(&frame(7, 12));
        assert_eq!((all.frames, all.missed, all.without_frame), (4, 4, 2));
        let missed =
            "4 of 4, 2 without a frame (first: frame 7, an exposure before it has no frame)";
        assert_eq!(value(&all.rows(), "deadlines missed"), missed);
        // A miss reported later with a lower number is the first.
        all.add(&FrameTimes::incomplete(5));
        assert_eq!(all.first_miss.unwrap().describe(), "incomplete");
    }

    #[test]
    fn frame_at_the_deadline_is_in_time() {
        let mut all = Latencies::default();
        all.add(&frame(1, 10));
        assert_eq!(all.missed, 0);
    }

    #[test]
    fn first_frame_above_the_watched_time_is_noted() {
        let mut all = Latencies::watching(Some(8 * MS));
        for (number, last_ms) in [(1, 7), (2, 8), (4, 20), (3, 9)] {
            all.add(&frame(number, last_ms));
        }
        let slow = |last_byte, unexposed| Slow {
            frame: 3,
            last_byte,
            unexposed,
        };
        assert_eq!(all.first_above, Some(slow(Some(9 * MS), None)));
        // An incomplete frame counts as the slowest.
        let mut lost = Latencies::watching(Some(8 * MS));
        lost.add(&FrameTimes::incomplete(3));
        assert_eq!(lost.first_above, Some(slow(None, None)));
        let mut without = Latencies::watching(Some(8 * MS));
        without.add_without_frame(2, 3, "before it");
        assert_eq!(without.first_above, Some(slow(None, Some("before it"))));
        let mut blind = Latencies::default();
        blind.add(&frame(1, 100));
        assert_eq!(blind.first_above, None);
    }

    #[test]
    fn invalid_numbers_are_missed_without_a_panic() {
        let hard = [
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::MAX,
            f64::MIN,
            -0.0,
        ];
        for attitude_age_s in hard {
            for spare_s in hard {
                let mut all = Latencies::default();
                all.add(&FrameTimes {
                    attitude_age_s,
                    spare_s,
                    last_byte: Duration::MAX,
                    ..frame(1, 4)
                });
                let in_time = spare_s >= 0.0;
                assert_eq!(all.missed, u64::from(!in_time), "{spare_s}");
                let aged = u64::from(!attitude_age_s.is_nan());
                assert_eq!(all.attitude_age.count(), aged, "{attitude_age_s}");
                assert_eq!(all.ahead, u64::from(attitude_age_s < 0.0));
                assert!(!all.rows().is_empty());
                assert!(serde_json::to_string(&all).is_ok());
            }
        }
    }

    #[test]
    fn report_has_the_quantiles_of_each_stage_in_ms() {
        let mut all = Latencies::watching(Some(8 * MS));
        all.add(&frame(5, 12));
        all.add(&FrameTimes {
            attitude_age_s: -0.01,
            ..frame(6, 6)
        });
        let json = serde_json::to_value(&all).unwrap();
        assert_eq!(json["frames"], 2);
        assert_eq!(json["ahead"], 1);
        assert_eq!(json["first_miss"]["frame"], 5);
        assert_eq!(json["first_above"]["frame"], 5);
        assert_eq!(json["first_above"]["last_octet_s"], 0.012);
        assert_eq!(json["watch_above_s"], 0.008);
        let last = &json["last_octet"];
        assert_eq!(last["count"], 2);
        // X-Val: by hand, of 6 and 12 ms.
        for (key, exact) in [("min_ms", 6.0), ("mean_ms", 9.0), ("max_ms", 12.0)] {
            assert!((last[key].as_f64().unwrap() - exact).abs() < 1e-9, "{key}");
        }
        let none = serde_json::to_value(Latencies::default()).unwrap();
        assert!(none["last_octet"]["mean_ms"].is_null());
        assert!(none["first_miss"].is_null());
    }
}
