//! Labelled frames made without the renderer, so that output tests do not depend on it.

use skyloop::attitude::Attitude;
use skyloop::camera::Camera;
use skyloop::fidelity::Fidelity;
use skyloop::frame::Frame;
use skyloop::label::{FidelityLabel, Label, ObjectLabel, RsoLabel};
use skyloop::load::Folder;

/// A small generator of numbers in 0..1 (SplitMix64): the same frames in every run.
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Mean 0, standard deviation 1, approximately normal.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }

    pub fn attitude(&mut self) -> Attitude {
        let q: [f64; 4] = std::array::from_fn(|_| self.normal());
        let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
        Attitude::from_xyzw(q.map(|c| c / norm)).unwrap()
    }
}

pub fn camera(name: &str) -> Camera {
    Camera::load(name, &Folder::Embedded("cameras")).unwrap()
}

/// A frame of one DN everywhere.
pub fn flat(width: usize, height: usize) -> Frame {
    Frame {
        width,
        height,
        dn: vec![100; width * height],
        expected_e: None,
        charge_e: None,
    }
}

/// A label without objects for `camera` at an attitude.
pub fn label(camera: &Camera, frame: u32, attitude: &Attitude) -> Label {
    let pointing = attitude.then(&camera.mounting);
    let matrix = pointing.matrix();
    let [ra_deg, dec_deg, roll_deg] = pointing.ra_dec_roll().map(f64::to_degrees);
    let second = 50 + frame / 2;
    let (minute, second) = (35 + second / 60, second % 60);
    let time = |ms: u32| format!("2019-06-15T23:{minute:02}:{second:02}.{ms:03}Z");
    let ms = 500 * (frame % 2);
    Label {
        frame,
        seed: 42,
        camera: camera.name.clone(),
        columns: camera.detector.width,
        rows: camera.detector.height,
        epoch_start: time(ms),
        epoch_mid: time(ms + 50),
        epoch_end: time(ms + 100),
        exposure_s: 0.1,
        q_icrf_to_body: attitude.xyzw(),
        q_body_to_camera: camera.mounting.xyzw(),
        rates_rad_s: [0.0; 3],
        state_gcrf_km: [7000.0, 0.0, 0.0, 0.0, 7.5, 0.0],
        r_icrf_to_camera: [0, 1, 2].map(|i| matrix.row(i).transpose().into()),
        ra_deg: ra_deg.rem_euclid(360.0),
        dec_deg,
        roll_deg: roll_deg.rem_euclid(360.0),
        background_e_px: 20.0,
        sun_deg: 90.0,
        sun_excluded: false,
        flooded_by: None,
        no_objects: None,
        spots_left_out: None,
        spots_left_out_snr: None,
        particles_left_out: None,
        fidelity: FidelityLabel::from(&Fidelity::REALTIME),
        overrun: None,
        effects: Vec::new(),
        unseen: Default::default(),
        unseen_counts: Default::default(),
        unseen_left_out: None,
        objects: Vec::new().into(),
    }
}

/// A star of `electrons` at a position.
pub fn star(id: String, names: &[&str], [x, y]: [f64; 2], electrons: f64) -> ObjectLabel {
    ObjectLabel {
        kind: "star",
        id,
        names: names.iter().map(|name| name.to_string()).collect(),
        x_px: x,
        y_px: y,
        x0_px: x,
        y0_px: y,
        x1_px: x,
        y1_px: y,
        vx_px_s: 0.0,
        vy_px_s: 0.0,
        mag: 5.0,
        band_mag: Some(5.0),
        electrons,
        snr: electrons / 40.0,
        ra_deg: 0.0,
        dec_deg: 0.0,
        in_frame: true,
        visible: electrons >= 120.0,
        reason: None,
        rso: None,
        planet: None,
    }
}

/// An RSO with a track of some pixels; invisible for `reason`, if given.
pub fn rso(name: &str, [x, y]: [f64; 2], electrons: f64, reason: Option<&str>) -> ObjectLabel {
    ObjectLabel {
        kind: "rso",
        x0_px: x - 2.0,
        y0_px: y - 1.0,
        x1_px: x + 2.0,
        y1_px: y + 1.0,
        visible: reason.is_none(),
        reason: reason.map(str::to_string),
        rso: Some(RsoLabel {
            range_km: 900.0,
            range_rate_km_s: -1.0,
            phase_deg: 60.0,
            illumination: 1.0,
            position_gcrf_km: [7000.0, 100.0, 900.0],
            velocity_gcrf_km_s: [0.0, 7.5, 0.0],
        }),
        ..star("NORAD 44322".to_string(), &[name], [x, y], electrons)
    }
}

/// Objects all over the frame, most of them faint.
pub fn field(camera: &Camera, stars: usize, numbers: &mut Numbers) -> Vec<ObjectLabel> {
    let [w, h] = [camera.detector.width as f64, camera.detector.height as f64];
    let names: [&[&str]; 6] = [
        &["HR 6056", "delta Oph", "1 Oph", "Yed Prior"],
        &["HR 6075", "epsilon Oph", "2 Oph", "Yed Posterior"],
        &["HR 6095", "gamma Her", "20 Her"],
        &["HR 6117", "24 Her"],
        &["HR 6111"],
        &[],
    ];
    let mut objects: Vec<ObjectLabel> = (0..stars)
        .map(|i| {
            let at = [w * numbers.next() - 0.5, h * numbers.next() - 0.5];
            let electrons = 60.0 * numbers.next().powf(-1.4);
            let names = names.get(i % 9).copied().unwrap_or(&[]);
            star(format!("HIP {}", 80000 + i), names, at, electrons)
        })
        .collect();
    let dark = Some("in the Earth's shadow");
    objects.push(rso("RCM-1", [w * 0.3, h * 0.6], 3000.0, None));
    objects.push(rso("RCM-2", [w * 0.33, h * 0.62], 2000.0, None));
    objects.push(rso("RCM-3", [w * 0.97, h * 0.1], 0.0, dark));
    objects
}

/// The frame with the objects of `label`: Gaussian images along their tracks, with noise.
pub fn frame(camera: &Camera, label: &Label, numbers: &mut Numbers) -> Frame {
    let (width, height) = (camera.detector.width, camera.detector.height);
    let mut electrons = vec![label.background_e_px; width * height];
    let sigma = camera.optics.psf.core_px();
    for object in label.objects.iter().filter(|object| object.in_frame) {
        for step in 0..5 {
            let part = f64::from(step) / 4.0;
            let x = object.x0_px + part * (object.x1_px - object.x0_px);
            let y = object.y0_px + part * (object.y1_px - object.y0_px);
            let scale = object.electrons / 5.0 / (std::f64::consts::TAU * sigma * sigma);
            for row in (y as usize).saturating_sub(6)..(y as usize + 7).min(height) {
                for column in (x as usize).saturating_sub(6)..(x as usize + 7).min(width) {
                    let d2 = (column as f64 - x).powi(2) + (row as f64 - y).powi(2);
                    electrons[row * width + column] += scale * (-d2 / (2.0 * sigma * sigma)).exp();
                }
            }
        }
    }
    let detector = &camera.detector;
    let dn = electrons
        .iter()
        .map(|e| {
            let noise = (e + detector.read_noise_e.powi(2)).sqrt() * numbers.normal();
            let dn = (e + noise) / detector.gain_e_per_dn + detector.offset_dn;
            dn.round().clamp(0.0, f64::from(detector.max_dn())) as u16
        })
        .collect();
    Frame {
        width,
        height,
        dn,
        expected_e: Some(electrons.iter().map(|e| *e as f32).collect()),
        charge_e: None,
    }
}
