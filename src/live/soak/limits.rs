//! Limits of a long run, and the verdicts about them.

use super::drift::Drift;
use crate::host::Memory;
use crate::timing::Latencies;
use serde::Serialize;
use skyloop_firmware_sim::verdict::Verdict;
use std::time::Duration;

/// Limits of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Limits {
    /// Maximum share of missed deadlines (0 to 1).
    pub max_miss_rate: f64,
    /// Maximum of the 99th percentile of the time from the trigger to the last byte, ms. Incomplete
    /// frames exceed it.
    pub max_p99_ms: Option<f64>,
    /// Maximum growth of resident memory since the run was warm, as a share.
    pub max_growth: Option<f64>,
}

/// Measurements of one camera.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Camera {
    /// Its name.
    pub name: String,
    /// Latencies of its frames.
    pub latencies: Latencies,
    /// Drift against the client's clock, s.
    #[serde(rename = "drift_s")]
    pub drift: Drift,
}

/// Measurements of a run.
#[derive(Debug, Clone, Default)]
pub struct Measured {
    /// Its cameras in order.
    pub cameras: Vec<Camera>,
    /// Message if it was stopped early.
    pub stopped: Option<String>,
    /// Its memory.
    pub memory: Memory,
    /// From the start of the command to the first frame at the client, s; `None`: there was none.
    pub first_frame_s: Option<f64>,
}

impl Limits {
    /// A collector that notes the first frame beyond the limits.
    #[must_use]
    pub fn latencies(&self) -> Latencies {
        let limit = |max_ms| bound(max_ms).unwrap_or(Duration::ZERO);
        Latencies::watching(self.max_p99_ms.map(limit))
    }

    /// A verdict for each limit and camera. A run without frames, or that was stopped, fails.
    #[must_use]
    pub(crate) fn assess(&self, found: &Measured) -> Vec<Verdict> {
        let mut verdicts = Vec::new();
        for Camera {
            name, latencies, ..
        } in &found.cameras
        {
            let mut own = vec![self.deadlines(latencies)];
            own.extend(self.max_p99_ms.map(|max_ms| p99(max_ms, latencies)));
            if found.cameras.len() > 1 {
                for verdict in &mut own {
                    verdict.text = format!("{name}: {}", verdict.text);
                    verdict.camera = Some(name.clone());
                }
            }
            verdicts.extend(own);
        }
        // Memory is not assessed if the run was stopped before it was warm.
        let is_assessed = found.stopped.is_none() || found.memory.warm.is_some();
        let max = self.max_growth.filter(|_| is_assessed);
        verdicts.extend(max.map(|max| growth(max, &found.memory)));
        let stopped = found.stopped.clone();
        verdicts.extend(stopped.map(|text| Verdict::new("minutes", false, text)));
        verdicts
    }

    fn deadlines(&self, found: &Latencies) -> Verdict {
        let Latencies { frames, missed, .. } = found;
        let rate = *missed as f64 / *frames as f64;
        let max = self.max_miss_rate;
        let passed = rate <= max;
        let text_start = format!("deadlines missed: {missed} of {frames} ({})", short(rate));
        let first = found.first_miss.filter(|_| !passed);
        let text = match (passed, first) {
            _ if *frames == 0 => {
                "deadlines: there was no frame; set --minutes to more than one frame period of the camera".to_string()
            }
            (true, _) => format!("{text_start} within {}", short(max)),
            (false, None) => format!("{text_start} is not within {}", short(max)),
            (false, Some(miss)) => format!(
                "{text_start} is above {}: frame {} was the first ({})",
                short(max),
                miss.frame,
                miss.describe()
            ),
        };
        Verdict {
            frame: first.map(|miss| miss.frame),
            ..Verdict::new("deadlines", passed, text)
        }
    }
}

/// A limit as a duration, clamped to the maximum; `None` if no duration meets it.
fn bound(max_ms: f64) -> Option<Duration> {
    let max = Duration::try_from_secs_f64(max_ms * 1e-3).unwrap_or(Duration::MAX);
    (max_ms >= 0.0).then_some(max)
}

fn p99(max_ms: f64, found: &Latencies) -> Verdict {
    let whole = found.last_byte.count();
    let lost = found.frames.saturating_sub(whole);
    // Incomplete frames count as the slowest.
    let part = 0.99 * (1.0 + lost as f64 / whole as f64);
    let p99 = found.last_byte.quantile(part).filter(|_| part <= 1.0);
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    let within = |p99: Duration| bound(max_ms).is_some_and(|max| p99 <= max);
    let passed = p99.is_some_and(within);
    let first = found.first_above.filter(|_| !passed);
    let named =
        first.map(|slow| format!("frame {} was the first ({})", slow.frame, slow.describe()));
    let text = match (p99, named) {
        (None, _) if found.frames == 0 => "p99 is not known: there was no frame".to_string(),
        (None, named) => format!(
            "p99 is above {max_ms} ms: {lost} of {} frames were lost or incomplete{}",
            found.frames,
            named.map_or(String::new(), |named| format!("; {named}"))
        ),
        (Some(p99), _) if passed => format!("p99 {:.1} ms within {max_ms} ms", ms(p99)),
        (Some(p99), None) => format!("p99 {:.1} ms is not within {max_ms} ms", ms(p99)),
        (Some(p99), Some(named)) => {
            format!("p99 {:.1} ms is above {max_ms} ms: {named}", ms(p99))
        }
    };
    Verdict {
        frame: first.map(|slow| slow.frame),
        ..Verdict::new("p99", passed, text)
    }
}

fn growth(max: f64, memory: &Memory) -> Verdict {
    let passed = memory.growth().is_some_and(|growth| growth <= max);
    let is = if passed { "within" } else { "is not within" };
    let text = format!("memory {} {is} {:+} %", memory.describe(), max * 1e2);
    Verdict::new("memory", passed, text)
}

/// A rate with two digits: `0`, `6.7e-4`, `1e-3`, `0.5`, `1`.
fn short(rate: f64) -> String {
    match rate {
        0.0 => "0".to_string(),
        0.1.. => format!("{}", (rate * 100.0).round() / 100.0),
        _ => format!("{rate:.1e}").replace(".0e", "e"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::soak::fixture::{TIMES, limits, of, run};
    use crate::timing::FrameTimes;

    fn texts(limits: &Limits, found: &Measured) -> Vec<String> {
        let verdicts = limits.assess(found);
        verdicts.into_iter().map(|verdict| verdict.text).collect()
    }

    #[test]
    fn run_within_its_limits_passes() {
        let limits = limits(1e-3, Some(12.0));
        let found = run(&limits, 18_000, 18_000, 17..29);
        let verdicts = limits.assess(&found);
        assert!(verdicts.iter().all(|verdict| verdict.passed));
        assert!(verdicts.iter().all(|verdict| verdict.frame.is_none()));
        // X-Val: 12 / 18000 = 6.67e-4.
        assert_eq!(
            verdicts[0].text,
            "deadlines missed: 12 of 18000 (6.7e-4) within 1e-3"
        );
        assert_eq!(verdicts[1].text, "p99 4.0 ms within 12 ms");
    }

    #[test]
    fn exceeded_limits_name_the_first_frame() {
        let limits = limits(1e-3, Some(12.0));
        let found = run(&limits, 1000, 512, 17..29);
        let verdicts = limits.assess(&found);
        assert!(verdicts.iter().all(|verdict| !verdict.passed));
        assert_eq!(
            verdicts[0].text,
            "deadlines missed: 12 of 1000 (1.2e-2) is above 1e-3: frame 17 was the first (late by 4.20 ms)"
        );
        assert_eq!(verdicts[0].frame, Some(17));
        let text = &verdicts[1].text;
        assert!(
            text.starts_with("p99 14.") && text.contains("is above 12 ms"),
            "{text}"
        );
        assert!(
            text.ends_with("frame 512 was the first (14.2 ms)"),
            "{text}"
        );
        assert_eq!(verdicts[1].frame, Some(512));
    }

    #[test]
    fn limit_itself_is_met() {
        let none = limits(0.0, None);
        assert_eq!(
            texts(&none, &run(&none, 10, 10, 0..0)),
            ["deadlines missed: 0 of 10 (0) within 0"]
        );
        let tenth = limits(0.1, Some(14.2));
        assert!(
            tenth
                .assess(&run(&tenth, 10, 0, 3..4))
                .iter()
                .all(|v| v.passed)
        );
    }

    #[test]
    fn run_without_frames_fails() {
        let limits = limits(1.0, Some(1e9));
        let verdicts = limits.assess(&of(limits.latencies()));
        assert!(verdicts.iter().all(|verdict| !verdict.passed));
        assert_eq!(verdicts[1].text, "p99 is not known: there was no frame");
        let mut broken = limits.latencies();
        broken.add(&FrameTimes {
            whole: false,
            ..TIMES
        });
        let verdicts = limits.assess(&of(broken));
        assert_eq!(
            verdicts[1].text,
            "p99 is above 1000000000 ms: 1 of 1 frames were lost or incomplete; frame 0 was the first (incomplete)"
        );
    }

    #[test]
    fn incomplete_frames_count_as_the_slowest() {
        let limits = limits(1.0, Some(12.0));
        let lost = |count: u32| {
            let mut found = run(&limits, 1000 - count, 1000, 0..0);
            for frame in 1000 - count..1000 {
                let frame = FrameTimes::incomplete(frame);
                found.cameras[0].latencies.add(&frame);
            }
            limits.assess(&found).remove(1)
        };
        // X-Val: 10 of 1000 are one in a hundred.
        assert_eq!(lost(10).text, "p99 4.0 ms within 12 ms");
        let more = lost(11);
        assert!(!more.passed);
        assert_eq!(
            more.text,
            "p99 is above 12 ms: 11 of 1000 frames were lost or incomplete; frame 989 was the first (incomplete)"
        );
        assert_eq!(more.frame, Some(989));
    }

    #[test]
    fn invalid_limits_are_never_met() {
        for hard in [f64::NAN, f64::NEG_INFINITY, -1.0] {
            let limits = limits(hard, Some(hard));
            let verdicts = limits.assess(&run(&limits, 10, 5, 0..0));
            assert!(verdicts.iter().all(|verdict| !verdict.passed), "{hard}");
        }
        let limits = limits(f64::INFINITY, Some(f64::MAX));
        let verdicts = limits.assess(&run(&limits, 10, 5, 0..10));
        assert!(verdicts.iter().all(|verdict| verdict.passed));
    }

    #[test]
    fn memory_growth_is_limited() {
        let limits = Limits {
            max_growth: Some(0.01),
            ..limits(1.0, None)
        };
        let with = |warm, end| Measured {
            memory: Memory {
                warm_s: 60.0,
                warm,
                end,
                ..Memory::default()
            },
            ..run(&limits, 1, 1, 0..0)
        };
        for (warm, end, passes) in [
            (Some(100_000_000), Some(101_000_000), true),
            (Some(100_000_000), Some(90_000_000), true),
            (Some(100_000_000), Some(101_100_000), false),
            (None, Some(1), false),
            (Some(0), Some(1), false),
        ] {
            let verdict = limits.assess(&with(warm, end)).remove(1);
            assert_eq!(
                (verdict.name, verdict.passed),
                ("memory", passes),
                "{verdict:?}"
            );
        }
        let verdict = limits
            .assess(&with(Some(100_000_000), Some(102_000_000)))
            .remove(1);
        assert_eq!(
            verdict.text,
            "memory 100.00 MB after 60 s, 102.00 MB at the end (+2.00 %) is not within +1 %"
        );
    }

    #[test]
    fn limits_apply_to_each_camera_and_a_stopped_run_fails() {
        let limits = limits(1e-3, Some(12.0));
        let mut both = run(&limits, 1000, 1000, 0..0);
        let mut other = run(&limits, 1000, 512, 0..0);
        other.cameras[0].name = "starboard".to_string();
        both.cameras.append(&mut other.cameras);
        both.stopped = Some("stopped after 0.50 of 30 min".to_string());
        let verdicts = limits.assess(&both);
        let passed: Vec<_> = verdicts.iter().map(|v| (v.name, v.passed)).collect();
        assert_eq!(
            passed,
            [
                ("deadlines", true),
                ("p99", true),
                ("deadlines", true),
                ("p99", false),
                ("minutes", false)
            ]
        );
        assert!(verdicts[0].text.starts_with("A: deadlines missed"));
        assert!(verdicts[3].text.starts_with("starboard: p99 14."));
        assert_eq!(verdicts[4].text, "stopped after 0.50 of 30 min");
    }

    #[test]
    fn rates_are_short() {
        // X-Val: by hand.
        for (rate, text) in [
            (0.0, "0"),
            (1e-3, "1e-3"),
            (6.667e-4, "6.7e-4"),
            (1.0, "1"),
            (0.1, "0.1"),
            (0.333, "0.33"),
            (0.012, "1.2e-2"),
        ] {
            assert_eq!(short(rate), text);
        }
    }
}
