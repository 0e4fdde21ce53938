//! From a file to the objects in it.

use crate::{Object, oem, read_text, tle};
use std::fmt;
use std::path::{Path, PathBuf};

/// What a file gave.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The objects, in the order of the file.
    pub objects: Vec<Object>,
    /// The records that could not be read, in the order of the file.
    pub rejected: Vec<Rejected>,
}

/// A record that could not be read. Shown as `file:line: reason`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// Name of the file or other source.
    pub source: String,
    /// Line in the source, counted from 1.
    pub line: usize,
    /// What is wrong.
    pub reason: String,
}

impl fmt::Display for Rejected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.source, self.line, self.reason)
    }
}

/// Why a file gave nothing at all.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error("cannot read the orbit file {}: {error}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        error: std::io::Error,
    },
    /// The text is neither element sets nor an OEM.
    #[error(
        "{source_name}: no orbit found; expected two-line element sets (TLE, 3LE) or a CCSDS OEM \
         in KVN, whose first line is CCSDS_OEM_VERS = ..."
    )]
    NoOrbit {
        /// The source's name.
        source_name: String,
    },
    /// An OEM with a header and no segment.
    #[error(
        "{source_name}: an OEM without a segment; a segment is META_START ... META_STOP and its states"
    )]
    NoSegment {
        /// The source's name.
        source_name: String,
    },
}

/// Reads the orbits of a TLE, 3LE or CCSDS OEM (KVN) file; the format is found from the text.
///
/// Errors: the file cannot be read, or holds no orbit data. Records that
/// cannot be read are listed in [`Loaded::rejected`]; the rest loads.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    let text = read_text(path).map_err(|error| LoadError::Read {
        path: path.to_owned(),
        error,
    })?;
    parse(&text, &path.display().to_string())
}

/// [`load`] for text at hand; `source` names it in messages.
pub fn parse(text: &str, source: &str) -> Result<Loaded, LoadError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if oem::looks_like(text) {
        match oem::parse(text, source) {
            loaded if loaded.objects.is_empty() && loaded.rejected.is_empty() => {
                Err(LoadError::NoSegment {
                    source_name: source.to_owned(),
                })
            }
            loaded => Ok(loaded),
        }
    } else if tle::looks_like(text) {
        Ok(tle::parse(text, source))
    } else {
        Err(LoadError::NoOrbit {
            source_name: source.to_owned(),
        })
    }
}
