//! The output folder of a run: names of files, and errors with file and remedy.

use super::png;
use skyloop_orbit::path_text;
use skyloop_orbit::{Mark, NO_MARK, OutputFile, may_replace};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file or folder that cannot be written.
#[derive(Debug, Error)]
#[error("cannot {action} {}: {source}{}", path_text(path), remedy(source))]
pub struct OutputError {
    /// The attempted action.
    pub action: &'static str,
    /// The file or folder.
    pub path: PathBuf,
    /// The system's error.
    pub source: io::Error,
}

impl OutputError {
    pub(super) fn new(action: &'static str, path: &Path, source: io::Error) -> OutputError {
        OutputError {
            action,
            path: path.to_path_buf(),
            source,
        }
    }
}

fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        // skyloop's own refusals contain their remedy.
        ErrorKind::InvalidInput => "",
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "; choose an output folder that you may write to"
        }
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
            "; a file of that name is in the way: choose another output folder or move the file"
        }
        ErrorKind::IsADirectory => {
            "; a folder of that name is in the way: choose another output folder or move it"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "; free some space, write fewer frames or choose an output folder on another disk"
        }
        _ => "; check the output folder or choose another",
    }
}

/// The labels of a run, and its contact sheet.
pub(crate) const LABELS: &str = "labels.jsonl";
pub(crate) const SHEET: &str = "contact_sheet.png";
/// Suffixes after [`frame_name`]: DN as FITS and as 16-bit PNG, a preview picture, and expected
/// electrons.
pub(crate) const FITS: &str = ".fits";
pub(crate) const PNG: &str = ".png";
pub(crate) const PREVIEW: &str = "_preview.png";
pub(crate) const ELECTRONS: &str = "_electrons.fits";

/// The name of a frame's files, without suffix.
pub(crate) fn frame_name(frame: u32) -> String {
    format!("frame_{frame:05}")
}

/// Whether a run gives this name to a file.
fn is_ours(name: &str) -> bool {
    if name == LABELS || name == SHEET {
        return true;
    }
    let Some(rest) = name.strip_prefix("frame_") else {
        return false;
    };
    let number = [ELECTRONS, PREVIEW, FITS, PNG]
        .iter()
        .find_map(|end| rest.strip_suffix(end));
    // The number must reproduce the name: no sign, no missing or extra zero.
    number.is_some_and(|digits| {
        digits
            .parse()
            .is_ok_and(|n: u32| frame_name(n) == format!("frame_{digits}"))
    })
}

/// The frames listed by the labels of an earlier run; `None` without a valid list of labels.
fn earlier_frames(labels: &Path) -> Option<BTreeSet<u32>> {
    // Opening a pipe would wait for a writer.
    let about = labels.metadata().ok()?;
    let file = about.is_file().then(|| File::open(labels).ok())??;
    let mut from = BufReader::new(file);
    let mut frames = BTreeSet::new();
    loop {
        let mut head = Vec::new();
        from.by_ref().take(LABEL_HEAD).read_to_end(&mut head).ok()?;
        if head.is_empty() {
            return Some(frames);
        }
        // The last line of a killed run may be incomplete.
        let text = String::from_utf8_lossy(&head);
        let number = text.strip_prefix("{\"frame\":")?;
        let digits = number.split(|c: char| !c.is_ascii_digit()).next()?;
        frames.insert(digits.parse().ok()?);
        from.skip_until(b'\n').ok()?;
    }
}

/// Number of bytes read from the start of each line of labels. They contain the longest frame
/// number, and every line is longer.
const LABEL_HEAD: u64 = 24;

/// Marks in the header of a frame's FITS file.
const FITS_MARK: Mark = &[
    "SIMPLE  =",
    "/ number in the run, from 0",
    "/ seed of the noise",
];

/// Whether a file named like one of a run belongs to the earlier run with these listed `frames`. A
/// killed run may have one more frame, which its FITS file identifies.
fn is_earlier(folder: &Folder, name: &str, frames: Option<&BTreeSet<u32>>) -> bool {
    let Some(frames) = frames else { return false };
    if name.ends_with(PNG) && !may_replace(&folder.path(name), png::MARK) {
        return false;
    }
    let Some(rest) = name.strip_prefix("frame_") else {
        return true;
    };
    let digits = rest.split(|c: char| !c.is_ascii_digit()).next();
    let Some(number) = digits.and_then(|digits| digits.parse().ok()) else {
        return false;
    };
    let is_listed = frames.contains(&number);
    let next = frames.last().map_or(0, |last| last.saturating_add(1));
    if name.ends_with(FITS) {
        return (is_listed || number == next) && may_replace(&folder.path(name), FITS_MARK);
    }
    let fits = folder.path(&(frame_name(number) + FITS));
    is_listed || number == next && fits.is_file() && may_replace(&fits, FITS_MARK)
}

/// Whether a run with the output folder `dir` would write a file at `path`.
pub fn is_of_run(dir: &Path, path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    name.is_some_and(|name| is_ours(name) && skyloop_orbit::is_same_file(&dir.join(name), path))
}

/// An output folder.
#[derive(Debug)]
pub struct Folder {
    dir: PathBuf,
}

impl Folder {
    /// Creates the folder if needed, and removes an earlier run's files; with `force`, all files
    /// with such names.
    ///
    /// An earlier run's files are those listed in its `labels.jsonl`, and that file itself. Nothing
    /// is removed if another file has one of these names, or if this process has read one of them.
    pub fn open(dir: &Path, force: bool) -> Result<Folder, OutputError> {
        let folder = Folder::shared(dir)?;
        let read = |e| folder.error("read the folder", "", e);
        let mut names = Vec::new();
        for entry in fs::read_dir(dir).map_err(read)? {
            let entry = entry.map_err(read)?;
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|name| is_ours(name)) else {
                continue;
            };
            // A folder of such a name does not belong to an earlier run.
            if !entry.file_type().map_err(read)?.is_dir() {
                names.push(name.to_string());
            }
        }
        let earlier = earlier_frames(&folder.path(LABELS));
        for name in &names {
            let replace = |e| folder.error("replace", name, e);
            skyloop_orbit::not_input(&folder.path(name)).map_err(replace)?;
            if !force && !is_earlier(&folder, name, earlier.as_ref()) {
                return Err(replace(skyloop_orbit::foreign()));
            }
        }
        for name in &names {
            fs::remove_file(folder.path(name))
                .map_err(|e| folder.error("remove the earlier run's", name, e))?;
        }
        Ok(folder)
    }

    /// Refuses to replace files of these names: those that this process has read and, without
    /// `force`, any without its mark. A file of a format without a mark needs the mark of the first
    /// file, `marked`.
    pub fn may_replace(
        &self,
        (marked, mark): (&str, Mark),
        others: &[(&str, Mark)],
        force: bool,
    ) -> Result<(), OutputError> {
        let first = self.path(marked);
        let has_text = first.metadata().is_ok_and(|about| about.len() > 0);
        let is_ours = has_text && may_replace(&first, mark);
        let names = std::iter::once((marked, mark)).chain(others.iter().copied());
        for (name, mark) in names.filter(|(name, _)| self.path(name).exists()) {
            let path = self.path(name);
            let replace = |e| self.error("replace", name, e);
            skyloop_orbit::not_input(&path).map_err(replace)?;
            let has_mark = if mark.is_empty() {
                is_ours
            } else {
                may_replace(&path, mark)
            };
            if !(force || has_mark && path.is_file()) {
                return Err(replace(skyloop_orbit::foreign()));
            }
        }
        Ok(())
    }

    /// A folder that may not exist.
    pub(crate) fn at(dir: &Path) -> Folder {
        Folder {
            dir: dir.to_path_buf(),
        }
    }

    /// Creates the folder if needed, without changing its contents.
    pub(crate) fn shared(dir: &Path) -> Result<Folder, OutputError> {
        let folder = Folder::at(dir);
        fs::create_dir_all(dir).map_err(|e| folder.error("create the folder", "", e))?;
        Ok(folder)
    }

    /// The path of a file in the folder; for an empty name, of the folder.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        if name.is_empty() {
            self.dir.clone()
        } else {
            self.dir.join(name)
        }
    }

    /// Creates a file; the caller has checked whether it may be replaced.
    pub(crate) fn create(&self, name: &str) -> Result<File, OutputError> {
        let file = self.output(name)?.file();
        file.map_err(|e| self.error("create", name, e))
    }

    /// Creates a file that can be removed again; the caller has checked whether it may be replaced.
    pub(crate) fn output(&self, name: &str) -> Result<OutputFile, OutputError> {
        let opened = OutputFile::open(&self.path(name), NO_MARK, true);
        let begun = opened.and_then(|mut output| output.begin().map(|()| output));
        begun.map_err(|e| self.error("create", name, e))
    }

    /// Removes files; some may be missing.
    pub(crate) fn remove(&self, names: &[String]) {
        for name in names {
            // The original error is already reported.
            let _ = fs::remove_file(self.path(name));
        }
    }

    /// Writes a whole file; after an error the file is removed.
    pub fn write(
        &self,
        name: &str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let mut out = BufWriter::with_capacity(1 << 16, self.create(name)?);
        content(&mut out)
            .and_then(|()| out.flush())
            .map_err(|error| {
                // Report the first error, not one from the removal.
                let _ = fs::remove_file(self.path(name));
                self.error("write", name, error)
            })
    }

    /// An error about a file in the folder.
    pub(crate) fn error(&self, action: &'static str, name: &str, source: io::Error) -> OutputError {
        OutputError::new(action, &self.path(name), source)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_exact_names_are_recognised() {
        for name in [
            "frame_00000.fits",
            "frame_00042.png",
            "frame_99999_electrons.fits",
            "frame_123456.png",
            "frame_00007_preview.png",
            "labels.jsonl",
            "contact_sheet.png",
        ] {
            assert!(is_ours(name), "{name}");
        }
        for name in [
            "frame_0000.fits",
            "frame_000000.fits",
            "frame_+0001.fits",
            "frame_00000.fit",
            "frame_00000.fits.bak",
            "frame_00000_electrons.png",
            "frame_00000_preview.fits",
            "frame_0_preview.png",
            "my_frame_00000.fits",
            "frame_.png",
            "frame_99999999999.png",
            "labels.json",
            "Contact_sheet.png",
        ] {
            assert!(!is_ours(name), "{name}");
        }
    }
}
