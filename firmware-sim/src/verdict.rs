//! Limits of a run and their verdicts: one table and one JUnit file for all commands with limits.

use skyloop_orbit::path_text;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Serialize;
use skyloop_orbit::{Mark, OutputFile};

pub use crate::junit::Suite;
use crate::report::Report;
use crate::text::{decimal, whole};

/// Whether a limit was met.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Verdict {
    /// Name of the limit: `deadlines`, `p99`, `memory`, `minutes`, `frames`, `centroids`, `missed`,
    /// `false`, `pointing` or `run`.
    pub name: &'static str,
    /// Camera, if there are several.
    pub camera: Option<String>,
    /// Whether the limit was met.
    pub passed: bool,
    /// Measured value and limit; for a limit not met, the first frame that exceeds it.
    pub text: String,
    /// The first frame that exceeds the limit.
    pub frame: Option<u32>,
}

impl Verdict {
    /// A verdict for the whole run.
    #[must_use]
    pub fn new(name: &'static str, passed: bool, text: String) -> Self {
        Self {
            name,
            camera: None,
            passed,
            text,
            frame: None,
        }
    }
}

/// One line for each verdict.
#[must_use]
pub fn table(verdicts: &[Verdict]) -> String {
    let line = |verdict: &Verdict| {
        let word = if verdict.passed { "passed" } else { "failed" };
        format!("{word}: {}\n", verdict.text)
    };
    verdicts.iter().map(line).collect()
}

/// The limits not met, in one line; `None` if all were met.
#[must_use]
pub fn broken(verdicts: &[Verdict]) -> Option<String> {
    let broken = verdicts.iter().filter(|verdict| !verdict.passed);
    let texts: Vec<&str> = broken.map(|verdict| verdict.text.as_str()).collect();
    (!texts.is_empty()).then(|| texts.join("; "))
}

impl Suite {
    /// A case for each verdict.
    #[must_use]
    pub fn document(&self, verdicts: &[Verdict]) -> String {
        let name = |verdict: &Verdict| match &verdict.camera {
            None => verdict.name.to_string(),
            Some(camera) => format!("{} of {camera}", verdict.name),
        };
        let cases = verdicts
            .iter()
            .map(|verdict| (name(verdict), verdict.passed, verdict.text.as_str()));
        self.xml(&cases.collect::<Vec<_>>())
    }
}

/// Error in verdict files until the run has ended.
pub const UNFINISHED: &str = "the run has not come to its end";
/// First bytes of a JUnit file of skyloop.
pub const JUNIT_MARK: Mark = &["<?xml", "<testsuite name=\"skyloop"];

/// Verdicts of a run that failed before any measurement: the error, and each of `checks`.
#[must_use]
pub fn not_run(checks: &[&'static str], error: &str) -> Vec<Verdict> {
    let check = |name: &&'static str| {
        let text = format!("{name}: not checked, the run failed: {error}");
        Verdict::new(name, false, text)
    };
    let run = Verdict::new("run", false, error.to_string());
    std::iter::once(run)
        .chain(checks.iter().map(check))
        .collect()
}

/// A file with the verdicts of a run. Until the end of the run it states a failure, so that an
/// aborted run has not passed. Errors name the file and a remedy.
#[derive(Debug)]
pub struct VerdictFile {
    path: PathBuf,
    output: OutputFile,
    has_begun: bool,
    is_final: bool,
}

impl VerdictFile {
    /// Opens the file, if one is named, without a change to it.
    ///
    /// # Errors
    /// The file cannot be written, is an input of this run, or is not from skyloop and `force` is
    /// not set. The error names the file and a remedy.
    pub fn open(path: Option<&Path>, mark: Mark, force: bool) -> Result<Option<Self>, String> {
        let Some(path) = path else { return Ok(None) };
        let output =
            OutputFile::open(path, mark, force).map_err(|error| unwritten(path, &error))?;
        Ok(Some(Self {
            path: path.to_owned(),
            output,
            has_begun: false,
            is_final: false,
        }))
    }

    /// Replaces the contents by `text`, the state of an unfinished run. A pipe gets the final text
    /// only.
    pub fn begin(&mut self, text: &str) -> Result<(), String> {
        self.has_begun = true;
        match self.output.is_regular() {
            Ok(false) => Ok(()),
            Ok(true) => self.write(text),
            Err(error) => Err(unwritten(&self.path, &error)),
        }
    }

    /// Writes the final text.
    pub fn finish(&mut self, text: &str) -> Result<(), String> {
        self.is_final = true;
        self.write(text)
    }

    /// Writes the text of a failed run, unless the final text is written, or a file of another
    /// program is not replaced yet.
    pub fn fail(&mut self, text: &str) -> Result<(), String> {
        if self.is_final || !self.has_begun && self.output.is_foreign() {
            return Ok(());
        }
        self.finish(text)
    }

    fn write(&mut self, text: &str) -> Result<(), String> {
        let written = self.output.write(text.as_bytes());
        written.map_err(|error| unwritten(&self.path, &error))
    }
}

fn unwritten(file: &Path, error: &std::io::Error) -> String {
    let remedy = match error.kind() {
        // This error has its own remedy.
        std::io::ErrorKind::InvalidInput => "",
        _ => "; name another file",
    };
    format!("cannot write {}: {error}{remedy}", path_text(file))
}

/// Limits of a run against a mock flight computer.
#[derive(Debug, Clone, Default, clap::Args)]
pub struct Limits {
    /// Exit with code 1 if the rms distance between measured and labelled centroids exceeds this,
    /// px
    #[arg(long, value_name = "PX", value_parser = decimal(0.0..=1e6), allow_negative_numbers = true)]
    max_centroid_rms: Option<f64>,
    /// Exit with code 1 if more bright, isolated, labelled objects than this are not detected, over
    /// all frames
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX), allow_negative_numbers = true)]
    max_missed: Option<u64>,
    /// Exit with code 1 if more detections than this have no labelled object, over all frames
    #[arg(long, value_name = "N", value_parser = whole(0..=u64::MAX), allow_negative_numbers = true)]
    max_false: Option<u64>,
    /// Exit with code 1 if the 99th percentile from the attitude to the last pixel block exceeds
    /// this; a lost frame counts as infinite
    #[arg(long, value_name = "MS", value_parser = decimal(0.001..=1e6), allow_negative_numbers = true)]
    max_latency_p99_ms: Option<f64>,
    /// Write the verdicts as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
}

impl Limits {
    /// Path of the JUnit file.
    #[must_use]
    pub fn junit(&self) -> Option<&Path> {
        self.junit.as_deref()
    }

    /// Opens the JUnit file, if one is named.
    pub fn open(&self, force: bool) -> Result<Option<VerdictFile>, String> {
        VerdictFile::open(self.junit(), JUNIT_MARK, force)
    }

    /// Verdicts of a run that failed before any measurement.
    #[must_use]
    pub fn not_run(&self, error: &str) -> Vec<Verdict> {
        let checks = [
            ("frames", true),
            ("centroids", self.max_centroid_rms.is_some()),
            ("missed", self.max_missed.is_some()),
            ("false", self.max_false.is_some()),
            ("p99", self.max_latency_p99_ms.is_some()),
        ];
        let set = checks.iter().filter(|(_, is_set)| *is_set);
        let names: Vec<&str> = set.map(|(name, _)| *name).collect();
        not_run(&names, error)
    }

    /// A verdict on the frames, and one for each limit. Without a measurement a limit is not met.
    #[must_use]
    pub fn assess(&self, report: &Report) -> Vec<Verdict> {
        let (came, requested) = (report.frames, report.requested);
        let frames = format!("{came} of {requested} frames were complete");
        let mut verdicts = vec![Verdict::new("frames", came >= requested, frames)];
        verdicts.extend(self.max_centroid_rms.map(|max| centroids(max, report)));
        let totals = &report.totals;
        let missed = ("missed", "bright labelled objects missed", totals.missed);
        let wrong = ("false", "false detections", totals.false_detections);
        for ((name, what, count), max) in [(missed, self.max_missed), (wrong, self.max_false)] {
            verdicts.extend(max.map(|max| {
                let passed = count <= max;
                let is = if passed { "within" } else { "above" };
                match unscored(report) {
                    Some(why) => Verdict::new(name, false, format!("{what}: not known: {why}")),
                    None => Verdict::new(name, passed, format!("{what}: {count}, {is} {max}")),
                }
            }));
        }
        verdicts.extend(self.max_latency_p99_ms.map(|max| p99(max, report)));
        verdicts
    }
}

/// Reason why some frames were not compared with their labels.
fn unscored(report: &Report) -> Option<String> {
    let (frames, compared) = (report.frames, report.totals.compared);
    let why = "brought both pixels and readable labels; choose another --output";
    let all = compared > 0 && compared >= frames;
    (!all).then(|| format!("{compared} of {frames} frames {why}"))
}

fn centroids(max_px: f64, report: &Report) -> Verdict {
    let why = || "no isolated, unsaturated object was matched".to_string();
    let residual = report.totals.residual().ok_or_else(why);
    let residual = unscored(report).map_or(residual, Err);
    match residual {
        Err(why) => Verdict::new("centroids", false, format!("centroids: not known: {why}")),
        Ok(residual) => {
            let rms = residual.rms_px;
            let passed = rms <= max_px;
            let is = if passed { "within" } else { "above" };
            let text = format!("centroids: rms {rms:.4} px, {is} {max_px} px");
            Verdict::new("centroids", passed, text)
        }
    }
}

/// Missing frames count as the longest latencies.
fn p99(max_ms: f64, report: &Report) -> Verdict {
    let measured = report.latencies.count();
    let lost = u64::from(report.requested.saturating_sub(report.frames));
    let part = 0.99 * (1.0 + lost as f64 / measured as f64);
    let p99 = report.latencies.quantile(part).filter(|_| part <= 1.0);
    let passed = p99.is_some_and(|p99| p99 <= Duration::from_secs_f64(max_ms * 1e-3));
    let is = if passed { "within" } else { "above" };
    let text = match p99.map(|p99| p99.as_secs_f64() * 1e3) {
        None if measured == 0 => "not known: no frame of an attitude of this client came".into(),
        None => format!("above {max_ms} ms: {lost} frames were lost or incomplete"),
        Some(p99) => format!("{p99:.2} ms, {is} {max_ms} ms"),
    };
    Verdict::new("p99", passed, format!("latency p99: {text}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::Totals;

    fn limits() -> Limits {
        Limits {
            max_centroid_rms: Some(0.5),
            max_missed: Some(2),
            max_false: Some(0),
            max_latency_p99_ms: Some(10.0),
            junit: None,
        }
    }

    /// A run of 200 frames with `whole` complete ones, each after 5 ms, the last two after 20 ms.
    fn report(whole: u32, compared: u32, missed: u64, rms_px: Option<f64>) -> Report {
        let residuals_px = rms_px.into_iter().map(|rms| [rms, 0.0]);
        let mut report = Report {
            requested: 200,
            frames: whole,
            totals: Totals {
                compared,
                missed,
                residuals_px: residuals_px.collect(),
                ..Totals::default()
            },
            ..Report::default()
        };
        for frame in 0..whole {
            let ms = if frame + 2 < whole { 5 } else { 20 };
            report.latencies.add(Duration::from_millis(ms));
        }
        report
    }

    #[test]
    fn limits_are_met_exceeded_or_unknown() {
        // X-Val: by hand. p99 of 200 frames is the 198th, 5 ms; with one lost frame the 199th of
        // 199, 20 ms.
        for (report, passed) in [
            (report(200, 200, 2, Some(0.5)), "+++++"),
            (report(200, 200, 3, Some(0.6)), "+--++"),
            (report(199, 199, 0, Some(0.1)), "-+++-"),
            (report(197, 197, 0, Some(0.1)), "-+++-"),
            (report(200, 0, 0, None), "+---+"),
            (report(200, 199, 0, Some(0.1)), "+---+"),
            (report(200, 200, 0, None), "+-+++"),
            (report(0, 0, 0, None), "-----"),
        ] {
            let verdicts = limits().assess(&report);
            let signs = verdicts
                .iter()
                .map(|verdict| if verdict.passed { '+' } else { '-' });
            assert_eq!(signs.collect::<String>(), passed, "{verdicts:#?}");
            assert_eq!(broken(&verdicts).is_none(), passed == "+++++");
        }
        let only = Limits::default().assess(&report(200, 0, 9, None));
        assert_eq!(table(&only), "passed: 200 of 200 frames were complete\n");
    }

    #[test]
    fn suites_have_a_case_for_each_verdict() {
        let mut verdicts = limits().assess(&report(200, 200, 3, Some(0.1)));
        verdicts[1].camera = Some("left".into());
        let text = Suite::default().document(&verdicts);
        for part in [
            "tests=\"5\" failures=\"1\"",
            "<testcase name=\"centroids of left\"",
            "<failure message=\"bright labelled objects missed: 3, above 2\">",
        ] {
            assert!(text.contains(part), "no {part:?} in {text}");
        }
    }
}
