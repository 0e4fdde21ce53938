//! PNG frames and the contact sheet, read back.

use super::synthetic::{Numbers, camera, field, flat, frame, label, rso, star};
use image::{DynamicImage, RgbImage};
use skyloop::attitude::Attitude;
use skyloop::camera::Camera;
use skyloop::frame::Frame;
use skyloop::label::ObjectLabel;
use skyloop::output::Writer;

/// Colours of the sheet.
const STAR: [u8; 3] = [110, 190, 255];
const RSO: [u8; 3] = [255, 170, 50];
const HIDDEN: [u8; 3] = [255, 110, 150];

fn sheet_of(camera: &Camera, frames: &[(Vec<ObjectLabel>, Frame)]) -> RgbImage {
    let dir = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(dir.path(), frames.len() as u32).unwrap();
    for (i, (objects, frame)) in frames.iter().enumerate() {
        let mut label = label(camera, i as u32, &Attitude::identity());
        label.objects = objects.clone().into();
        writer.write_frame(camera, &label, "{}", frame).unwrap();
    }
    writer.finish().unwrap();
    let sheet = image::open(dir.path().join("contact_sheet.png"));
    sheet.unwrap().into_rgb8()
}

/// Pixels of a colour in the square of `half` around a position in the picture's first panel.
fn count(sheet: &RgbImage, color: [u8; 3], [x, y]: [f64; 2], half: i32) -> usize {
    let (x, y) = (12 + x.round() as i32, 64 + y.round() as i32);
    (y - half..=y + half)
        .flat_map(|row| (x - half..=x + half).map(move |column| (column, row)))
        .filter(|(column, row)| sheet.get_pixel(*column as u32, *row as u32).0 == color)
        .count()
}

#[test]
fn the_png_contains_the_dn_row_0_first() {
    let dir = tempfile::tempdir().unwrap();
    let mut numbers = Numbers(10);
    let camera = camera("cots-wide");
    let mut label = label(&camera, 0, &numbers.attitude());
    label.objects = field(&camera, 20, &mut numbers).into();
    let mut frame = frame(&camera, &label, &mut numbers);
    frame.dn[..2].copy_from_slice(&[0, 65535]);
    let mut writer = Writer::create(dir.path(), 1).unwrap();
    writer.write_frame(&camera, &label, "{}", &frame).unwrap();
    let open = |name: &str| image::open(dir.path().join(name)).unwrap();
    let DynamicImage::ImageLuma16(picture) = open("frame_00000.png") else {
        panic!("not 16-bit grey");
    };
    assert_eq!((picture.width(), picture.height()), (1280, 1024));
    assert_eq!(picture.as_raw(), &frame.dn);
    // The preview: the same pixels in 8 bits, black without light and white at saturation.
    let DynamicImage::ImageLuma8(preview) = open("frame_00000_preview.png") else {
        panic!("not 8-bit grey");
    };
    assert_eq!(preview.dimensions(), picture.dimensions());
    assert_eq!(preview.as_raw()[..2], [0, 255]);
    let brighter = preview.as_raw().iter().filter(|grey| **grey > 0).count();
    assert!(brighter > preview.as_raw().len() / 2);
}

#[test]
fn every_kind_of_object_has_its_ring_and_its_name() {
    let camera = camera("fai-nir");
    let objects = vec![
        star("HIP 1".into(), &["HR 1", "Sirrah"], [40.0, 40.0], 5000.0),
        rso("RCM-1", [120.0, 60.0], 5000.0, None),
        rso("RCM-2", [60.0, 200.0], 0.0, Some("in the Earth's shadow")),
        // Below the limit: neither ring nor name.
        star("HIP 2".into(), &[], [200.0, 200.0], 100.0),
    ];
    let sheet = sheet_of(&camera, &[(objects, flat(256, 256))]);
    // Two panel pixels per pixel; centres of first pixels coincide.
    let at = |x: f64, y: f64| [2.0 * x + 0.5, 2.0 * y + 0.5];
    assert!(count(&sheet, STAR, at(40.0, 40.0), 9) > 8);
    let whole = count(&sheet, RSO, at(120.0, 60.0), 18);
    let dashed = count(&sheet, HIDDEN, at(60.0, 200.0), 18);
    let is_dashed = whole > 30 && dashed > 15 && dashed < whole;
    assert!(is_dashed, "{dashed} of {whole}");
    assert_eq!(count(&sheet, STAR, at(200.0, 200.0), 12), 0);
    // Names on the right: six letters are about 36 px wide.
    assert!(count(&sheet, STAR, at(60.0, 40.0), 18) > 40);
}

#[test]
fn a_star_of_snr_5_stands_out_of_the_noise() {
    let mut numbers = Numbers(11);
    let camera = camera("fai-nir");
    let mut label = label(&camera, 0, &Attitude::identity());
    let (read, gain) = (camera.detector.read_noise_e, camera.detector.gain_e_per_dn);
    // In one pixel; the light of a star covers about four.
    let noise_e = (label.background_e_px + read * read + gain * gain / 12.0).sqrt();
    let positions = (0..16).map(|i| [i % 4, i / 4].map(|i| 20.0 + 50.0 * f64::from(i)));
    let positions: Vec<[f64; 2]> = positions.collect();
    // Unlabelled, so that no ring covers the measured pixels.
    let stars = positions.iter();
    let stars = stars.map(|at| star("HIP 1".into(), &[], *at, 10.0 * noise_e));
    label.objects = stars.collect::<Vec<_>>().into();
    let frame = frame(&camera, &label, &mut numbers);
    let sheet = sheet_of(&camera, &[(Vec::new(), frame)]);
    let grey = |off: f64| {
        let grey = positions.iter().map(|at| {
            let [x, y] = at.map(|x| (2.0 * (x + off)) as u32);
            f64::from(sheet.get_pixel(12 + x, 64 + y).0[0])
        });
        grey.sum::<f64>() / 16.0
    };
    let (stars, sky) = (grey(0.0), grey(20.0));
    assert!(sky < 70.0 && stars > sky + 30.0, "sky {sky}, stars {stars}");
}

/// The last entry of the legend is the widest of a small sheet.
#[test]
fn the_legend_fits_on_the_sheet_of_one_small_frame() {
    let camera = camera("fai-nir");
    let sheet = sheet_of(&camera, &[(Vec::new(), flat(256, 256))]);
    let paper = *sheet.get_pixel(0, 0);
    let blank = |column: u32| (0..64).all(|row| *sheet.get_pixel(column, row) == paper);
    let text_ends = (0..sheet.width()).rev().find(|column| !blank(*column));
    let margin = sheet.width() - 1 - text_ends.unwrap();
    assert!((12..40).contains(&margin), "{margin} px");
}

#[test]
fn sheets_have_up_to_twelve_panels_for_any_camera() {
    let mut camera = camera("fai-nir");
    (camera.detector.width, camera.detector.height) = (640, 10);
    let frames: Vec<_> = (0..30).map(|_| (Vec::new(), flat(640, 10))).collect();
    let sheet = sheet_of(&camera, &frames);
    let size = (4 * 524 + 12, 3 * (8 + 38 + 12) + 64 + 12);
    assert_eq!(sheet.dimensions(), size);
    for (width, height) in [(1, 1), (1, 2000), (700, 3), (8192, 2)] {
        (camera.detector.width, camera.detector.height) = (width, height);
        let objects = vec![
            rso("A", [0.0, 0.0], 100.0, None),
            star("B".into(), &[], [0.0, 0.0], 1e9),
        ];
        let sheet = sheet_of(&camera, &[(objects, flat(width, height))]);
        assert!(sheet.width() < 640 && sheet.height() < 700);
    }
}
