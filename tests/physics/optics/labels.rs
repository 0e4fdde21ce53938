//! Labels have the centre of the light for any point spread function.

use hifitime::Epoch;
use skyloop::attitude::VehicleState;
use skyloop::camera::Psf;
use skyloop::camera::psf::{Image, Images, Shape, Variation};
use skyloop::config::Config;
use skyloop::engine::Emulator;
use skyloop::fidelity::Choice;
use skyloop::sky::catalog::Selection;
use std::str::FromStr;
use std::sync::Arc;

/// About +Y, deg/s.
fn turning(deg_s: f64) -> VehicleState {
    let q = [0.1, 0.2, -0.3, 0.927_361_849_549_570_4];
    let epoch = Epoch::from_str("2026-02-11T18:22:41 UTC").unwrap();
    VehicleState::new(1, epoch, q, [0.0, deg_s.to_radians(), 0.0], None).unwrap()
}

/// A PSF image with an offset centre of light shifts both the light and the label.
#[test]
fn labels_include_the_offset_of_the_psf_centre() {
    let rows = |text: &str| -> Vec<Vec<f64>> {
        let line = |line: &str| line.split(' ').map(|s| s.parse().unwrap()).collect();
        text.split(", ").map(line).collect()
    };
    // X-Val: its centre is 0.7 - 0.1 = 0.6 cells right of its middle and 0.2 below: 0.3 and 0.1 px.
    let image = Image::new(&rows("0 0 0, 0.1 0 0.7, 0 0.2 0")).unwrap();
    let images = Images::new(2.0, [vec![0.0], vec![0.0]], vec![image]).unwrap();
    let mut config = Config::defaults().unwrap();
    config.sky.selection = Selection::Bsc;
    config.label_snr = 0.0;
    let mut emulator = Emulator::new(&mut config);
    emulator.choice.noise = false;
    emulator.keep_expected = true;
    let camera = emulator.camera_mut();
    camera.detector.dark_e_s = 0.0;
    let psf = |shape| Psf::new(shape, Variation::default());
    camera.optics.psf = psf(Shape::Gaussian(0.3));
    let vehicle = turning(0.0);
    let centred = emulator.expose(&vehicle, 0).unwrap().label.objects;
    emulator.camera_mut().optics.psf = psf(Shape::Images(Arc::new(images)));
    let exposed = emulator.expose(&vehicle, 0).unwrap();
    let moved = &exposed.label.objects;
    assert!(moved.len() > 100);
    for moved in moved {
        let before = centred.iter().find(|object| object.id == moved.id);
        let Some(before) = before else { continue };
        for (a, b) in [
            ([before.x_px, before.y_px], [moved.x_px, moved.y_px]),
            ([before.x0_px, before.y0_px], [moved.x0_px, moved.y0_px]),
            ([before.x1_px, before.y1_px], [moved.x1_px, moved.y1_px]),
        ] {
            assert!((b[0] - a[0] - 0.3).abs() < 1e-9 && (b[1] - a[1] - 0.1).abs() < 1e-9);
        }
    }
}

/// A PSF offset upwards by `off_px`: a Gaussian of 1.2 px in cells of half a pixel.
fn coma(off_px: f64) -> Image {
    let cell = |i: i32, off: f64| {
        let edge = |i: f64| libm::erf((i / 2.0 - off) / (1.2 * std::f64::consts::SQRT_2));
        (edge(f64::from(i) + 0.5) - edge(f64::from(i) - 0.5)) / 2.0
    };
    let row = |j: i32| (-18..=18).map(|i| cell(i, 0.0) * cell(j, off_px)).collect();
    Image::new(&(-18..=18).map(row).collect::<Vec<Vec<f64>>>()).unwrap()
}

/// Along a track the offset is that of each position, not that of the field centre.
#[test]
fn labels_follow_offsets_along_a_track() {
    let images = [0.8, 0.0, 0.8].map(coma).to_vec();
    let positions = [vec![-110.0, 0.0, 110.0], vec![0.0]];
    let images = Images::new(2.0, positions, images).unwrap();
    let mut config = Config::defaults().unwrap();
    config.sky.selection = Selection::Bsc;
    let mut emulator = Emulator::new(&mut config);
    let camera = emulator.camera_mut();
    camera.optics.psf = Psf::new(Shape::Images(Arc::new(images)), Variation::default());
    camera.exposure_s = 0.5;
    let vehicle = turning(30.0);
    let scene = emulator.scene(&emulator.camera(), &vehicle, 0, &Choice::default());
    let (mut compared, mut furthest) = (0, 0.0f64);
    for source in scene.unwrap().sources {
        let inside = |at: [f64; 2]| at.iter().all(|x| (15.0..240.0).contains(x));
        if !inside(source.start) || !inside(source.end) {
            continue;
        }
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        for (row, column, shares) in source.footprint.rows(0..256) {
            for (x, share) in (column..).zip(shares) {
                let share = f64::from(*share);
                light += share;
                moments[0] += share * x as f64;
                moments[1] += share * row as f64;
            }
        }
        let centre = moments.map(|moment| moment / light);
        let off = [0, 1].map(|k| source.centroid[k] - centre[k]);
        assert!(off[0].hypot(off[1]) < 1e-3, "{off:?} {:?}", source.body);
        compared += 1;
        // With a constant offset the centroid would be at this position.
        let middle = (source.start[1] + source.end[1]) / 2.0;
        furthest = furthest.max((source.centroid[1] - middle).abs());
    }
    assert!(compared > 10 && furthest > 0.1, "{compared} {furthest} px");
}
