//! The files that the subcommands are given.

use anyhow::Context;
use skyloop::orbit::{Contents, LoadError, files, load_contents};
use std::path::PathBuf;

/// A file, and what it holds or why it holds nothing.
pub struct Source {
    pub file: PathBuf,
    pub contents: Result<Contents, LoadError>,
}

/// Every file that is named, and those of folders in order of name, each read when its turn comes.
pub fn sources(paths: &[PathBuf]) -> anyhow::Result<impl Iterator<Item = Source>> {
    let mut all = Vec::new();
    for path in paths {
        all.extend(files(path).with_context(|| path.display().to_string())?);
    }
    Ok(all.into_iter().map(|file| Source {
        contents: load_contents(&file),
        file,
    }))
}

/// Adds the records that were refused to `rejected`, and files that hold nothing.
pub fn readable(source: Source, rejected: &mut Vec<String>) -> Option<Contents> {
    match source.contents {
        Ok(mut contents) => {
            let refused = std::mem::take(&mut contents.rejected);
            rejected.extend(refused.iter().map(ToString::to_string));
            Some(contents)
        }
        Err(error) => {
            rejected.push(error.to_string());
            None
        }
    }
}
