//! Faults of camera files, and that the JSON Schema has the limits of the loader.

use super::*;
use crate::load::{agree, both};

/// The text of a camera file, with these tables for the point spread function and whatever follows it.
fn file(psf: &str) -> String {
    format!(
        r#"
name = "X"
[optics]
focal_length_mm = 20.0
aperture_mm = 10.0
transmission = 0.8
band = [400.0, 900.0]
projection = {{ model = "brown-conrady", k = [0.001], p = [0.0, 0.0], strength = 1.0 }}
vignetting = {{ table = [[0.0, 1.0], [40.0, 0.5]] }}
stray = {{ pst = [[0.0, 1e-3], [90.0, 1e-9]], sun_exclusion_deg = 40.0 }}
psf = {psf}
[detector]
width_px = 64
height_px = 64
pixel_um = 5.0
quantum_efficiency = 0.5
dark_e_s = 10.0
dark_reference_c = 20.0
temperature_c = 20.0
dark_doubling_k = 6.5
dark_nonuniformity = 0.1
hot_fraction = 0.001
hot_e_s = 100.0
prnu = 0.01
dead_fraction = 0.001
stuck_fraction = 0.001
read_noise_e = 5.0
full_well_e = 10000.0
blooming = "column"
nonlinearity = 0.01
gain_e_per_dn = 3.0
offset_dn = 30.0
stuck_dn = 4095.0
adc_bits = 12
[radiation]
flux_cm2_s = 1.0
thickness_um = 10.0
energy_mev = 534.0
diffusion_um = 1.0
readout_s = 0.01
[timing]
exposure_s = 0.1
rate_hz = 5.0
shutter = "rolling"
row_us = 10.0
[mounting]
misalignment_arcsec = [0.0, 0.0, 0.0]
"#
    )
}

const GAUSSIAN: &str = "{ kind = \"gaussian\", sigma_px = 0.8, width_by_field = [[0.0, 1.0], [2.0, 1.5]], wavelength_exponent = 1.0 }";

fn load(text: &str) -> Option<String> {
    let read = parse("camera.toml", text, &Folder::current());
    read.err().map(|error| error.to_string())
}

#[test]
fn the_schema_has_the_loaders_limits() {
    let bases = [
        GAUSSIAN,
        "{ kind = \"airy\", obscuration = 0.3 }",
        "{ kind = \"moffat\", fwhm_px = 2.0, beta = 2.5 }",
        "{ kind = \"image\", images = [{ file = \"no\", at_px = [1.0, 1.0] }], oversampling = 4.0 }",
    ]
    .map(file);
    agree(
        &schema(),
        LIMITS,
        &bases.each_ref().map(String::as_str),
        load,
    );
}

/// A fault: text of the file, its replacement, the lines that are reported, and the keys that it concerns.
type Fault = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

/// Each is reported once whatever else is wrong with other keys than its own.
const FAULTS: &[Fault] = &[
    (
        "\"X\"",
        "3",
        "name: must be a text of 1 to 60 characters in quotes, not 3",
        &["name"],
    ),
    (
        "aperture_mm = 10.0",
        "aperture_mm = 1e9",
        "optics.aperture_mm = 1000000000: must be 0.01 to 100000 mm",
        &["aperture"],
    ),
    (
        "transmission = 0.8",
        "transmission = \"a\"",
        "optics.transmission: must be 0 to 1, not \"a\"",
        &["transmission"],
    ),
    (
        "[400.0, 900.0]",
        "[900.0, 400.0]",
        "optics.band = [900, 400]",
        &["band"],
    ),
    (
        "k = [0.001]",
        "k = [1.0, 1.0, 1.0, 1.0]",
        "optics.projection.k",
        &["field"],
    ),
    (
        "model = ",
        "kind = ",
        "optics.projection.kind: unknown key `kind`, known: model, k, p, strength",
        &["field"],
    ),
    (
        "strength = 1.0",
        "strength = true",
        "optics.projection.strength: must be 0 to 100, not true",
        &["field"],
    ),
    (
        "[40.0, 0.5]",
        "[-40.0, 0.5]",
        "optics.vignetting.table[1][0] = -40: must be 0 to 180 deg",
        &["field"],
    ),
    (
        "{ table = ",
        "{ cos4 = true, table = ",
        "optics.vignetting.cos4",
        &["field"],
    ),
    (
        "pst = [[0.0, 1e-3], [90.0, 1e-9]], sun_exclusion_deg = 40.0",
        "a = 1",
        "optics.stray.a: unknown key `a`, known: pst, sun_exclusion_deg",
        &[
            "pst",
            "exclusion",
            "field",
            "width",
            "height",
            "pitch",
            "psf",
        ],
    ),
    (
        "sun_exclusion_deg = 40.0",
        "sun_exclusion_deg = 0.1",
        "optics.stray.sun_exclusion_deg = 0.1",
        &["field", "width", "height", "pitch", "psf"],
    ),
    (
        "sun_exclusion_deg = 40.0",
        "sun_exclusion_deg = 181",
        "optics.stray.sun_exclusion_deg = 181: must be 0 to 180 deg",
        &["exclusion"],
    ),
    (
        "[90.0, 1e-9]",
        "[90.0, 1e-1]",
        "optics.stray.pst[1]",
        &["pst"],
    ),
    (
        "[[0.0, 1e-3], [90.0, 1e-9]]",
        "[[\"a\", 1e-3], [0.5, 1e-4], [-1.0, true], [90.0, 2.0], 7]",
        "optics.stray.pst[0][0]: must be 0 to 180 deg, not \"a\"
optics.stray.pst[2][0] = -1: must be 0 to 180 deg
optics.stray.pst[2][1]: must be 0.000000000001 to 1, not true
optics.stray.pst[3][1] = 2: must be 0.000000000001 to 1
optics.stray.pst[4]: must be a list of 2 values, not 7",
        &["pst"],
    ),
    (
        "sigma_px = 0.8",
        "sigma_px = 800",
        "optics.psf.sigma_px = 800",
        &["psf"],
    ),
    (
        "kind = \"gaussian\"",
        "kind = \"x\"",
        "optics.psf.kind = \"x\"",
        &["psf"],
    ),
    (
        "width_px = 64",
        "width_px = -1",
        "detector.width_px: must be a whole number, 1 to 8192 px, not -1",
        &["width"],
    ),
    (
        "height_px = 64",
        "height_px = 2.5",
        "detector.height_px: must be a whole number, 1 to 8192 px, not 2.5",
        &["height"],
    ),
    (
        "pixel_um = 5.0",
        "pixel_um = 1e400",
        "detector.pixel_um: must be 0.3 to 1000 um, not 1e400",
        &["pitch"],
    ),
    (
        "quantum_efficiency = 0.5\n",
        "",
        "the key `quantum_efficiency` is missing",
        &["efficiency"],
    ),
    (
        "dark_e_s = 10.0",
        "dark_e_ss = 10.0",
        "unknown key `dark_e_ss`",
        &["dark"],
    ),
    (
        "dark_e_s = 10.0\n",
        "dark_e_s = 9e8\n",
        "detector.temperature_c = 46.5",
        &["dark", "warm"],
    ),
    (
        "dark_doubling_k = 6.5",
        "dark_doubling_k = nan",
        "detector.dark_doubling_k = NaN: must be 1 to 100 K",
        &["dark", "doubling"],
    ),
    (
        "hot_fraction = 0.001\n",
        "",
        "detector.hot_e_s: needs detector.hot_fraction",
        &["hot", "dark"],
    ),
    (
        "prnu = 0.01",
        "prnu = 0.01\ndead_px = [[64, 2]]",
        "detector.dead_px[0] = [64, 2]",
        &["width", "height"],
    ),
    (
        "prnu = 0.01",
        "prnu = 0.01\nstuck_px = [[1, 2, 3]]",
        "detector.stuck_px[0]: must have 2 values, not 3",
        &["stuck"],
    ),
    (
        "prnu = 0.01",
        "prnu = 0.01\ndead_px = [[64, 2], [1], [1, 2], [-1, 99], [2, 99]]",
        "detector.dead_px[0] = [64, 2]
detector.dead_px[1]: must have 2 values, not 1
detector.dead_px[3][0]: must be a whole number, 0 to 4294967295, not -1
detector.dead_px[4] = [2, 99]",
        &["width", "height"],
    ),
    (
        "read_noise_e = 5.0",
        "read_noise_e = 50000.0",
        "detector.read_noise_e = 50000: must be at most",
        &["well"],
    ),
    (
        "full_well_e = 10000.0",
        "full_well_e = 0",
        "detector.full_well_e = 0: must be 1 to",
        &["well"],
    ),
    (
        "blooming = \"column\"",
        "blooming = 3",
        "detector.blooming: must be one of \"none\", \"column\", not 3",
        &["blooming"],
    ),
    (
        "offset_dn = 30.0",
        "offset_dn = 5000.0",
        "detector.offset_dn = 5000: must be 0 to 4095 DN",
        &["bits"],
    ),
    (
        "stuck_dn = 4095.0",
        "stuck_dn = 70000",
        "detector.stuck_dn = 70000: must be 0 to 65535 DN",
        &["digit"],
    ),
    (
        "adc_bits = 12",
        "adc_bits = 99",
        "detector.adc_bits = 99: must be 1 to 16 bits",
        &["bits"],
    ),
    (
        "flux_cm2_s = 1.0",
        "flux_cm2_s = true",
        "radiation.flux_cm2_s: must be \"orbit\" or 0 to 1000000000 1/cm^2/s, not true",
        &["flux"],
    ),
    (
        "thickness_um = 10.0",
        "thickness_um = 0",
        "radiation.thickness_um = 0: must be 0.1 to 2000 um",
        &["thickness"],
    ),
    (
        "readout_s = 0.01",
        "readout_s = 1.0",
        "radiation.readout_s = 1: must be at most",
        &["rate"],
    ),
    (
        "rate_hz = 5.0",
        "rate_hz = 400.0",
        "timing.rate_hz = 400: must be at most",
        &["rate", "exposure", "shutter", "height"],
    ),
    (
        "exposure_s = 0.1",
        "exposure_s = \"a\"",
        "timing.exposure_s: must be ",
        &["exposure"],
    ),
    (
        "shutter = \"rolling\"",
        "shutter = \"global\"",
        "timing.row_us: rows take turns",
        &["shutter"],
    ),
    (
        "row_us = 10.0\n",
        "",
        "timing.row_us: timing.shutter = \"rolling\" needs",
        &["shutter"],
    ),
    (
        "[0.0, 0.0, 0.0]",
        "[0.0, 99999.0, 0.0]",
        "mounting.misalignment_arcsec[1] = 99999",
        &["mounting"],
    ),
    (
        "[0.0, 0.0, 0.0]",
        "[\"a\", 99999.0, true]",
        "mounting.misalignment_arcsec[0]: must be -36000 to 36000 arcsec, not \"a\"
mounting.misalignment_arcsec[1] = 99999: must be
mounting.misalignment_arcsec[2]: must be -36000 to 36000 arcsec, not true",
        &["mounting"],
    ),
];

#[test]
fn every_fault_of_a_file_is_reported_whatever_the_others() {
    let base = file(GAUSSIAN).replace("temperature_c = 20.0", "temperature_c = 46.5");
    let base = base.replace("dark_reference_c = 46.5", "dark_reference_c = 20.0");
    assert_eq!(load(&base), None);
    // SplitMix64 (Steele, Lea and Flood 2014).
    let mut state = 41u64;
    let mut draw = |most: usize| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((word ^ word >> 31) % most as u64) as usize
    };
    let singles = (0..FAULTS.len()).map(|one| vec![one]);
    let many: Vec<Vec<usize>> = (0..150)
        .map(|_| {
            let wanted = 2 + draw(14);
            (0..60).fold(Vec::new(), |mut all: Vec<usize>, _| {
                let one = draw(FAULTS.len());
                let concerns = |other: &usize| {
                    let (from, .., keys) = FAULTS[*other];
                    from == FAULTS[one].0 || keys.iter().any(|key| FAULTS[one].3.contains(key))
                };
                if all.len() < wanted && !all.iter().any(concerns) {
                    all.push(one);
                }
                all
            })
        })
        .collect();
    for faults in singles.chain(many) {
        let mut text = base.clone();
        for (from, to, ..) in faults.iter().map(|one| FAULTS[*one]) {
            assert!(text.contains(from), "{from}: {text}");
            text = text.replacen(from, to, 1);
        }
        let error = load(&text).unwrap_or_else(|| panic!("accepted: {text}"));
        let lines = faults.iter().flat_map(|one| FAULTS[*one].2.lines());
        for words in lines.clone() {
            assert!(error.contains(words), "{words} is not in: {error}");
        }
        let found = error.lines().filter(|line| !line.ends_with(" faults:"));
        assert_eq!(found.count(), lines.count(), "{faults:?}: {error}");
    }
}

#[test]
fn schema_and_loader_agree_on_keys_that_go_together() {
    let base = file(GAUSSIAN);
    for (from, to, is_valid) in [
        ("X", "X", true),
        ("X", " Kamera Nº 1 ", true),
        ("X", " ", false),
        ("X", "A\\n", false),
        ("X", "A\\u0007", false),
        ("X", "A\\u009b", false),
        ("row_us = 10.0", "", false),
        ("shutter = \"rolling\"", "", false),
        ("shutter = \"rolling\"", "shutter = \"global\"", false),
        ("model = \"brown-conrady\", ", "", false),
        ("brown-conrady", "pinhole", false),
        ("brown-conrady", "fisheye", false),
        ("k = [0.001], ", "", false),
        ("sigma_px = 0.8, ", "", false),
        ("sigma_px = 0.8", "fwhm_px = 0.8", false),
        ("kind = \"gaussian\"", "kind = \"airy\"", false),
        (
            "vignetting = { table",
            "vignetting = { cos4 = true, table",
            false,
        ),
        (
            "vignetting = { table",
            "vignetting = { cos4 = false, table",
            true,
        ),
        ("band = [400.0, 900.0]", "band = \"v\"", true),
        ("band = [400.0, 900.0]", "band = \"w\"", false),
        ("flux_cm2_s = 1.0", "flux_cm2_s = \"orbit\"", true),
        ("flux_cm2_s = 1.0", "flux_cm2_s = \"all\"", false),
        // Values without their keys are no table.
        (
            "{ pst = [[0.0, 1e-3], [90.0, 1e-9]], sun_exclusion_deg = 40.0 }",
            "[[[0.0, 1e-3], [90.0, 1e-9]], 40.0]",
            false,
        ),
        ("{ table = [[0.0, 1.0], [40.0, 0.5]] }", "[false]", false),
        ("[radiation]", "[[radiation]]", false),
        ("[timing]", "[[timing]]", false),
        ("[mounting]", "[[mounting]]", false),
        ("[detector]", "[[detector]]", false),
    ] {
        assert!(base.contains(from), "{from}");
        both(&schema(), &base.replacen(from, to, 1), load, is_valid);
    }
    for name in CAMERAS {
        let (_, text) = Folder::Embedded("cameras")
            .read(&format!("{name}.toml"))
            .unwrap();
        let load = |text: &str| {
            parse(name, text, &Folder::Embedded("cameras"))
                .err()
                .map(|e| e.to_string())
        };
        both(&schema(), &text, load, true);
    }
}
