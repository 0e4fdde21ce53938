//! Reads external text files.

use crate::read::{LARGEST_FILE, read_bytes};
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

/// The text of an orbit file of up to 2 GiB; see [`read_text_within`].
///
/// # Errors
///
/// As for [`read_text_within`].
pub fn read_text(path: &Path) -> Result<String> {
    read_text_within(path, LARGEST_FILE)
}

/// The text of a file of up to `max` bytes, without its byte order mark: UTF-8, or UTF-16 with a
/// mark. Invalid bytes are replaced: names may have any encoding, numbers are ASCII.
///
/// # Errors
///
/// As for [`read_bytes`]; [`ErrorKind::InvalidData`] for a file that is no text: it has a NUL.
pub fn read_text_within(path: &Path, max: u64) -> Result<String> {
    let bytes = read_bytes(path, max, |head| {
        let is_utf_16 = matches!(head, [0xff, 0xfe, ..] | [0xfe, 0xff, ..]);
        if !is_utf_16 && head.contains(&0) {
            return Err(no_text());
        }
        Ok(())
    })?;
    let text = match bytes.as_slice() {
        [0xff, 0xfe, rest @ ..] => utf_16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf_16(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        // No copy of a valid text.
        _ => String::from_utf8(bytes)
            .unwrap_or_else(|odd| String::from_utf8_lossy(odd.as_bytes()).into_owned()),
    };
    if text.contains('\0') {
        return Err(no_text());
    }
    Ok(text)
}

fn no_text() -> Error {
    let why = "not a text file; text is UTF-8, or UTF-16 with a byte order mark";
    Error::new(ErrorKind::InvalidData, why)
}

/// The remedy for a file that is too large; none for other errors.
pub fn remedy(error: &Error) -> Option<&'static str> {
    (error.kind() == ErrorKind::FileTooLarge)
        .then_some("give it in parts: a folder stands for all its files of orbits")
}

/// UTF-16 text; invalid units are replaced.
fn utf_16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let (pairs, rest) = bytes.as_chunks();
    let letters = char::decode_utf16(pairs.iter().copied().map(unit));
    let text = letters.map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER));
    let torn = (!rest.is_empty()).then_some(char::REPLACEMENT_CHARACTER);
    text.chain(torn).collect()
}

/// A file, or the entries of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Listing {
    /// The path itself, or the files of a folder, ordered by name.
    pub files: Vec<PathBuf>,
    /// Other entries of a folder: folders, pipes, sockets and devices (which may be endless).
    pub others: Vec<PathBuf>,
}

/// The files of a path.
///
/// # Errors
///
/// The folder cannot be listed.
pub fn files(path: &Path) -> Result<Listing> {
    if !path.is_dir() {
        let files = vec![path.to_owned()];
        let others = Vec::new();
        return Ok(Listing { files, others });
    }
    let entries = std::fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
    let mut all = entries.collect::<Result<Vec<PathBuf>>>()?;
    all.sort();
    // A broken link is reported when it is read.
    let is_file = |path: &PathBuf| path.metadata().map_or(true, |it| it.is_file());
    let (files, others) = all.into_iter().partition(is_file);
    Ok(Listing { files, others })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_too_long_is_reported_with_a_remedy() {
        let path = std::env::temp_dir().join(format!("skyloop-long-{}", std::process::id()));
        let mut file = std::fs::File::create(&path).unwrap();
        std::io::Write::write_all(&mut file, &[b' '; 1 << 16]).unwrap();
        // A sparse file takes no space.
        file.set_len(LARGEST_FILE + 1).unwrap();
        let error = crate::load(&path).unwrap_err().to_string();
        std::fs::remove_file(&path).unwrap();
        assert!(
            error.contains("longer than 2 GiB; give it in parts"),
            "{error}"
        );
    }

    #[test]
    fn a_program_is_not_text() {
        let program = std::env::current_exe().unwrap();
        let error = read_text(&program).unwrap_err().to_string();
        assert!(error.contains("not a text file"), "{error}");
        let this = Path::new(env!("CARGO_MANIFEST_DIR")).join("text.rs");
        assert_eq!(read_text(&this).unwrap(), include_str!("text.rs"));
    }

    #[test]
    fn a_folder_is_listed_in_order() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("omm");
        let names = files(&folder).unwrap().files;
        let names: Vec<_> = names.iter().filter_map(|path| path.file_name()).collect();
        assert_eq!(names, ["csv.rs", "json.rs", "kvn.rs", "mod.rs", "xml.rs"]);
        let missing = Path::new("no/such/file");
        assert_eq!(files(missing).unwrap().files, [missing]);
        let inner = Path::new(env!("CARGO_MANIFEST_DIR"));
        assert!(files(inner).unwrap().others.contains(&folder));
    }

    #[test]
    fn byte_order_marks_select_the_encoding() {
        let path = std::env::temp_dir().join(format!("skyloop-marks-{}", std::process::id()));
        // X-Val: by hand, Unicode 16.0, 23.8: FEFF in the byte order; U+1F6F0 is D83D DEF0.
        let little = b"\xff\xfe1\x00\xe9\x00\n\x00\x3d\xd8\xf0\xde".as_slice();
        let big = b"\xfe\xff\x001\x00\xe9\x00\n\xd8\x3d\xde\xf0";
        let eight = "\u{feff}1é\n🛰".as_bytes();
        for bytes in [little, big, eight] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read_text(&path).unwrap(), "1é\n🛰");
        }
        std::fs::write(&path, &little[..little.len() - 1]).unwrap();
        assert_eq!(read_text(&path).unwrap(), "1é\n\u{fffd}\u{fffd}");
        std::fs::write(&path, &little[2..]).unwrap();
        let error = read_text(&path).unwrap_err();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(error.kind(), ErrorKind::InvalidData);
        assert!(error.to_string().contains("UTF-16 with"), "{error}");
    }
}
