//! The folder of a run: our names in it, and errors that say which file and what to do.

use std::fs::{self, File};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A file or folder that cannot be written.
#[derive(Debug, Error)]
#[error("cannot {action} {}: {source}; {}", path.display(), remedy(source))]
pub struct OutputError {
    /// What was tried.
    pub action: &'static str,
    /// On what.
    pub path: PathBuf,
    /// What the system said.
    pub source: io::Error,
}

fn remedy(error: &io::Error) -> &'static str {
    match error.kind() {
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            "choose an output folder that you may write to"
        }
        ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
            "a file of that name is in the way: choose another output folder or move the file"
        }
        ErrorKind::IsADirectory => {
            "a folder of that name is in the way: choose another output folder or move it"
        }
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded | ErrorKind::FileTooLarge => {
            "free some space, write fewer frames or choose an output folder on another disk"
        }
        _ => "check the output folder or choose another",
    }
}

/// What follows [`frame_name`]: digital numbers as FITS and as 16-bit PNG, a picture to look at, and expected electrons.
pub const FITS: &str = ".fits";
pub const PNG: &str = ".png";
pub const PREVIEW: &str = "_preview.png";
pub const ELECTRONS: &str = "_electrons.fits";

/// The name of a frame's files, without what follows it.
pub fn frame_name(frame: u32) -> String {
    format!("frame_{frame:05}")
}

/// Whether a run of ours gives this name to a file.
fn is_ours(name: &str) -> bool {
    if name == super::LABELS || name == super::SHEET {
        return true;
    }
    let Some(rest) = name.strip_prefix("frame_") else {
        return false;
    };
    let number = [ELECTRONS, PREVIEW, FITS, PNG]
        .iter()
        .find_map(|end| rest.strip_suffix(end));
    // Written back, the number gives the name again: no sign, no missing or extra zero.
    number.is_some_and(|digits| {
        digits
            .parse()
            .is_ok_and(|n: u32| frame_name(n) == format!("frame_{digits}"))
    })
}

/// An output folder.
#[derive(Debug)]
pub struct Folder {
    dir: PathBuf,
}

impl Folder {
    /// Creates the folder if need be, and removes an earlier run's files.
    pub fn open(dir: &Path) -> Result<Folder, OutputError> {
        let folder = Folder::shared(dir)?;
        let read = |e| folder.error("read the folder", "", e);
        for entry in fs::read_dir(dir).map_err(read)? {
            let entry = entry.map_err(read)?;
            let name = entry.file_name();
            let Some(name) = name.to_str().filter(|name| is_ours(name)) else {
                continue;
            };
            // A folder of such a name is not of an earlier run.
            if !entry.file_type().map_err(read)?.is_dir() {
                fs::remove_file(entry.path())
                    .map_err(|e| folder.error("remove the earlier run's", name, e))?;
            }
        }
        Ok(folder)
    }

    /// Creates the folder if need be, and leaves alone what is in it.
    pub fn shared(dir: &Path) -> Result<Folder, OutputError> {
        let folder = Folder {
            dir: dir.to_path_buf(),
        };
        fs::create_dir_all(dir).map_err(|e| folder.error("create the folder", "", e))?;
        Ok(folder)
    }

    /// The path of a file in it; of itself for no name.
    pub fn path(&self, name: &str) -> PathBuf {
        if name.is_empty() {
            self.dir.clone()
        } else {
            self.dir.join(name)
        }
    }

    /// Creates a file.
    pub fn create(&self, name: &str) -> Result<File, OutputError> {
        File::create(self.path(name)).map_err(|e| self.error("create", name, e))
    }

    /// Writes a whole file; after an error nothing of it is left.
    pub fn write(
        &self,
        name: &str,
        content: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    ) -> Result<(), OutputError> {
        let mut out = BufWriter::with_capacity(1 << 16, self.create(name)?);
        content(&mut out)
            .and_then(|()| out.flush())
            .map_err(|error| {
                // Whatever removing it says, the first error is the one to report.
                let _ = fs::remove_file(self.path(name));
                self.error("write", name, error)
            })
    }

    /// An error on a file in the folder.
    pub fn error(&self, action: &'static str, name: &str, source: io::Error) -> OutputError {
        OutputError {
            action,
            path: self.path(name),
            source,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_exact_names_are_ours() {
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
