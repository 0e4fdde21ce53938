//! Orbit files (TLE, 3LE, OEM) by name.

use super::{ConfigError, Folder};
use skyloop_orbit::{Loaded, Object};

/// Every object of a file.
pub fn all(folder: &Folder, name: &str) -> Result<Loaded, ConfigError> {
    let (file, text) = folder.read(name)?;
    skyloop_orbit::parse(&text, &file).map_err(|e| ConfigError::Orbit(e.to_string()))
}

/// The object that `FILE` or `FILE:NAME` selects; NAME is an id, the number in it, or a name of it.
pub fn one(folder: &Folder, selector: &str) -> Result<Object, ConfigError> {
    let (file, wanted) = match (folder.read(selector), selector.rsplit_once(':')) {
        (Err(_), Some((file, wanted))) => (file, Some(wanted)),
        _ => (selector, None),
    };
    let Loaded {
        mut objects,
        rejected,
    } = all(folder, file)?;
    let refuse = |reason: String| ConfigError::Orbit(format!("{file}: {reason}"));
    if let (true, Some(first)) = (objects.is_empty(), rejected.first()) {
        return Err(ConfigError::Orbit(first.to_string()));
    }
    let known = objects
        .iter()
        .take(8)
        .map(|o| o.id.clone())
        .collect::<Vec<_>>()
        .join(", ");
    match wanted {
        None if objects.len() == 1 => Ok(objects.remove(0)),
        None => Err(refuse(format!(
            "{} objects: pick one as FILE:NAME ({known})",
            objects.len()
        ))),
        Some(wanted) => objects
            .into_iter()
            .find(|o| {
                let number = o.id.strip_prefix("NORAD ");
                o.id == wanted || number == Some(wanted) || o.names.iter().any(|n| n == wanted)
            })
            .ok_or_else(|| refuse(format!("no object {wanted:?}; it has {known}"))),
    }
}
