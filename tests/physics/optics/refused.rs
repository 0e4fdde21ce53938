//! Invalid optics in camera files are refused in one line, with file, key and value.

use super::cameras::{GAUSSIAN, load_in, text};

/// Table, its keys between semicolons, and the parts of the message.
const REFUSED: &str = r#"
optics.psf | kind = "round" | optics.psf.kind = "round" | "gaussian", "airy", "moffat", "image"
optics.psf | kind = "gaussian" | optics.psf.sigma_px | missing
optics.psf | kind = "gaussian"; sigma_px = -0.5 | optics.psf.sigma_px = -0.5 | 0.01 to 100
optics.psf | kind = "gaussian"; sigma_px = 1.0; beta = 2.0 | optics.psf.beta | means nothing to kind "gaussian"
optics.psf | kind = "airy"; obscuration = 0.95 | optics.psf.obscuration = 0.95 | 0 to 0.9
optics.psf | kind = "airy"; wavelength_exponent = 1.0 | optics.psf.wavelength_exponent | means nothing to kind "airy"
optics.psf | kind = "moffat"; fwhm_px = 1.0; beta = 1.2 | optics.psf.beta = 1.2 | 1.5 to 20
optics.psf | kind = "moffat"; fwhm_px = 0.0; beta = 2.0 | optics.psf.fwhm_px = 0 | 0.02 to 20
optics.psf | kind = "gaussian"; sigma_px = 1.0; wavelength_exponent = nan | optics.psf.wavelength_exponent = NaN | -4 to 4
optics.psf | kind = "gaussian"; sigma_px = 1.0; width_by_field = [[1.0, 1.0], [1.0, 1.5]] | optics.psf.width_by_field[1] = [1.0, 1.5] | greater angle than the point before it, [1.0, 1.0]
optics.psf | kind = "gaussian"; sigma_px = 1.0; width_by_field = [[1.0, 0.0]] | optics.psf.width_by_field[0][1] = 0 | 0.1 to 10
optics.psf | kind = "gaussian"; sigma_px = 1.0; width_by_field = [[1.0, 1.0], [95.0, 1.0]] | optics.psf.width_by_field[1][0] = 95 | below 90.00 deg
optics.psf | kind = "gaussian"; sigma_px = 1.0; width_by_field = [[1.0, 1.0, 2.0]] | optics.psf.width_by_field[0]: must have 2 values, not 3
optics.psf | kind = "moffat"; fwhm_px = 15.0; beta = 2.0; width_by_field = [[0.0, 1.0], [3.0, 1.5]] | optics.psf.fwhm_px | 15.00 px comes to 22.50 px, by 1.5 in the field (optics.psf.width_by_field) | at most 20 px
optics.psf | kind = "gaussian"; sigma_px = 50.0; width_by_field = [[0.0, 2.1]] | optics.psf.sigma_px | by 2.1 in the field | at most 100 px
optics.psf | kind = "gaussian"; sigma_px = 95.0; wavelength_exponent = 4.0 | optics.psf.sigma_px | with the colour of stars (power 4) | at most 100 px
optics.psf | kind = "moffat"; fwhm_px = 19.0; beta = 1.5; wavelength_exponent = -4.0 | optics.psf.fwhm_px | with the colour of stars (power -4) | at most 20 px
optics.psf | kind = "image"; oversampling = 2 | optics.psf.images | missing
optics.psf | kind = "image"; oversampling = 0.5; images = [{ file = "good.csv" }] | optics.psf.oversampling = 0.5 | 1 to 64
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "short.csv" }] | optics.psf.images[0].file = | short.csv with a sum of 0.97 | sum to 1 within 0.001: divide each by 0.97
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "below.csv" }] | optics.psf.images[0].file | below.csv with a sample of -0.1 in line 2 | 0 or more
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "ragged.csv" }] | optics.psf.images[0].file | ragged.csv: samples in line 3: 1, in line 1: 2 | every row needs as many
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "empty.csv" }] | optics.psf.images[0].file | empty.csv: no samples
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "counts.csv" }] | optics.psf.images[0].file | counts.csv with a sum of 2000: | divide each by 2000
optics.psf | kind = "image"; oversampling = 2; images = [] | optics.psf.images = []: must be at least one { file
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "words.csv" }] | optics.psf.images[0].file | words.csv: line 1: "half" is no number
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "none.csv" }] | optics.psf.images[0].file | none.csv | No such file | check the path
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "good.csv" }, { file = "good.csv", at_px = [1.0, 2.0] }] | optics.psf.images[0].at_px | missing | one of several
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "good.csv", at_px = [1.0, 2e9] }] | optics.psf.images[0].at_px[1] = 2000000000
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "good.csv", at_px = [1.0, 2.0, 3.0] }] | optics.psf.images[0].at_px: must have 2 values, not 3
optics.psf | kind = "image"; oversampling = 2; images = [{ file = "good.csv", at_px = [1.0, 2.0] }, { file = "good.csv", at_px = [5.0, 9.0] }] | optics.psf.images | crossings of a grid
optics.psf | kind = "gaussian"; sigma_px = 1.0; width_by_field = [] | optics.psf.width_by_field = [] | at least one [angle, factor]
optics.psf | kind = "gaussian"; sigma_px = 110.0 | optics.psf.sigma_px = 110: must be 0.01 to 100 px
optics.psf | kind = "gaussian"; sigma = 1.0 | optics.psf.sigma: unknown key `sigma`: did you mean `sigma_px`?
optics.psf | kind = "gaussian"; sigma_px = "1" | optics.psf.sigma_px: must be 0.01 to 100 px, not "1"
optics.psf | kind = "gaussian"; sigma_px = | not TOML: sigma_px has no value: write sigma_px = value
optics.projection |  | optics.projection: is empty: name its model
optics.projection | model = "mercator" | optics.projection.model = "mercator" | brown-conrady
optics.projection | k = [0.1] | optics.projection.k: goes with optics.projection.model
optics.projection | p = [0.1, 0.2] | optics.projection.p: goes with optics.projection.model
optics.projection | strength = 2.0 | optics.projection.strength: goes with optics.projection.model
optics.projection | model = "pinhole"; k = [0.1] | optics.projection.k: means nothing to model "pinhole"
optics.projection | model = "fisheye"; k = [0.0]; p = [0.1, 0.1] | optics.projection.p: means nothing to model "fisheye", which takes k, strength
optics.projection | model = "brown-conrady" | optics.projection.k: the key `k` is missing
optics.projection | model = "fisheye" | optics.projection.k: the key `k` is missing
optics.projection | model = "fisheye"; k = [] | optics.projection.k = [] | 1 to 4 numbers
optics.projection | model = "brown-conrady"; k = [1.0, 2.0, 3.0, 4.0, 5.0] | optics.projection.k = [1.0, 2.0, 3.0, 4.0, 5.0] | 1 to 3 numbers | k1, k2, p1, p2, k3
optics.projection | model = "brown-conrady"; k = [0.1, nan] | optics.projection.k[1] = NaN
optics.projection | model = "brown-conrady"; k = [0.1]; p = [0.0, 0.0, 0.1] | optics.projection.p: must have 2 values, not 3
optics.projection | model = "brown-conrady"; k = [0.1]; p = [0.0, 1e9] | optics.projection.p[1] = 1000000000
optics.projection | model = "brown-conrady"; k = [0.1]; strength = -1.0 | optics.projection.strength = -1 | 0 to 100
optics.projection | model = "brown-conrady"; k = [-1.0]; strength = 100.0 | optics.projection.k = [-1.0] | fold
optics.projection | model = "brown-conrady"; k = [0.0]; p = [0.0, 10.0] | optics.projection.p = [0.0, 10.0] | fold
optics.projection | model = "fisheye"; k = [-100.0] | optics.projection.k = [-100.0] | fold
optics.vignetting |  | optics.vignetting: is empty: set cos4 = true
optics.vignetting | cos4 = 1 | optics.vignetting.cos4: must be true or false, not 1
optics.vignetting | table = [[0.0, 1.0], [200.0, 0.1]] | optics.vignetting.table[1][0] = 200: must be 0 to 180 deg
optics.vignetting | table = [[0.0, 1.0], [5.0, 1.1]] | optics.vignetting.table[1][1] = 1.1 | 0 to 1
optics.vignetting | table = [[0.0, 1.0], [5.0]] | optics.vignetting.table[1]: must have 2 values, not 1
optics.vignetting | table = [[4.0, 1.0], [2.0, 0.5]] | optics.vignetting.table[1] = [2.0, 0.5] | greater angle
optics.vignetting | table = [] | optics.vignetting.table = []
optics.vignetting | table = [[0.0, 1.0]]; cos4 = true | optics.vignetting.cos4: given with optics.vignetting.table
optics.stray |  | optics.stray: is empty: set pst = [[angle, transmittance], ...] or sun_exclusion_deg
optics.stray | pst = [] | optics.stray.pst = [] | at least one [angle, transmittance]
optics.stray | pst = [[10.0, 0.0]] | optics.stray.pst[0][1] = 0: must be 0.000000000001 to 1
optics.stray | pst = [[10.0, 1e-3], [20.0, 1.5]] | optics.stray.pst[1][1] = 1.5
optics.stray | pst = [[10.0, nan]] | optics.stray.pst[0][1] = NaN
optics.stray | pst = [[10.0, 1e-3], [190.0, 1e-5]] | optics.stray.pst[1][0] = 190: must be 0 to 180 deg
optics.stray | pst = [[20.0, 1e-3], [10.0, 1e-5]] | optics.stray.pst[1] = [10.0, 1e-5] | greater angle
optics.stray | pst = [[20.0, 1e-3], [30.0, 1e-3], [40.0, 2e-3]] | optics.stray.pst[2] = [40.0, 0.002] | before it, [30.0, 0.001]: a point-source transmittance falls
optics.stray | pst = [[20.0, 1e-3, 1.0]] | optics.stray.pst[0]: must have 2 values, not 3
optics.stray | psf = [[20.0, 1e-3]] | optics.stray.psf: unknown key `psf`
optics.stray | sun_exclusion_deg = 3.0 | optics.stray.sun_exclusion_deg = 3: must be 3.94 to 180 deg | never in the image | 3.66 deg
optics.stray | sun_exclusion_deg = nan | optics.stray.sun_exclusion_deg = NaN
optics.stray | sun_exclusion_deg = 181.0 | optics.stray.sun_exclusion_deg = 181
mounting | misalignment_arcsec = [0.0, 40000.0, 0.0] | mounting.misalignment_arcsec[1] = 40000 | -36000 to 36000 arcsec
mounting | misalignment_arcsec = [0.0, 0.0, 0.0, 0.0] | mounting.misalignment_arcsec: must have 3 values, not 4
mounting | q_body_to_camera = [0.0, 0.0, 0.0, 1.0, 0.0] | mounting.q_body_to_camera: must have 4 values, not 5
"#;

/// Checks the refusal of a camera with these lines: one line that begins with the file and contains
/// these words.
fn refused(text: &str, words: &[&str]) {
    let message = refusal(text, words);
    assert_eq!(message.lines().count(), 1, "{message}");
}

/// The refusal of a camera with these lines: it begins with the file and contains these words.
fn refusal(text: &str, words: &[&str]) -> String {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("short.csv", "0.2, 0.3\n0.2, 0.27\n");
    write("good.csv", "0.2, 0.3\n0.2, 0.3005\n");
    write("below.csv", "0.5, 0.6\n-0.1, 0.0\n");
    write("ragged.csv", "0.5, 0.5\n# remark\n0.0\n");
    write("empty.csv", "# nothing\n\n");
    write("counts.csv", "500, 500\n400, 600\n");
    write("words.csv", "0.5, half\n");
    let Err(error) = load_in(folder.path(), text) else {
        panic!("accepted: {text}");
    };
    let message = error.to_string();
    let file = folder.path().join("mine.toml").display().to_string();
    assert!(message.starts_with(&file), "{message}");
    for word in words {
        assert!(message.contains(word), "{message} has no {word}");
    }
    message
}

#[test]
fn each_wrong_key_is_named_with_what_is_allowed() {
    let rows: Vec<&str> = REFUSED.trim().lines().collect();
    for row in &rows {
        let columns: Vec<&str> = row.split(" | ").collect();
        let keys = columns[1].replace("; ", "\n");
        let has_psf = columns[0] == "optics.psf";
        let optics = if has_psf { "" } else { GAUSSIAN };
        let tables = format!("[{}]\n{keys}", columns[0]);
        refused(&text(optics, &tables), &columns[2..]);
    }
    assert!(rows.len() > 40);
}

#[test]
fn widths_outside_the_tables_are_refused() {
    // Diffraction wider than the tables.
    let slow = text("", "[optics.psf]\nkind = \"airy\"");
    let slow = slow.replace("aperture_mm = 10.0", "aperture_mm = 0.05");
    let words = ["optics.psf.kind", "at most 20 px", "enlarge the aperture"];
    refused(&slow, &words);
    // An unknown key in the optics' own table.
    for (value, words) in [
        (
            "[1.0, 2.0, 3.0]",
            "optics.principal_px: must have 2 values, not 3",
        ),
        ("[1.0, 2e6]", "optics.principal_px[1] = 2000000"),
    ] {
        let optics = format!("principal_px = {value}\n{GAUSSIAN}");
        refused(&text(&optics, ""), &[words]);
    }
}

/// The message names the table that lacks a key, not a nested table that has a header.
#[test]
fn the_missing_table_is_named() {
    let whole = text(GAUSSIAN, "[optics.projection]\nmodel = \"pinhole\"");
    let inner = whole.find("[optics.projection]").unwrap();
    let bare = format!("name = \"mine\"\n{}", &whole[inner..]);
    let keys = [
        "focal_length_mm",
        "aperture_mm",
        "transmission",
        "band",
        "psf",
    ];
    let missing = keys.map(|key| format!("mine.toml:2:2: optics: the key `{key}` is missing"));
    let message = refusal(&bare, &missing.each_ref().map(String::as_str));
    assert_eq!(message.lines().count(), 1 + keys.len(), "{message}");
}

/// The error about a fold gives its position and a strength without a fold, which loads.
#[test]
fn lens_folds_are_refused() {
    // x (1 - 100 x^2) turns at x = 0.0577; a corner of the detector is at 0.064.
    let keys = "[optics.projection]\nmodel = \"brown-conrady\"\nk = [-100.0]";
    // At strength s the fold's image is at 2/3 of 1 / sqrt(300 s). It lies outside of the corner
    // plus 4.0 px on each side, 133.7 px of 2000, up to s = 0.331.
    let words = [
        "optics.projection.k = [-100.0]",
        "fold",
        "3.30 deg",
        "optics.projection.strength = 0.33",
    ];
    refused(&text(GAUSSIAN, keys), &words);
    // The message does not blame a width at an angle beyond the fold.
    let psf =
        "psf = { kind = \"gaussian\", sigma_px = 0.8, width_by_field = [[0.0, 1.0], [4.0, 1.2]] }";
    refused(&text(psf, keys), &words[..3]);
    let folder = tempfile::tempdir().unwrap();
    let weaker = |strength: &str| {
        let keys = format!("{keys}\nstrength = {strength}");
        load_in(folder.path(), &text(GAUSSIAN, &keys))
    };
    assert!(weaker("0.33").is_ok() && weaker("0.34").is_err());
    // The fold's image is at 2/3 of 1 / sqrt(3 k). The corner is 127.8 px from the principal point:
    // 130 px is within the reach of the PSF (4.0 px) around it, 136 px is not.
    let keys = |radius_px: f64| {
        let k = -(2.0f64 / 3.0 * 2000.0 / radius_px).powi(2) / 3.0;
        format!("[optics.projection]\nmodel = \"brown-conrady\"\nk = [{k:?}]")
    };
    let words = ["optics.projection.k", "within 4.0 px"];
    refused(&text(GAUSSIAN, &keys(130.0)), &words);
    load_in(folder.path(), &text(GAUSSIAN, &keys(136.0))).unwrap();
}

#[test]
fn a_misaligned_camera_is_turned_about_its_own_axes() {
    let folder = tempfile::tempdir().unwrap();
    let load = |mounting: &str| load_in(folder.path(), &text(GAUSSIAN, mounting)).unwrap();
    // A quarter turn about z, and 60 arcsec about the camera's x, which then points along its
    // former -y.
    let q = "[mounting]\nq_body_to_camera = [0.0, 0.0, 0.7071067811865476, 0.7071067811865476]";
    let straight = load(q).mounting;
    let turned = load(&format!("{q}\nmisalignment_arcsec = [60.0, 0.0, 0.0]")).mounting;
    let between = straight.inverse().then(&turned);
    let seen = between.rotate(&nalgebra::Vector3::z());
    // X-Val: 60 arcsec are 2.908882e-4 rad.
    let is_turned = (seen.y - 2.908_882e-4).abs() < 1e-9 && seen.x.abs() < 1e-12;
    assert!(is_turned, "{seen}");
    let none = load("[mounting]\nmisalignment_arcsec = [0.0, 0.0, 0.0]").mounting;
    assert_eq!(none, load("").mounting);
}
