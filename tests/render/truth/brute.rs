//! The contents of a frame by brute force, from its label and the camera's constants alone. Nothing
//! here calls the renderer's projection, point spread function, tracks or footprints.

use std::f64::consts::SQRT_2;
use std::ops::Range;
use std::str::FromStr;

use hifitime::Epoch;
use nalgebra::{Matrix3, Vector3};
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::fidelity::Fidelity;
use skyloop::label::{EffectLabel, Label, ObjectLabel};
use skyloop::measure::Bench;
use skyloop::orbit::Object;
use skyloop::sky::catalog::Selection;

use crate::fixtures::{self, dark, noise_free};

pub use crate::fixtures::{look_at, unit};
pub use crate::oem::{falling, oem};

/// Speed of light, km/s (exact).
const LIGHT_KM_S: f64 = 299_792.458;
/// Gravitational parameter of the Earth, km^3/s^2 (WGS84).
const GM: f64 = 398_600.441_8;

pub fn epoch(text: &str) -> Epoch {
    Epoch::from_str(&format!("{text} UTC")).unwrap()
}

/// An emulator without noise that labels everything and stores the expected electrons.
pub fn emulator(
    camera: &str,
    stars: Selection,
    objects: Vec<Object>,
    fidelity: Fidelity,
) -> Emulator {
    let mut config = dark(Config::defaults().unwrap());
    config.camera = fixtures::camera(camera);
    config.sky.selection = stars;
    config.objects = objects;
    config.fidelity = fidelity;
    noise_free(config)
}

/// One frame: attitude `[x, y, z, w]` of any non-zero length, rates in deg/s.
pub fn expose(
    emulator: &mut Emulator,
    at: Epoch,
    q: [f64; 4],
    rates_deg_s: [f64; 3],
    orbit: Option<([f64; 3], [f64; 3])>,
) -> ExposedFrame {
    let vehicle = vehicle(at, q, rates_deg_s, orbit);
    emulator.expose(&vehicle, 0).unwrap()
}

/// The vehicle of a frame of `fai-nir`, turning at these rates (deg/s).
pub fn turning(rates_deg_s: [f64; 3]) -> VehicleState {
    let at = epoch("2026-02-11T18:22:41.25");
    vehicle(at, [0.1, 0.2, -0.3, 0.9], rates_deg_s, None)
}

/// Bright stars in front of a modified `fai-nir`.
pub fn changed_fai(change: impl FnOnce(&mut Emulator)) -> Emulator {
    let mut emulator = emulator("fai-nir", Selection::Bsc, Vec::new(), Fidelity::REALTIME);
    change(&mut emulator);
    emulator
}

/// The built-in scene with bright stars, aberration and a dark sky; labels list everything.
pub fn builtin() -> Config {
    let mut config = dark(Config::builtin().unwrap());
    config.sky.corrections.aberration = true;
    config
}

/// The maximum of some values, and 0.
pub fn maximum(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}

/// The vehicle state of [`expose`].
pub fn vehicle(
    at: Epoch,
    q: [f64; 4],
    rates_deg_s: [f64; 3],
    orbit: Option<([f64; 3], [f64; 3])>,
) -> VehicleState {
    let norm = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    let rates = rates_deg_s.map(f64::to_radians);
    VehicleState::new(5, at, q.map(|c| c / norm), rates, orbit).unwrap()
}

/// The plan's label of `effect`, with the error of leaving it out.
pub fn verdict(emulator: &Emulator, vehicle: &VehicleState, effect: &str) -> EffectLabel {
    let bench = Bench {
        emulator,
        camera: emulator.camera(),
        vehicle: vehicle.clone(),
    };
    let verdicts = bench.verdicts(&emulator.choice).unwrap();
    let mut verdicts = verdicts.into_iter();
    verdicts.find(|verdict| verdict.effect == effect).unwrap()
}

/// Electrons of all of an object's light that arrives in the exposure: Clark et al. 2021, Eqs. (2),
/// (11).
pub fn arriving_e(label: &Label, object: &ObjectLabel, camera: &Camera) -> f64 {
    let area = std::f64::consts::PI * camera.optics.aperture_m.powi(2) / 4.0;
    let gathered = camera.detector.quantum_efficiency * camera.optics.transmission * area;
    let irradiance = camera.optics.band.zero_point() * 10f64.powf(-0.4 * object.band_mag.unwrap());
    irradiance * gathered * label.exposure_s
}

/// `R(q)` written out.
pub fn matrix([x, y, z, w]: [f64; 4]) -> Matrix3<f64> {
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
    )
}

// Plain numbers: faster than generic vectors where tests are little optimised.
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `R(q) v = v + 2 w (u x v) + 2 u x (u x v)` with `q = (u, w)`.
fn rotated([x, y, z, w]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let across = cross([x, y, z], v);
    let again = cross([x, y, z], across);
    [0, 1, 2].map(|k| v[k] + 2.0 * (w * across[k] + again[k]))
}

/// An ICRF direction in the camera, `t` seconds after mid-exposure, as in the label:
/// `M exp(-[w x] t) R(q)`.
pub fn in_camera(label: &Label, direction: [f64; 3], t: f64) -> [f64; 3] {
    let rates = label.rates_rad_s;
    let rate = rates[0].hypot(rates[1]).hypot(rates[2]);
    let axis = rates.map(|part| if rate > 0.0 { part / rate } else { 0.0 });
    let (sin, cos) = (-rate * t / 2.0).sin_cos();
    let turn = [axis[0] * sin, axis[1] * sin, axis[2] * sin, cos];
    let body = rotated(turn, rotated(label.q_icrf_to_body, direction));
    rotated(label.q_body_to_camera, body)
}

/// Unit vector of the label's apparent right ascension and declination.
pub fn apparent(object: &ObjectLabel) -> Vector3<f64> {
    unit(object.ra_deg.to_radians(), object.dec_deg.to_radians())
}

/// The direction of an object `t` seconds after mid-exposure, unit vector: for objects in orbit
/// light time and first-order aberration by the geocentric velocity, from the label's states and
/// the Earth's gravity.
fn direction(label: &Label, object: &ObjectLabel, t: f64) -> Vector3<f64> {
    let Some(rso) = &object.rso else {
        return apparent(object);
    };
    let fall = |r: Vector3<f64>, v: Vector3<f64>, t: f64| {
        r + v * t - r * (GM / r.norm().powi(3) * t * t / 2.0)
    };
    let [x, y, z, vx, vy, vz] = label.state_gcrf_km;
    let (r, v) = (Vector3::new(x, y, z), Vector3::new(vx, vy, vz));
    let velocity = v - r * (GM / r.norm().powi(3) * t);
    let [position, motion] = [rso.position_gcrf_km, rso.velocity_gcrf_km_s].map(Vector3::from);
    let target = |t| fall(position, motion, t);
    let observer = fall(r, v, t);
    let light_time = (target(t) - observer).norm() / LIGHT_KM_S;
    let line = target(t - light_time) - observer;
    (line.normalize() + velocity / LIGHT_KM_S).normalize()
}

/// The position of its image `t` seconds after mid-exposure, px.
pub fn pixel(label: &Label, object: &ObjectLabel, camera: &Camera, t: f64) -> [f64; 2] {
    let [x, y, z] = in_camera(label, direction(label, object, t).into(), t);
    let [cx, cy] = camera.optics.principal_px;
    let f = camera.optics.focal_px;
    [cx + f * x / z, cy + f * y / z]
}

/// The image's position at 65 instants of the exposure, and the maximum distance (px) between
/// consecutive ones.
fn track(label: &Label, object: &ObjectLabel, camera: &Camera) -> (Vec<[f64; 2]>, f64) {
    let instants = (0..=64).map(|i| (f64::from(i) / 64.0 - 0.5) * label.exposure_s);
    let points: Vec<[f64; 2]> = instants.map(|t| pixel(label, object, camera, t)).collect();
    let gaps = points
        .windows(2)
        .map(|ends| (ends[1][0] - ends[0][0]).hypot(ends[1][1] - ends[0][1]));
    let gap = maximum(gaps);
    (points, gap)
}

pub struct Image {
    pub width: usize,
    pub height: usize,
    pub e: Vec<f64>,
}

/// Columns (or rows) `from..past`.
#[derive(Clone, Copy, Debug)]
pub struct Box2 {
    pub low: [i64; 2],
    pub past: [i64; 2],
}

impl Box2 {
    /// The box of nearly all light of `object`: its track, widened by 6 sigma.
    pub fn of(label: &Label, object: &ObjectLabel, camera: &Camera) -> Box2 {
        let (points, gap) = track(label, object, camera);
        // Between two points the track bends by less than an eighth of their distance.
        let pad = 6.0 * camera.optics.psf.core_px() + 0.5 + gap / 8.0;
        let bound = |k: usize, start: f64, maximum: fn(f64, f64) -> f64| {
            points.iter().map(|at| at[k]).fold(start, maximum)
        };
        Box2 {
            low: [0, 1].map(|k| (bound(k, f64::MAX, f64::min) - pad).floor() as i64),
            past: [0, 1].map(|k| (bound(k, f64::MIN, f64::max) + pad).ceil() as i64 + 1),
        }
    }

    pub fn meets(&self, other: &Box2) -> bool {
        (0..2).all(|k| self.low[k] < other.past[k] && other.low[k] < self.past[k])
    }

    pub fn within(&self, image: &Image) -> bool {
        self.low.iter().all(|low| *low >= 0)
            && self.past[0] <= image.width as i64
            && self.past[1] <= image.height as i64
    }

    pub fn clipped(&self, width: usize, height: usize) -> Box2 {
        let size = [width as i64, height as i64];
        Box2 {
            low: [0, 1].map(|k| self.low[k].clamp(0, size[k])),
            past: [0, 1].map(|k| self.past[k].clamp(0, size[k])),
        }
    }
}

impl Image {
    /// The frame's expected electrons without the label's background.
    pub fn light_of(exposed: &ExposedFrame) -> Image {
        let background = exposed.label.background_e_px;
        let expected = exposed.frame.expected_e.iter().flatten();
        Image {
            width: exposed.frame.width,
            height: exposed.frame.height,
            e: expected.map(|e| f64::from(*e) - background).collect(),
        }
    }

    pub fn peak(&self) -> f64 {
        maximum(self.e.iter().copied())
    }

    /// The maximum difference from `truth`, as a part of its brightest pixel.
    pub fn off(&self, truth: &[f64]) -> f64 {
        let off = self.e.iter().zip(truth).map(|(a, b)| (a - b).abs());
        maximum(off) / maximum(truth.iter().copied())
    }

    /// Light, and its centre (px), inside a box.
    pub fn moments(&self, region: &Box2) -> (f64, [f64; 2]) {
        let region = region.clipped(self.width, self.height);
        let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
        for row in region.low[1]..region.past[1] {
            for column in region.low[0]..region.past[0] {
                let e = self.e[row as usize * self.width + column as usize];
                sum += e;
                x += e * column as f64;
                y += e * row as f64;
            }
        }
        (sum, [x / sum, y / sum])
    }
}

/// `electrons` of `object` on each pixel of the part of its box on the detector, row by row: the
/// Gaussian integrated over every pixel, and over time by Simpson's rule.
pub fn stamp(label: &Label, object: &ObjectLabel, camera: &Camera) -> (Box2, Vec<f64>) {
    let size = [camera.detector.width, camera.detector.height];
    let region = Box2::of(label, object, camera).clipped(size[0], size[1]);
    let columns = (region.past[0] - region.low[0]).max(0) as usize;
    let rows = (region.past[1] - region.low[1]).max(0) as usize;
    let mut e = vec![0.0; columns * rows];
    // A tenth of a pixel a step where it is fastest: an error of some 2e-6 of the peak.
    let (_, gap) = track(label, object, camera);
    let steps = 2 * ((5.0 * 64.0 * gap).ceil() as usize).max(2);
    let sigma = camera.optics.psf.core_px();
    // No light beyond 7 sigma and half a pixel.
    let pad = 7.0 * sigma + 0.5;
    for i in 0..=steps {
        let t = (i as f64 / steps as f64 - 0.5) * label.exposure_s;
        let at = pixel(label, object, camera, t);
        let weight = simpson(i, steps) / steps as f64 * object.electrons;
        let near = Box2 {
            low: [0, 1].map(|k| ((at[k] - pad) as i64).max(region.low[k])),
            past: [0, 1].map(|k| ((at[k] + pad) as i64 + 1).min(region.past[k])),
        };
        if (0..2).any(|k| near.low[k] >= near.past[k]) {
            continue;
        }
        let [across, down] = [0, 1].map(|k| shares(near.low[k]..near.past[k], at[k], sigma));
        for (row, down) in (near.low[1] - region.low[1]..).zip(&down) {
            let from = row as usize * columns + (near.low[0] - region.low[0]) as usize;
            for (e, across) in e[from..].iter_mut().zip(&across) {
                *e += weight * down * across;
            }
        }
    }
    (region, e)
}

/// The light of all the label's objects.
pub fn image(label: &Label, camera: &Camera) -> Image {
    let (width, height) = (camera.detector.width, camera.detector.height);
    let mut e = vec![0.0; width * height];
    for object in label.objects.iter().filter(|o| o.electrons > 0.0) {
        let (region, light) = stamp(label, object, camera);
        let columns = (region.past[0] - region.low[0]) as usize;
        for (i, light) in light.iter().enumerate() {
            let (row, column) = (i / columns, i % columns);
            e[(region.low[1] as usize + row) * width + region.low[0] as usize + column] += light;
        }
    }
    Image { width, height, e }
}

/// A normal density of width `sigma` around `at`, integrated over each of these pixels:
/// `(erf((x + 1/2 - at) / (sqrt(2) sigma)) - erf((x - 1/2 - at) / (sqrt(2) sigma))) / 2`.
pub fn shares(pixels: Range<i64>, at: f64, sigma: f64) -> Vec<f64> {
    let edge = |pixel: i64| libm::erf((pixel as f64 - 0.5 - at) / (SQRT_2 * sigma));
    let edges: Vec<f64> = (pixels.start..=pixels.end).map(edge).collect();
    edges
        .windows(2)
        .map(|two| (two[1] - two[0]) / 2.0)
        .collect()
}

/// Weight of node `i` of `n` (even) steps in Simpson's rule, for a step of 1.
pub fn simpson(i: usize, n: usize) -> f64 {
    match i {
        0 => 1.0 / 3.0,
        i if i == n => 1.0 / 3.0,
        i if i % 2 == 1 => 4.0 / 3.0,
        _ => 2.0 / 3.0,
    }
}

/// `(position m, velocity m/s)` for a vehicle state, from km and km/s.
pub fn orbit(r: Vector3<f64>, v: Vector3<f64>) -> Option<([f64; 3], [f64; 3])> {
    Some(((r * 1e3).into(), (v * 1e3).into()))
}
