//! A report as text.

use super::{MAX_BYTES, MAX_MS, Report, Scale, Step};
use crate::ratio::{Row, mark};
use std::fmt;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\n\n{}", self.machine, Row::head("ns an object"))?;
        for row in &self.rows {
            writeln!(f, "{row}")?;
        }
        writeln!(
            f,
            "\n{:>9}  {:>18}  {:>18}",
            "objects", "SGP4, ns an object", "tracks, ns an object"
        )?;
        for Scale {
            objects,
            exact_ns,
            tracked_ns,
        } in &self.scale
        {
            writeln!(f, "{objects:>9}  {exact_ns:>18.1}  {tracked_ns:>18.2}")?;
        }
        let Step {
            objects,
            frames,
            p50_ms,
            p99_ms,
            first_ms,
            exact_p50_ms,
            found: [candidates, unseen, labelled],
            bytes,
        } = &self.step;
        writeln!(
            f,
            "\nwhole step of {objects} objects, {frames} frames at 10 Hz: p50 {p50_ms:.2} ms, p99 {p99_ms:.2} ms (at most {MAX_MS}{}); first frame \
             {first_ms:.1} ms; by SGP4 alone p50 {exact_p50_ms:.2} ms\n\
             a frame has {candidates:.0} candidates, {unseen:.0} unseen, {labelled:.0} labelled objects; memory {bytes:.0} B an object (at most {MAX_BYTES}{})",
            mark(*p99_ms <= MAX_MS),
            mark(*bytes <= MAX_BYTES)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Report as _;
    use crate::ratio::Machine;

    #[test]
    fn missed_limits_are_marked() {
        let row = |work: &str, ratio, least| Row {
            work: work.to_string(),
            against: "another",
            time: 10.0,
            against_time: 10.0 * ratio,
            ratio,
            spread: [ratio, ratio],
            least,
            most: None,
        };
        let mut report = Report {
            machine: Machine {
                cpu: "none".to_string(),
                threads: 2,
                load: None,
                level: "portable".to_string(),
            },
            rows: vec![
                row("short", 1.6, Some(1.7)),
                row("enough", 1.7, Some(1.7)),
                row("free", 0.1, None),
            ],
            step: Step {
                objects: 1,
                frames: 1,
                p50_ms: 1.0,
                p99_ms: MAX_MS + 1.0,
                first_ms: 1.0,
                exact_p50_ms: 1.0,
                found: [1.0; 3],
                bytes: MAX_BYTES,
            },
            scale: Vec::new(),
        };
        let marked = |report: &Report| -> Vec<String> {
            let text = report.to_string();
            let lines = text.lines().filter(|line| line.contains("NOT met"));
            lines
                .map(|line| line.split(' ').next().unwrap_or_default().to_string())
                .collect()
        };
        assert_eq!(marked(&report), ["short", "whole"]);
        assert_eq!(report.broken().len(), 2);
        report.step.p99_ms = MAX_MS;
        report.step.bytes = MAX_BYTES + 1.0;
        assert_eq!(marked(&report), ["short", "a"]);
    }
}
