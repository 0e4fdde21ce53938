//! An output file of a run: opened with the other options, emptied when the run begins. A start that fails leaves an earlier file as it is.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Result};
use std::path::{Path, PathBuf};

/// An output file whose earlier contents are still there.
#[derive(Debug)]
pub struct Claim {
    file: File,
    path: PathBuf,
    /// It did not exist before, and the run has not begun: it is removed again.
    is_spare: bool,
}

impl Claim {
    /// Opens the file, and changes nothing in it.
    ///
    /// Errors: it cannot be written, or this process has read it.
    pub fn new(path: &Path) -> Result<Claim> {
        skyloop_orbit::not_input(path)?;
        let mut options = OpenOptions::new();
        let (file, is_spare) = match options.write(true).create_new(true).open(path) {
            Ok(file) => (file, true),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                let mut options = OpenOptions::new();
                let options = options.write(true).create(true).truncate(false);
                (options.open(path)?, false)
            }
            Err(error) => return Err(error),
        };
        Ok(Claim {
            file,
            path: path.to_owned(),
            is_spare,
        })
    }

    /// The file, to be written from [`Claim::begin`] on.
    pub fn file(&self) -> Result<File> {
        self.file.try_clone()
    }

    /// Removes the earlier contents.
    pub fn begin(&mut self) -> Result<()> {
        self.is_spare = false;
        // A device or a pipe has none.
        if self.file.metadata()?.is_file() {
            self.file.set_len(0)?;
        }
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if self.is_spare {
            // The run has failed for another reason, which is reported.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn a_claim_changes_nothing_until_the_run_begins() {
        let folder = tempfile::tempdir().unwrap();
        let [new, old] = ["new", "old"].map(|name| folder.path().join(name));
        std::fs::write(&old, "earlier").unwrap();
        for path in [&new, &old] {
            drop(Claim::new(path).unwrap());
        }
        assert!(!new.exists());
        assert_eq!(std::fs::read(&old).unwrap(), b"earlier");
        for path in [&new, &old] {
            let mut claim = Claim::new(path).unwrap();
            let mut file = claim.file().unwrap();
            claim.begin().unwrap();
            file.write_all(b"now").unwrap();
            drop(claim);
            assert_eq!(std::fs::read(path).unwrap(), b"now");
        }
        assert!(Claim::new(&folder.path().join("no/file")).is_err());
    }
}
