//! A file of text by its path.

use super::folder::OutputError;
use std::fs;
use std::path::Path;

/// Writes a file whole, and makes its folder if need be.
///
/// Errors: the folder or the file cannot be written.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(|e| fail("create the folder", folder, e))?;
    }
    fs::write(path, text).map_err(|e| fail("write", path, e))
}

/// Removes a file.
///
/// Errors: it cannot be removed.
pub fn remove_file(path: &Path) -> Result<(), OutputError> {
    fs::remove_file(path).map_err(|e| fail("remove", path, e))
}

fn fail(action: &'static str, path: &Path, source: std::io::Error) -> OutputError {
    OutputError {
        action,
        path: path.to_path_buf(),
        source,
    }
}
