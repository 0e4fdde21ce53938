//! From a file to the objects in it.

use crate::format::Format;
use crate::lines::LineFinder;
use crate::parts::{Part, parts};
use crate::record::{Found, Record, shorten};
use crate::{
    Identity, Object, Orbit, Source, lines, oem, omm, path_text, printable_line, read_text, remedy,
    server, theory, tle, unite, unread, xml,
};
use hifitime::Epoch;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
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
    /// The text's format; of a text in several, that of its first.
    pub format: Format,
    /// Its element sets, in the order of the text.
    pub records: Vec<Record>,
    /// Its objects with an ephemeris, in the order of the text.
    pub ephemerides: Vec<Object>,
    /// The records that could not be read, in the order of the text.
    pub rejected: Vec<Rejected>,
    /// What was assumed of records that were read, a line for each kind.
    pub assumed: Vec<String>,
    /// START_TIME of the first segment of an OEM in the text.
    first_start: Option<Epoch>,
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
        Rejected {
            source: source.to_owned(),
            line,
            reason: printable_line(reason).into_owned(),
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
    /// An OEM with a header and no segment.
    #[error("{source_name}: an OEM without a segment; a segment is {segment}")]
    NoSegment {
        /// The source's name.
        source_name: String,
        /// What a segment is in the text's notation.
        segment: &'static str,
    },
    /// The text has the form of element sets and holds none.
    #[error("{source_name}: {format}, and no record in it")]
    NoRecord {
        /// The source's name.
        source_name: String,
        /// Its format.
        format: Format,
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
    if text.trim().is_empty() {
        return Err(LoadError::Empty {
            source_name: source.to_owned(),
        });
    }
    let format = format(text, source)?;
    let mut all = Contents {
        format,
        records: Vec::new(),
        ephemerides: Vec::new(),
        rejected: Vec::new(),
        assumed: Vec::new(),
        first_start: None,
    };
    // Texts in brackets are one part, whatever their lines begin with.
    let is_bracketed = !matches!(
        format,
        Format::Tle | Format::ThreeLine | Format::OmmKvn | Format::OemKvn
    );
    let parts = if is_bracketed && Format::of(text) == Some(format) {
        Vec::new()
    } else {
        parts(text)
    };
    if parts.len() > 1 {
        let mut unread = BTreeMap::new();
        for part in parts {
            all.add_part(&part, source, &mut unread);
        }
        all.reject_unread(unread, source);
    } else {
        all.add(text, format, source, 0);
        if matches!(format, Format::OmmXml | Format::OemXml) {
            all.reject_unread(unread::messages(text), source);
        }
    }
    if all.len() == 0 {
        return Err(no_record(format, source));
    }
    all.assumed = theory::assumptions(&all.records, source);
    let remarks = all.ephemerides.iter().flat_map(Object::remarks);
    all.assumed
        .extend(remarks.map(|(line, remark)| format!("{source}:{line}: {remark}")));
    Ok(all)
}

/// The error of a text in a format that holds nothing.
fn no_record(format: Format, source: &str) -> LoadError {
    let source_name = source.to_owned();
    let segment = match format {
        Format::OemKvn => "META_START ... META_STOP and its states",
        Format::OemXml => "<segment> with <metadata> and <data>",
        _ => {
            return LoadError::NoRecord {
                source_name,
                format,
            };
        }
    };
    LoadError::NoSegment {
        source_name,
        segment,
    }
}

/// The format of a text or, of one in parts, of the first that is read.
fn format(text: &str, source: &str) -> Result<Format, LoadError> {
    let source_name = || source.to_owned();
    let named = unread::by_header(text);
    let format = Format::of(text).filter(|_| named.is_none());
    let may_answer = matches!(format, None | Some(Format::OmmJson));
    if let Some(says) = may_answer.then(|| server::words(text, source)).flatten() {
        return Err(LoadError::Answer {
            source_name: source_name(),
            says,
        });
    }
    if let Some(format) = format {
        return Ok(format);
    }
    let parts = parts(text);
    if named.is_none()
        && let Some(format) = parts.iter().skip(1).find_map(|part| Format::of(part.text))
    {
        return Ok(format);
    }
    let mut found: Vec<String> = named.into_iter().collect();
    if found.is_empty() {
        found.extend(parts.iter().filter_map(|part| unread::found(part.text)));
        found.extend(unread::messages(text).into_keys());
    }
    let mut known = BTreeSet::new();
    found.retain(|kind| known.insert(kind.clone()));
    if found.is_empty() {
        return Err(LoadError::NoOrbit {
            source_name: source_name(),
            begins: server::quoted(text).chars().take(40).collect(),
        });
    }
    Err(LoadError::Unread {
        source_name: source_name(),
        found: found.join("; "),
        has_orbits: parts.iter().any(|part| unread::has_orbits(part.text)),
    })
}

impl Contents {
    /// The number of records, read or refused.
    fn len(&self) -> usize {
        self.records.len() + self.ephemerides.len() + self.rejected.len()
    }

    /// Adds what a text in a known format holds, which has some lines of its file before it.
    fn add(&mut self, text: &str, format: Format, source: &str, lines_before: usize) {
        let mut found = Found::new(source);
        let mut ephemerides = Vec::new();
        match format {
            Format::Tle | Format::ThreeLine => tle::read(text, &mut found),
            Format::OmmKvn => omm::kvn::read(text, &mut found),
            Format::OmmXml => omm::xml::read(text, &mut found),
            Format::OmmJson => omm::json::read(text, &mut found),
            Format::OmmCsv => omm::csv::read(text, &mut found),
            Format::OemKvn => {
                let loaded = oem::parse(text, source, &mut self.first_start);
                add_ephemerides(loaded, &mut ephemerides, &mut found);
            }
            Format::OemXml => {}
        }
        // An NDM may hold messages of both kinds.
        if matches!(format, Format::OmmXml | Format::OemXml) && oem::xml::looks_like(text) {
            let loaded = oem::xml::parse(text, source, &mut self.first_start);
            add_ephemerides(loaded, &mut ephemerides, &mut found);
        }
        if matches!(format, Format::OmmXml | Format::OemXml) {
            let mut finder = LineFinder::new(text);
            for (offset, rest) in xml::between(text) {
                let line = finder.line(offset);
                let at = line + lines_before;
                let reason = format!(
                    "'{}' behind a message in XML: remove it, or split the file at line {at}",
                    shorten(rest)
                );
                found.reject(line, reason);
            }
        }
        for record in &mut found.records {
            record.line += lines_before;
        }
        for rejected in &mut found.rejected {
            rejected.line += lines_before;
        }
        for object in &mut ephemerides {
            if let Orbit::Ephemeris(ephemeris) = &mut object.orbit {
                ephemeris.move_lines(lines_before);
            }
        }
        self.records.append(&mut found.records);
        self.rejected.append(&mut found.rejected);
        self.ephemerides.append(&mut ephemerides);
    }

    /// Adds a part of a text in several formats.
    fn add_part(
        &mut self,
        part: &Part,
        source: &str,
        unread: &mut BTreeMap<String, (usize, usize)>,
    ) {
        let line = part.lines_before + 1;
        match (Format::of(part.text), unread::found(part.text)) {
            (Some(format), _) => {
                let count = self.len();
                self.add(part.text, format, source, part.lines_before);
                if matches!(format, Format::OmmXml | Format::OemXml) {
                    for (found, (count, line)) in unread::messages(part.text) {
                        let first = (0, line + part.lines_before);
                        unread.entry(found).or_insert(first).0 += count;
                    }
                }
                if self.len() == count {
                    let reason = no_record(format, source).to_string();
                    let reason = reason.trim_start_matches(source).trim_start_matches(": ");
                    self.rejected.push(Rejected::new(source, line, reason));
                }
            }
            (None, Some(found)) => {
                let messages = lines::numbered(part.text)
                    .filter(|(_, line)| line.trim_start().starts_with("CCSDS_"));
                unread.entry(found).or_insert((0, line)).0 += messages.count().max(1);
            }
            (None, None) => {
                let reason = "a message without orbits: remove it";
                self.rejected.push(Rejected::new(source, line, reason));
            }
        }
    }

    /// Reports messages of kinds that are not read: how many of each, and the line of the first.
    fn reject_unread(&mut self, unread: BTreeMap<String, (usize, usize)>, source: &str) {
        for (found, (count, line)) in unread {
            let reason = match count {
                1 => found,
                count => format!("{count} messages, each {found}"),
            };
            self.rejected.push(Rejected::new(source, line, &reason));
        }
        self.rejected.sort_by_key(|rejected| rejected.line);
    }

    /// An object for each record and each ephemeris, in the order of the text: several may be of one object, see [`unite`].
    pub fn into_objects(self) -> Vec<Object> {
        let sets = self.records.into_par_iter();
        let mut objects: Vec<Object> = sets.map(Object::from).collect();
        objects.extend(self.ephemerides);
        objects
    }

    /// The same as a source of [`unite`].
    pub fn into_source(self, rank: u8) -> Source {
        let records = self.records.iter().map(|record| record.line);
        let lines = records.chain(self.ephemerides.iter().map(Object::line));
        Source {
            lines: lines.collect(),
            objects: self.into_objects(),
            rank,
        }
    }
}

fn add_ephemerides(loaded: Loaded, ephemerides: &mut Vec<Object>, found: &mut Found) {
    ephemerides.extend(loaded.objects);
    found.rejected.extend(loaded.rejected);
}

impl From<Contents> for Loaded {
    /// Element sets of one object become one object, with every set that differs. An ephemeris of it stays an object of its own.
    fn from(mut contents: Contents) -> Self {
        let ephemerides = std::mem::take(&mut contents.ephemerides);
        let rejected = std::mem::take(&mut contents.rejected);
        let assumed = std::mem::take(&mut contents.assumed);
        let mut objects = unite(vec![contents.into_source(0)]).objects;
        objects.extend(ephemerides);
        Loaded {
            objects,
            rejected,
            assumed,
        }
    }
}

impl From<Record> for Object {
    fn from(record: Record) -> Self {
        let (id, number) = (record.object_id(), record.elements.norad);
        let identity = Identity::of_set(number, &record.designator, &record.name);
        // Catalogues are long: no byte more than it takes.
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
    /// first counts, so that one with a state then goes before one without. An ephemeris is not changed.
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

    /// The line at which its ephemeris begins.
    fn line(&self) -> usize {
        match &self.orbit {
            Orbit::Ephemeris(own) => own.segments.first().map_or(1, |first| first.line),
            Orbit::Elements(..) => 1,
        }
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
