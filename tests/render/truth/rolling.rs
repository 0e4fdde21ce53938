//! Rolling shutter against integration row by row, from the label and the camera's constants alone.

use skyloop::camera::{Camera, Shutter};
use skyloop::engine::ExposedFrame;
use skyloop::label::{Label, ObjectLabel};

use super::brute::{Image, arriving_e, changed_fai, pixel, shares, simpson, turning};

/// Light that the rows collect from an object of unit light: on the detector's pixels, and its sum
/// and centre (px) over all rows. Rows beyond the detector are exposed with the row at its edge.
fn collected(
    label: &Label,
    object: &ObjectLabel,
    camera: &Camera,
    row_s: f64,
) -> (Vec<f64>, f64, [f64; 2]) {
    let (width, height) = (camera.detector.width as i64, camera.detector.height as i64);
    let sigma = camera.optics.psf.core_px();
    let pad = 7.0 * sigma + 2.0;
    let last = (height - 1) as f64;
    let half = label.exposure_s / 2.0;
    let mut image = vec![0.0; (width * height) as usize];
    let (mut light, mut moments) = (0.0, [0.0; 2]);
    let readout = last * row_s;
    // The image position over the whole time; rows further away get nothing.
    let ys: Vec<f64> = (0..=200)
        .map(|i| (f64::from(i) / 200.0 - 0.5) * (label.exposure_s + readout))
        .map(|t| pixel(label, object, camera, t)[1])
        .collect();
    let low = (ys.iter().copied().fold(f64::MAX, f64::min) - pad).floor() as i64;
    let high = (ys.iter().copied().fold(f64::MIN, f64::max) + pad).ceil() as i64;
    for row in low..=high {
        let mid = ((row as f64).clamp(0.0, last) - last / 2.0) * row_s;
        let ends = [-half, half].map(|t| pixel(label, object, camera, mid + t));
        let length = (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]);
        if ends
            .iter()
            .all(|end| (end[1] - row as f64).abs() > pad + length)
        {
            continue;
        }
        let steps = 2 * ((5.0 * length).ceil() as usize).max(4);
        for i in 0..=steps {
            let t = mid + (2.0 * i as f64 / steps as f64 - 1.0) * half;
            let [x, y] = pixel(label, object, camera, t);
            if (y - row as f64).abs() > pad {
                continue;
            }
            let weight = simpson(i, steps) / steps as f64 * shares(row..row + 1, y, sigma)[0];
            light += weight;
            moments[0] += weight * x;
            moments[1] += weight * row as f64;
            if !(0..height).contains(&row) {
                continue;
            }
            let from = ((x - pad) as i64).clamp(0, width);
            let past = ((x + pad) as i64 + 1).clamp(0, width);
            for (column, share) in (from..past).zip(shares(from..past, x, sigma)) {
                image[(row * width + column) as usize] += weight * share;
            }
        }
    }
    (image, light, moments.map(|m| m / light))
}

/// Worst errors of a frame: of light, of centres (px), of pixels as parts of the brightest one.
fn compare(exposed: &ExposedFrame, row_s: f64) -> (f64, f64, f64) {
    let (label, camera) = (&exposed.label, &exposed.camera);
    let seen = Image::light_of(exposed);
    let mut truth = vec![0.0; seen.e.len()];
    let (mut off_light, mut off_px) = (0.0f64, 0.0f64);
    for object in label.objects.iter().filter(|o| o.electrons > 0.0) {
        let (image, light, centre) = collected(label, object, camera, row_s);
        let arriving = arriving_e(label, object, camera);
        // Tracks of faint sources are sampled coarsely: `Fidelity::track_e`.
        let off_e = (object.electrons - arriving * light).abs();
        off_light = off_light.max(off_e / (arriving * light).max(1000.0));
        off_px = off_px.max((object.x_px - centre[0]).hypot(object.y_px - centre[1]));
        for (sum, e) in truth.iter_mut().zip(image) {
            *sum += arriving * e;
        }
        // Its position when its own row opens and closes.
        for (at, edge) in [
            ([object.x0_px, object.y0_px], -0.5),
            ([object.x1_px, object.y1_px], 0.5),
        ] {
            let last = camera.detector.height as f64 - 1.0;
            let t = (at[1].clamp(0.0, last) - last / 2.0) * row_s + edge * label.exposure_s;
            let expected = pixel(label, object, camera, t);
            let off = (expected[0] - at[0]).hypot(expected[1] - at[1]);
            assert!(off < 1e-5, "{off} {object:?}");
        }
    }
    (off_light, off_px, seen.off(&truth))
}

/// A frame with this shutter, however little it changes.
fn exposed(shutter: Shutter, exposure_s: f64, rates: [f64; 3]) -> ExposedFrame {
    let mut emulator = changed_fai(|emulator| {
        emulator.choice.all = true;
        let camera = emulator.camera_mut();
        (camera.shutter, camera.exposure_s) = (shutter, exposure_s);
    });
    emulator.expose(&turning(rates), 0).unwrap()
}

#[test]
fn rows_collect_light_while_they_are_open() {
    let mut longer = 0.0f64;
    for row_us in [200.0, 1500.0] {
        // deg/s; 30 of them move images by 28 px in the exposure, with the rows, against them,
        // along them, about the boresight.
        for rates in [
            [0.02, 0.0, 0.0],
            [30.0, 0.0, 0.0],
            [-30.0, 0.0, 0.0],
            [0.0, 30.0, 0.0],
            [10.0, -5.0, 60.0],
        ] {
            let row_s = row_us * 1e-6;
            let exposed = exposed(Shutter::Rolling { row_s }, 0.05, rates);
            let (light, px, pixel) = compare(&exposed, row_s);
            let what = format!(
                "{row_us} us a row, {rates:?} deg/s: light {light:.1e}, centre {px:.1e} px, \
                 pixel {pixel:.1e}"
            );
            println!("{what}");
            assert!(light <= 2e-6 && px <= 1e-4 && pixel <= 3e-5, "{what}");
            let objects = exposed.label.objects.iter();
            for o in objects.filter(|o| o.electrons > 0.0) {
                let arriving = arriving_e(&exposed.label, o, &exposed.camera);
                longer = longer.max((o.electrons / arriving - 1.0).abs());
            }
        }
    }
    // 278 px/s at 1500 us a row: 1 / (1 - 0.42).
    assert!(longer > 0.5, "{longer}");
}

/// A scene at rest does not depend on the order in which its rows are exposed.
#[test]
fn at_rest_it_is_the_global_shutter() {
    let shutters = [Shutter::Rolling { row_s: 1e-4 }, Shutter::Global];
    let [rolling, global] = shutters.map(|shutter| exposed(shutter, 0.1, [0.0; 3]));
    assert_eq!(rolling.frame.expected_e, global.frame.expected_e);
    for (a, b) in rolling.label.objects.iter().zip(&global.label.objects) {
        let off = (a.electrons / b.electrons - 1.0).abs();
        assert!(off < 1e-12, "{a:?} {b:?}");
    }
}
