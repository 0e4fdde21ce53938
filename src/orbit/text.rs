//! Text files from outside, bounded: a file may be anything, a device without an end too.

use std::io::{Error, Read, Result};
use std::path::{Path, PathBuf};

/// Octets that a file may have: an OEM of a day at a state a second has 10 million.
const LARGEST: u64 = 256 << 20;

/// The text of a file of at most 256 MiB. Names in it may be in any encoding (what is no UTF-8 is replaced); all that
/// is read as numbers is ASCII.
///
/// Errors: the file cannot be read, is longer, or holds a NUL, which no text does.
pub fn read_text(path: &Path) -> Result<String> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return Err(Error::other(format!("longer than {} MiB", LARGEST >> 20)));
    }
    if bytes.contains(&0) {
        return Err(Error::other("not a text file"));
    }
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The files that a path stands for: itself, or everything in a folder, in order of name.
///
/// Errors: the folder cannot be listed.
pub fn files(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let entries = std::fs::read_dir(path)?.map(|entry| Ok(entry?.path()));
    let mut files = entries.collect::<Result<Vec<PathBuf>>>()?;
    files.sort();
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn a_file_without_an_end_is_refused() {
        let error = read_text(Path::new("/dev/zero")).unwrap_err();
        assert!(error.to_string().contains("256 MiB"), "{error}");
        assert_eq!(read_text(Path::new("/dev/null")).unwrap(), "");
    }

    #[test]
    fn a_program_is_no_text_and_this_file_is() {
        let program = std::env::current_exe().unwrap();
        let error = read_text(&program).unwrap_err().to_string();
        assert!(error.contains("not a text file"), "{error}");
        let this = Path::new(env!("CARGO_MANIFEST_DIR")).join("text.rs");
        assert_eq!(read_text(&this).unwrap(), include_str!("text.rs"));
    }

    #[test]
    fn a_folder_stands_for_its_files_in_order() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("omm");
        let names = files(&folder).unwrap();
        let names: Vec<_> = names.iter().filter_map(|path| path.file_name()).collect();
        assert_eq!(names, ["csv.rs", "json.rs", "kvn.rs", "mod.rs", "xml.rs"]);
        let missing = Path::new("no/such/file");
        assert_eq!(files(missing).unwrap(), [missing]);
    }
}
