//! Output files. An input file is never replaced. A file that skyloop did not write is replaced
//! only with `--force`. Opening a file never blocks.

use crate::read::not_input;
use std::fs::{File, FileType, OpenOptions};
use std::io::{Error, ErrorKind, Read, Result, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Marks a file that skyloop wrote. The file begins with the first text, and the others are in its
/// first bytes. A format without room for a mark has none: a file is then replaced only by force.
pub type Mark = &'static [&'static str];

/// For formats without room for a mark (element sets, candump logs), and files that users edit.
pub const NO_MARK: Mark = &[];

/// Bytes that are searched for a mark.
const HEAD: u64 = 1024;

/// An open output file with its earlier contents still in place.
#[derive(Debug)]
pub struct OutputFile {
    file: File,
    path: PathBuf,
    /// New, and nothing written yet: removed on drop.
    is_unused: bool,
    /// Not written completely: removed on drop.
    is_broken: bool,
    /// An earlier file without the mark.
    is_foreign: bool,
}

impl OutputFile {
    /// Opens the file and changes nothing in it. `force` accepts a file without the `mark`.
    ///
    /// # Errors
    ///
    /// The file cannot be written; this process has read it, or skyloop did not write it
    /// ([`ErrorKind::InvalidInput`]); a pipe without a reader; a block device.
    pub fn open(path: &Path, mark: Mark, force: bool) -> Result<OutputFile> {
        if path == Path::new("-") {
            return Err(invalid(
                "this option has no standard output: give /dev/stdout, or ./- for a file of this name",
            ));
        }
        not_input(path)?;
        let is_foreign = !may_replace(path, mark);
        if is_foreign && !force {
            return Err(match mark {
                [] => unmarked(),
                _ => foreign(),
            });
        }
        let mut new = OpenOptions::new();
        let mut old = OpenOptions::new();
        let (file, is_unused) = match open(new.write(true).create_new(true), path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {
                let old = old.write(true).create(true).truncate(false);
                (open(old, path)?, false)
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {
                let why = "its folder does not exist: make it first";
                return Err(Error::new(ErrorKind::NotFound, why));
            }
            opened => (opened?, true),
        };
        if is_block_device(file.metadata()?.file_type()) {
            return Err(invalid("this is a disk: name a file"));
        }
        Ok(OutputFile {
            file,
            path: path.to_owned(),
            is_unused,
            is_broken: false,
            is_foreign,
        })
    }

    /// The file, to be written after [`OutputFile::begin`].
    pub fn file(&self) -> Result<File> {
        self.file.try_clone()
    }

    /// Whether it replaces a file that skyloop did not write.
    #[must_use]
    pub fn is_foreign(&self) -> bool {
        self.is_foreign
    }

    /// Whether it is a regular file, neither pipe nor device.
    pub fn is_regular(&self) -> Result<bool> {
        Ok(self.file.metadata()?.is_file())
    }

    /// Removes the earlier contents.
    ///
    /// # Errors
    ///
    /// An error of the system; this process has read the file meanwhile.
    pub fn begin(&mut self) -> Result<()> {
        not_input(&self.path)?;
        self.is_unused = false;
        if self.is_regular()? {
            self.file.set_len(0)?;
            self.file.rewind()?;
        }
        Ok(())
    }

    /// Replaces the contents. A regular file that is not written completely is removed on drop.
    ///
    /// # Errors
    ///
    /// Those of [`OutputFile::begin`], or an error of the system.
    pub fn write(&mut self, contents: &[u8]) -> Result<()> {
        self.begin()?;
        self.is_broken = self.is_regular()?;
        self.file.write_all(contents)?;
        self.is_broken = false;
        Ok(())
    }

    /// Appends a text. After an error a partial text is cut off, and an empty file is removed on
    /// drop.
    ///
    /// # Errors
    ///
    /// An error of the system.
    pub fn append(&mut self, text: &[u8]) -> Result<()> {
        let length = self.file.metadata()?.len();
        let written = self.file.write_all(text);
        if written.is_err() && self.is_regular()? {
            self.file.set_len(length)?;
            self.file.seek(SeekFrom::Start(length))?;
            self.discard_empty();
        }
        written
    }

    /// After an error: removes an empty file on drop; a longer one stays.
    pub fn discard_empty(&mut self) {
        let about = self.file.metadata();
        self.is_broken |= about.is_ok_and(|about| about.is_file() && about.len() == 0);
    }
}

impl Drop for OutputFile {
    fn drop(&mut self) {
        // Neither a link nor its target is removed.
        let is_file = || {
            self.path
                .symlink_metadata()
                .is_ok_and(|about| about.is_file())
        };
        if self.is_unused || self.is_broken && is_file() {
            // The run has already failed, and that error is reported.
            let _ = std::fs::remove_file(&self.path);
        }
    }
}

/// Writes a whole file, in place of an older one.
///
/// # Errors
///
/// Those of [`OutputFile::open`] and [`OutputFile::write`].
pub fn write_file(path: &Path, text: &str, mark: Mark, force: bool) -> Result<()> {
    OutputFile::open(path, mark, force)?.write(text.as_bytes())
}

/// Whether writing loses nothing: the file is missing, empty, has the mark, or is not a regular
/// file.
#[must_use]
pub fn may_replace(path: &Path, mark: Mark) -> bool {
    let Ok(about) = path.metadata() else {
        return true;
    };
    if !about.is_file() || about.len() == 0 {
        return true;
    }
    let Ok(head) = head_of(path) else {
        return false;
    };
    let head = String::from_utf8_lossy(&head);
    let first = mark.first().is_some_and(|first| head.starts_with(first));
    first && mark.iter().all(|part| head.contains(part))
}

fn head_of(path: &Path) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    File::open(path)?.take(HEAD).read_to_end(&mut head)?;
    Ok(head)
}

fn invalid(why: &str) -> Error {
    Error::new(ErrorKind::InvalidInput, why)
}

/// The error where an output would replace a file that skyloop did not write.
#[must_use]
pub fn foreign() -> Error {
    invalid("skyloop did not make this file: name another, or replace it with --force")
}

/// The error for a format without a mark: skyloop may have written the file.
fn unmarked() -> Error {
    invalid("exists already: name another file, or replace it with --force")
}

/// Opens for writing without waiting for the reader of a pipe.
#[cfg(unix)]
fn open(options: &mut OpenOptions, path: &Path) -> Result<File> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    use std::os::unix::fs::OpenOptionsExt;
    options.custom_flags(OFlags::NONBLOCK.bits() as i32);
    let file = options.open(path).map_err(|error| {
        let no_reader = Some(rustix::io::Errno::NXIO.raw_os_error());
        if error.raw_os_error() == no_reader {
            invalid("no program reads this pipe: start that one first")
        } else {
            error
        }
    })?;
    fcntl_setfl(&file, fcntl_getfl(&file)? - OFlags::NONBLOCK)?;
    Ok(file)
}

#[cfg(not(unix))]
fn open(options: &mut OpenOptions, path: &Path) -> Result<File> {
    options.open(path)
}

#[cfg(unix)]
fn is_block_device(kind: FileType) -> bool {
    std::os::unix::fs::FileTypeExt::is_block_device(&kind)
}

#[cfg(not(unix))]
fn is_block_device(_: FileType) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    const MARK: Mark = &["begin", "mark"];

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("skyloop-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn an_output_changes_nothing_until_it_begins() {
        let folder = folder("output");
        let [new, old] = ["new", "old"].map(|name| folder.join(name));
        std::fs::write(&old, "begin: an earlier one with its mark").unwrap();
        for path in [&new, &old] {
            drop(OutputFile::open(path, MARK, false).unwrap());
        }
        assert!(!new.exists());
        assert!(std::fs::read(&old).unwrap().starts_with(b"begin"));
        for path in [&new, &old] {
            let mut output = OutputFile::open(path, MARK, false).unwrap();
            let mut file = output.file().unwrap();
            output.begin().unwrap();
            file.write_all(b"now").unwrap();
            output.write(b"then").unwrap();
            drop(output);
            assert_eq!(std::fs::read(path).unwrap(), b"then");
        }
        let error = OutputFile::open(&folder.join("no/file"), MARK, true).unwrap_err();
        assert!(error.to_string().contains("make it first"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_file_without_the_mark_is_replaced_by_force_only() {
        let folder = folder("foreign");
        let file = folder.join("file");
        for (contents, mark, may) in [
            ("", NO_MARK, true),
            ("", MARK, true),
            ("begin mark", MARK, true),
            ("begin mark", NO_MARK, false),
            (" begin mark", MARK, false),
            ("begin", MARK, false),
            ("mark", MARK, false),
        ] {
            std::fs::write(&file, contents).unwrap();
            let written = write_file(&file, "new", mark, false);
            assert_eq!(written.is_ok(), may, "{contents:?} {mark:?}");
            let text = written.map_or_else(|error| error.to_string(), |()| String::new());
            let is_unmarked = text.starts_with("exists already: name another");
            assert_eq!(
                is_unmarked,
                !may && mark.is_empty(),
                "{contents:?} {mark:?}"
            );
            let expected = if may { "new" } else { contents };
            assert_eq!(std::fs::read_to_string(&file).unwrap(), expected);
            assert!(write_file(&file, "new", mark, true).is_ok());
        }
        for name in ["-", "."] {
            assert!(write_file(Path::new(name), "", MARK, true).is_err());
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    #[cfg(unix)]
    fn a_pipe_without_a_reader_is_refused_at_once() {
        let folder = folder("pipes");
        let pipe = folder.join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let error = OutputFile::open(&pipe, MARK, false).unwrap_err();
        assert!(error.to_string().contains("no program reads this pipe"));
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe)
        });
        // The reader may not have opened the pipe yet.
        let written = (0..1000).find(|_| {
            std::thread::sleep(std::time::Duration::from_millis(5));
            write_file(&pipe, &"x".repeat(300_000), NO_MARK, false).is_ok()
        });
        assert!(written.is_some());
        assert_eq!(reader.join().unwrap().unwrap().len(), 300_000);
        assert!(write_file(Path::new("/dev/null"), "x", NO_MARK, false).is_ok());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
