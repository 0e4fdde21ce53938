//! A plain camera with some keys of its file changed.

use skyloop::camera::Camera;
use skyloop::load::{ConfigError, Folder};

/// 64 x 64 px of 10 um behind 20 mm: 2,000 px a radian, no dark current, no read noise, 1 e-/DN.
const PLAIN: &str = r#"
name = "plain"
[optics]
focal_length_mm = 20.0
aperture_mm = 10.0
transmission = 0.8
band = "v"
[optics.psf]
kind = "gaussian"
sigma_px = 0.8
[detector]
width_px = 64
height_px = 64
pixel_um = 10.0
quantum_efficiency = 0.5
dark_e_s = 0.0
read_noise_e = 0.0
full_well_e = 60000.0
gain_e_per_dn = 1.0
offset_dn = 100.0
adc_bits = 16
[timing]
exposure_s = 0.1
rate_hz = 1.0
"#;

/// The plain camera with these keys: `table.key = value`, separated by `; `, values as in TOML.
pub fn try_camera(keys: &str) -> Result<Camera, ConfigError> {
    let mut table: toml::Table = PLAIN.parse().unwrap();
    for assignment in keys.split("; ").filter(|keys| !keys.is_empty()) {
        let (name, value) = assignment.split_once(" = ").unwrap();
        let (tables, key) = name.rsplit_once('.').unwrap();
        let mut at = &mut table;
        for step in tables.split('.') {
            let inner = at.entry(step).or_insert_with(|| toml::Table::new().into());
            at = inner.as_table_mut().unwrap();
        }
        let value: toml::Table = format!("value = {value}").parse().unwrap();
        at.insert(key.to_string(), value["value"].clone());
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("camera.toml"), table.to_string()).unwrap();
    Camera::load("camera.toml", &Folder::Disk(folder.path().to_path_buf()))
}

/// [`try_camera`] of valid keys.
pub fn camera(keys: &str) -> Camera {
    try_camera(keys).unwrap()
}
