//! A report as text.

use super::{MOST_MS, MOST_OCTETS, Report, Scale, Step};
use std::fmt;

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let load = self
            .load
            .map_or("unknown".to_string(), |load| format!("{load:.2}"));
        writeln!(
            f,
            "{}, {} threads, load {load}, {}",
            self.cpu, self.threads, self.level
        )?;
        writeln!(
            f,
            "\n{:<38}{:>9}  {:<26}{:>9}{:>9}  {:<14}{:>6}",
            "an object of", "ns", "against", "ns", "ratio", "quartiles", "least"
        )?;
        for row in &self.rows {
            let least = row.least.map_or(String::new(), |least| format!("{least}"));
            let spread = format!("{:.1} to {:.1}", row.spread[0], row.spread[1]);
            writeln!(
                f,
                "{:<38}{:>9.2}  {:<26}{:>9.1}{:>7.1} x  {spread:<14}{least:>6}{}",
                row.work,
                row.ns,
                row.against,
                row.against_ns,
                row.ratio,
                mark(row.least.is_none_or(|least| row.ratio >= least))
            )?;
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
            octets,
        } = &self.step;
        writeln!(
            f,
            "\nwhole step of {objects} objects, {frames} frames at 10 Hz: p50 {p50_ms:.2} ms, p99 {p99_ms:.2} ms (at most {MOST_MS}{}); first frame \
             {first_ms:.1} ms; by SGP4 alone p50 {exact_p50_ms:.2} ms\n\
             a frame has {candidates:.0} candidates, {unseen:.0} unseen, {labelled:.0} labelled objects; memory {octets:.0} B an object (at most {MOST_OCTETS}{})",
            mark(*p99_ms <= MOST_MS),
            mark(*octets <= MOST_OCTETS)
        )
    }
}

/// What stands behind a promise.
fn mark(kept: bool) -> &'static str {
    if kept { "" } else { "  NOT kept" }
}

#[cfg(test)]
mod tests {
    use super::super::Row;
    use super::*;

    #[test]
    fn what_is_not_kept_is_marked() {
        let row = |work: &str, ratio, least| Row {
            work: work.to_string(),
            against: "another",
            ns: 10.0,
            against_ns: 10.0 * ratio,
            ratio,
            spread: [ratio, ratio],
            least,
        };
        let mut report = Report {
            cpu: "none".to_string(),
            threads: 2,
            load: None,
            level: "portable".to_string(),
            rows: vec![
                row("short", 1.6, Some(1.7)),
                row("enough", 1.7, Some(1.7)),
                row("free", 0.1, None),
            ],
            step: Step {
                objects: 1,
                frames: 1,
                p50_ms: 1.0,
                p99_ms: MOST_MS + 1.0,
                first_ms: 1.0,
                exact_p50_ms: 1.0,
                found: [1.0; 3],
                octets: MOST_OCTETS,
            },
            scale: Vec::new(),
        };
        let marked = |report: &Report| -> Vec<String> {
            let text = report.to_string();
            let lines = text.lines().filter(|line| line.contains("NOT kept"));
            lines
                .map(|line| line.split(' ').next().unwrap_or_default().to_string())
                .collect()
        };
        assert_eq!(marked(&report), ["short", "whole"]);
        assert_eq!(report.broken().len(), 2);
        report.step.p99_ms = MOST_MS;
        report.step.octets = MOST_OCTETS + 1.0;
        assert_eq!(marked(&report), ["short", "a"]);
    }
}
