//! Vignetting and distortion of moving images, against integration from the label and the camera's
//! constants.

use skyloop::camera::{Camera, Model, Projection, Vignetting};
use skyloop::engine::ExposedFrame;
use skyloop::label::{Label, ObjectLabel};

use super::brute::{Image, arriving_e, changed_fai, pixel, shares, simpson, turning};

/// X-Val: a barrel of 3 % in the corners of 27 degrees, radial and tangential.
const K: [f64; 3] = [-0.3, 0.05, 0.0];
const P: [f64; 2] = [1e-3, -5e-4];

/// The image's position, and its transmission: cos^4 of its angle. Brown-Conrady's equations
/// written out.
fn position(label: &Label, object: &ObjectLabel, camera: &Camera, t: f64) -> ([f64; 2], f64) {
    let (c, f) = (camera.optics.principal_px, camera.optics.focal_px);
    let at = pixel(label, object, camera, t);
    let (x, y) = ((at[0] - c[0]) / f, (at[1] - c[1]) / f);
    let r2 = x * x + y * y;
    let light = (1.0 + r2).powi(-2);
    let radial = 1.0 + K[0] * r2 + K[1] * r2 * r2;
    let xd = x * radial + 2.0 * P[0] * x * y + P[1] * (r2 + 2.0 * x * x);
    let yd = y * radial + P[0] * (r2 + 2.0 * y * y) + 2.0 * P[1] * x * y;
    ([c[0] + f * xd, c[1] + f * yd], light)
}

/// Worst errors of light, centres (px) and pixels (of the brightest).
fn compare(exposed: &ExposedFrame) -> [f64; 3] {
    let (label, camera) = (&exposed.label, &exposed.camera);
    let (width, height) = (camera.detector.width as i64, camera.detector.height as i64);
    let sigma = camera.optics.psf.core_px();
    let mut truth = vec![0.0; (width * height) as usize];
    let [mut off_light, mut off_px] = [0.0f64; 2];
    for o in label.objects.iter().filter(|o| o.electrons > 0.0) {
        let arriving = arriving_e(label, o, camera);
        let length = (o.x1_px - o.x0_px).hypot(o.y1_px - o.y0_px);
        let steps = 2 * ((8.0 * length).ceil() as usize).max(2);
        let (mut light, mut moments) = (0.0, [0.0; 2]);
        for i in 0..=steps {
            let t = (i as f64 / steps as f64 - 0.5) * label.exposure_s;
            let (at, passes) = position(label, o, camera, t);
            let weight = simpson(i, steps) / steps as f64 * passes;
            light += weight;
            moments = [0, 1].map(|k| moments[k] + weight * at[k]);
            let pad = 7.0 * sigma + 1.0;
            let range = |at: f64, size: i64| {
                ((at - pad) as i64).clamp(0, size)..((at + pad) as i64 + 1).clamp(0, size)
            };
            let [across, down] =
                [0, 1].map(|k| shares(range(at[k], [width, height][k]), at[k], sigma));
            for (row, down) in range(at[1], height).zip(down) {
                let down = arriving * weight * down;
                let from = row * width + range(at[0], width).start;
                let line = &mut truth[from as usize..];
                for (e, across) in line.iter_mut().zip(&across) {
                    *e += down * across;
                }
            }
        }
        off_light = off_light.max((o.electrons / (arriving * light) - 1.0).abs());
        let centre = moments.map(|m| m / light);
        off_px = off_px.max((o.x_px - centre[0]).hypot(o.y_px - centre[1]));
    }
    [off_light, off_px, Image::light_of(exposed).off(&truth)]
}

#[test]
fn vignetting_and_distortion_match_the_lens_model() {
    for rates in [
        [0.0; 3],
        [30.0, 0.0, 0.0],
        [10.0, -5.0, 60.0],
        [0.0, 60.0, 0.0],
    ] {
        let mut emulator = changed_fai(|emulator| {
            let optics = &mut emulator.camera_mut().optics;
            optics.vignetting = Vignetting::Cos4;
            optics.projection = Projection::new(Model::BrownConrady { k: K, p: P });
        });
        let [light, px, pixel] = compare(&emulator.expose(&turning(rates), 0).unwrap());
        println!("{rates:?} deg/s: light {light:.1e}, centre {px:.1e} px, pixel {pixel:.1e}");
        let is_near = light < 1e-6 && px < 1e-4 && pixel < 3e-5;
        assert!(is_near, "{light} {px} {pixel}");
    }
}

/// The labelled transmission of a streak that leaves the detector is as accurate as that of one on
/// it, also where the transmission has a kink: a larger detector gives the same label.
#[test]
fn labels_of_streaks_that_leave_the_detector_do_not_depend_on_where_it_ends() {
    let labels = |more_rows: usize| {
        let mut emulator = changed_fai(|emulator| {
            let camera = emulator.camera_mut();
            let table = [[0.0, 1.0], [17.0, 0.8], [20.0, 0.1]];
            let table = table.map(|[deg, t]: [f64; 2]| [deg.to_radians(), t]);
            camera.optics.vignetting = Vignetting::Table(table.to_vec());
            camera.optics.principal_px[1] += more_rows as f64;
            camera.detector.height += 2 * more_rows;
            camera.exposure_s = 0.4;
        });
        let vehicle = turning([-40.0, 20.0, 0.0]);
        emulator.expose(&vehicle, 0).unwrap().label
    };
    let (low, high) = (labels(0), labels(200));
    let (mut left, mut worst) = (0, [0.0f64; 2]);
    for a in &low.objects {
        let Some(b) = high.objects.iter().find(|b| b.id == a.id) else {
            continue;
        };
        left += u32::from(!(0.0..256.0).contains(&a.y0_px) || !(0.0..256.0).contains(&a.y1_px));
        let off_px = (a.x_px - b.x_px).hypot(a.y_px + 200.0 - b.y_px);
        let off_light = (a.electrons / b.electrons - 1.0).abs();
        worst = [worst[0].max(off_px), worst[1].max(off_light)];
    }
    println!("{left} leave it: centre and light off by {worst:?} (px, part)");
    let is_same = worst[0] < 1e-4 && worst[1] < 1e-5;
    assert!(left > 20 && is_same, "{left} {worst:?}");
}
