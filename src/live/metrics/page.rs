//! Writes Prometheus' text format: metrics, samples, labels.

use super::{BOUNDS, Snapshot, Stage};
use skyloop_orbit::printable;
use std::collections::BTreeSet;
use std::fmt::Write;

/// A page, and the names of its metrics.
#[derive(Default)]
pub(super) struct Page {
    pub text: String,
    names: BTreeSet<String>,
}

/// Labels and snapshot of a camera or link.
pub(super) type Of<'c> = (Vec<(&'static str, &'c str)>, &'c Snapshot);

/// Labels of a sample in the text format.
fn written(labels: &[(&str, &str)]) -> String {
    let labels = labels.iter().map(|(key, value)| {
        // Names come from files: control characters are escaped.
        let value = printable(value);
        let value = value.replace('\\', "\\\\").replace('"', "\\\"");
        format!("{key}=\"{}\"", value.replace('\n', "\\n"))
    });
    let labels = labels.collect::<Vec<_>>().join(",");
    if labels.is_empty() {
        labels
    } else {
        format!("{{{labels}}}")
    }
}

impl Page {
    /// Begins a metric; false if it is there already.
    pub fn begin(&mut self, name: &str, kind: &str, help: &str) -> bool {
        let is_new = self.names.insert(name.to_string());
        if is_new {
            // Writing to a string cannot fail.
            let _ = writeln!(self.text, "# HELP {name} {help}\n# TYPE {name} {kind}");
        }
        is_new
    }

    pub fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: impl std::fmt::Display) {
        let _ = writeln!(self.text, "{name}{} {value}", written(labels));
    }

    /// Adds a metric with a sample of each known value.
    pub fn family<V: std::fmt::Display>(
        &mut self,
        of: &[Of<'_>],
        (name, kind, help): (&str, &str, &str),
        value: impl Fn(&Snapshot) -> Option<V>,
    ) {
        let known = of
            .iter()
            .filter_map(|(labels, of)| Some((labels, value(of)?)));
        let known: Vec<_> = known.collect();
        if known.is_empty() || !self.begin(name, kind, help) {
            return;
        }
        for (labels, value) in known {
            self.sample(name, labels, value);
        }
    }

    pub fn histogram(&mut self, name: &str, labels: &[(&str, &str)], stage: &Stage) {
        let Stage {
            name: of,
            within,
            count,
            sum,
        } = stage;
        let labels = [labels, &[("stage", *of)]].concat();
        let bounds = BOUNDS.iter().map(|(_, le)| *le).zip(within.iter());
        for (le, within) in bounds.chain([("+Inf", count)]) {
            let labels = [&labels[..], &[("le", le)]].concat();
            self.sample(&format!("{name}_bucket"), &labels, within);
        }
        let sum = number(sum.as_secs_f64());
        self.sample(&format!("{name}_sum"), &labels, sum);
        self.sample(&format!("{name}_count"), &labels, count);
    }
}

pub(super) fn number(value: f64) -> String {
    if value == f64::INFINITY {
        "+Inf".to_string()
    } else if value == f64::NEG_INFINITY {
        "-Inf".to_string()
    } else {
        value.to_string()
    }
}
