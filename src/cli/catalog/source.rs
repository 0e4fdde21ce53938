//! The files that the subcommands are given.

use anyhow::Context;
use skyloop::orbit::path_text;
use skyloop::orbit::{Contents, LoadError, files, load_contents};
use std::path::{Path, PathBuf};

/// A file, and what it holds or why it holds nothing.
pub struct Source {
    pub file: PathBuf,
    /// Whether the command line names it itself, not a folder that it is in.
    pub named: bool,
    pub contents: Result<Contents, LoadError>,
}

/// Every file that is named, and those of folders in order of name, each read when its turn comes.
/// What else folders hold is added to `passed_over`.
pub fn sources(
    paths: &[PathBuf],
    passed_over: &mut Vec<String>,
) -> anyhow::Result<impl Iterator<Item = Source> + use<>> {
    let mut all = Vec::new();
    for path in paths {
        let listing = files(path).with_context(|| path_text(path))?;
        let named = !path.is_dir();
        all.extend(listing.files.into_iter().map(|file| (file, named)));
        passed_over.extend(listing.others.iter().map(|other| shown(other)));
    }
    Ok(all.into_iter().map(|(file, named)| Source {
        contents: load_contents(&file),
        file,
        named,
    }))
}

impl Source {
    /// Whether it is no file of orbits, in a folder of others.
    pub fn is_foreign(&self) -> bool {
        let error = self.contents.as_ref().err();
        !self.named && error.is_some_and(LoadError::is_foreign)
    }

    /// Whether it is named and cannot be opened.
    pub fn is_missing(&self) -> bool {
        let error = self.contents.as_ref().err();
        self.named
            && error.is_some_and(|it| matches!(it, LoadError::Read { .. }) && !it.is_foreign())
    }
}

/// Adds the records that were refused to `rejected`, files that hold nothing too, and those that
/// are none of orbits to `passed_over`.
///
/// Errors: the file is named and cannot be opened.
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
        Err(_) if foreign => passed_over.push(shown(&source.file)),
        Err(error) => rejected.push(error.to_string()),
    }
    Ok(None)
}

pub fn shown(file: &Path) -> String {
    path_text(file)
}
