//! Cameras, vehicles and lights for the cases.

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop::attitude::{Attitude, VehicleState};
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::fidelity::{Choice, Fidelity};
use skyloop::frame::{Frame, Memory};
use skyloop::orbit::sgp4_batch::Level;
use skyloop::plan::{Plan, simulated};
use skyloop::render::render;
use skyloop::scene::{Body, Candidate, Scene, build_scene};
use std::sync::OnceLock;

pub use crate::fixtures::unit;
use crate::fixtures::{dark, noise_free};
pub use crate::oem::{falling, oem};
pub use crate::plain_camera::camera;

pub fn epoch(text: &str) -> Epoch {
    skyloop::orbit::time::parse_utc(text).unwrap()
}

/// The default time.
pub fn noon() -> Epoch {
    epoch("2026-03-01T12:00:00")
}

/// A vehicle with that attitude and those body rates (deg/s), at [`noon`].
pub fn vehicle(attitude: &Attitude, rates_deg_s: [f64; 3]) -> VehicleState {
    let rates = rates_deg_s.map(f64::to_radians);
    VehicleState::new(7, noon(), attitude.xyzw(), rates, None).unwrap()
}

/// The same at rest.
pub fn still(attitude: &Attitude) -> VehicleState {
    vehicle(attitude, [0.0; 3])
}

/// A low orbit at [`noon`], km and km/s.
pub const LOW_KM: Vector3<f64> = Vector3::new(7000.0, 0.0, 0.0);
pub const LOW_KM_S: Vector3<f64> = Vector3::new(0.0, 7.5, 0.0);

/// The vehicle in that orbit, pointed away from the Earth.
pub fn in_low_orbit() -> VehicleState {
    orbiter(&towards(&LOW_KM), LOW_KM * 1e3, LOW_KM_S * 1e3)
}

/// A vehicle at rest in orbit, m and m/s.
pub fn orbiter(
    attitude: &Attitude,
    position_m: Vector3<f64>,
    velocity_m_s: Vector3<f64>,
) -> VehicleState {
    let orbit = Some((position_m.into(), velocity_m_s.into()));
    VehicleState::new(7, noon(), attitude.xyzw(), [0.0; 3], orbit).unwrap()
}

/// The attitude with the boresight along `direction`.
pub fn towards(direction: &Vector3<f64>) -> Attitude {
    let (ra, dec) = (
        direction.y.atan2(direction.x),
        direction.z.atan2(direction.x.hypot(direction.y)),
    );
    Attitude::towards(ra, dec, 0.3)
}

/// The plain camera with as many rows as columns, and these keys.
pub fn square(side: usize, keys: &str) -> Camera {
    camera(&format!(
        "detector.width_px = {side}; detector.height_px = {side}; {keys}"
    ))
}

/// An emulator without noise, with only objects and the added lights in the sky. Labels list
/// everything, and expected electrons are stored.
pub fn emulator(camera: Camera, fidelity: Fidelity, with: impl FnOnce(&mut Config)) -> Emulator {
    let mut config = dark(Config::defaults().unwrap());
    config.camera = camera;
    config.fidelity = fidelity;
    config.choice.off.extend(["stars", "shot noise"]);
    with(&mut config);
    noise_free(config)
}

/// One with the stars of the Bright Star Catalogue.
pub fn starry(camera: Camera, fidelity: Fidelity) -> Emulator {
    emulator(camera, fidelity, |config| {
        config.choice.off.retain(|name| *name != "stars");
    })
}

/// A light: apparent direction (ICRF) and electrons of the exposure.
#[derive(Clone, Copy, Debug)]
pub struct Light {
    pub direction: Vector3<f64>,
    pub electrons: f64,
}

impl Light {
    pub fn new(direction: Vector3<f64>, electrons: f64) -> Light {
        Light {
            direction,
            electrons,
        }
    }
}

/// A star's candidate, the template of others.
fn template() -> Candidate {
    static STAR: OnceLock<Candidate> = OnceLock::new();
    let star = || {
        let camera = crate::fixtures::camera("all-sky");
        let emulator = starry(camera, Fidelity::REALTIME);
        let vehicle = vehicle(&Attitude::identity(), [0.0; 3]);
        let scene = emulator.scene(&emulator.camera(), &vehicle, 0, &emulator.choice);
        let view = scene.unwrap().view;
        let is_star = |candidate: &&Candidate| matches!(candidate.body, Body::Star(_));
        view.candidates.iter().find(is_star).unwrap().clone()
    };
    STAR.get_or_init(star).clone()
}

/// A frame of these lights alone: its scene, expected electrons and DN.
pub struct Lit {
    pub scene: Scene,
    pub expected_e: Vec<f64>,
    pub dn: Vec<u16>,
    /// The effects of its plan.
    pub choice: Choice,
}

pub fn alone(
    emulator: &Emulator,
    vehicle: &VehicleState,
    direction: Vector3<f64>,
    electrons: f64,
) -> Lit {
    light(emulator, vehicle, &[Light::new(direction, electrons)])
}

pub fn expected(exposed: ExposedFrame) -> Vec<f64> {
    let pixels = exposed.frame.expected_e.unwrap();
    pixels.into_iter().map(f64::from).collect()
}

/// Puts `lights` in front of the camera of `emulator`.
pub fn light(emulator: &Emulator, vehicle: &VehicleState, lights: &[Light]) -> Lit {
    let mut choice = emulator.choice.clone();
    choice.off.retain(|name| *name != "stars");
    let bare = emulator.scene(&emulator.camera(), vehicle, 0, &emulator.choice);
    let mut view = bare.unwrap().view;
    let template = template();
    let Body::Star(seen) = template.body.clone() else {
        unreachable!()
    };
    view.candidates = lights
        .iter()
        .map(|light| {
            let mut star = seen;
            star.direction = light.direction;
            star.wavelength_ratio = 1.0;
            let mut candidate = template.clone();
            candidate.body = Body::Star(star);
            candidate.clear_e = light.electrons;
            candidate.light = 1.0;
            candidate.hidden = None;
            candidate
        })
        .collect();
    let simulated = simulated(&view, emulator.fidelity(), &choice);
    let scene = build_scene(view, simulated, emulator.fidelity());
    let frame = drawn(&Plan::new(&scene, emulator.fidelity(), &choice), &scene);
    let expected_e = frame.expected_e.unwrap().into_iter().map(f64::from);
    Lit {
        expected_e: expected_e.collect(),
        dn: frame.dn,
        scene,
        choice,
    }
}

/// The frame of a plan, with its expected electrons.
pub fn drawn(plan: &Plan<'_>, scene: &Scene) -> Frame {
    render(
        plan,
        scene,
        Some(Level::best()),
        true,
        &mut Memory::default(),
        &|_, _| {},
    )
}

/// The direction (ICRF) whose image is at `pixel` of a camera with that attitude.
pub fn behind(camera: &Camera, attitude: &Attitude, pixel: [f64; 2]) -> Vector3<f64> {
    let mounted = attitude.then(&camera.mounting);
    mounted.inverse().rotate(&camera.optics.direction(pixel))
}

/// A Gaussian's share of the pixel whose centre is `x` from it, along one axis: closed form.
pub fn share_along(x: f64, sigma: f64) -> f64 {
    let below = |x: f64| 0.5 * libm::erfc(-x / sigma / std::f64::consts::SQRT_2);
    below(x + 0.5) - below(x - 0.5)
}

/// Light, and its centre (px).
pub fn moments(image: &[f64], width: usize) -> (f64, [f64; 2]) {
    let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
    for (i, e) in image.iter().enumerate() {
        sum += e;
        x += e * (i % width) as f64;
        y += e * (i / width) as f64;
    }
    (sum, [x / sum, y / sum])
}

/// Fails where a frame or its label contains a non-finite number.
pub fn check_numbers(exposed: &ExposedFrame, what: &str) {
    let expected = exposed.frame.expected_e.iter().flatten();
    assert!(
        expected.clone().all(|e| e.is_finite() && *e >= 0.0),
        "{what}"
    );
    let charge = exposed.frame.charge_e.iter().flatten();
    assert!(charge.clone().all(|e| e.is_finite()), "{what}");
    let label: serde_json::Value = serde_json::from_str(&exposed.json).unwrap();
    for object in label["objects"].as_array().unwrap() {
        let object = object.as_object().unwrap();
        for (key, value) in object {
            // No light arrives.
            let dark = key == "band_mag" && object["electrons"].as_f64() == Some(0.0);
            assert!(!value.is_null() || dark, "{what}: {key} of {object:?}");
        }
    }
}
