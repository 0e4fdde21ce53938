//! The configuration files that are built in, so that the binary needs no file beside it.

macro_rules! files {
    ($($path:literal),* $(,)?) => {
        &[$(($path, include_str!(concat!("../../configs/", $path)))),*]
    };
}

/// Every built-in file by its path below `configs/`.
const FILES: &[(&str, &str)] = files![
    "default.toml",
    "cameras/fai-nir.toml",
    "cameras/fai-630.toml",
    "cameras/rigel-l.toml",
    "cameras/cots-wide.toml",
    "cameras/cmos-rolling.toml",
    "cameras/ccd-transfer.toml",
    "cameras/all-sky.toml",
    "cameras/horizon.toml",
    "scenes/rcm-2019-06-15/scene.toml",
    "scenes/rcm-2019-06-15/cassiope-A.oem",
    "scenes/rcm-2019-06-15/cassiope-B.oem",
    "scenes/rcm-2019-06-15/rcm-1-A.oem",
    "scenes/rcm-2019-06-15/rcm-1-B.oem",
    "scenes/rcm-2019-06-15/rcm-2-A.oem",
    "scenes/rcm-2019-06-15/rcm-2-B.oem",
    "scenes/rcm-2019-06-15/rcm-3-A.oem",
    "scenes/rcm-2019-06-15/rcm-3-B.oem",
];

/// The bare names of the cameras in `configs/cameras/`.
pub const CAMERAS: &[&str] = &[
    "fai-nir",
    "fai-630",
    "rigel-l",
    "cots-wide",
    "cmos-rolling",
    "ccd-transfer",
    "all-sky",
    "horizon",
];

/// A valid camera file.
pub const EXAMPLE_CAMERA: &str = include_str!("../../configs/cameras/cots-wide.toml");

/// Every key with its default.
pub const DEFAULT_TOML: &str = include_str!("../../configs/default.toml");

/// Folder and file of the scene that runs where none is named.
pub const DEFAULT_SCENE: (&str, &str) = ("scenes/rcm-2019-06-15", "scene.toml");

/// The text of a built-in file.
pub fn file(path: &str) -> Option<&'static str> {
    FILES
        .iter()
        .find(|(p, _)| *p == path)
        .map(|(_, text)| *text)
}
