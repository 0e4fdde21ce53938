//! FITS files, read by an independent library.

use super::synthetic::{Numbers, camera, field, flat, frame, label};
use fitsrs::card::Value;
use fitsrs::hdu::header::extension::image::Image;
use fitsrs::wcs::ImgXY;
use fitsrs::{Fits, HDU, Pixels};
use nalgebra::{Matrix3, Rotation3, Vector3};
use skyloop::attitude::Attitude;
use skyloop::camera::{Camera, Model, Projection};
use skyloop::frame::Frame;
use skyloop::label::Label;
use skyloop::output::Writer;
use std::io::Cursor;
use std::path::Path;

fn write(dir: &Path, camera: &Camera, label: &Label, frame: &Frame) {
    let mut writer = Writer::create(dir, 1).unwrap();
    writer
        .write_frame(camera, label, &label.to_json(), frame)
        .unwrap();
    writer.finish().unwrap();
}

/// The first unit of a file, and its values as numbers.
fn read(path: &Path) -> (fitsrs::fits::HDU<Image>, Vec<f64>) {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(bytes.len() % 2880, 0, "whole blocks");
    let mut fits = Fits::from_reader(Cursor::new(bytes));
    let Some(Ok(HDU::Primary(hdu))) = fits.next() else {
        panic!("{}: no primary unit", path.display());
    };
    let values = match fits.get_data(&hdu).pixels() {
        Pixels::I16(it) => it.map(f64::from).collect(),
        Pixels::F32(it) => it.map(f64::from).collect(),
        _ => panic!("{}: neither 16-bit integers nor float32", path.display()),
    };
    assert!(fits.next().is_none(), "nothing behind the image");
    (hdu, values)
}

fn text(hdu: &fitsrs::fits::HDU<Image>, key: &str) -> String {
    match hdu.get_header().get(key) {
        Some(Value::String { value, .. }) => value.trim_end().to_string(),
        other => panic!("{key}: {other:?}"),
    }
}

fn number(hdu: &fitsrs::fits::HDU<Image>, key: &str) -> f64 {
    match hdu.get_header().get(key) {
        Some(Value::Integer { value, .. }) => *value as f64,
        Some(Value::Float { value, .. }) => *value,
        other => panic!("{key}: {other:?}"),
    }
}

#[test]
fn dn_electrons_and_headers_round_trip() {
    let mut numbers = Numbers(1);
    let mut camera = camera("fai-nir");
    // As set by a command.
    camera.detector.gain_e_per_dn = 3.7;
    let mut label = label(&camera, 7, &numbers.attitude());
    label.objects = field(&camera, 20, &mut numbers).into();
    let mut frame = frame(&camera, &label, &mut numbers);
    frame.dn[0] = 0;
    frame.dn[1] = 65535;
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), &camera, &label, &frame);

    let (hdu, stored) = read(&dir.path().join("frame_00007.fits"));
    assert_eq!(number(&hdu, "BITPIX"), 16.0);
    let (zero, scale) = (number(&hdu, "BZERO"), number(&hdu, "BSCALE"));
    let dn: Vec<f64> = stored.iter().map(|v| zero + scale * v).collect();
    let due: Vec<f64> = frame.dn.iter().map(|dn| f64::from(*dn)).collect();
    assert!(dn == due);

    for (key, value) in [
        ("BUNIT", "adu"),
        ("INSTRUME", "fai-nir"),
        ("FILTER", "650-1100 nm"),
        ("TIMESYS", "UTC"),
        ("DATE-OBS", "2019-06-15T23:35:53.500"),
        ("DATE-BEG", "2019-06-15T23:35:53.500"),
        ("DATE-AVG", "2019-06-15T23:35:53.550"),
        ("DATE-END", "2019-06-15T23:35:53.600"),
        ("RADESYS", "ICRS"),
        ("CTYPE1", "RA---TAN"),
        ("CTYPE2", "DEC--TAN"),
    ] {
        assert_eq!(text(&hdu, key), value, "{key}");
    }
    for (key, value) in [
        ("NAXIS1", 256.0),
        ("NAXIS2", 256.0),
        ("FRAME", 7.0),
        ("SEED", 42.0),
        // Modified Julian date of 2019-06-15: 58649; (23 h 35 min 53.5 s) / 86400 s.
        ("MJD-OBS", 58649.0 + 84953.50 / 86400.0),
        ("MJD-BEG", 58649.0 + 84953.50 / 86400.0),
        ("MJD-AVG", 58649.0 + 84953.55 / 86400.0),
        ("MJD-END", 58649.0 + 84953.60 / 86400.0),
        ("RA", label.ra_deg),
        ("DEC", label.dec_deg),
        ("PA_PNT", label.roll_deg),
        ("XPOSURE", 0.1),
        ("EXPTIME", 0.1),
        ("GAIN", 3.7),
        ("OFFSET", camera.detector.offset_dn),
        ("Q_X", label.q_icrf_to_body[0]),
        ("Q_W", label.q_icrf_to_body[3]),
        ("CRPIX1", 128.5),
    ] {
        let read = number(&hdu, key);
        let is_same = (read - value).abs() <= 1e-13 * value.abs();
        assert!(is_same, "{key} {read} {value}");
    }

    let (hdu, electrons) = read(&dir.path().join("frame_00007_electrons.fits"));
    assert_eq!(number(&hdu, "BITPIX"), -32.0);
    assert_eq!(text(&hdu, "BUNIT"), "electron");
    let expected = frame.expected_e.unwrap().into_iter().map(f64::from);
    assert!(electrons == expected.collect::<Vec<_>>());
}

#[test]
fn files_are_complete_for_any_size_and_seed() {
    let dir = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (1440, 1), (1441, 1), (3, 700)] {
        let mut camera = camera("fai-nir");
        (camera.detector.width, camera.detector.height) = (width, height);
        let mut label = label(&camera, 0, &Attitude::identity());
        label.seed = u64::MAX;
        write(dir.path(), &camera, &label, &flat(width, height));
        let (hdu, stored) = read(&dir.path().join("frame_00000.fits"));
        assert_eq!(stored.len(), width * height);
        let sides = ["NAXIS1", "NAXIS2"].map(|key| number(&hdu, key) as usize);
        assert_eq!(sides, [width, height]);
        assert!(dir.path().join("contact_sheet.png").exists());
    }
}

/// The sum of a SIP polynomial at (u, v); zero where the header has none.
fn polynomial(hdu: &fitsrs::fits::HDU<Image>, name: &str, u: f64, v: f64) -> f64 {
    let given = |key: String| hdu.get_header().get(&key).map(|_| number(hdu, &key));
    let Some(order) = given(format!("{name}_ORDER")) else {
        return 0.0;
    };
    let order = order as i32;
    let term = |(p, q): (i32, i32)| {
        let factor = given(format!("{name}_{p}_{q}")).unwrap_or(0.0);
        factor * u.powi(p) * v.powi(q)
    };
    let all = (0..=order).flat_map(|p| (0..=order - p).map(move |q| (p, q)));
    all.map(term).sum()
}

/// The direction of a pixel, counted from 0, by the header's numbers: Calabretta & Greisen 2002,
/// Sections 2, 5.1.3 and 5.1.5, step by step over native longitude and latitude, with the SIP
/// polynomials.
fn direction_by_header(hdu: &fitsrs::fits::HDU<Image>, [x, y]: [f64; 2]) -> Vector3<f64> {
    let key = |key: &str| number(hdu, key);
    let (dx, dy) = (x + 1.0 - key("CRPIX1"), y + 1.0 - key("CRPIX2"));
    let [a, b] = ["A", "B"].map(|name| polynomial(hdu, name, dx, dy));
    let (dx, dy) = (dx + a, dy + b);
    let xi = key("CD1_1") * dx + key("CD1_2") * dy;
    let eta = key("CD2_1") * dx + key("CD2_2") * dy;
    let phi = xi.atan2(-eta);
    let theta = if text(hdu, "CTYPE1").contains("ARC") {
        (90.0 - xi.hypot(eta)).to_radians()
    } else {
        (180.0 / std::f64::consts::PI).atan2(xi.hypot(eta))
    };
    let [ra_p, dec_p, pole] = ["CRVAL1", "CRVAL2", "LONPOLE"].map(|name| key(name).to_radians());
    let turn = phi - pole;
    // Their Eq. (2), as a vector before the right ascension of the pole is added.
    let along = theta.sin() * dec_p.cos() - theta.cos() * dec_p.sin() * turn.cos();
    let across = -theta.cos() * turn.sin();
    let up = theta.sin() * dec_p.sin() + theta.cos() * dec_p.cos() * turn.cos();
    Rotation3::from_axis_angle(&Vector3::z_axis(), ra_p) * Vector3::new(along, across, up)
}

#[test]
fn the_wcs_gives_every_pixel_the_direction_that_the_camera_does() {
    let mut numbers = Numbers(2);
    // Boresights exactly at both poles and near them, at several rolls; then anywhere.
    let to_pole = |tilt: f64, roll: f64| {
        let q = |half: f64, axis: usize| {
            let mut q = [0.0, 0.0, 0.0, half.cos()];
            q[axis] = half.sin();
            Attitude::from_xyzw(q).unwrap()
        };
        q(roll / 2.0, 2).then(&q(tilt / 2.0, 0))
    };
    let pi = std::f64::consts::PI;
    let mut attitudes: Vec<Attitude> = [0.0, 1e-12, 1e-9, 1e-6, pi - 1e-9, pi]
        .into_iter()
        .flat_map(|tilt| [0.0, 1.0, 2.5, -3.0].map(|roll| to_pole(tilt, roll)))
        .collect();
    attitudes.extend((0..40).map(|_| numbers.attitude()));

    let dir = tempfile::tempdir().unwrap();
    for (i, attitude) in attitudes.iter().enumerate() {
        let mut camera = camera(["fai-nir", "cots-wide"][i % 2]);
        camera.mounting = numbers.attitude();
        // The boresight is the camera's: the mounting is removed from the attitude.
        let [x, y, z, w] = camera.mounting.xyzw();
        let back = Attitude::from_xyzw([-x, -y, -z, w]).unwrap();
        camera.optics.principal_px[0] += 13.7;
        let label = label(&camera, 0, &attitude.then(&back));
        // Only the header matters: one row of the detector keeps files and panels small.
        let size = [camera.detector.width as f64, camera.detector.height as f64];
        (camera.detector.width, camera.detector.height) = (600, 1);
        write(dir.path(), &camera, &label, &flat(600, 1));

        let (hdu, _) = read(&dir.path().join("frame_00000.fits"));
        let wcs = hdu.wcs().unwrap();
        let matrix = matrix(&label);
        for _ in 0..50 {
            let pixel = size.map(|n| n * numbers.next() - 0.5);
            let truth = matrix.transpose() * camera.optics.direction(pixel);
            // FITS pixels are counted from 1.
            let at = ImgXY::new(pixel[0] + 1.0, pixel[1] + 1.0);
            let lonlat = wcs.unproj_lonlat(&at).unwrap();
            let (sin_d, cos_d) = lonlat.lat().sin_cos();
            let (sin_a, cos_a) = lonlat.lon().sin_cos();
            let theirs = Vector3::new(cos_d * cos_a, cos_d * sin_a, sin_d);
            // The library is accurate to 1e-9 rad; a latitude near the pole loses half its digits.
            let ours = direction_by_header(&hdu, pixel);
            for (found, within) in [(ours, 1e-12), (theirs, 1e-7)] {
                let off = (found - truth).norm();
                assert!(off < within, "{i} {pixel:?} {off:e}");
            }
        }
    }
}

/// ICRF to camera.
fn matrix(label: &Label) -> Matrix3<f64> {
    let rows = label.r_icrf_to_camera;
    Matrix3::from_fn(|row, column| rows[row][column])
}

/// Distorted lenses: the header's polynomials give every pixel its direction within 0.01 px, and
/// back.
#[test]
fn the_wcs_of_a_distorted_lens_is_within_a_hundredth_of_a_pixel() {
    let brown = |k, p| Projection::new(Model::BrownConrady { k, p });
    let fisheye = |k| Projection::new(Model::Fisheye { k });
    let mut numbers = Numbers(5);
    let dir = tempfile::tempdir().unwrap();
    let (barrel, pincushion) = ([-0.28, 0.09, -0.01], [0.3, -0.5, 0.0]);
    for (name, lens, kind) in [
        ("fai-nir", brown(barrel, [3e-4, -2e-4]), "RA---TAN-SIP"),
        (
            "cots-wide",
            brown(pincushion, [-1e-3, 2e-3]),
            "RA---TAN-SIP",
        ),
        ("fai-nir", fisheye([0.0; 4]), "RA---ARC"),
        (
            "cots-wide",
            fisheye([-0.02, 3e-3, -8e-4, 4e-5]),
            "RA---ARC-SIP",
        ),
    ] {
        let mut camera = camera(name);
        camera.optics.projection = lens;
        camera.optics.principal_px[1] -= 7.3;
        if kind.contains("ARC") {
            // Some 75 degrees from the boresight in the corners.
            camera.optics.focal_px *= 0.2;
        }
        let label = label(&camera, 0, &numbers.attitude());
        let frame = frame(&camera, &label, &mut numbers);
        write(dir.path(), &camera, &label, &frame);
        let (hdu, _) = read(&dir.path().join("frame_00000.fits"));
        assert_eq!(text(&hdu, "CTYPE1"), kind);
        let matrix = matrix(&label);
        let size = [camera.detector.width as f64, camera.detector.height as f64];
        let mut worst = [0.0f64; 2];
        for _ in 0..400 {
            let pixel = size.map(|n| n * numbers.next() - 0.5);
            // The pixel with the true direction given by the header.
            let seen = matrix * direction_by_header(&hdu, pixel);
            let [x, y] = camera.optics.project(&seen).unwrap();
            worst[0] = worst[0].max((x - pixel[0]).hypot(y - pixel[1]));
            // Inverse: from the ideal image of the true direction to the pixel.
            let optics = &camera.optics;
            let (lens, direction) = (optics.projection.ideal(), optics.direction(pixel));
            let ideal = optics.project_by(&lens, &direction).unwrap();
            let [u, v] = [0, 1].map(|k| ideal[k] - optics.principal_px[k]);
            let [a, b] = ["AP", "BP"].map(|name| polynomial(&hdu, name, u, v));
            let back = [ideal[0] + a, ideal[1] + b];
            worst[1] = worst[1].max((back[0] - pixel[0]).hypot(back[1] - pixel[1]));
        }
        println!("{name} {kind} {worst:?}");
        let worst = worst[0].max(worst[1]);
        assert!(worst < 0.01, "{name} {kind} {worst}");
        if kind.ends_with("SIP") {
            let stated = number(&hdu, "SIPERR");
            assert!(worst < 2.0 * stated + 1e-9, "{stated}");
            assert!(number(&hdu, "A_DMAX") > 0.5);
        }
    }
}
