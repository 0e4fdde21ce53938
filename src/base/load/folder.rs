//! Folders of configuration and orbit files: on disk, or built into the binary.

use super::embedded;
use super::error::ConfigError;
use skyloop_orbit::path_text;
use skyloop_orbit::{LARGEST_CONFIG, LARGEST_FILE};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

const SCENE: &str = "scene.toml";

/// The remedy for a configuration file that is too long.
fn too_long(error: &std::io::Error) -> Option<&'static str> {
    (error.kind() == ErrorKind::FileTooLarge)
        .then_some("check that it is the right file; long tables of orbits and attitudes have files of their own")
}

/// The folder that relative file names in a configuration refer to.
#[derive(Debug, Clone, PartialEq)]
pub enum Folder {
    /// On disk.
    Disk(PathBuf),
    /// A built-in folder below `configs/`.
    Embedded(&'static str),
}

impl Folder {
    /// The folder that holds `file`.
    pub fn of(file: &Path) -> Folder {
        Folder::Disk(file.parent().map(Path::to_path_buf).unwrap_or_default())
    }

    /// The scene or run file at a path, or the `scene.toml` of a folder: its folder, its name in
    /// messages, and its text.
    pub fn open(path: &Path) -> Result<(Folder, String, String), ConfigError> {
        let of_folder =
            "a folder stands for the scene.toml in it: name the file, or a folder that has one";
        let (path, remedy) = if path.is_dir() {
            (path.join(SCENE), of_folder)
        } else {
            (path.to_path_buf(), "check the path")
        };
        let name = path_text(&path);
        match skyloop_orbit::read_text_within(&path, LARGEST_CONFIG) {
            Ok(text) => Ok((Folder::of(&path), name, text)),
            Err(source) => Err(ConfigError::Read {
                file: name,
                remedy: too_long(&source).unwrap_or(remedy).to_string(),
                source,
            }),
        }
    }

    /// The folder that holds the file `name`, a path relative to this folder.
    pub fn folder_of(&self, name: &str) -> Folder {
        match self {
            Folder::Disk(folder) => Folder::of(&folder.join(name)),
            // Built-in folders have no subfolders.
            Folder::Embedded(folder) => Folder::Embedded(folder),
        }
    }

    /// The working directory.
    pub fn current() -> Folder {
        Folder::Disk(PathBuf::new())
    }

    /// Whether the file `name` exists.
    pub(crate) fn has(&self, name: &str) -> bool {
        match self {
            Folder::Disk(folder) => folder.join(name).exists(),
            Folder::Embedded(folder) => embedded::file(&format!("{folder}/{name}")).is_some(),
        }
    }

    /// The files of the folder `name`, ordered by name, and its other entries; none where `name` is
    /// not a folder.
    pub(crate) fn listing(&self, name: &str) -> Result<Option<[Vec<String>; 2]>, ConfigError> {
        let Folder::Disk(folder) = self else {
            return Ok(None);
        };
        let path = folder.join(name);
        if name.is_empty() || !path.is_dir() {
            return Ok(None);
        }
        let listing = skyloop_orbit::files(&path).map_err(|source| ConfigError::Read {
            file: path_text(&path),
            source,
            remedy: "check the folder".to_string(),
        })?;
        let below = |file: PathBuf| {
            let entry = file.file_name().unwrap_or_default().to_string_lossy();
            format!("{}/{entry}", name.trim_end_matches('/'))
        };
        let all = [listing.files, listing.others];
        Ok(Some(all.map(|all| all.into_iter().map(below).collect())))
    }

    /// The TOML file `name`: its name in messages, and its text.
    pub fn read(&self, name: &str) -> Result<(String, String), ConfigError> {
        self.read_within(name, LARGEST_CONFIG)
    }

    /// The orbit file `name`: its name in messages, and its text.
    pub(crate) fn read_orbits(&self, name: &str) -> Result<(String, String), ConfigError> {
        self.read_within(name, LARGEST_FILE)
    }

    /// The file `name` of up to `max` bytes: its name in messages, and its text.
    pub fn read_within(&self, name: &str, max: u64) -> Result<(String, String), ConfigError> {
        let failed = |file: String, source: std::io::Error| {
            let remedy = match max {
                LARGEST_FILE => skyloop_orbit::remedy(&source),
                _ => too_long(&source),
            };
            let path = match self {
                Folder::Disk(folder) if folder.as_os_str().is_empty() => "check the path",
                _ => {
                    "check the path; relative paths start at the folder of the file that names them"
                }
            };
            ConfigError::Read {
                file,
                remedy: remedy.unwrap_or(path).to_string(),
                source,
            }
        };
        match self {
            Folder::Disk(folder) => {
                let path = folder.join(name);
                let file = match name {
                    "" => "\"\"".to_string(),
                    _ => path_text(&path),
                };
                match skyloop_orbit::read_text_within(&path, max) {
                    Ok(text) => Ok((file, text)),
                    Err(source) => Err(failed(file, source)),
                }
            }
            Folder::Embedded(folder) => {
                let path = format!("{folder}/{name}");
                match embedded::file(&path) {
                    Some(text) => Ok((format!("configs/{path}"), text.to_string())),
                    None => Err(failed(path, ErrorKind::NotFound.into())),
                }
            }
        }
    }
}
