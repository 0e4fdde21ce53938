//! Loads the objects of an orbit file.

use crate::format::Format;
use crate::lines::Part;
use crate::parts::parts;
use crate::record::{At, Record, shorten};
use crate::unread::Unread;
use crate::{
    Identity, Object, Orbit, Source, oem, omm, path_text, printable_line, read_text, remedy,
    server, theory, tle, unite, unread, xml,
};
use hifitime::Epoch;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fmt;
use std::path::{Path, PathBuf};

/// Objects and rejected records of a file.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The objects, in the order of the file.
    pub objects: Vec<Object>,
    /// The records that could not be read, in the order of the file.
    pub rejected: Vec<Rejected>,
    /// Assumptions for the accepted records, a line for each kind.
    pub assumed: Vec<String>,
}

/// The records of a text, before records of one object are united.
#[derive(Clone, Debug)]
pub struct Contents {
    /// The format of the text, or of its first part.
    pub format: Format,
    /// Its element sets, in the order of the text.
    pub records: Vec<Record>,
    /// Its objects with an ephemeris, in the order of the text.
    pub ephemerides: Vec<Object>,
    /// The records that could not be read, in the order of the text.
    pub rejected: Vec<Rejected>,
    /// Assumptions for the accepted records, a line for each kind.
    pub assumed: Vec<String>,
    /// Name of the text in messages.
    source: String,
    /// Count of records of the current part so far, read or refused.
    taken: usize,
    /// START_TIME of the first segment of an OEM in the text.
    pub(crate) first_start: Option<Epoch>,
}

/// A record that could not be read. Printed as `file:line: reason`, or the reason alone without a
/// source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// Name of the file or other source.
    pub source: String,
    /// Line in the source, counted from 1.
    pub line: usize,
    /// The fault.
    pub reason: String,
}

impl Rejected {
    /// The reason becomes one printable line.
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
        if self.source.is_empty() {
            return f.write_str(&self.reason);
        }
        write!(f, "{}:{}: {}", self.source, self.line, self.reason)
    }
}

/// Why a file gave no objects.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The file could not be read.
    #[error(
        "cannot read the orbit file {}: {error}{}",
        path_text(path),
        remedy_of(error)
    )]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        #[source]
        error: std::io::Error,
    },
    /// The text holds no readable orbit.
    #[error("{source_name}: {reason}")]
    Nothing {
        /// The source's name.
        source_name: String,
        /// The kind of the text, and the remedy.
        reason: String,
        /// Whether the text is of another kind than orbits, such as other files in the same folder.
        /// False for an orbit file without records, and for an unsupported format of orbits.
        is_foreign: bool,
    },
}

fn remedy_of(error: &std::io::Error) -> String {
    remedy(error).map_or(String::new(), |remedy| format!("; {remedy}"))
}

impl LoadError {
    /// Whether the file is not an orbit file: not text, or a text of another kind.
    pub fn is_foreign(&self) -> bool {
        match self {
            LoadError::Read { error, .. } => error.kind() == std::io::ErrorKind::InvalidData,
            LoadError::Nothing { is_foreign, .. } => *is_foreign,
        }
    }

    fn lost(source: &str, reason: impl Into<String>) -> Self {
        LoadError::Nothing {
            source_name: source.to_owned(),
            reason: reason.into(),
            is_foreign: false,
        }
    }
}

/// Reads the objects of an orbit file; the [`Format`] is detected from the text.
///
/// # Errors
///
/// The file cannot be read, or holds no orbit data. Records that cannot be read are listed in
/// [`Loaded::rejected`]; the rest loads.
pub fn load(path: &Path) -> Result<Loaded, LoadError> {
    load_contents(path).map(Loaded::from)
}

/// [`load`] for a text; `source` is its name in messages.
pub fn parse(text: &str, source: &str) -> Result<Loaded, LoadError> {
    parse_contents(text, source).map(Loaded::from)
}

/// Reads the records of an orbit file; errors as for [`load`].
pub fn load_contents(path: &Path) -> Result<Contents, LoadError> {
    let text = read_text(path).map_err(|error| LoadError::Read {
        path: path.to_owned(),
        error,
    })?;
    parse_contents(&text, &path_text(path))
}

/// [`load_contents`] for a text; `source` is its name in messages.
pub fn parse_contents(text: &str, source: &str) -> Result<Contents, LoadError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        return Err(LoadError::lost(source, "empty; fetch the file again"));
    }
    let format = format(text, source)?;
    let mut all = Contents {
        format,
        records: Vec::new(),
        ephemerides: Vec::new(),
        rejected: Vec::new(),
        assumed: Vec::new(),
        source: source.to_owned(),
        taken: 0,
        first_start: None,
    };
    let whole = Part {
        text,
        lines_before: 0,
    };
    // JSON, CSV and XML are one part, whatever their lines begin with.
    let is_bracketed = matches!(format, Format::OmmJson | Format::OmmCsv) || format.is_xml();
    let parts = if is_bracketed && Format::of(text) == Some(format) {
        vec![whole]
    } else {
        parts(text)
    };
    let mut unread = Unread::new();
    match parts.as_slice() {
        [part] => all.add(part, format, &mut unread),
        parts => parts
            .iter()
            .for_each(|part| all.add_part(part, &mut unread)),
    }
    if parts.len() > 1 || format.is_xml() {
        all.reject_unread(unread);
    }
    if all.len() == 0 {
        return Err(LoadError::lost(source, lack(format)));
    }
    all.assumed = theory::assumptions(&all.records, source);
    let remarks = all.ephemerides.iter().flat_map(Object::remarks);
    let remarks = remarks.map(|(line, remark)| format!("{source}:{line}: {remark}"));
    all.assumed.extend(remarks);
    Ok(all)
}

/// What a text without records lacks, by its format.
fn lack(format: Format) -> String {
    let segment = match format {
        Format::OemKvn => "META_START ... META_STOP and its states",
        Format::OemXml => "<segment> with <metadata> and <data>",
        _ => return format!("{format}, and no record in it"),
    };
    format!("an OEM without a segment; a segment is {segment}")
}

/// The format of a text, or of its first readable part.
fn format(text: &str, source: &str) -> Result<Format, LoadError> {
    let named = unread::by_header(text);
    let format = Format::of(text).filter(|_| named.is_none());
    if matches!(format, None | Some(Format::OmmJson))
        && let Some(says) = server::words(text, source)
    {
        let answer = format!("the answer of a server: \"{says}\"; fetch the file again");
        return Err(LoadError::lost(source, format!("no orbits, but {answer}")));
    }
    if let Some(format) = format {
        return Ok(format);
    }
    let parts = parts(text);
    let mut found = Vec::from_iter(named);
    if found.is_empty() {
        if let Some(format) = parts.iter().skip(1).find_map(|part| Format::of(part.text)) {
            return Ok(format);
        }
        let mut messages = Unread::new();
        for part in &parts {
            found.extend(unread::found(part.text));
            unread::add_messages(part, &mut messages);
        }
        found.extend(messages.into_keys());
    }
    let mut known = BTreeSet::new();
    found.retain(|kind| known.insert(kind.clone()));
    let begins: String = server::quoted(text).chars().take(40).collect();
    Err(LoadError::Nothing {
        source_name: source.to_owned(),
        reason: match found.is_empty() {
            true => format!(
                "no orbit found, it begins with \"{begins}\"; expected two-line element sets (TLE, \
                 3LE), OMM in KVN, XML, JSON or CSV, or a CCSDS OEM in KVN, whose first line is \
                 CCSDS_OEM_VERS = ..., or in XML"
            ),
            false => found.join("; "),
        },
        is_foreign: !parts.iter().any(|part| unread::has_orbits(part.text)),
    })
}

impl Contents {
    /// Count of records, read or refused.
    fn len(&self) -> usize {
        self.records.len() + self.ephemerides.len() + self.rejected.len()
    }

    /// Adds the next record of a part. Errors state its number: a text may be one line.
    pub(crate) fn take(&mut self, record: At<Record>) {
        self.taken += 1;
        match record {
            Ok(record) => self.records.push(record),
            Err((line, reason)) => self.reject(line, format!("record {}: {reason}", self.taken)),
        }
    }

    pub(crate) fn reject(&mut self, line: usize, reason: impl AsRef<str>) {
        let rejected = Rejected::new(&self.source, line, reason.as_ref());
        self.rejected.push(rejected);
    }

    /// Adds the records of a part in a known format.
    fn add(&mut self, part: &Part, format: Format, unread: &mut Unread) {
        self.taken = 0;
        match format {
            Format::Tle | Format::ThreeLine => tle::read(part, self),
            Format::OmmKvn => omm::kvn::read(part, self),
            Format::OmmXml => omm::xml::read(part, self),
            Format::OmmJson => omm::json::read(part, self),
            Format::OmmCsv => omm::csv::read(part, self),
            Format::OemKvn => oem::read(part, self),
            Format::OemXml => {}
        }
        if !format.is_xml() {
            return;
        }
        // An NDM may hold messages of both kinds.
        if oem::xml::looks_like(part.text) {
            oem::xml::read(part, self);
        }
        let mut finder = part.finder();
        for (offset, rest) in xml::between(part.text) {
            let (line, rest) = (finder.line(offset), shorten(rest));
            let remedy = format!("remove it, or split the file at line {line}");
            self.reject(line, format!("'{rest}' behind a message in XML: {remedy}"));
        }
        unread::add_messages(part, unread);
    }

    /// Adds one part of a text with several parts; its format is detected.
    fn add_part(&mut self, part: &Part, unread: &mut Unread) {
        let line = part.lines_before + 1;
        match (Format::of(part.text), unread::found(part.text)) {
            (Some(format), _) => {
                let count = self.len();
                self.add(part, format, unread);
                if self.len() == count {
                    self.reject(line, lack(format));
                }
            }
            (None, Some(found)) => {
                let lines = part.lines().map(|(_, line)| line.trim_start());
                let messages = lines.filter(|line| line.starts_with("CCSDS_"));
                unread.entry(found).or_insert((0, line)).0 += messages.count().max(1);
            }
            (None, None) => self.reject(line, "a message without orbits: remove it"),
        }
    }

    /// Rejects messages of unsupported kinds, in the order of the text.
    fn reject_unread(&mut self, unread: Unread) {
        for (found, (count, line)) in unread {
            match count {
                1 => self.reject(line, found),
                _ => self.reject(line, format!("{count} messages, each {found}")),
            }
        }
        self.rejected.sort_by_key(|rejected| rejected.line);
    }

    /// An object for each record and each ephemeris, in the order of the text. Several may be the
    /// same object, see [`unite`].
    pub(crate) fn into_objects(self) -> Vec<Object> {
        let sets = self.records.into_par_iter();
        let mut objects: Vec<Object> = sets.map(Object::from).collect();
        objects.extend(self.ephemerides);
        objects
    }

    /// The objects as a source of [`unite`], with its name in messages.
    pub fn into_source(self, name: String, rank: u8) -> Source {
        let records = self.records.iter().map(|record| record.line);
        let lines = records.chain(self.ephemerides.iter().map(Object::line));
        Source {
            name,
            lines: lines.collect(),
            objects: self.into_objects(),
            rank,
        }
    }
}

impl From<Contents> for Loaded {
    /// Unites the element sets of each object, without duplicates. Its ephemeris stays an object of
    /// its own.
    fn from(mut contents: Contents) -> Self {
        let ephemerides = std::mem::take(&mut contents.ephemerides);
        let rejected = std::mem::take(&mut contents.rejected);
        let assumed = std::mem::take(&mut contents.assumed);
        let mut objects = unite(vec![contents.into_source(String::new(), 0)]).objects;
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
        // No spare capacity: catalogues are large.
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
    /// Adds the element sets and names of `other`, the same object in another record or file,
    /// without duplicates. Of sets with equal epochs the first is used, unless SGP4 has a state
    /// only for a later one.
    pub(crate) fn join(&mut self, other: Object) {
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
        self.add_names(other.names);
    }

    /// Adds the segments and names of `other`, an ephemeris of the same object in the same message.
    pub(crate) fn extend(&mut self, other: Object) {
        if let (Orbit::Ephemeris(own), Orbit::Ephemeris(further)) = (&mut self.orbit, other.orbit) {
            own.segments.extend(further.segments);
        }
        self.add_names(other.names);
    }

    /// First line of its ephemeris.
    fn line(&self) -> usize {
        match &self.orbit {
            Orbit::Ephemeris(own) => own.segments.first().map_or(1, |first| first.line),
            Orbit::Elements(..) => 1,
        }
    }

    fn add_names(&mut self, names: Vec<String>) {
        for name in names {
            if !self.names.contains(&name) {
                self.names.push(name);
            }
        }
    }
}
