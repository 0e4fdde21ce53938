//! Orbit files of every format, and folders of them.

use super::error::ConfigError;
use super::folder::Folder;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::io::ErrorKind;

use skyloop_orbit::{
    Contents, Loaded, Object, Rejected, Source, United, file_and_name, parse_contents, unite,
};

/// Largest number of objects in a message.
const NAMED: usize = 3;

/// Refusals and notices of orbit files.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// Refused records, one line each.
    pub rejected: Vec<String>,
    /// Skipped files and assumptions, one line each.
    pub notices: Vec<String>,
}

/// All orbit files of a scene. Records of an object are united after all are read, since the last
/// file may show that earlier records are of one object.
#[derive(Debug, Default)]
pub struct Pool {
    sources: Vec<Source>,
}

impl Pool {
    /// Adds an object.
    pub fn push(&mut self, object: Object, rank: u8) {
        self.sources.push(Source {
            objects: vec![object],
            rank,
            ..Source::default()
        });
    }

    /// Adds every object of a file, or of all files in a folder; each file is a source with this
    /// rank.
    ///
    /// # Errors
    ///
    /// A file cannot be read, or has no usable object.
    pub fn read(
        &mut self,
        folder: &Folder,
        name: &str,
        rank: u8,
        findings: &mut Findings,
    ) -> Result<(), ConfigError> {
        if let (file, Some(_)) = file_and_name(name, |file| folder.has(file))
            && folder.has(file)
        {
            return Err(ConfigError::Orbit(format!(
                "{name}: objects are taken from whole files: write {file}"
            )));
        }
        let mut refused = Vec::new();
        let mut is_empty = true;
        for (file, contents) in load(folder, name, findings)? {
            findings.add(&contents.rejected, &contents.assumed);
            refused.extend_from_slice(&contents.rejected);
            let source = contents.into_source(file, rank);
            is_empty &= source.objects.is_empty();
            self.sources.push(source);
        }
        if is_empty {
            let nothing = Loaded {
                rejected: refused,
                ..Loaded::default()
            };
            let why = nothing.pick(None).err().unwrap_or_default();
            return Err(ConfigError::Orbit(format!("{name}: {why}")));
        }
        Ok(())
    }

    /// The objects of a rank, each with the index of its source.
    pub fn of_rank(&self, rank: u8) -> impl Iterator<Item = (usize, &Object)> + Clone {
        let sources = self.sources.iter().enumerate();
        let sources = sources.filter(move |(_, source)| source.rank == rank);
        sources.flat_map(|(index, source)| source.objects.iter().map(move |object| (index, object)))
    }

    /// Number of sources so far.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Whether there are no sources.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Unites the records of each object. An ephemeris in addition to another orbit of an object is
    /// refused, since the object would be drawn twice.
    pub fn unite(self, findings: &mut Findings) -> United {
        let united = unite(self.sources);
        let refused = united.refused.iter().map(|(_, refused)| refused);
        findings.rejected.extend(refused.map(Rejected::to_string));
        united
    }
}

/// Reports how many objects have several element sets, if any.
pub fn several_sets(objects: &[Object]) -> Option<String> {
    let several = objects.iter().filter(|object| object.sets().count() > 1);
    let several: Vec<&Object> = several.collect();
    let what = match several.len() {
        0 => return None,
        1 => "1 object has".to_owned(),
        count => format!("{count} objects have"),
    };
    let rule = "the one whose epoch is nearest to an exposure counts";
    Some(format!(
        "{what} several element sets ({}): {rule}",
        named(&several)
    ))
}

/// Names that several objects share that have no other identity, with their counts.
pub fn shared_names(objects: &[Object]) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    for object in objects.iter().filter(|o| o.identity.has_name_alone()) {
        *counts.entry(object.capital_name()).or_insert(0) += 1;
    }
    counts.retain(|_, count| *count > 1);
    counts
}

/// Reports the names that several objects share, if any.
pub fn report_shared_names(shared: &BTreeMap<String, usize>) -> Option<String> {
    let named = shared.iter().take(NAMED);
    let named = named.map(|(name, count)| format!("{name}: {count}"));
    let more = (shared.len() > NAMED).then(|| "...".to_string());
    let named: Vec<String> = named.chain(more).collect();
    (!named.is_empty()).then(|| {
        format!(
            "objects of one name without number, designator and OBJECT_ID ({}): each orbit is taken as a separate object; give all records of one object the same catalogue number",
            named.join(", ")
        )
    })
}

/// The first objects by name: `NORAD 5 (VANGUARD 1), ...`.
pub fn named(objects: &[&Object]) -> String {
    let labels = objects.iter().take(NAMED).map(|object| object.label());
    let more = (objects.len() > NAMED).then(|| "...".to_string());
    labels.chain(more).collect::<Vec<_>>().join(", ")
}

/// The object of a selector `FILE` or `FILE:NAME`, see [`file_and_name`] and [`Loaded::pick`].
pub fn one(
    folder: &Folder,
    selector: &str,
    findings: &mut Findings,
) -> Result<Object, ConfigError> {
    FileCache::new(folder).one(selector, findings)
}

/// Files that are read once for several objects.
pub struct FileCache<'a> {
    folder: &'a Folder,
    files: HashMap<String, Loaded>,
}

impl FileCache<'_> {
    /// An empty cache for the files in `folder`.
    pub fn new(folder: &Folder) -> FileCache<'_> {
        let files = HashMap::new();
        FileCache { folder, files }
    }

    /// [`one`], from a cached file if possible.
    pub fn one(&mut self, selector: &str, findings: &mut Findings) -> Result<Object, ConfigError> {
        let (file, name) = file_and_name(selector, |file| self.folder.has(file));
        let loaded = match self.files.entry(file.to_string()) {
            Entry::Occupied(read) => read.into_mut(),
            Entry::Vacant(entry) => entry.insert(whole(load(self.folder, file, findings)?)),
        };
        let object = loaded
            .find(name)
            .map_err(|why| ConfigError::Orbit(format!("{file}: {why}")))?;
        findings.add(&loaded.rejected, &loaded.assumed);
        Ok(object.clone())
    }
}

impl Findings {
    /// Adds refusals and assumptions, without duplicates from other uses of the same file.
    fn add(&mut self, rejected: &[Rejected], assumed: &[String]) {
        add_new(&mut self.rejected, rejected.iter().map(Rejected::to_string));
        add_new(&mut self.notices, assumed.iter().cloned());
    }
}

/// Adds lines without duplicates.
fn add_new(all: &mut Vec<String>, lines: impl Iterator<Item = String>) {
    let known: HashSet<String> = all.iter().cloned().collect();
    all.extend(lines.filter(|line| !known.contains(line)));
}

/// Reports the entries of a folder that are not orbit files, if any.
pub fn passed_over(names: &[String]) -> Option<String> {
    let more = if names.len() > NAMED { ", ..." } else { "" };
    let mut named: Vec<&str> = names.iter().map(String::as_str).collect();
    named.sort_unstable();
    named.truncate(NAMED);
    let (named, count) = (named.join(", "), names.len());
    let what = match count {
        0 => return None,
        1 => "entry is not an orbit file",
        _ => "entries are not orbit files",
    };
    Some(format!(
        "skipped: {count} {what} ({named}{more}); list a subfolder by its own path, and give a population.toml \
         as [objects] population"
    ))
}

/// A file, or all orbit files of a folder, with their names.
fn load(
    folder: &Folder,
    name: &str,
    findings: &mut Findings,
) -> Result<Vec<(String, Contents)>, ConfigError> {
    let Some([files, others]) = folder.listing(name)? else {
        let (file, text) = folder.read_orbits(name)?;
        let contents = parse_contents(&text, &file);
        let contents = contents.map_err(|error| ConfigError::Orbit(error.to_string()))?;
        return Ok(vec![(name.to_owned(), contents)]);
    };
    let mut all = Vec::new();
    let mut foreign = others;
    for file in files {
        match given(folder, &file) {
            Given::Orbits(contents) => all.push((file, contents)),
            Given::Foreign => foreign.push(file),
            Given::Unusable(reason) => findings.rejected.push(reason),
        }
    }
    findings.notices.extend(passed_over(&foreign));
    Ok(all)
}

/// The objects of some files.
fn whole(files: Vec<(String, Contents)>) -> Loaded {
    let mut loaded = Loaded::default();
    let mut sources = Vec::new();
    for (file, mut contents) in files {
        loaded.rejected.append(&mut contents.rejected);
        loaded.assumed.append(&mut contents.assumed);
        sources.push(contents.into_source(file, 0));
    }
    let united = unite(sources);
    loaded.objects = united.objects;
    let refused = united.refused.into_iter().map(|(_, refused)| refused);
    loaded.rejected.extend(refused);
    loaded
}

/// The contents of a file in a folder.
enum Given {
    Orbits(Contents),
    /// Not an orbit file.
    Foreign,
    /// Unreadable, or an orbit file without records.
    Unusable(String),
}

fn given(folder: &Folder, name: &str) -> Given {
    let (file, text) = match folder.read_orbits(name) {
        Ok(read) => read,
        Err(ConfigError::Read { source, .. }) if source.kind() == ErrorKind::InvalidData => {
            return Given::Foreign;
        }
        Err(error) => return Given::Unusable(error.to_string()),
    };
    match parse_contents(&text, &file) {
        Ok(contents) => Given::Orbits(contents),
        Err(error) if error.is_foreign() => Given::Foreign,
        Err(error) => Given::Unusable(error.to_string()),
    }
}
