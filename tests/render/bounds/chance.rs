//! Random cameras, attitudes and rates: small frames with a little of everything, mostly at unusual
//! values.

use std::f64::consts::TAU;
use std::path::Path;

use crate::fixtures::{look_at, unit};
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::fidelity::Choice;
use skyloop::load::Folder;
use skyloop::rng::{NoiseKey, PixelStream};

/// Position and velocity of the observer (km, km/s), and of objects near it relative to it.
pub const ORBIT: ([f64; 3], [f64; 3]) = ([2500.0, 6500.0, 100.0], [-7.0, 2.7, 0.3]);
pub const OBJECTS: [([f64; 3], [f64; 3]); 3] = [
    ([-3.0, 4.0, 2.0], [0.02, 0.1, -0.05]),
    ([-40.0, 12.0, 30.0], [3.0, 1.0, 2.0]),
    ([-300.0, 90.0, -250.0], [9.0, -4.0, 1.0]),
];
/// Bright stars, degrees.
const BRIGHT: [[f64; 2]; 6] = [
    [101.29, -16.72],
    [84.05, -1.2],
    [56.87, 24.1],
    [95.99, -52.7],
    [152.09, 11.97],
    [310.36, 45.28],
];

/// One random frame.
pub struct Case {
    pub camera: Camera,
    pub vehicle: VehicleState,
    pub choice: Choice,
    /// Whether the field is wide and contains many stars.
    pub wide: bool,
    /// The camera's file, printed when a case fails.
    pub text: String,
}

/// Random numbers, the same for the same seed.
pub struct Random(PixelStream);

impl Random {
    pub fn new(seed: u64) -> Random {
        let key = NoiseKey {
            seed,
            sequence: 0,
            repeat: 0,
        };
        Random(PixelStream::new(key, 200, 0))
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.uniform()
    }

    /// Uniform in the logarithm.
    fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        self.uniform(low.ln(), high.ln()).exp()
    }

    fn once_in(&mut self, n: f64) -> bool {
        self.0.uniform() * n < 1.0
    }

    /// Once in `n` times 0, else log-uniform.
    fn zero_or_log_uniform(&mut self, n: f64, low: f64, high: f64) -> f64 {
        if self.once_in(n) {
            0.0
        } else {
            self.log_uniform(low, high)
        }
    }

    fn pick<'a, T>(&mut self, of: &'a [T]) -> &'a T {
        &of[(self.0.uniform() * of.len() as f64) as usize]
    }

    fn direction(&mut self) -> Vector3<f64> {
        Vector3::new(self.0.normal(), self.0.normal(), self.0.normal()).normalize()
    }
}

/// The frame of a seed; none where such a camera is invalid.
pub fn case(seed: u64, epoch: Epoch, folder: &Path) -> Option<Case> {
    let mut random = Random::new(seed);
    let c = &mut random;
    let [width, height] = [0, 1].map(|_| c.uniform(64.0, 128.0) as u32);
    let exposure_s = c.log_uniform(1e-3, 4.0);
    let field_deg = c.log_uniform(1.0, 40.0);
    let fisheye = c.once_in(5.0);
    let focal_px = f64::from(width) / field_deg.to_radians();
    let psf = psf(c, folder);
    // Diffraction is some pixels wide at f/5 to f/40.
    let aperture_mm = if psf.contains("airy") {
        focal_px * 0.01 / c.log_uniform(5.0, 40.0)
    } else {
        c.log_uniform(1.0, 100.0)
    };
    let projection = projection(c, fisheye, field_deg);
    let vignetting = match c.uniform(0.0, 3.0) as u32 {
        0 => String::new(),
        1 => "vignetting = { cos4 = true }\n".to_string(),
        _ => format!(
            "vignetting = {{ table = [[0.0, 1.0], [{:?}, {:?}], [{:?}, {:?}]] }}\n",
            0.2 * field_deg,
            c.uniform(0.5, 1.0),
            0.4 * field_deg,
            c.uniform(0.0, 0.5)
        ),
    };
    let shutter = match c.uniform(0.0, 3.0) as u32 {
        0 => String::new(),
        1 => format!(
            "shutter = \"rolling\"\nrow_us = {:?}",
            c.log_uniform(1e-3, 2.0) * exposure_s / f64::from(height) * 1e6
        ),
        _ => format!(
            "shutter = \"frame-transfer\"\nrow_us = {:?}",
            c.log_uniform(1e-5, 1e-2) * exposure_s * 1e6
        ),
    };
    let listed = |c: &mut Random| {
        let mut coordinate = |side| c.uniform(0.0, f64::from(side)) as u32;
        let mut pixels = [[width, height]; 6]
            .map(|sides| sides.map(&mut coordinate))
            .to_vec();
        pixels.truncate(if c.once_in(2.0) { 6 } else { 0 });
        format!("{pixels:?}")
    };
    let full_well = c.log_uniform(100.0, 2e5);
    let bits = c.uniform(6.0, 16.99) as u32;
    let detector = format!(
        "width_px = {width}\nheight_px = {height}\npixel_um = 10.0\nquantum_efficiency = 0.6\nprnu = {:?}\ndark_e_s = {:?}\n\
         dark_nonuniformity = {:?}\nhot_fraction = {:?}\nhot_e_s = {:?}\ndead_fraction = {:?}\ndead_px = {}\nstuck_fraction = {:?}\n\
         stuck_px = {}\nread_noise_e = {:?}\nfull_well_e = {full_well:?}\nblooming = \"{}\"\nnonlinearity = {:?}\n\
         gain_e_per_dn = {:?}\noffset_dn = {:?}\nadc_bits = {bits}\nadc_clips_first = true",
        c.zero_or_log_uniform(2.0, 1e-3, 0.5).min(0.3),
        c.zero_or_log_uniform(3.0, 1e-2, 1e4),
        c.zero_or_log_uniform(2.0, 1e-2, 2.0),
        c.zero_or_log_uniform(2.0, 1e-4, 1e-2),
        c.zero_or_log_uniform(2.0, 1.0, 1e5),
        c.zero_or_log_uniform(2.0, 1e-4, 1e-2),
        listed(c),
        c.zero_or_log_uniform(2.0, 1e-4, 1e-2),
        listed(c),
        c.zero_or_log_uniform(4.0, 1e-2, 30.0),
        if c.once_in(2.0) { "none" } else { "column" },
        c.zero_or_log_uniform(2.0, 1e-4, 0.5),
        full_well / 2f64.powi(bits as i32) * c.log_uniform(0.3, 3.0),
        c.uniform(0.0, 0.2) * 2f64.powi(bits as i32),
    );
    let radiation = if c.once_in(2.0) {
        let area_cm2 = f64::from(width * height) * 1e-6;
        format!(
            "[radiation]\nflux_cm2_s = {:?}\nthickness_um = {:?}\ndiffusion_um = {:?}\n",
            c.log_uniform(0.1, 30.0) / area_cm2 / exposure_s,
            c.uniform(2.0, 20.0),
            c.uniform(0.0, 8.0)
        )
    } else {
        String::new()
    };
    let principal = [width, height].map(|side| f64::from(side) * c.uniform(0.3, 0.7));
    let text = format!(
        "name = \"by chance\"\nserial = {seed}\n[optics]\nfocal_length_mm = {:?}\naperture_mm = {aperture_mm:?}\ntransmission = {:?}\n\
         band = \"silicon\"\nprincipal_px = {principal:?}\n{psf}{vignetting}{projection}[detector]\n{detector}\n{radiation}[timing]\n\
         exposure_s = {exposure_s:?}\nrate_hz = 0.01\n{shutter}\n",
        focal_px * 0.01,
        c.log_uniform(1e-3, 1.0),
    );
    std::fs::write(folder.join("random.toml"), &text).unwrap();
    let camera = Camera::load("random.toml", &Folder::Disk(folder.to_path_buf())).ok()?;

    let vehicle = vehicle(c, epoch, seed as u32, &camera, field_deg)?;
    // Other effects are on or off. One that is off changes the contributions of the others.
    let mut choice = Choice {
        all: true,
        ..Choice::default()
    };
    for effect in skyloop::effect::EFFECTS {
        if effect.name != "readout" && c.once_in(8.0) && !c.once_in(2.0) {
            choice.off.push(effect.name);
        }
    }
    Some(Case {
        camera,
        vehicle,
        choice,
        wide: field_deg > 6.0,
        text,
    })
}

fn projection(c: &mut Random, fisheye: bool, field_deg: f64) -> String {
    // Relative displacement at the field's edge.
    let half = (field_deg / 2.0).to_radians();
    let strength = c.log_uniform(1e-5, 0.2) * if c.once_in(2.0) { -1.0 } else { 1.0 };
    if fisheye {
        let k = [strength / half.powi(2), 0.1 * strength / half.powi(4)];
        return format!("projection = {{ model = \"fisheye\", k = {k:?} }}\n");
    }
    if c.once_in(3.0) {
        return String::new();
    }
    let edge = half.tan();
    let k = [strength / edge.powi(2), 0.2 * strength / edge.powi(4)];
    let p = [0, 1].map(|_| c.uniform(-0.1, 0.1) * strength / edge);
    format!("projection = {{ model = \"brown-conrady\", k = {k:?}, p = {p:?} }}\n")
}

fn psf(c: &mut Random, folder: &Path) -> String {
    let varies = if c.once_in(2.0) {
        String::new()
    } else {
        let width = c.uniform(0.6, 2.5);
        format!(", width_by_field = [[0.0, 1.0], [20.0, {width:?}]]")
    };
    match c.uniform(0.0, 10.0) as u32 {
        0..=4 => format!(
            "psf = {{ kind = \"gaussian\", sigma_px = {:?}{varies} }}\n",
            c.log_uniform(0.3, 3.0)
        ),
        5..=6 => format!(
            "psf = {{ kind = \"moffat\", fwhm_px = {:?}, beta = {:?}{varies} }}\n",
            c.log_uniform(0.7, 3.0),
            c.uniform(2.5, 8.0)
        ),
        7 => format!(
            "psf = {{ kind = \"airy\", obscuration = {:?}{varies} }}\n",
            c.uniform(0.0, 0.6)
        ),
        _ => image(c, folder),
    }
}

/// Blobs side by side, as of coma or a ghost.
fn image(c: &mut Random, folder: &Path) -> String {
    const SIDE: usize = 24;
    let blobs: Vec<[f64; 4]> = (0..3)
        .map(|_| {
            let [x, y] = [0, 1].map(|_| c.uniform(8.0, 16.0));
            [x, y, c.uniform(1.2, 4.0), c.uniform(0.1, 1.0)]
        })
        .collect();
    let at = |x: usize, y: usize| -> f64 {
        let blob = |[bx, by, s, light]: &[f64; 4]| {
            let r2 = (x as f64 - bx).powi(2) + (y as f64 - by).powi(2);
            light / (s * s) * (-r2 / (2.0 * s * s)).exp()
        };
        blobs.iter().map(blob).sum()
    };
    let all: f64 = (0..SIDE * SIDE).map(|i| at(i % SIDE, i / SIDE)).sum();
    let row = |y| {
        let row = (0..SIDE).map(|x| format!("{:.9}", at(x, y) / all));
        row.collect::<Vec<_>>().join(", ")
    };
    let rows: Vec<String> = (0..SIDE).map(row).collect();
    std::fs::write(folder.join("random.csv"), rows.join("\n")).unwrap();
    let oversampling = *c.pick(&[2.0, 3.0, 4.0]);
    format!(
        "psf = {{ kind = \"image\", images = [{{ file = \"random.csv\" }}], oversampling = {oversampling:?} }}\n"
    )
}

fn vehicle(
    c: &mut Random,
    epoch: Epoch,
    sequence: u32,
    camera: &Camera,
    field_deg: f64,
) -> Option<VehicleState> {
    let orbit = !c.once_in(4.0);
    let towards = match c.uniform(0.0, 3.0) as u32 {
        0 => c.direction(),
        1 if orbit => Vector3::from(c.pick(&OBJECTS).0).normalize(),
        _ => {
            let [ra, dec] = c.pick(&BRIGHT).map(f64::to_radians);
            unit(ra, dec)
        }
    };
    let aside = c.direction() * (c.uniform(0.0, 0.7) * field_deg.to_radians());
    let q = look_at(towards + aside, c.uniform(0.0, TAU));
    // Image motion during the exposure and the readout, px.
    let open_s = camera.exposure_s + camera.readout_s();
    let rate = c.zero_or_log_uniform(5.0, 1e-4, 60.0) / camera.optics.focal_px / open_s;
    let mut axis = c.direction();
    if c.once_in(4.0) {
        axis.z *= 20.0;
    }
    let rate = axis.normalize() * rate.min(0.99 / open_s);
    let orbit = orbit.then(|| {
        let (position, velocity) = ORBIT;
        (position.map(|x| x * 1e3), velocity.map(|x| x * 1e3))
    });
    VehicleState::new(sequence, epoch, q, rate.into(), orbit).ok()
}
