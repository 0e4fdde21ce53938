//! Orbit files (TLE, 3LE, OEM) by name.

use super::{ConfigError, Folder};
use skyloop_orbit::{Loaded, Object, Rejected};

/// Every object of a file; what is wrong with its other records goes to `rejected`.
pub fn all(
    folder: &Folder,
    name: &str,
    rejected: &mut Vec<String>,
) -> Result<Vec<Object>, ConfigError> {
    let loaded = load(folder, name)?;
    rejected.extend(loaded.rejected.iter().map(Rejected::to_string));
    Ok(loaded.objects)
}

/// The object that `FILE` or `FILE:NAME` selects, see [`Loaded::pick`].
pub fn one(
    folder: &Folder,
    selector: &str,
    rejected: &mut Vec<String>,
) -> Result<Object, ConfigError> {
    let (file, name) = match (folder.read(selector), selector.rsplit_once(':')) {
        (Err(_), Some((file, name))) => (file, Some(name)),
        _ => (selector, None),
    };
    let (object, refused) = load(folder, file)?
        .pick(name)
        .map_err(|why| ConfigError::Orbit(format!("{file}: {why}")))?;
    rejected.extend(refused.iter().map(Rejected::to_string));
    Ok(object)
}

fn load(folder: &Folder, name: &str) -> Result<Loaded, ConfigError> {
    let (file, text) = folder.read(name)?;
    skyloop_orbit::parse(&text, &file).map_err(|e| ConfigError::Orbit(e.to_string()))
}
