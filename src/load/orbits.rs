//! Orbit files (TLE, 3LE, OEM) by name.

use super::{ConfigError, Folder};
use std::collections::hash_map::Entry;
use std::collections::{HashMap, HashSet};

use skyloop_orbit::{Loaded, Object, Rejected, file_and_name};

/// Adds every object of a file to `objects`. What is wrong with its other records goes to `rejected`, and so
/// does an object that an earlier file gave: shown twice, it would send its light twice.
pub fn add(
    folder: &Folder,
    name: &str,
    objects: &mut Vec<Object>,
    rejected: &mut Vec<String>,
) -> Result<(), ConfigError> {
    add_without(folder, name, &HashSet::new(), objects, rejected)
}

/// [`add`], but for the objects of the ids `without`, which have come from elsewhere.
pub fn add_without(
    folder: &Folder,
    name: &str,
    without: &HashSet<String>,
    objects: &mut Vec<Object>,
    rejected: &mut Vec<String>,
) -> Result<(), ConfigError> {
    if let (file, Some(_)) = file_and_name(name, |file| folder.has(file))
        && folder.has(file)
    {
        return Err(ConfigError::Orbit(format!(
            "{name}: objects are taken from whole files: write {file}"
        )));
    }
    let loaded = load(folder, name)?;
    book(&loaded.rejected, rejected);
    if loaded.objects.is_empty() {
        let why = loaded.pick(None).err().unwrap_or_default();
        return Err(ConfigError::Orbit(format!("{name}: {why}")));
    }
    let known: HashSet<String> = objects.iter().map(|object| object.id.clone()).collect();
    let wanted = loaded.objects.into_iter();
    for object in wanted.filter(|object| !without.contains(&object.id)) {
        if known.contains(&object.id) {
            let label = object.label();
            rejected.push(format!(
                "{name}: {label} is in an earlier file: keep one of the two"
            ));
        } else {
            objects.push(object);
        }
    }
    Ok(())
}

/// The object that `FILE` or `FILE:NAME` selects, see [`file_and_name`] and [`Loaded::pick`].
pub fn one(
    folder: &Folder,
    selector: &str,
    rejected: &mut Vec<String>,
) -> Result<Object, ConfigError> {
    Shelf::new(folder).one(selector, rejected)
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
    pub fn one(
        &mut self,
        selector: &str,
        rejected: &mut Vec<String>,
    ) -> Result<Object, ConfigError> {
        let (file, name) = file_and_name(selector, |file| self.folder.has(file));
        let loaded = match self.files.entry(file.to_string()) {
            Entry::Occupied(read) => read.into_mut(),
            Entry::Vacant(place) => place.insert(load(self.folder, file)?),
        };
        let object = loaded
            .find(name)
            .map_err(|why| ConfigError::Orbit(format!("{file}: {why}")))?;
        book(&loaded.rejected, rejected);
        Ok(object.clone())
    }
}

/// Adds what was refused, unless another use of the same file has told it already.
fn book(refused: &[Rejected], rejected: &mut Vec<String>) {
    let known: HashSet<String> = rejected.iter().cloned().collect();
    let lines = refused.iter().map(Rejected::to_string);
    rejected.extend(lines.filter(|line| !known.contains(line)));
}

fn load(folder: &Folder, name: &str) -> Result<Loaded, ConfigError> {
    let (file, text) = folder.read(name)?;
    skyloop_orbit::parse(&text, &file).map_err(|e| ConfigError::Orbit(e.to_string()))
}
