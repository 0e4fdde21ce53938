//! `skyloop catalog check`: contents of orbit files, and their unusable records.

use super::source::{Source, sources};
use crate::cli::common::say_json;
use anyhow::bail;
use clap::Args as ClapArgs;
use hifitime::Epoch;
use serde::Serialize;
use skyloop::effect::counted;
use skyloop::load::orbits::{passed_over, report_shared_names, shared_names};
use skyloop::orbit::time::utc_text;
use skyloop::orbit::{
    self, Contents, Object, Orbit, Record, Rejected, United, is_placeholder, path_text, places,
    unite,
};
use skyloop_firmware_sim::console::say;
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Orbit files, or folders of them; the format is recognised from the content
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Exit with code 1 if a file or a record is unusable
    #[arg(long)]
    strict: bool,
    /// Print JSON instead of lines
    #[arg(long)]
    json: bool,
}

/// Maximum number of objects named in a line; JSON has all.
const NAMED: usize = 5;

#[derive(Serialize, Default)]
struct Report {
    objects: usize,
    records: usize,
    /// Names shared by several objects that have no other identity, and their number.
    shared_names: BTreeMap<String, usize>,
    rejected: usize,
    /// Files without orbits.
    unusable: usize,
    /// Other files in the folders.
    passed_over: Vec<String>,
    files: Vec<FileReport>,
}

#[derive(Serialize, Default)]
struct FileReport {
    file: String,
    /// None if it is not an orbit file.
    format: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    /// Number of element sets, and of objects with an ephemeris.
    records: usize,
    objects: usize,
    /// Epochs of the first and last element set; without sets, the coverage of ephemerides.
    first_epoch: Option<String>,
    last_epoch: Option<String>,
    /// Whether `first_epoch` and `last_epoch` are of element sets.
    #[serde(skip)]
    has_sets: bool,
    /// Coverage of ephemerides, if the file has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    covers: Option<[String; 2]>,
    beyond_99999: usize,
    /// Assumptions about records and ephemerides, one line for each kind.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    assumed: Vec<String>,
    /// Objects with several sets, and the number of sets.
    several_sets: BTreeMap<String, usize>,
    /// Sets without a state at their own epoch.
    stateless: Vec<Stateless>,
    rejected: Vec<Refusal>,
}

/// A set for which SGP4 has no state at its own epoch.
#[derive(Serialize)]
struct Stateless {
    line: usize,
    norad: u32,
    /// Error code of the reference implementation.
    code: u8,
    reason: String,
}

#[derive(Serialize)]
struct Refusal {
    line: usize,
    reason: String,
}

impl From<Rejected> for Refusal {
    fn from(Rejected { line, reason, .. }: Rejected) -> Self {
        Refusal { line, reason }
    }
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let (mut report, mut all, mut missing) = (Report::default(), Vec::new(), 0);
    for source in sources(&args.files, &mut report.passed_over)? {
        missing += usize::from(source.is_missing());
        if source.is_foreign() {
            report.passed_over.push(path_text(&source.file));
            continue;
        }
        let (file, objects) = of_source(source);
        all.push(objects);
        report.files.push(file);
    }
    // Refuse the same records as a scene.
    let United {
        objects, refused, ..
    } = unite(all);
    report.objects = objects.len();
    report.shared_names = shared_names(&objects);
    for (source, refused) in refused {
        let file = &mut report.files[source];
        file.rejected.push(refused.into());
        file.rejected.sort_by_key(|refusal| refusal.line);
    }
    for file in &report.files {
        report.records += file.records;
        report.rejected += file.rejected.len();
        report.unusable += usize::from(file.error.is_some());
        if !args.json {
            say(format_args!("{}", file.lines()))?;
        }
    }
    report.passed_over.sort();
    if args.json {
        say_json(&report)?;
    } else {
        let total = (report.files.len() > 1).then(|| report.total());
        let lines = [
            passed_over(&report.passed_over),
            total,
            report_shared_names(&report.shared_names),
        ];
        for line in lines.into_iter().flatten() {
            say(format_args!("{line}\n"))?;
        }
    }
    if report.objects == 0 {
        bail!("no object in {}", counted(report.files.len(), "file"));
    }
    if missing > 0 {
        let files = counted(missing, "file");
        bail!("{files} of the command line cannot be opened: see above; check the path");
    }
    if args.strict && report.rejected + report.unusable > 0 {
        bail!("--strict: {}", report.losses());
    }
    Ok(())
}

impl Report {
    fn total(&self) -> String {
        let files = counted(self.files.len(), "file");
        let (objects, records) = (
            counted(self.objects, "object"),
            counted(self.records, "record"),
        );
        format!("{files}: {records} of {objects}; {}", self.losses())
    }

    fn losses(&self) -> String {
        let records = counted(self.rejected, "record");
        let files = counted(self.unusable, "file");
        format!("{records} and {files} cannot be used")
    }
}

/// The report of a file, and its objects.
fn of_source(source: Source) -> (FileReport, orbit::Source) {
    let file = path_text(&source.file);
    match source.contents {
        Ok(mut contents) => {
            let rejected = std::mem::take(&mut contents.rejected);
            let report = FileReport {
                file,
                rejected: rejected.into_iter().map(Refusal::from).collect(),
                assumed: std::mem::take(&mut contents.assumed),
                ..of_contents(&contents)
            };
            let source = contents.into_source(report.file.clone(), 0);
            let report = report.with_objects(&source.objects);
            (report, source)
        }
        Err(error) => {
            let report = FileReport {
                file,
                error: Some(error.to_string()),
                ..FileReport::default()
            };
            (report, orbit::Source::default())
        }
    }
}

fn of_contents(contents: &Contents) -> FileReport {
    let (records, ephemerides) = (&contents.records, &contents.ephemerides);
    let covers = covers(ephemerides);
    let (first, last) = epochs(records).or(covers).unzip();
    let numbers: BTreeSet<u32> = records.iter().map(|record| record.elements.norad).collect();
    FileReport {
        format: Some(contents.format.name()),
        records: records.len() + ephemerides.len(),
        first_epoch: first.map(utc_text),
        last_epoch: last.map(utc_text),
        has_sets: !records.is_empty(),
        covers: covers.map(|(start, stop)| [start, stop].map(utc_text)),
        beyond_99999: numbers.range(100_000..).count(),
        stateless: records.iter().filter_map(stateless).collect(),
        ..FileReport::default()
    }
}

fn stateless(record: &Record) -> Option<Stateless> {
    let error = record.elements.state_teme_after(0.0).err()?;
    Some(Stateless {
        line: record.line,
        norad: record.elements.norad,
        code: error.code(),
        reason: error.to_string(),
    })
}

fn epochs(records: &[Record]) -> Option<(Epoch, Epoch)> {
    let epochs = records.iter().map(|record| record.elements.epoch);
    range(epochs.map(|epoch| (epoch, epoch)))
}

fn covers(ephemerides: &[Object]) -> Option<(Epoch, Epoch)> {
    range(ephemerides.iter().filter_map(|object| match &object.orbit {
        Orbit::Ephemeris(ephemeris) => ephemeris.interval(),
        Orbit::Elements(..) => None,
    }))
}

fn range(intervals: impl Iterator<Item = (Epoch, Epoch)>) -> Option<(Epoch, Epoch)> {
    intervals.reduce(|(first, last), (start, stop)| (first.min(start), last.max(stop)))
}

impl FileReport {
    /// Adds the number of different objects, and the number of element sets of each.
    fn with_objects(mut self, objects: &[Object]) -> Self {
        let mut sets: Vec<(String, usize)> = Vec::new();
        for (object, place) in objects.iter().zip(places(objects.iter())) {
            if place == sets.len() {
                sets.push((object.id.clone(), 0));
            }
            let (id, count) = &mut sets[place];
            *count += usize::from(matches!(object.orbit, Orbit::Elements(..)));
            if let Some(number) = object.identity.number() {
                *id = format!("NORAD {number}");
            }
        }
        self.objects = sets.len();
        // Placeholders without number and name may denote different objects.
        sets.retain(|(id, count)| *count > 1 && !is_placeholder(id));
        self.several_sets = sets.into_iter().collect();
        self
    }

    fn lines(&self) -> String {
        let file = &self.file;
        let Some(format) = self.format else {
            return format!("{}\n", self.error.as_deref().unwrap_or_default());
        };
        let (records, objects) = (
            counted(self.records, "record"),
            counted(self.objects, "object"),
        );
        let mut text = format!(
            "{file}: {format}, {records} of {objects}, {} rejected\n",
            self.rejected.len()
        );
        if let Some([first, last]) = &self.covers {
            text += &format!("  covers {first} to {last}\n");
        }
        if let (true, Some(first), Some(last)) =
            (self.has_sets, &self.first_epoch, &self.last_epoch)
        {
            text += &format!("  epochs {first} to {last}\n");
        }
        if self.beyond_99999 > 0 {
            text += &format!("  numbers beyond 99999: {}\n", self.beyond_99999);
        }
        if !self.several_sets.is_empty() {
            let sets = self.several_sets.iter();
            let named = sets.map(|(id, count)| format!("{id}: {count}"));
            let count = counted(self.several_sets.len(), "object");
            text += &format!("  several element sets: {count} ({})\n", some(named));
        }
        if !self.stateless.is_empty() {
            let mut codes: BTreeMap<u8, usize> = BTreeMap::new();
            for set in &self.stateless {
                *codes.entry(set.code).or_default() += 1;
            }
            let codes = codes
                .iter()
                .map(|(code, count)| format!("code {code}: {count}"));
            let codes: Vec<String> = codes.collect();
            text += &format!(
                "  no state by SGP4 at their own epoch: {}\n",
                codes.join(", ")
            );
            for set in self.stateless.iter().take(NAMED) {
                text += &format!(
                    "    {file}:{}: NORAD {}: {}\n",
                    set.line, set.norad, set.reason
                );
            }
        }
        for assumed in &self.assumed {
            text += &format!("  assumed: {assumed}\n");
        }
        for Refusal { line, reason } in &self.rejected {
            text += &format!("  {file}:{line}: {reason}\n");
        }
        text
    }
}

/// The first names, and `...` if there are more.
fn some(names: impl Iterator<Item = String>) -> String {
    let mut names: Vec<String> = names.take(NAMED + 1).collect();
    if names.len() > NAMED {
        names.truncate(NAMED);
        names.push("...".to_string());
    }
    names.join(", ")
}
