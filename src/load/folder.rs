//! Where configuration and orbit files are read from: a folder on disk, or the files built into the binary.

use super::{ConfigError, embedded};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Octets that a file may have: an OEM of a day at a state a second has 10 million.
const LARGEST: u64 = 256 << 20;

/// The folder that relative file names in a configuration refer to.
#[derive(Debug, Clone, PartialEq)]
pub enum Folder {
    /// On disk.
    Disk(PathBuf),
    /// A folder below `configs/` that is built in.
    Embedded(&'static str),
}

impl Folder {
    /// The folder that holds `file`.
    pub fn of(file: &Path) -> Folder {
        Folder::Disk(file.parent().map(Path::to_path_buf).unwrap_or_default())
    }

    /// The folder that the process runs in.
    pub fn current() -> Folder {
        Folder::Disk(PathBuf::new())
    }

    /// The file called `name`, and the name to use for it in messages.
    pub fn read(&self, name: &str) -> Result<(String, String), ConfigError> {
        let failed = |file: String, source: std::io::Error| ConfigError::Read {
            file,
            source,
            remedy: match self {
                Folder::Disk(folder) if folder.as_os_str().is_empty() => "check the path",
                _ => {
                    "check the path; relative paths start at the folder of the file that names them"
                }
            }
            .to_string(),
        };
        match self {
            Folder::Disk(folder) => {
                let path = folder.join(name);
                let shown = path.display().to_string();
                match read_bounded(&path) {
                    Ok(bytes) if bytes.contains(&0) => {
                        Err(failed(shown, std::io::Error::other("not a text file")))
                    }
                    // Names in orbit files may be in any encoding; all that is read as numbers is ASCII.
                    Ok(bytes) => Ok((shown, String::from_utf8_lossy(&bytes).into_owned())),
                    Err(source) => Err(failed(shown, source)),
                }
            }
            Folder::Embedded(folder) => {
                let path = format!("{folder}/{name}");
                match embedded::file(&path) {
                    Some(text) => Ok((format!("configs/{path}"), text.to_string())),
                    None => Err(failed(path, std::io::ErrorKind::NotFound.into())),
                }
            }
        }
    }
}

/// A file of at most [`LARGEST`] octets.
fn read_bounded(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(LARGEST + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LARGEST {
        return Err(std::io::Error::other("longer than 256 MiB"));
    }
    Ok(bytes)
}
