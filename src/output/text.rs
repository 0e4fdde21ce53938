//! Text files by path.

use super::folder::OutputError;
use skyloop_orbit::{Mark, OutputFile};
use std::fs;
use std::path::Path;

/// Writes a whole file, and creates its folder if needed. `mark` and `force` decide whether an
/// existing file may be replaced.
///
/// Errors: the folder or the file cannot be written, or the file may not be replaced.
pub fn write_text(path: &Path, text: &str, mark: Mark, force: bool) -> Result<(), OutputError> {
    if let Some(folder) = path.parent() {
        make_folder(folder)?;
    }
    skyloop_orbit::write_file(path, text, mark, force)
        .map_err(|e| OutputError::new("write", path, e))
}

/// Writes files into a folder, which is created if needed. All are checked before the first is
/// replaced.
///
/// Errors: those of [`write_text`].
pub fn write_files(
    folder: &Path,
    files: &[(String, Vec<u8>)],
    mark: Mark,
    force: bool,
) -> Result<(), OutputError> {
    make_folder(folder)?;
    let open = |(name, _): &(String, Vec<u8>)| {
        let path = folder.join(name);
        OutputFile::open(&path, mark, force).map_err(|e| OutputError::new("write", &path, e))
    };
    let opened: Vec<OutputFile> = files.iter().map(open).collect::<Result<_, _>>()?;
    for (mut output, (name, contents)) in opened.into_iter().zip(files) {
        let written = output.write(contents);
        written.map_err(|e| OutputError::new("write", &folder.join(name), e))?;
    }
    Ok(())
}

/// Creates a folder if needed. Call it before long work whose results go there.
///
/// Errors: it cannot be created.
pub fn make_folder(folder: &Path) -> Result<(), OutputError> {
    fs::create_dir_all(folder).map_err(|e| OutputError::new("create the folder", folder, e))
}

/// Removes a file.
///
/// Errors: it cannot be removed.
pub fn remove_file(path: &Path) -> Result<(), OutputError> {
    let removed = skyloop_orbit::not_input(path).and_then(|()| fs::remove_file(path));
    removed.map_err(|e| OutputError::new("remove", path, e))
}
