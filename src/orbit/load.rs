//! From a file to the objects in it.

use crate::format::Format;
use crate::path_text;
use crate::record::{Found, Record};
use crate::{
    Identity, Object, Orbit, Register, oem, omm, read_text, remedy, server, theory, tle, unread,
};
use rayon::prelude::*;
use std::fmt;
use std::path::{Path, PathBuf};

/// What a file gave.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The objects, in the order of the file.
    pub objects: Vec<Object>,
    /// The records that could not be read, in the order of the file.
    pub rejected: Vec<Rejected>,
    /// What was assumed of records that were read, a line for each kind.
    pub assumed: Vec<String>,
}

/// What a text holds, as it gives it.
#[derive(Clone, Debug)]
pub struct Contents {
    /// The text's format.
    pub format: Format,
    /// Its element sets, in the order of the text.
    pub records: Vec<Record>,
    /// Its objects with an ephemeris, in the order of the text.
    pub ephemerides: Vec<Object>,
    /// The records that could not be read, in the order of the text.
    pub rejected: Vec<Rejected>,
    /// What was assumed of records that were read, a line for each kind.
    pub assumed: Vec<String>,
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

impl Rejected {
    /// A reason in one line, whatever it quotes.
    pub(crate) fn new(source: &str, line: usize, reason: &str) -> Self {
        let escaped = |c: char| match c.is_control() {
            true => c.escape_default().to_string(),
            false => c.to_string(),
        };
        Rejected {
            source: source.to_owned(),
            line,
            reason: reason.chars().map(escaped).collect(),
        }
    }
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
    #[error("cannot read the orbit file {}: {error}{}", path_text(path), remedy(error).map_or(String::new(), |it| format!("; {it}")))]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        #[source]
        error: std::io::Error,
    },
    /// There is nothing in the file.
    #[error("{source_name}: empty; fetch the file again")]
    Empty {
        /// The source's name.
        source_name: String,
    },
    /// The text is in no format that is read.
    #[error(
        "{source_name}: no orbit found, it begins with \"{begins}\"; expected two-line element sets (TLE, 3LE), OMM in KVN, XML, JSON or CSV, or a \
         CCSDS OEM in KVN, whose first line is CCSDS_OEM_VERS = ..., or in XML"
    )]
    NoOrbit {
        /// The source's name.
        source_name: String,
        /// Its first words.
        begins: String,
    },
    /// The text is a server's answer in place of orbits.
    #[error(
        "{source_name}: no orbits, but the answer of a server: \"{says}\"; fetch the file again"
    )]
    Answer {
        /// The source's name.
        source_name: String,
        /// The server's words.
        says: String,
    },
    /// The text is in a known format that is not read.
    #[error("{source_name}: {found}")]
    Unread {
        /// The source's name.
        source_name: String,
        /// What it is, and the remedy.
        found: String,
        /// Whether it holds orbits, or attitudes alone.
        has_orbits: bool,
    },
    /// The text has the form of element sets and holds none.
    #[error("{source_name}: {format}, and no record in it")]
    NoRecord {
        /// The source's name.
        source_name: String,
        /// Its format.
        format: Format,
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

impl LoadError {
    /// Whether this is no file of orbits at all, such as others in the same folder: no text, or one in no format that is read.
    pub fn is_foreign(&self) -> bool {
        match self {
            LoadError::Read { error, .. } => error.kind() == std::io::ErrorKind::InvalidData,
            LoadError::NoOrbit { .. } => true,
            LoadError::Unread { has_orbits, .. } => !has_orbits,
            // A file that has lost its records is a loss.
            LoadError::Empty { .. }
            | LoadError::Answer { .. }
            | LoadError::NoRecord { .. }
            | LoadError::NoSegment { .. } => false,
        }
    }
}

/// Reads the objects of an orbit file in any [`Format`], which is found from the text.
///
/// Errors: the file cannot be read, or holds no orbit data. Records that
/// cannot be read are listed in [`Loaded::rejected`]; the rest loads.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    load_contents(path).map(Loaded::from)
}

/// [`load`] for text at hand; `source` names it in messages.
pub fn parse(text: &str, source: &str) -> Result<Loaded, LoadError> {
    parse_contents(text, source).map(Loaded::from)
}

/// Reads the records of an orbit file; errors as of [`load`].
pub fn load_contents(path: &Path) -> Result<Contents, LoadError> {
    let text = read_text(path).map_err(|error| LoadError::Read {
        path: path.to_owned(),
        error,
    })?;
    parse_contents(&text, &path_text(path))
}

/// [`load_contents`] for text at hand; `source` names it in messages.
pub fn parse_contents(text: &str, source: &str) -> Result<Contents, LoadError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let source_name = || source.to_owned();
    if text.trim().is_empty() {
        return Err(LoadError::Empty {
            source_name: source_name(),
        });
    }
    let format = Format::of(text);
    let may_answer = matches!(format, None | Some(Format::OmmJson));
    if let Some(says) = may_answer.then(|| server::words(text, source)).flatten() {
        return Err(LoadError::Answer {
            source_name: source_name(),
            says,
        });
    }
    let format = format.ok_or_else(|| match unread::found(text) {
        Some(found) => LoadError::Unread {
            source_name: source_name(),
            found,
            has_orbits: unread::has_orbits(text),
        },
        None => LoadError::NoOrbit {
            source_name: source_name(),
            begins: server::quoted(text).chars().take(40).collect(),
        },
    })?;
    let mut found = Found::new(source);
    let mut ephemerides = Vec::new();
    match format {
        Format::Tle | Format::ThreeLine => tle::read(text, &mut found),
        Format::OmmKvn => omm::kvn::read(text, &mut found),
        Format::OmmXml => omm::xml::read(text, &mut found),
        Format::OmmJson => omm::json::read(text, &mut found),
        Format::OmmCsv => omm::csv::read(text, &mut found),
        Format::OemKvn => add_ephemerides(oem::parse(text, source), &mut ephemerides, &mut found),
        Format::OemXml => {}
    }
    // An NDM may hold messages of both kinds.
    if matches!(format, Format::OmmXml | Format::OemXml) && oem::xml::looks_like(text) {
        let loaded = oem::xml::parse(text, source);
        add_ephemerides(loaded, &mut ephemerides, &mut found);
    }
    let Found {
        records, rejected, ..
    } = found;
    if !records.is_empty() || !ephemerides.is_empty() || !rejected.is_empty() {
        let mut assumed = theory::assumptions(&records, source);
        let remarks = ephemerides.iter().flat_map(Object::remarks);
        assumed.extend(remarks.map(|(line, remark)| format!("{source}:{line}: {remark}")));
        return Ok(Contents {
            format,
            assumed,
            records,
            ephemerides,
            rejected,
        });
    }
    Err(match format {
        Format::OemKvn | Format::OemXml => LoadError::NoSegment {
            source_name: source_name(),
        },
        _ => LoadError::NoRecord {
            source_name: source_name(),
            format,
        },
    })
}

fn add_ephemerides(loaded: Loaded, ephemerides: &mut Vec<Object>, found: &mut Found) {
    ephemerides.extend(loaded.objects);
    found.rejected.extend(loaded.rejected);
}

impl From<Contents> for Loaded {
    /// Sets of one object become one, with every set that differs.
    fn from(contents: Contents) -> Self {
        let sets = contents.records.into_par_iter();
        let mut objects: Vec<Object> = sets.map(Object::from).collect();
        // Catalogues are long: where none comes twice, none is moved.
        let numbers = objects.par_iter().map(|one| one.identity.number());
        let mut numbers: Vec<Option<u32>> = numbers.collect();
        numbers.par_sort_unstable();
        let are_apart = numbers.is_sorted_by(|a, b| a < b);
        if numbers.first() == Some(&None) || !are_apart {
            objects = each_once(objects);
        }
        objects.extend(contents.ephemerides);
        Loaded {
            objects,
            rejected: contents.rejected,
            assumed: contents.assumed,
        }
    }
}

/// Each object once, with every set that differs.
fn each_once(all: Vec<Object>) -> Vec<Object> {
    let (mut objects, mut register) = (Vec::<Object>::new(), Register::default());
    for mut object in all {
        let place = register.place(&object);
        if let Some((place, known)) = place.and_then(|at| Some((at, objects.get_mut(at)?))) {
            known.join(object);
            register.note(known, place);
        } else {
            register.insert(&mut object, objects.len());
            objects.push(object);
        }
    }
    objects.shrink_to_fit();
    objects
}

impl From<Record> for Object {
    fn from(record: Record) -> Self {
        let (id, number) = (record.object_id(), record.elements.norad);
        let identity = Identity::of_set(number, &record.designator, &record.name);
        // Catalogues are long: no octet more than it takes.
        let name = Some(record.name).filter(|name| !name.is_empty());
        Object {
            id,
            names: name.map_or(Vec::new(), |name| vec![name.as_str().to_owned()]),
            identity,
            orbit: Orbit::Elements(record.elements, Vec::new()),
        }
    }
}

impl Object {
    /// Adds the element sets and names of `other`, the same object from another record or file, where they differ. Of sets of one epoch the
    /// first is asked, so that one with a state then goes before one without. An ephemeris is left as it is.
    pub fn join(&mut self, other: Object) {
        let (Orbit::Elements(own, others), Orbit::Elements(set, further)) =
            (&mut self.orbit, other.orbit)
        else {
            return;
        };
        for mut set in [set].into_iter().chain(further) {
            if *own == set || others.contains(&set) {
                continue;
            }
            let mut known = std::iter::once(&mut *own).chain(others.iter_mut());
            if let Some(twin) = known.find(|known| known.epoch == set.epoch)
                && twin.state_teme_after(0.0).is_err()
                && set.state_teme_after(0.0).is_ok()
            {
                std::mem::swap(twin, &mut set);
            }
            others.push(set);
        }
        self.identity.join(other.identity);
        self.call(other.names);
    }

    /// Adds the segments and names of `other`, an ephemeris of the same object from the same message.
    pub(crate) fn extend(&mut self, other: Object) {
        if let (Orbit::Ephemeris(own), Orbit::Ephemeris(further)) = (&mut self.orbit, other.orbit) {
            own.segments.extend(further.segments);
        }
        self.call(other.names);
    }

    /// Adds names where they differ.
    fn call(&mut self, names: Vec<String>) {
        for name in names {
            if !self.names.contains(&name) {
                self.names.push(name);
            }
        }
    }
}
