//! Orbit files of every format, and folders of them, by name.

use super::{ConfigError, Folder, Register};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};
use std::io::ErrorKind;

use skyloop_orbit::{Loaded, Object, Orbit, Rejected, file_and_name};

/// Objects that a line names at most.
const NAMED: usize = 3;

/// What there is to say of orbit files beside the objects in them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Findings {
    /// Records that were refused, one line each.
    pub rejected: Vec<String>,
    /// What was passed over, one line each.
    pub notices: Vec<String>,
}

/// Adds every object of a file, or of all files in a folder, to `objects`. Element sets of an object that is there
/// already become further sets of it. An ephemeris beside other orbits of an object is refused: shown twice, it would send
/// its light twice.
pub fn add(
    folder: &Folder,
    name: &str,
    objects: &mut Vec<Object>,
    findings: &mut Findings,
) -> Result<(), ConfigError> {
    add_without(folder, name, &Register::default(), objects, findings).map(drop)
}

/// [`add`], but for the objects `without`, which have come from elsewhere. Gives the places of those that were there and have got
/// further element sets, or the same again.
pub fn add_without(
    folder: &Folder,
    name: &str,
    without: &Register,
    objects: &mut Vec<Object>,
    findings: &mut Findings,
) -> Result<Vec<usize>, ConfigError> {
    if let (file, Some(_)) = file_and_name(name, |file| folder.has(file))
        && folder.has(file)
    {
        return Err(ConfigError::Orbit(format!(
            "{name}: objects are taken from whole files: write {file}"
        )));
    }
    let mut loaded = load(folder, name, findings)?;
    book(&loaded.rejected, &mut findings.rejected);
    if loaded.objects.is_empty() {
        let why = loaded.pick(None).err().unwrap_or_default();
        return Err(ConfigError::Orbit(format!("{name}: {why}")));
    }
    if !without.is_empty() {
        loaded.objects.retain(|object| !without.has(object));
    }
    let is_set = |object: &Object| matches!(object.orbit, Orbit::Elements(..));
    if objects.is_empty() && loaded.objects.iter().all(is_set) {
        // Within a file, or a folder, each object is one already.
        *objects = loaded.objects;
        return Ok(Vec::new());
    }
    let mut register = Register::of(objects);
    let Gathered { joined, refused } = gather(objects, &mut register, loaded.objects);
    let refused = refused.iter().map(|why| format!("{name}: {why}"));
    findings.rejected.extend(refused);
    Ok(joined)
}

/// Says of how many objects there are several element sets, if there are any.
pub fn several_sets(objects: &[Object]) -> Option<String> {
    let several = |object: &&Object| match &object.orbit {
        Orbit::Elements(_, others) => !others.is_empty(),
        Orbit::Ephemeris(_) => false,
    };
    let several: Vec<&Object> = objects.iter().filter(several).collect();
    let (named, count) = (named(&several), several.len());
    let what = if count == 1 {
        "object has"
    } else {
        "objects have"
    };
    (count > 0).then(|| {
        format!(
            "{count} {what} several element sets ({named}): the one whose epoch is nearest to an exposure counts"
        )
    })
}

/// The first of some objects by name: `NORAD 5 (VANGUARD 1), ...`.
pub fn named(objects: &[&Object]) -> String {
    let labels = objects.iter().take(NAMED).map(|object| object.label());
    let more = (objects.len() > NAMED).then(|| "...".to_string());
    labels.chain(more).collect::<Vec<_>>().join(", ")
}

/// The object that `FILE` or `FILE:NAME` selects, see [`file_and_name`] and [`Loaded::pick`].
pub fn one(
    folder: &Folder,
    selector: &str,
    findings: &mut Findings,
) -> Result<Object, ConfigError> {
    Shelf::new(folder).one(selector, findings)
}

/// Files that are read once, however many objects are taken out of them.
pub struct Shelf<'a> {
    folder: &'a Folder,
    files: HashMap<String, Loaded>,
}

impl Shelf<'_> {
    /// Of the files in `folder`; none is read yet.
    pub fn new(folder: &Folder) -> Shelf<'_> {
        let files = HashMap::new();
        Shelf { folder, files }
    }

    /// [`one`], from a file that may have been read before.
    pub fn one(&mut self, selector: &str, findings: &mut Findings) -> Result<Object, ConfigError> {
        let (file, name) = file_and_name(selector, |file| self.folder.has(file));
        let loaded = match self.files.entry(file.to_string()) {
            Entry::Occupied(read) => read.into_mut(),
            Entry::Vacant(place) => place.insert(load(self.folder, file, findings)?),
        };
        let object = loaded
            .find(name)
            .map_err(|why| ConfigError::Orbit(format!("{file}: {why}")))?;
        book(&loaded.rejected, &mut findings.rejected);
        Ok(object.clone())
    }
}

/// Adds what was refused, unless another use of the same file has told it already.
fn book(refused: &[Rejected], rejected: &mut Vec<String>) {
    let known: HashSet<String> = rejected.iter().cloned().collect();
    let lines = refused.iter().map(Rejected::to_string);
    rejected.extend(lines.filter(|line| !known.contains(line)));
}

/// What came of objects that were there already.
#[derive(Debug, Default)]
pub struct Gathered {
    /// The places of those that have got further element sets, or the same again.
    pub joined: Vec<usize>,
    /// Which could not be joined, and why, a line each.
    pub refused: Vec<String>,
}

/// Adds `new` objects to `objects`, whose `register` it keeps; element sets of those that are there to them.
pub fn gather(objects: &mut Vec<Object>, register: &mut Register, new: Vec<Object>) -> Gathered {
    let mut gathered = Gathered::default();
    objects.reserve(new.len());
    register.reserve(new.len());
    for object in new {
        let place = register.place(&object);
        let Some((place, known)) = place.and_then(|at| Some((at, objects.get_mut(at)?))) else {
            register.insert(&object, objects.len());
            objects.push(object);
            continue;
        };
        match (&known.orbit, &object.orbit) {
            (Orbit::Elements(..), Orbit::Elements(..)) => {
                known.join(object);
                gathered.joined.push(place);
            }
            _ => gathered.refused.push(format!(
                "{} is {}in an earlier file: keep one of the two",
                object.label(),
                match known.id == object.id {
                    true => String::new(),
                    false => format!("{} ", known.label()),
                }
            )),
        }
    }
    gathered
}

/// Says what a folder holds beside files of orbits, if there is anything.
pub fn passed_over(names: &[String]) -> Option<String> {
    let more = if names.len() > NAMED { ", ..." } else { "" };
    let mut named: Vec<&str> = names.iter().map(String::as_str).collect();
    named.sort_unstable();
    named.truncate(NAMED);
    let (named, count) = (named.join(", "), names.len());
    let what = match count {
        0 => return None,
        1 => "entry is no file",
        _ => "entries are no files",
    };
    Some(format!(
        "passed over: {count} {what} of orbits ({named}{more}); name a folder in a folder by itself, and give a population.toml \
         as [objects] population"
    ))
}

/// A file, or all files of a folder, of which those that are in no format of orbits are passed over.
fn load(folder: &Folder, name: &str, findings: &mut Findings) -> Result<Loaded, ConfigError> {
    let Some([files, others]) = folder.listing(name)? else {
        let (file, text) = folder.read(name)?;
        let loaded = skyloop_orbit::parse(&text, &file);
        let loaded = loaded.map_err(|e| ConfigError::Orbit(e.to_string()))?;
        findings.notices.extend(remarks(&file, &loaded.objects));
        return Ok(loaded);
    };
    let mut all = Loaded::default();
    let mut register = Register::default();
    let mut foreign = others;
    for file in files {
        match given(folder, &file) {
            Given::Orbits(loaded) => {
                findings.notices.extend(remarks(&file, &loaded.objects));
                all.rejected.extend(loaded.rejected);
                for reason in gather(&mut all.objects, &mut register, loaded.objects).refused {
                    all.rejected.push(Rejected {
                        source: file.clone(),
                        line: 1,
                        reason,
                    });
                }
            }
            Given::Foreign => foreign.push(file),
            Given::Unusable(reason) => findings.rejected.push(reason),
        }
    }
    findings.notices.extend(passed_over(&foreign));
    Ok(all)
}

/// What was assumed of objects of a file, a line each.
fn remarks(file: &str, objects: &[Object]) -> Vec<String> {
    let remarks = objects.iter().flat_map(Object::remarks);
    remarks
        .map(|(line, remark)| format!("{file}:{line}: {remark}"))
        .collect()
}

/// What a file of a folder gives.
enum Given {
    Orbits(Loaded),
    /// It is no file of orbits.
    Foreign,
    /// It cannot be read, or has the form of one and holds nothing.
    Unusable(String),
}

fn given(folder: &Folder, name: &str) -> Given {
    let (file, text) = match folder.read(name) {
        Ok(read) => read,
        Err(ConfigError::Read { source, .. }) if source.kind() == ErrorKind::InvalidData => {
            return Given::Foreign;
        }
        Err(error) => return Given::Unusable(error.to_string()),
    };
    match skyloop_orbit::parse(&text, &file) {
        Ok(loaded) => Given::Orbits(loaded),
        Err(error) if error.is_foreign() => Given::Foreign,
        Err(error) => Given::Unusable(error.to_string()),
    }
}
