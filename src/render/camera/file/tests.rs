//! Faults of camera files, and agreement of the JSON Schema with the limits of the loader.

use super::*;
use rayon::prelude::*;
use skyloop_base::load::{agree, both};

/// The text of a camera file with this table for the point spread function.
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
        &Camera::schema(),
        LIMITS,
        &bases.each_ref().map(String::as_str),
        load,
    );
}

/// A fault per entry: text of the file, its replacement, and in brackets the affected keys; below,
/// the reported lines. Each fault is reported once, independent of faults of other keys.
const FAULTS: &str = r#"
"X" => 3 [name]
    name: must be a text of 1 to 60 characters in quotes, not 3
aperture_mm = 10.0 => aperture_mm = 1e9 [aperture]
    optics.aperture_mm = 1000000000: must be 0.01 to 100000 mm
transmission = 0.8 => transmission = "a" [transmission]
    optics.transmission: must be 0 to 1, not "a"
[400.0, 900.0] => [900.0, 400.0] [band]
    optics.band = [900, 400]
k = [0.001] => k = [1.0, 1.0, 1.0, 1.0] [field]
    optics.projection.k
model => kind [field]
    optics.projection.kind: unknown key `kind`, known: model, k, p, strength
strength = 1.0 => strength = true [field]
    optics.projection.strength: must be 0 to 100, not true
[40.0, 0.5] => [-40.0, 0.5] [field]
    optics.vignetting.table[1][0] = -40: must be 0 to 180 deg
{ table => { cos4 = true, table [field]
    optics.vignetting.cos4
pst = [[0.0, 1e-3], [90.0, 1e-9]], sun_exclusion_deg = 40.0 => a = 1 [pst exclusion field width height pitch psf]
    optics.stray.a: unknown key `a`, known: pst, sun_exclusion_deg
sun_exclusion_deg = 40.0 => sun_exclusion_deg = 0.1 [field width height pitch psf]
    optics.stray.sun_exclusion_deg = 0.1
sun_exclusion_deg = 40.0 => sun_exclusion_deg = 181 [exclusion]
    optics.stray.sun_exclusion_deg = 181: must be 0 to 180 deg
[90.0, 1e-9] => [90.0, 1e-1] [pst]
    optics.stray.pst[1]
[[0.0, 1e-3], [90.0, 1e-9]] => [["a", 1e-3], [0.5, 1e-4], [-1.0, true], [90.0, 2.0], 7] [pst]
    optics.stray.pst[0][0]: must be 0 to 180 deg, not "a"
    optics.stray.pst[2][0] = -1: must be 0 to 180 deg
    optics.stray.pst[2][1]: must be 0.000000000001 to 1, not true
    optics.stray.pst[3][1] = 2: must be 0.000000000001 to 1
    optics.stray.pst[4]: must be a list of 2 values, not 7
sigma_px = 0.8 => sigma_px = 800 [psf]
    optics.psf.sigma_px = 800
kind = "gaussian" => kind = "x" [psf]
    optics.psf.kind = "x"
width_px = 64 => width_px = -1 [width]
    detector.width_px: must be a whole number, 1 to 8192 px, not -1
height_px = 64 => height_px = 2.5 [height]
    detector.height_px: must be a whole number, 1 to 8192 px, not 2.5
pixel_um = 5.0 => pixel_um = 1e400 [pitch]
    detector.pixel_um: must be 0.3 to 1000 um, not 1e400
quantum_efficiency = 0.5 =>  [efficiency]
    the key `quantum_efficiency` is missing
dark_e_s = 10.0 => dark_e_ss = 10.0 [dark]
    unknown key `dark_e_ss`
dark_e_s = 10.0 => dark_e_s = 9e8 [dark warm]
    detector.temperature_c = 46.5
dark_doubling_k = 6.5 => dark_doubling_k = nan [dark doubling]
    detector.dark_doubling_k = NaN: must be 1 to 100 K
hot_fraction = 0.001 =>  [hot dark]
    detector.hot_e_s: needs detector.hot_fraction
prnu = 0.01 => prnu = 0.01\ndead_px = [[64, 2]] [width height]
    detector.dead_px[0] = [64, 2]
prnu = 0.01 => prnu = 0.01\nstuck_px = [[1, 2, 3]] [stuck]
    detector.stuck_px[0]: must have 2 values, not 3
prnu = 0.01 => prnu = 0.01\ndead_px = [[64, 2], [1], [1, 2], [-1, 99], [2, 99]] [width height]
    detector.dead_px[0] = [64, 2]
    detector.dead_px[1]: must have 2 values, not 1
    detector.dead_px[3][0]: must be a whole number, 0 to 4294967295, not -1
    detector.dead_px[4] = [2, 99]
read_noise_e = 5.0 => read_noise_e = 50000.0 [well]
    detector.read_noise_e = 50000: must be at most
full_well_e = 10000.0 => full_well_e = 0 [well]
    detector.full_well_e = 0: must be 1 to
blooming = "column" => blooming = 3 [blooming]
    detector.blooming: must be one of "none", "column", not 3
offset_dn = 30.0 => offset_dn = 5000.0 [bits]
    detector.offset_dn = 5000: must be 0 to 4095 DN
stuck_dn = 4095.0 => stuck_dn = 70000 [digit]
    detector.stuck_dn = 70000: must be 0 to 65535 DN
adc_bits = 12 => adc_bits = 99 [bits]
    detector.adc_bits = 99: must be 1 to 16 bits
flux_cm2_s = 1.0 => flux_cm2_s = true [flux]
    radiation.flux_cm2_s: must be "orbit" or 0 to 1000000000 1/cm^2/s, not true
thickness_um = 10.0 => thickness_um = 0 [thickness]
    radiation.thickness_um = 0: must be 0.1 to 2000 um
readout_s = 0.01 => readout_s = 1.0 [rate]
    radiation.readout_s = 1: must be at most
rate_hz = 5.0 => rate_hz = 400.0 [rate exposure shutter height]
    timing.rate_hz = 400: must be at most
exposure_s = 0.1 => exposure_s = "a" [exposure]
    timing.exposure_s: must be 
shutter = "rolling" => shutter = "global" [shutter]
    timing.row_us: means nothing to shutter
row_us = 10.0 =>  [shutter]
    timing.row_us: the key `row_us` is missing: shutter "rolling" needs
[0.0, 0.0, 0.0] => [0.0, 99999.0, 0.0] [mounting]
    mounting.misalignment_arcsec[1] = 99999
[0.0, 0.0, 0.0] => ["a", 99999.0, true] [mounting]
    mounting.misalignment_arcsec[0]: must be -36000 to 36000 arcsec, not "a"
    mounting.misalignment_arcsec[1] = 99999: must be
    mounting.misalignment_arcsec[2]: must be -36000 to 36000 arcsec, not true
"#;

struct Fault {
    from: &'static str,
    to: String,
    keys: Vec<&'static str>,
    reported: Vec<&'static str>,
}

/// The faults of [`FAULTS`].
fn faults() -> Vec<Fault> {
    let mut faults: Vec<Fault> = Vec::new();
    for line in FAULTS.trim().lines() {
        if let Some(reported) = line.strip_prefix("    ") {
            faults.last_mut().unwrap().reported.push(reported);
            continue;
        }
        let (from, to) = line.split_once(" => ").unwrap();
        let (to, keys) = to.rsplit_once(" [").unwrap();
        faults.push(Fault {
            from,
            to: to.replace("\\n", "\n"),
            keys: keys.trim_end_matches(']').split(' ').collect(),
            reported: Vec::new(),
        });
    }
    faults
}

#[test]
fn every_fault_is_reported_independently() {
    let base = file(GAUSSIAN).replace("temperature_c = 20.0", "temperature_c = 46.5");
    let base = base.replace("dark_reference_c = 46.5", "dark_reference_c = 20.0");
    assert_eq!(load(&base), None);
    // SplitMix64 (Steele, Lea and Flood 2014).
    let mut state = 41u64;
    let mut draw = |count: usize| {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = (state ^ state >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ word >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((word ^ word >> 31) % count as u64) as usize
    };
    let all = faults();
    let singles = (0..all.len()).map(|one| vec![one]);
    let many: Vec<Vec<usize>> = (0..150)
        .map(|_| {
            let wanted = 2 + draw(14);
            (0..60).fold(Vec::new(), |mut chosen: Vec<usize>, _| {
                let one = draw(all.len());
                let Fault { from, keys, .. } = &all[one];
                let concerns = |other: &usize| {
                    let other = &all[*other];
                    other.from == *from || other.keys.iter().any(|key| keys.contains(key))
                };
                if chosen.len() < wanted && !chosen.iter().any(concerns) {
                    chosen.push(one);
                }
                chosen
            })
        })
        .collect();
    let cases: Vec<_> = singles.chain(many).collect();
    cases.par_iter().for_each(|chosen| {
        let faults = || chosen.iter().map(|one| &all[*one]);
        let mut text = base.clone();
        for Fault { from, to, .. } in faults() {
            assert!(text.contains(from), "{from}: {text}");
            text = text.replacen(from, to, 1);
        }
        let error = load(&text).unwrap_or_else(|| panic!("accepted: {text}"));
        let reported: Vec<&str> = faults().flat_map(|fault| fault.reported.clone()).collect();
        for words in &reported {
            assert!(error.contains(words), "{words} is not in: {error}");
        }
        let found = error.lines().filter(|line| !line.ends_with(" faults:"));
        assert_eq!(found.count(), reported.len(), "{chosen:?}: {error}");
    });
}

#[test]
fn schema_and_loader_agree_on_combined_keys() {
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
        // Values without their keys are not a table.
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
        both(
            &Camera::schema(),
            &base.replacen(from, to, 1),
            load,
            is_valid,
        );
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
        both(&Camera::schema(), &text, load, true);
    }
}
