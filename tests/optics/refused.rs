//! What a camera file may not say of its optics: refused with file, key and value.

use crate::cameras::{GAUSSIAN, load_in, text};
use skyloop::load::ConfigError;

/// Keys, and what the message must have.
fn check(optics: &str, tables: &str, parts: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    write("short.csv", "0.2, 0.3\n0.2, 0.27\n");
    write("good.csv", "0.2, 0.3\n0.2, 0.3005\n");
    write("below.csv", "0.5, 0.6\n-0.1, 0.0\n");
    write("ragged.csv", "0.5, 0.5\n0.0\n");
    write("words.csv", "0.5, half\n");
    let error = load_in(folder.path(), &text(optics, tables)).unwrap_err();
    let message = error.to_string();
    assert!(
        message.contains("mine.toml") || matches!(error, ConfigError::Read { .. }),
        "{message}"
    );
    for part in parts {
        assert!(message.contains(part), "{tables}: {message} has no {part}");
    }
}

#[test]
fn point_spread_functions() {
    for (keys, parts) in [
        (
            "kind = \"round\"",
            vec![
                "optics.psf.kind = \"round\"",
                "\"gaussian\", \"airy\", \"moffat\", \"image\"",
            ],
        ),
        (
            "kind = \"gaussian\"",
            vec!["optics.psf.sigma_px", "missing"],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = -0.5",
            vec!["optics.psf.sigma_px = -0.5", "0.01 to 10"],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = 1.0\nbeta = 2.0",
            vec!["optics.psf.beta", "no key of kind \"gaussian\""],
        ),
        (
            "kind = \"airy\"\nobscuration = 0.95",
            vec!["optics.psf.obscuration = 0.95", "0 to 0.9"],
        ),
        (
            "kind = \"airy\"\nwavelength_exponent = 1.0",
            vec!["optics.psf.wavelength_exponent", "no key"],
        ),
        (
            "kind = \"moffat\"\nfwhm_px = 1.0\nbeta = 1.2",
            vec!["optics.psf.beta = 1.2", "1.5 to 20"],
        ),
        (
            "kind = \"moffat\"\nfwhm_px = 0.0\nbeta = 2.0",
            vec!["optics.psf.fwhm_px = 0", "0.02 to 20"],
        ),
        (
            "kind = \"moffat\"\nfwhm_px = 15.0\nbeta = 2.0\nwidth_by_field = [[0.0, 1.0], [3.0, 1.5]]",
            vec![
                "optics.psf.width_by_field = [[0.0, 1.0], [3.0, 1.5]]",
                "within 20 px",
            ],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = 1.0\nwidth_by_field = [[1.0, 1.0], [1.0, 1.5]]",
            vec![
                "optics.psf.width_by_field = [[1.0, 1.0], [1.0, 1.5]]",
                "rising",
            ],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = 1.0\nwidth_by_field = [[1.0, 0.0]]",
            vec!["optics.psf.width_by_field = 0", "0.1 to 10"],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = 1.0\nwidth_by_field = [[95.0, 1.0]]",
            vec!["optics.psf.width_by_field = 95", "below 90.00 deg"],
        ),
        (
            "kind = \"gaussian\"\nsigma_px = 1.0\nwavelength_exponent = nan",
            vec!["optics.psf.wavelength_exponent = NaN", "-4 to 4"],
        ),
    ] {
        check("", &format!("[optics.psf]\n{keys}"), &parts);
    }
    // Diffraction wider than the tables.
    let slow = text("", "[optics.psf]\nkind = \"airy\"")
        .replace("aperture_mm = 10.0", "aperture_mm = 0.05");
    let folder = tempfile::tempdir().unwrap();
    let message = load_in(folder.path(), &slow).unwrap_err().to_string();
    assert!(
        message.contains("optics.psf.kind") && message.contains("at most 20 px"),
        "{message}"
    );
}

#[test]
fn images() {
    let at = |file: &str, place: &str| format!("{{ file = \"{file}\"{place} }}");
    let keys = |images: &str| {
        format!("[optics.psf]\nkind = \"image\"\noversampling = 2\nimages = [{images}]")
    };
    for (images, parts) in [
        (
            at("short.csv", ""),
            [
                "optics.psf.images[0].file = ",
                "short.csv with a sum of 0.97",
                "sum to 1 within 0.001",
            ],
        ),
        (
            at("below.csv", ""),
            [
                "optics.psf.images[0].file",
                "below.csv with a sample of -0.1",
                "0 or more",
            ],
        ),
        (
            at("ragged.csv", ""),
            ["optics.psf.images[0].file", "ragged.csv", "one length"],
        ),
        (
            at("words.csv", ""),
            [
                "optics.psf.images[0].file",
                "words.csv: line 1",
                "not numbers",
            ],
        ),
        (
            at("none.csv", ""),
            ["none.csv", "check the path", "No such file"],
        ),
        (
            [at("good.csv", ""), at("good.csv", ", at_px = [1.0, 2.0]")].join(", "),
            ["optics.psf.images[0].at_px", "missing", "one of several"],
        ),
        (
            [
                at("good.csv", ", at_px = [1.0, 2.0]"),
                at("good.csv", ", at_px = [5.0, 9.0]"),
            ]
            .join(", "),
            ["optics.psf.images", "crossings of a grid", "mine.toml"],
        ),
    ] {
        check("", &keys(&images), &parts);
    }
    check(
        "",
        "[optics.psf]\nkind = \"image\"\noversampling = 2",
        &["optics.psf.images", "missing"],
    );
    check(
        "",
        &keys(&at("good.csv", "")).replace("= 2", "= 0.5"),
        &["optics.psf.oversampling = 0.5", "1 to 64"],
    );
}

#[test]
fn projections_and_folds() {
    for (keys, parts) in [
        (
            "model = \"mercator\"",
            vec!["optics.projection.model = \"mercator\"", "brown-conrady"],
        ),
        (
            "k = [0.1]",
            vec!["optics.projection.k", "no key of model \"pinhole\""],
        ),
        (
            "model = \"fisheye\"\np = [0.1, 0.1]",
            vec!["optics.projection.p", "no key"],
        ),
        (
            "model = \"brown-conrady\"\nk = [1.0, 2.0, 3.0, 4.0]",
            vec!["optics.projection.k = [1.0, 2.0, 3.0, 4.0]", "at most 3"],
        ),
        (
            "model = \"brown-conrady\"\nk = [nan]",
            vec!["optics.projection.k = NaN"],
        ),
        (
            "model = \"brown-conrady\"\nstrength = -1.0",
            vec!["optics.projection.strength = -1", "0 to 100"],
        ),
        // x (1 - 100 x^2) turns at x = 0.0577; a corner of the detector is at 0.064.
        (
            "model = \"brown-conrady\"\nk = [-100.0]",
            vec!["optics.projection.k = [-100.0]", "fold", "3.30 deg"],
        ),
        (
            "model = \"brown-conrady\"\nk = [-1.0]\nstrength = 100.0",
            vec!["optics.projection.k = [-1.0]", "fold"],
        ),
        (
            "model = \"brown-conrady\"\np = [0.0, 10.0]",
            vec!["optics.projection.p = [0.0, 10.0]", "fold"],
        ),
        (
            "model = \"fisheye\"\nk = [-100.0]",
            vec!["optics.projection.k = [-100.0]", "fold"],
        ),
    ] {
        check(GAUSSIAN, &format!("[optics.projection]\n{keys}"), &parts);
    }
    // The fold's image is at 2/3 of 1 / sqrt(3 k): just outside the corner, 127.8 px from the principal point, but
    // within the reach of the PSF, 4.2 px; then clear of it.
    let keys = |radius_px: f64| {
        let k = -(2.0f64 / 3.0 * 2000.0 / radius_px).powi(2) / 3.0;
        format!("[optics.projection]\nmodel = \"brown-conrady\"\nk = [{k:?}]")
    };
    check(
        GAUSSIAN,
        &keys(130.0),
        &["optics.projection.k", "within 4.3 px"],
    );
    let folder = tempfile::tempdir().unwrap();
    load_in(folder.path(), &text(GAUSSIAN, &keys(136.0))).unwrap();
}

#[test]
fn vignetting_and_misalignment() {
    for (tables, parts) in [
        (
            "[optics.vignetting]\ntable = [[0.0, 1.0], [5.0, 1.1]]",
            vec!["optics.vignetting.table = 1.1", "0 to 1"],
        ),
        (
            "[optics.vignetting]\ntable = [[4.0, 1.0], [2.0, 0.5]]",
            vec![
                "optics.vignetting.table = [[4.0, 1.0], [2.0, 0.5]]",
                "rising",
            ],
        ),
        (
            "[optics.vignetting]\ntable = []",
            vec!["optics.vignetting.table = []"],
        ),
        (
            "[optics.vignetting]\ntable = [[0.0, 1.0]]\ncos4 = true",
            vec!["optics.vignetting.table", "exclude"],
        ),
        (
            "[mounting]\nmisalignment_arcsec = [0.0, 40000.0, 0.0]",
            vec!["mounting.misalignment_arcsec = 40000", "-36000 to 36000"],
        ),
    ] {
        check(GAUSSIAN, tables, &parts);
    }
}

#[test]
fn a_misaligned_camera_is_turned_about_its_own_axes() {
    let folder = tempfile::tempdir().unwrap();
    let load = |mounting: &str| load_in(folder.path(), &text(GAUSSIAN, mounting)).unwrap();
    // A quarter turn about z, and 60 arcsec about the camera's x: it then looks at its former -y.
    let q = "[mounting]\nq_body_to_camera = [0.0, 0.0, 0.7071067811865476, 0.7071067811865476]";
    let straight = load(q).mounting;
    let turned = load(&format!("{q}\nmisalignment_arcsec = [60.0, 0.0, 0.0]")).mounting;
    let back = straight.xyzw();
    let back =
        skyloop::attitude::Attitude::from_xyzw([-back[0], -back[1], -back[2], back[3]]).unwrap();
    let between = back.then(&turned);
    let seen = between.rotate(&nalgebra::Vector3::z());
    // X-Val: 60 arcsec are 2.908882e-4 rad.
    assert!(
        (seen.y - 2.908_882e-4).abs() < 1e-9 && seen.x.abs() < 1e-12,
        "{seen}"
    );
    assert_eq!(
        load("[mounting]\nmisalignment_arcsec = [0.0, 0.0, 0.0]").mounting,
        load("").mounting
    );
}
