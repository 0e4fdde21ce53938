//! A file of text by its path.

use super::folder::OutputError;
use std::fs;
use std::path::Path;

/// Writes a file whole, and makes its folder if need be.
///
/// Errors: the folder or the file cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    skyloop_orbit::write_file(path, text).map_err(|e| fail("write", path, e))
}

/// Makes a folder, if it is not there: before long work whose outcome it is to hold.
///
/// Errors: it cannot be made.
pub fn make_folder(folder: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(folder).map_err(|e| fail("create the folder", folder, e))
}

/// Removes a file.
///
/// Errors: it cannot be removed.
pub fn remove_file(path: &Path) -> Result<(), OutputError> {
    let removed = skyloop_orbit::not_input(path).and_then(|()| fs::remove_file(path));
    removed.map_err(|e| fail("remove", path, e))
}

fn fail(action: &'static str, path: &Path, source: std::io::Error) -> OutputError {
    OutputError {
        action,
        path: path.to_path_buf(),
        source,
    }
}
