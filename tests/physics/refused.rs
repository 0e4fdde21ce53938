//! Invalid detector, particle and timing values of camera files are refused with file, key and
//! value. Doubtful ones give a warning.

use crate::table::check_refusals;
use skyloop::camera::Camera;
use skyloop::load::{CAMERAS, Folder};

fn built_in(name: &str) -> String {
    let file = format!("{name}.toml");
    Folder::Embedded("cameras").read(&file).unwrap().1
}

/// `ccd-transfer` with one key set, or added to the table that it belongs to.
fn with(key: &str, value: &str) -> String {
    let text = built_in("ccd-transfer");
    let (table, key) = key.split_once('.').unwrap();
    let line = format!("{key} = {value}");
    let old = text
        .lines()
        .find(|line| line.starts_with(&format!("{key} = ")));
    match old {
        Some(old) => text.replacen(old, &line, 1),
        None if text.contains(&format!("[{table}]")) => {
            text.replacen(&format!("[{table}]"), &format!("[{table}]\n{line}"), 1)
        }
        None => format!("{text}\n[{table}]\n{line}\n"),
    }
}

fn load(text: &str) -> Result<Camera, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.toml"), text).unwrap();
    let loaded = Camera::load("mine.toml", &Folder::Disk(folder.path().to_path_buf()));
    loaded.map_err(|error| error.to_string())
}

/// The refusal of `ccd-transfer` with this key and value: one line that names the file.
fn refusal(assignment: &str) -> String {
    let (key, value) = assignment.split_once(" = ").unwrap();
    let message = load(&with(key, value)).unwrap_err();
    assert!(message.contains("mine.toml"), "{assignment}: {message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

#[test]
fn numbers_out_of_range_are_refused() {
    for (key, min, max) in [
        ("detector.prnu", "0", "0.3"),
        ("detector.dark_e_s", "0", "1000000000 e-/s"),
        ("detector.dark_reference_c", "-200", "150 deg C"),
        ("detector.temperature_c", "-200", "150 deg C"),
        ("detector.dark_doubling_k", "1", "100 K"),
        ("detector.dark_nonuniformity", "0", "2"),
        ("detector.hot_fraction", "0", "0.1"),
        ("detector.hot_e_s", "0", "1000000000 e-/s"),
        ("detector.dead_fraction", "0", "0.1"),
        ("detector.stuck_fraction", "0", "0.1"),
        ("detector.stuck_dn", "0", "65535 DN"),
        ("detector.read_noise_e", "0", "1000000 e-"),
        ("detector.full_well_e", "1", "1000000000 e-"),
        ("detector.nonlinearity", "0", "0.5"),
        ("radiation.flux_cm2_s", "0", "1000000000 1/cm^2/s"),
        ("radiation.thickness_um", "0.1", "2000 um"),
        ("radiation.energy_mev", "50", "1000000 MeV"),
        ("radiation.diffusion_um", "0", "100 um"),
        ("radiation.readout_s", "0", "10000 s"),
        ("timing.row_us", "0.001", "1000000 us"),
    ] {
        check_refusals(
            &format!(
                "{key} = -300.0 | {key} = -300 | must be {min} to {max}\n\
                 {key} = 2e9 | {key} = 2000000000 | must be {min} to {max}\n\
                 {key} = nan | {key} = NaN | must be {min} to {max}\n\
                 {key} = inf | {key} = inf | must be {min} to {max}\n\
                 {key} = [true] | {key}: must be | {min} to {max}"
            ),
            refusal,
        );
    }
}

/// At 150 deg C dark current has doubled 28 times above its reference, to 3.4e8 times as much. 1e9
/// particles hit 0.59 cm^2 in 0.3 s.
const WORDS_AND_POSITIONS: &str = r#"
detector.blooming = "row" | detector.blooming = "row" | must be one of "none", "column"
radiation.flux_cm2_s = "leo" | radiation.flux_cm2_s = "leo" | a number or "orbit"
timing.shutter = "leaf" | timing.shutter = "leaf" | "frame-transfer"
detector.dead_px = [[0, 0], [512, 3]] | detector.dead_px[1] = [512, 3] | below [512, 512]
detector.stuck_px = [[0, 512]] | detector.stuck_px[0] = [0, 512] | below [512, 512]
detector.stuck_px = [[0, 5, 1]] | detector.stuck_px[0]:  | must have 2 values, not 3
detector.temperature_c = 150.0 | detector.temperature_c = 150 | dark current and hot pixels stay below 1e9 e-/s
radiation.flux_cm2_s = 1e9 | radiation.flux_cm2_s = 1000000000 | particles
"#;

/// Mistaken units (metres, per cent, kelvin, milliseconds), values out of range, and values that
/// are no numbers.
const VALUES: &str = r#"
optics.focal_length_mm = 0.036 | optics.focal_length_mm = 0.036 | must be 0.5 to 1000000 mm
detector.pixel_um = 15e-6 | detector.pixel_um = 0.000015 | must be 0.3 to 1000 um
detector.prnu = 0.5 | detector.prnu = 0.5 | 0 to 0.3, a share: 0.5 % is 0.005
detector.quantum_efficiency = 55 | detector.quantum_efficiency = 55 | a share: 55 % is 0.55
detector.temperature_c = 253.0 | detector.temperature_c = 253 | -200 to 150 deg C
timing.exposure_s = 200 | timing.rate_hz = 4: must be at most 0.00499 | Hz with timing.exposure_s = 200 s: exposures do not overlap
radiation.readout_s = 100.0 | radiation.readout_s = 100 | at most 1 / timing.rate_hz = 0.25 s
detector.offset_dn = 16383.0 | detector.offset_dn = 16383 | below 16383, the full scale of 14 bits
detector.read_noise_e = 2e5 | detector.read_noise_e = 200000 | at most detector.full_well_e = 100000 e-
detector.width_px = 512.5 | detector.width_px:  | must be a whole number, 1 to 8192 px, not 512.5
detector.adc_clips_first = 1 | detector.adc_clips_first:  | must be true or false, not 1
detector.gain_e_per_dn = \n | not TOML: gain_e_per_dn has no value | write gain_e_per_dn = value
detector.hot_fracton = 0.1 | detector.hot_fracton: unknown key `hot_fracton` | did you mean `hot_fraction`?
"#;

#[test]
fn invalid_words_positions_and_values_are_refused() {
    check_refusals(WORDS_AND_POSITIONS, refusal);
    check_refusals(VALUES, refusal);
    // 17,700 particles, each spread over 68 x 68 pixels at the two steps of its track.
    let wide = with("radiation.diffusion_um", "100.0").replace("\"orbit\"", "1e5");
    let message = load(&wide).unwrap_err();
    let max = "radiation.flux_cm2_s = 100000: must be at most 6.";
    assert!(message.contains(max), "{message}");
    load(&wide.replace("1e5", "6e4")).unwrap();
    // 100 px wide on pixels of one micrometre: every step of a track would cover the whole
    // detector.
    let fine = with("radiation.diffusion_um", "100.0").replace("pixel_um = 15.0", "pixel_um = 1.0");
    let thick = fine.replace("thickness_um = 15.0", "thickness_um = 200.0");
    let message = load(&thick).unwrap_err();
    for word in [": radiation.diffusion_um = 100", "thickness_um"] {
        assert!(message.contains(word), "{message}");
    }
}

#[test]
fn a_converter_that_clips_first_is_accepted() {
    assert!(load(&with("detector.full_well_e", "1e6")).is_ok());
    for name in CAMERAS {
        let camera = Camera::load(name, &Folder::current()).unwrap();
        let silenced = built_in(name).contains("adc_clips_first = true");
        let clips_first = camera.detector.converter_clips_first().is_some();
        assert_eq!(clips_first, silenced, "{name}");
    }
}

fn without(text: &str, key: &str) -> String {
    let start = format!("{key} = ");
    let lines = text.lines().filter(|line| !line.starts_with(&start));
    lines.map(|line| format!("{line}\n")).collect()
}

#[test]
fn a_key_without_its_required_key_is_refused() {
    let text = built_in("ccd-transfer");
    let stuck = with("detector.stuck_dn", "12.0");
    for (text, key, needs) in [
        (
            without(&text, "hot_e_s"),
            "hot_fraction",
            "detector.hot_e_s",
        ),
        (
            without(&text, "hot_fraction"),
            "hot_e_s",
            "detector.hot_fraction",
        ),
        (
            stuck,
            "stuck_dn",
            "detector.stuck_fraction or detector.stuck_px",
        ),
    ] {
        let message = load(&text).unwrap_err();
        let expected = format!(": detector.{key}: needs {needs}");
        assert!(message.contains(&expected), "{message}");
    }
    // An effect that is switched off explicitly needs no other key.
    let off = without(&with("detector.hot_fraction", "0.0"), "hot_e_s");
    assert!(load(&off).is_ok());
    let stuck = with("detector.stuck_dn", "12.0\nstuck_px = []");
    assert!(load(&stuck).is_ok());
}
