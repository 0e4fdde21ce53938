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
            "work", "ns", "against", "ns", "ratio", "quartiles", "least"
        )?;
        for row in &self.rows {
            let least = row.least.map_or(String::new(), |least| format!("{least}"));
            let spread = format!("{:.1} to {:.1}", row.spread[0], row.spread[1]);
            writeln!(
                f,
                "{:<38}{:>9.2}  {:<26}{:>9.1}{:>7.1} x  {spread:<14}{least:>6}",
                row.work, row.ns, row.against, row.against_ns, row.ratio
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
            "\nwhole step of {objects} objects, {frames} frames at 10 Hz: p50 {p50_ms:.2} ms, p99 {p99_ms:.2} ms (at most {MOST_MS}); first frame \
             {first_ms:.1} ms; by SGP4 alone p50 {exact_p50_ms:.2} ms\n\
             a frame has {candidates:.0} candidates, {unseen:.0} unseen, {labelled:.0} labelled objects; memory {octets:.0} B an object (at most {MOST_OCTETS})"
        )
    }
}
