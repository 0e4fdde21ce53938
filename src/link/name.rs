//! The name of a pseudo-terminal in the file system, a symbolic link.
//!
//! A killed run leaves its name behind, and the system reuses the device number. So the link has a
//! mark of skyloop: `/dev/pts/./N`, equivalent to `/dev/pts/N`. An abstract socket, which ends with
//! its process, shows whether the owner still runs. Nothing else is ever removed.

use super::lock::lock;
use skyloop_firmware_sim::port::Refusal;
use skyloop_orbit::path_text;
use skyloop_protocols::crc::Crc32;
use std::io;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{MetadataExt, symlink};
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Folder of the slave devices.
const DEVICES: &str = "/dev/pts/";
/// The same folder in the spelling that marks names of skyloop.
const OURS: &str = "/dev/pts/./";

/// A symbolic link to a device.
pub(super) struct Name {
    pub path: PathBuf,
    /// Reserves the name for this process while the socket exists.
    claim: Mutex<Option<UnixDatagram>>,
}

impl Name {
    /// Creates the link from `path` to `device`; replaces only the name of a run that has ended.
    pub fn create(path: &Path, device: &str) -> Result<Name, Refusal> {
        const FOLDER: &str = "choose a name in a folder that you may write";
        const OTHER: &str = "choose another name, or remove what is there";
        let claim = key(path).and_then(claim).map_err(|source| {
            let taken = source.kind() == io::ErrorKind::AlreadyExists;
            refused(source, if taken { "choose another name" } else { FOLDER })
        })?;
        if let Ok(found) = path.symlink_metadata() {
            if !(found.is_symlink() && is_stale(path, device)) {
                return Err(refused(io::ErrorKind::AlreadyExists.into(), OTHER));
            }
            std::fs::remove_file(path).map_err(|error| refused(error, FOLDER))?;
            tracing::warn!("{}: this name of a killed run is reused", path_text(path));
        }
        symlink(marked(device), path).map_err(|error| refused(error, FOLDER))?;
        Ok(Name {
            path: path.to_path_buf(),
            claim: Mutex::new(Some(claim)),
        })
    }

    /// Redirects the link to another device, if it leads to `from`.
    pub fn redirect(&self, from: &str, to: &str) -> io::Result<()> {
        if self.leads_to(from) {
            std::fs::remove_file(&self.path)?;
            symlink(marked(to), &self.path)?;
        }
        Ok(())
    }

    /// Removes the link, if it leads to `device`.
    pub fn remove(&self, device: &str) {
        if self.leads_to(device) {
            // It may have been removed already.
            let _ = std::fs::remove_file(&self.path);
        }
        drop(lock(&self.claim).take());
    }

    fn leads_to(&self, device: &str) -> bool {
        leads_to(&self.path, device)
    }
}

/// Whether two paths are the same name.
pub(super) fn is_same(a: &Path, b: &Path) -> bool {
    a == b || matches!((key(a), key(b)), (Ok(a), Ok(b)) if a == b)
}

fn refused(source: io::Error, remedy: &str) -> Refusal {
    Refusal {
        action: "give it that name",
        source,
        remedy: remedy.to_string(),
    }
}

/// Whether an unclaimed link was left by a run of skyloop that has ended. `device` is the new one.
fn is_stale(path: &Path, device: &str) -> bool {
    let Ok(to) = path.read_link() else {
        return false;
    };
    let to = to.as_os_str().as_bytes();
    to.starts_with(OURS.as_bytes())
        || leads_to(path, device)
        || (to.starts_with(DEVICES.as_bytes()) && !path.exists())
}

/// The comparison of paths ignores `.` components.
fn leads_to(path: &Path, device: &str) -> bool {
    path.read_link().is_ok_and(|to| to == Path::new(device))
}

fn marked(device: &str) -> String {
    match device.strip_prefix(DEVICES) {
        Some(number) => format!("{OURS}{number}"),
        None => device.to_string(),
    }
}

/// Socket name of a path, from its folder and its file name.
fn key(path: &Path) -> io::Result<String> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let folder = std::fs::metadata(folder)?;
    let name = path.file_name().unwrap_or(path.as_os_str());
    Ok(format!(
        "skyloop-pty {:x} {:x} {:08x}",
        folder.dev(),
        folder.ino(),
        Crc32::new().update(name.as_bytes()).finish()
    ))
}

fn claim(key: String) -> io::Result<UnixDatagram> {
    let address = SocketAddr::from_abstract_name(key)?;
    UnixDatagram::bind_addr(&address).map_err(|error| match error.kind() {
        io::ErrorKind::AddrInUse => {
            io::Error::new(io::ErrorKind::AlreadyExists, "a running skyloop has it")
        }
        _ => error,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(path: &Path, device: &str) -> io::ErrorKind {
        Name::create(path, device).err().unwrap().source.kind()
    }

    #[test]
    fn stale_name_is_reused_although_its_device_exists() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        // An existing device stands for another program's terminal with the reused number.
        for to in ["/dev/pts/./ptmx", "/dev/pts/./999999", "/dev/pts/999999"] {
            symlink(to, &path).unwrap();
            let name = Name::create(&path, "/dev/pts/5").ok().unwrap();
            assert_eq!(path.read_link().unwrap(), Path::new("/dev/pts/5"), "{to}");
            assert_eq!(refusal(&path, "/dev/pts/6"), io::ErrorKind::AlreadyExists);
            name.redirect("/dev/pts/5", "/dev/pts/7").unwrap();
            name.remove("/dev/pts/5");
            assert!(
                leads_to(&path, "/dev/pts/7"),
                "it belongs to another device now"
            );
            name.remove("/dev/pts/7");
            assert!(path.symlink_metadata().is_err());
        }
        // An unmarked name with the number of the new device.
        symlink("/dev/pts/ptmx", &path).unwrap();
        assert!(Name::create(&path, "/dev/pts/ptmx").is_ok());
    }

    #[test]
    fn files_of_others_are_unchanged() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("port");
        for to in ["/dev/pts/ptmx", "/dev/null", "nowhere"] {
            symlink(to, &path).unwrap();
            assert_eq!(refusal(&path, "/dev/pts/5"), io::ErrorKind::AlreadyExists);
            assert_eq!(path.read_link().unwrap(), Path::new(to));
            std::fs::remove_file(&path).unwrap();
        }
        std::fs::write(&path, "mine").unwrap();
        assert_eq!(refusal(&path, "/dev/pts/5"), io::ErrorKind::AlreadyExists);
        assert_eq!(std::fs::read(&path).unwrap(), b"mine");
        let nowhere = folder.path().join("no/port");
        assert_eq!(refusal(&nowhere, "/dev/pts/5"), io::ErrorKind::NotFound);
    }

    #[test]
    fn spellings_of_one_name_are_equal() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("in")).unwrap();
        let at = |text: &str| folder.path().join(text);
        assert!(is_same(&at("a"), &at("in/../a")) && is_same(Path::new("a"), Path::new("./a")));
        assert!(!is_same(&at("a"), &at("b")) && !is_same(&at("a"), &at("in/a")));
        assert!(is_same(&at("no/a"), &at("no/a")));
    }
}
