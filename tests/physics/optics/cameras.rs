//! Camera files for tests.

use skyloop::camera::Camera;
use skyloop::load::{ConfigError, Folder};
use std::path::Path;

/// A camera of 200 x 160 pixels of 10 um with 20 mm f/2 optics; `optics` are lines below
/// `[optics]`, `tables` follow it.
pub fn text(optics: &str, tables: &str) -> String {
    format!(
        r#"name = "mine"
[optics]
focal_length_mm = 20.0
aperture_mm = 10.0
transmission = 0.8
band = [500.0, 700.0]
{optics}
{tables}
[detector]
width_px = 200
height_px = 160
pixel_um = 10.0
quantum_efficiency = 0.5
dark_e_s = 10.0
read_noise_e = 5.0
full_well_e = 50000.0
gain_e_per_dn = 4.0
offset_dn = 100.0
adc_bits = 14
[timing]
exposure_s = 0.1
rate_hz = 1.0
"#
    )
}

pub const GAUSSIAN: &str = "psf = { kind = \"gaussian\", sigma_px = 0.8 }";

pub fn load_in(folder: &Path, text: &str) -> Result<Camera, ConfigError> {
    std::fs::write(folder.join("mine.toml"), text).unwrap();
    Camera::load("mine.toml", &Folder::Disk(folder.to_path_buf()))
}

pub fn load(text: &str) -> Result<Camera, ConfigError> {
    load_in(tempfile::tempdir().unwrap().path(), text)
}
