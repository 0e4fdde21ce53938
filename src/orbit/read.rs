//! Reads external files within limits. A path may name an endless device or a pipe without a
//! writer.

use std::collections::BTreeMap;
use std::fs::{File, FileType};
use std::io::{Cursor, Error, ErrorKind, Read, Result};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Largest file of orbits or of a recording, bytes. A million OMM in XML, as [`crate::write`]
/// writes them, have 1.1 billion.
pub const LARGEST_FILE: u64 = 2 << 30;
/// Largest table of numbers (a list of attitudes, an image of a point spread function), bytes.
pub const LARGEST_TABLE: u64 = 256 << 20;
/// Largest TOML file, bytes. The parsed values take up to 130 times as much memory.
pub const LARGEST_CONFIG: u64 = 4 << 20;
/// Largest input from a pipe, whose length is unknown in advance, bytes.
pub const LARGEST_PIPE: u64 = 256 << 20;
/// Bytes that are read first, to check the kind of contents; also the size of a pipe's chunks.
const HEAD: u64 = 1 << 16;
const PIPE_TIMEOUT: Duration = Duration::from_secs(if cfg!(test) { 1 } else { 10 });

/// A file that this process has read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// Path as opened.
    pub path: PathBuf,
    /// Length of the contents.
    pub bytes: u64,
    /// CRC-32 (IEEE 802.3) of its contents.
    pub crc32: u32,
}

/// Length and CRC-32 of each file that was read, by path.
static INPUTS: Mutex<BTreeMap<PathBuf, (u64, u32)>> = Mutex::new(BTreeMap::new());

/// All files that this process has read, ordered by path. No output may replace one of them.
#[must_use]
pub fn inputs() -> Vec<Input> {
    let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    let input = |(path, (bytes, crc32)): (&PathBuf, &(u64, u32))| Input {
        path: path.clone(),
        bytes: *bytes,
        crc32: *crc32,
    };
    inputs.iter().map(input).collect()
}

/// Whether this process has read the file at `path`, also under another name.
#[must_use]
pub fn is_input(path: &Path) -> bool {
    let inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    inputs.keys().any(|input| is_same_file(input, path))
}

/// Refuses to write a file that this process has read.
///
/// # Errors
///
/// [`ErrorKind::InvalidInput`].
pub fn not_input(path: &Path) -> Result<()> {
    if is_input(path) {
        let why = "this run reads this file: name another file";
        return Err(Error::new(ErrorKind::InvalidInput, why));
    }
    Ok(())
}

/// Whether two paths lead to one regular file, which need not exist yet. Links and other spellings
/// of a path count as the same file. A device or a pipe may be used twice.
#[must_use]
pub fn is_same_file(a: &Path, b: &Path) -> bool {
    match (a.metadata(), b.metadata()) {
        (Ok(of_a), Ok(of_b)) => {
            of_a.is_file() && of_b.is_file() && (is_one_inode(&of_a, &of_b) || is_one_path(a, b))
        }
        (Err(_), Err(_)) => a == b || is_one_path(a, b),
        _ => false,
    }
}

#[cfg(unix)]
fn is_one_inode(a: &std::fs::Metadata, b: &std::fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

#[cfg(not(unix))]
fn is_one_inode(_: &std::fs::Metadata, _: &std::fs::Metadata) -> bool {
    false
}

/// Compares the real paths; for a missing file that of its folder.
fn is_one_path(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let folder = path.parent().filter(|folder| *folder != Path::new(""));
            let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
            Some(folder.join(path.file_name()?))
        })
    };
    real(a).is_some_and(|a| real(b) == Some(a))
}

/// The bytes of a file of up to `max` bytes, or of a pipe of up to [`LARGEST_PIPE`]. `check` gets
/// the first 64 KiB before the rest is read.
///
/// # Errors
///
/// From opening the file; [`ErrorKind::IsADirectory`]; [`ErrorKind::InvalidInput`] for a device or
/// socket; [`ErrorKind::FileTooLarge`]; [`ErrorKind::TimedOut`] for a pipe without data for 10 s;
/// from `check`.
pub fn read_bytes(
    path: &Path,
    max: u64,
    check: impl FnOnce(&[u8]) -> Result<()>,
) -> Result<Vec<u8>> {
    let about = path.metadata()?;
    let kind = about.file_type();
    let (mut from, length, max): (Box<dyn Read>, u64, u64) = if kind.is_dir() {
        return Err(Error::new(ErrorKind::IsADirectory, "this is a folder"));
    } else if kind.is_file() {
        (Box::new(File::open(path)?), about.len(), max)
    } else if is_pipe(kind) {
        (Box::new(Pipe::open(path)), 0, max.min(LARGEST_PIPE))
    } else {
        let why = "this is a device or a socket: name a file or a pipe";
        return Err(Error::new(ErrorKind::InvalidInput, why));
    };
    let mut bytes = Vec::new();
    from.by_ref().take(HEAD).read_to_end(&mut bytes)?;
    check(&bytes)?;
    if length <= max {
        bytes.try_reserve_exact((length as usize).saturating_sub(bytes.len()))?;
        let left = (max + 1).saturating_sub(bytes.len() as u64);
        from.take(left).read_to_end(&mut bytes)?;
    }
    if length.max(bytes.len() as u64) > max {
        let why = match max {
            GIB.. => format!("longer than {} GiB", max / GIB),
            _ => format!("longer than {} MiB", max >> 20),
        };
        return Err(Error::new(ErrorKind::FileTooLarge, why));
    }
    let found = (bytes.len() as u64, crc32fast::hash(&bytes));
    let mut inputs = INPUTS.lock().unwrap_or_else(PoisonError::into_inner);
    inputs.insert(path.to_owned(), found);
    Ok(bytes)
}

const GIB: u64 = 1 << 30;

#[cfg(unix)]
fn is_pipe(kind: FileType) -> bool {
    std::os::unix::fs::FileTypeExt::is_fifo(&kind)
}

#[cfg(not(unix))]
fn is_pipe(_: FileType) -> bool {
    false
}

/// A pipe, read by its own thread: opening a pipe without a writer blocks.
struct Pipe {
    chunks: Receiver<Result<Vec<u8>>>,
    chunk: Cursor<Vec<u8>>,
}

impl Pipe {
    fn open(path: &Path) -> Self {
        let (found, chunks) = sync_channel(4);
        let path = path.to_owned();
        // Without a writer the thread stays blocked until the process ends.
        std::thread::spawn(move || {
            let mut from = match File::open(path) {
                Ok(from) => from,
                Err(error) => return drop(found.send(Err(error))),
            };
            loop {
                let mut chunk = vec![0; HEAD as usize];
                let read = match from.read(&mut chunk) {
                    Ok(0) => return,
                    Ok(length) => {
                        chunk.truncate(length);
                        Ok(chunk)
                    }
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    Err(error) => Err(error),
                };
                let failed = read.is_err();
                if found.send(read).is_err() || failed {
                    return;
                }
            }
        });
        Self {
            chunks,
            chunk: Cursor::default(),
        }
    }
}

impl Read for Pipe {
    fn read(&mut self, to: &mut [u8]) -> Result<usize> {
        if self.chunk.position() as usize >= self.chunk.get_ref().len() {
            match self.chunks.recv_timeout(PIPE_TIMEOUT) {
                Ok(chunk) => self.chunk = Cursor::new(chunk?),
                Err(RecvTimeoutError::Disconnected) => return Ok(0),
                Err(RecvTimeoutError::Timeout) => {
                    let why = format!(
                        "nothing has come through this pipe for {} s: start the program that writes to it first",
                        PIPE_TIMEOUT.as_secs()
                    );
                    return Err(Error::new(ErrorKind::TimedOut, why));
                }
            }
        }
        self.chunk.read(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn temporary(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("skyloop-{name}-{}", std::process::id()))
    }

    fn error(path: &Path, max: u64) -> (ErrorKind, String) {
        let error = read_bytes(path, max, |_| Ok(())).unwrap_err();
        (error.kind(), error.to_string())
    }

    #[test]
    fn files_are_read_up_to_their_limit_and_are_inputs_under_every_name() {
        let [file, other, hard] = ["input", "other", "hard"].map(temporary);
        std::fs::write(&file, "123456789").unwrap();
        assert!(!is_input(&file));
        assert_eq!(error(&file, 8).0, ErrorKind::FileTooLarge);
        let bytes = read_bytes(&file, 9, |_| Ok(())).unwrap();
        assert_eq!(bytes, b"123456789");
        // X-Val: the check value of CRC-32/ISO-HDLC in the catalogue of parametrised CRC
        // algorithms.
        let known = inputs().into_iter().find(|input| input.path == file);
        let known = known.unwrap();
        assert_eq!((known.bytes, known.crc32), (9, 0xCBF4_3926));
        std::fs::write(&other, "123456789").unwrap();
        std::fs::hard_link(&file, &hard).unwrap();
        let name = file.file_name().unwrap();
        let spelt = file.parent().unwrap().join(".").join(name);
        assert!(not_input(&hard).is_err() && not_input(&other).is_ok());
        assert!(is_input(&hard) && is_input(&spelt) && !is_input(&other));
        for path in [&file, &other, &hard] {
            std::fs::remove_file(path).unwrap();
        }
        // `is_same_file` works without the files, too.
        assert!(is_same_file(&file, &spelt) && !is_same_file(&file, &other));
    }

    #[test]
    #[cfg(unix)]
    fn devices_folders_and_missing_files_are_refused() {
        let folder = std::env::temp_dir();
        for (path, kind) in [
            (Path::new("/dev/zero"), ErrorKind::InvalidInput),
            (Path::new("/dev/null"), ErrorKind::InvalidInput),
            (Path::new("no/such/file"), ErrorKind::NotFound),
            (folder.as_path(), ErrorKind::IsADirectory),
        ] {
            assert_eq!(error(path, 8).0, kind, "{}", path.display());
        }
    }

    #[test]
    #[cfg(unix)]
    fn a_pipe_is_read_to_its_end_and_one_without_a_writer_is_refused() {
        let pipe = temporary("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let (kind, text) = error(&pipe, 8);
        assert_eq!(kind, ErrorKind::TimedOut, "{text}");
        // A new pipe: the blocked thread still reads the first one.
        std::fs::remove_file(&pipe).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        let writer = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::write(pipe, vec![b'x'; 300_000])
        });
        let bytes = read_bytes(&pipe, LARGEST_CONFIG, |_| Ok(())).unwrap();
        writer.join().unwrap().unwrap();
        std::fs::remove_file(&pipe).unwrap();
        assert_eq!(bytes, vec![b'x'; 300_000]);
    }
}
