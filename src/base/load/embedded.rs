//! The built-in configuration files, so that the binary needs no other file.

macro_rules! files {
    ($($path:literal),* $(,)?) => {
        &[$(($path, include_str!(concat!("../../../configs/", $path)))),*]
    };
}

/// Every built-in file, with its path below `configs/`.
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

/// Names of the cameras in `configs/cameras/`.
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

/// A valid camera file; its table `spare` has valid values of the other keys.
pub const EXAMPLE_CAMERA: &str = concat!(
    include_str!("../../../configs/cameras/cots-wide.toml"),
    r#"
[spare.optics]
psf = { images = [{ file = "x", at_px = [0.0, 0.0] }], obscuration = 0.0, fwhm_px = 2.0, beta = 2.5, oversampling = 4.0, wavelength_exponent = 0.0 }
vignetting = { cos4 = false, table = [[0.0, 1.0]] }
[spare.radiation]
flux_cm2_s = 0.0
thickness_um = 10.0
[spare.timing]
row_us = 10.0
[spare.detector]
hot_fraction = 0.0
hot_e_s = 0.0
"#
);

/// Every key with its default.
pub const DEFAULT_TOML: &str = include_str!("../../../configs/default.toml");

/// Folder and file of the default scene.
pub const DEFAULT_SCENE: (&str, &str) = ("scenes/rcm-2019-06-15", "scene.toml");

/// The text of a built-in file.
pub(crate) fn file(path: &str) -> Option<&'static str> {
    let file = FILES.iter().find(|(known, _)| *known == path);
    file.map(|(_, text)| *text)
}
