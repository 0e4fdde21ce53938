//! `--ready-file`: reports to scripts that all links listen, with their addresses.

use anyhow::{Context, anyhow, bail};
use serde::Serialize;
use skyloop::link::capture::remedy_of;
use skyloop::orbit::path_text;
use skyloop::orbit::{Mark, foreign, may_replace, not_input};
use std::path::{Path, PathBuf};

#[derive(Serialize)]
pub struct Ready<'a> {
    pub pid: u32,
    /// Addresses of the first camera, with the ports and names that the system assigned.
    pub links: Vec<String>,
    /// Further cameras.
    #[serde(rename = "heads")]
    pub cameras: Vec<Head<'a>>,
    /// Address of the metrics server.
    pub metrics: Option<String>,
}

#[derive(Serialize)]
pub struct Head<'a> {
    pub name: &'a str,
    pub links: Vec<String>,
}

/// The file, which is removed at the end of the run.
pub struct ReadyFile {
    file: PathBuf,
    /// Temporary file with its text, until it is published.
    part: Option<PathBuf>,
}

/// The mark of a ready file; one left by a killed run is replaced.
const MARK: Mark = &["{", "\"pid\"", "\"links\""];

/// Refuses a folder that does not exist, a file that is not regular, an input, and without `force`
/// a file that skyloop did not write.
pub fn check(file: &Path, force: bool) -> anyhow::Result<()> {
    let shown = path_text(file);
    let folder = file
        .parent()
        .filter(|folder| !folder.as_os_str().is_empty());
    if folder.is_some_and(|folder| !folder.is_dir()) {
        bail!("--ready-file {shown}: its folder does not exist; make it first");
    }
    not_input(file).with_context(|| format!("--ready-file {shown}"))?;
    if file.symlink_metadata().is_ok_and(|about| !about.is_file()) {
        bail!(
            "--ready-file {shown}: this is no regular file, and it would be replaced: name another"
        );
    }
    if !force && !may_replace(file, MARK) {
        return Err(foreign()).with_context(|| format!("--ready-file {shown}"));
    }
    Ok(())
}

impl ReadyFile {
    /// Writes the text under another name: readers never see a partial file.
    pub fn prepare(file: &Path, ready: &Ready<'_>) -> anyhow::Result<ReadyFile> {
        let mut name = file.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}", ready.pid));
        let part = file.with_file_name(name);
        let text = serde_json::to_string_pretty(ready)? + "\n";
        let prepared = ReadyFile {
            file: file.to_owned(),
            part: Some(part.clone()),
        };
        prepared.written(std::fs::write(&part, text))?;
        Ok(prepared)
    }

    pub fn publish(&mut self) -> anyhow::Result<()> {
        if let Some(part) = &self.part {
            self.written(std::fs::rename(part, &self.file))?;
        }
        self.part = None;
        Ok(())
    }

    fn written(&self, done: std::io::Result<()>) -> anyhow::Result<()> {
        done.map_err(|error| {
            let shown = path_text(&self.file);
            anyhow!("--ready-file {shown}: {error}{}", remedy_of(&error))
        })
    }
}

impl Drop for ReadyFile {
    fn drop(&mut self) {
        if let Some(part) = &self.part {
            // The error that prevented publication is reported.
            let _ = std::fs::remove_file(part);
        } else if let Err(error) = std::fs::remove_file(&self.file) {
            let shown = path_text(&self.file);
            tracing::warn!("--ready-file {shown}: cannot be removed: {error}");
        }
    }
}
