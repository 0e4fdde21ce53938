//! `--ready-file`: says for scripts that all links listen, and where.

use anyhow::{Context, bail};
use serde::Serialize;
use skyloop::orbit::path_text;
use skyloop::orbit::{Mark, foreign, may_replace, not_input};
use std::path::{Path, PathBuf};

/// What the file says.
#[derive(Serialize)]
pub struct Ready<'a> {
    /// The process.
    pub pid: u32,
    /// Where the first camera listens: addresses with the ports and names that the system gave.
    pub links: Vec<String>,
    /// Where each further camera does.
    pub heads: Vec<Head<'a>>,
    /// Where figures are served.
    pub metrics: Option<String>,
}

/// A further camera.
#[derive(Serialize)]
pub struct Head<'a> {
    /// Its name in the run file.
    pub name: &'a str,
    /// Where it listens.
    pub links: Vec<String>,
}

/// A file that is there; it is removed at the end of the run.
pub struct ReadyFile(PathBuf);

/// How a ready file is recognised; one that a killed run has left is replaced.
const MARK: Mark = &["{", "\"pid\"", "\"links\""];

/// Refuses a folder that does not exist, what is no regular file, an input, and without `force` a file that skyloop did not write.
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
    /// Writes the file under another name and renames it: a reader never sees a part of it.
    pub fn write(file: &Path, ready: &Ready<'_>) -> anyhow::Result<ReadyFile> {
        let shown = path_text(file);
        let mut name = file.file_name().unwrap_or_default().to_os_string();
        name.push(format!(".{}", ready.pid));
        let part = file.with_file_name(name);
        let text = serde_json::to_string_pretty(ready)? + "\n";
        let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, file));
        written.with_context(|| {
            format!("--ready-file {shown}: check that its folder exists and may be written")
        })?;
        Ok(ReadyFile(file.to_owned()))
    }
}

impl Drop for ReadyFile {
    fn drop(&mut self) {
        if let Err(error) = std::fs::remove_file(&self.0) {
            tracing::warn!(
                "--ready-file {}: cannot be removed: {error}",
                path_text(&self.0)
            );
        }
    }
}
