//! The files with the verdicts of a soak.

use super::args::Args;
use anyhow::Error;
use skyloop::orbit::Mark;
use skyloop::soak::{Report, suite};
use skyloop_firmware_sim::verdict::{JUNIT_MARK, UNFINISHED, VerdictFile, not_run};
use std::path::PathBuf;

pub struct Outputs {
    junit: Option<VerdictFile>,
    json: Option<VerdictFile>,
}

/// The mark of the JSON file of a soak.
const JSON_MARK: Mark = &["{", "\"passed\": ", "\"verdicts\": ["];

impl Outputs {
    pub fn open(args: &Args) -> anyhow::Result<Outputs> {
        let open = |path: &Option<PathBuf>, mark| {
            let opened = VerdictFile::open(path.as_deref(), mark, args.force.force);
            opened.map_err(Error::msg)
        };
        Ok(Outputs {
            junit: open(&args.junit, JUNIT_MARK)?,
            json: open(&args.json, JSON_MARK)?,
        })
    }

    /// Writes the contents for a run that has not ended.
    pub fn begin(&mut self, args: &Args) -> anyhow::Result<()> {
        let [junit, json] = failed(args, UNFINISHED);
        self.each([junit, json], VerdictFile::begin)
    }

    /// Writes the contents for a run that failed without verdicts.
    pub fn fail(&mut self, args: &Args, error: &str) -> anyhow::Result<()> {
        self.each(failed(args, error), VerdictFile::fail)
    }

    pub fn finish(&mut self, report: &Report) -> anyhow::Result<()> {
        let junit = report.suite().document(&report.verdicts);
        let json = serde_json::to_string_pretty(report)? + "\n";
        self.each([junit, json], VerdictFile::finish)
    }

    fn each(
        &mut self,
        texts: [String; 2],
        write: impl Fn(&mut VerdictFile, &str) -> Result<(), String>,
    ) -> anyhow::Result<()> {
        let files = [&mut self.junit, &mut self.json].into_iter().zip(texts);
        for (file, text) in files {
            if let Some(file) = file {
                write(file, &text).map_err(Error::msg)?;
            }
        }
        Ok(())
    }
}

/// The texts of both files for a run without verdicts.
fn failed(args: &Args, error: &str) -> [String; 2] {
    let verdicts = not_run(&args.checks(), error);
    let json = serde_json::json!({ "passed": false, "error": error, "verdicts": verdicts });
    [
        suite(&args.config).document(&verdicts),
        format!("{json:#}\n"),
    ]
}
