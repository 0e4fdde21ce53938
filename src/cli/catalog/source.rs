//! The files of the command line.

use anyhow::Context;
use skyloop::orbit::path_text;
use skyloop::orbit::{Contents, LoadError, files, load_contents};
use std::path::PathBuf;

/// A file, and its contents or the reason why it has none.
pub struct Source {
    pub file: PathBuf,
    /// Whether the command line names the file itself, not its folder.
    pub named: bool,
    pub contents: Result<Contents, LoadError>,
}

/// Every named file, and the files of folders in order of name; each is read when the iterator
/// reaches it. Other files in folders are added to `passed_over`.
pub fn sources(
    paths: &[PathBuf],
    passed_over: &mut Vec<String>,
) -> anyhow::Result<impl Iterator<Item = Source> + use<>> {
    let mut all = Vec::new();
    for path in paths {
        let listing = files(path).with_context(|| path_text(path))?;
        let named = !path.is_dir();
        all.extend(listing.files.into_iter().map(|file| (file, named)));
        passed_over.extend(listing.others.iter().map(|other| path_text(other)));
    }
    Ok(all.into_iter().map(|(file, named)| Source {
        contents: load_contents(&file),
        file,
        named,
    }))
}

impl Source {
    /// Whether it is a file in a folder, and not an orbit file.
    pub fn is_foreign(&self) -> bool {
        let error = self.contents.as_ref().err();
        !self.named && error.is_some_and(LoadError::is_foreign)
    }

    /// Whether the command line names it and it cannot be opened.
    pub fn is_missing(&self) -> bool {
        let error = self.contents.as_ref().err();
        self.named
            && error.is_some_and(|it| matches!(it, LoadError::Read { .. }) && !it.is_foreign())
    }
}

/// The contents of an orbit file. Adds refused records and files without contents to `rejected`,
/// and files in folders that are not orbit files to `passed_over`.
///
/// Errors: the command line names the file and it cannot be opened.
pub fn readable(
    source: Source,
    rejected: &mut Vec<String>,
    passed_over: &mut Vec<String>,
) -> anyhow::Result<Option<Contents>> {
    let (missing, foreign) = (source.is_missing(), source.is_foreign());
    match source.contents {
        Ok(mut contents) => {
            let refused = std::mem::take(&mut contents.rejected);
            rejected.extend(refused.iter().map(ToString::to_string));
            return Ok(Some(contents));
        }
        Err(error) if missing => return Err(error.into()),
        Err(_) if foreign => passed_over.push(path_text(&source.file)),
        Err(error) => rejected.push(error.to_string()),
    }
    Ok(None)
}
