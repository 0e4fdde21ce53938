//! From a file to the objects in it.

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
    /// Name of the text in messages.
    source: String,
    /// How many records of the part were read or refused so far.
    taken: usize,
    /// START_TIME of the first segment of an OEM in the text.
    pub(crate) first_start: Option<Epoch>,
}

/// A record that could not be read. Shown as `file:line: reason`, without a source the reason alone.
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
        if self.source.is_empty() {
            return f.write_str(&self.reason);
        }
        write!(f, "{}:{}: {}", self.source, self.line, self.reason)
    }
}

/// Why a file gave nothing at all.
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
        /// What the system said.
        #[source]
        error: std::io::Error,
    },
    /// The text holds no orbit that can be read.
    #[error("{source_name}: {reason}")]
    Nothing {
        /// The source's name.
        source_name: String,
        /// What the text is, and the remedy.
        reason: String,
        /// Whether it is of another kind than orbits, such as other files in the same folder. A
        /// file that has lost its records, or an unread format of orbits, is not.
        is_foreign: bool,
    },
}

fn remedy_of(error: &std::io::Error) -> String {
    remedy(error).map_or(String::new(), |remedy| format!("; {remedy}"))
}

impl LoadError {
    /// Whether this is not a file of orbits at all: not text, or a text of another kind.
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
    // A text in brackets is one part, whatever its lines begin with.
    let is_bracketed = matches!(format, Format::OmmJson | Format::OmmCsv) || format.is_xml();
    let parts = match is_bracketed && Format::of(text) == Some(format) {
        true => vec![whole],
        false => parts(text),
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
    let comments = all.ephemerides.iter().flat_map(Object::comments);
    let comments = comments.map(|(line, comment)| format!("{source}:{line}: {comment}"));
    all.assumed.extend(comments);
    Ok(all)
}

/// What a text in a format lacks that holds nothing.
fn lack(format: Format) -> String {
    let segment = match format {
        Format::OemKvn => "META_START ... META_STOP and its states",
        Format::OemXml => "<segment> with <metadata> and <data>",
        _ => return format!("{format}, and no record in it"),
    };
    format!("an OEM without a segment; a segment is {segment}")
}

/// The format of a text or, of one in parts, of the first that is read.
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
    /// How many records there are, read or refused.
    fn len(&self) -> usize {
        self.records.len() + self.ephemerides.len() + self.rejected.len()
    }

    /// Adds the next record of a part. Errors get its number: a file may have one line for all.
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

    /// Adds what a part in a known format holds.
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

    /// Adds a part of a text in several formats.
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

    /// Rejects messages of kinds that are not read, in the order of the text.
    fn reject_unread(&mut self, unread: Unread) {
        for (found, (count, line)) in unread {
            match count {
                1 => self.reject(line, found),
                _ => self.reject(line, format!("{count} messages, each {found}")),
            }
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

    /// The same as a source of [`unite`], with its name in messages.
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
    /// Element sets of one object become one object, with every set that differs. An ephemeris of it stays an object of its own.
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
    /// Adds the element sets and names of `other`, the same object in another record or file, where
    /// they differ. Of sets of one epoch the first is used: one with a state goes before one
    /// without.
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
