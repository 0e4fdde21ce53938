//! Cameras, scenes and their frames.
#![allow(dead_code, reason = "each test program uses its own part of this")]

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use skyloop::attitude::VehicleState;
use skyloop::camera::Camera;
use skyloop::config::Config;
use skyloop::engine::{Emulator, ExposedFrame};
use skyloop::flight;
use skyloop::load::Folder;
use skyloop::sky::catalog::Selection;
use skyloop_firmware_sim::mission::Mission;
use std::path::Path;

/// A shipped camera.
pub fn camera(name: &str) -> Camera {
    Camera::load(name, &Folder::current()).unwrap()
}

/// The centre of a camera's detector, `side` pixels square.
pub fn cropped(mut camera: Camera, side: usize) -> Camera {
    (camera.detector.width, camera.detector.height) = (side, side);
    camera.optics.principal_px = [(side as f64 - 1.0) / 2.0; 2];
    camera
}

/// The configuration of a scene: a file or folder of `configs/scenes`.
pub fn scene(name: &str) -> Config {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/scenes");
    Config::load(&scenes.join(name)).unwrap()
}

/// The effects that add light, except stars and objects in orbit.
const DARK_SKY: [&str; 9] = [
    "zodiacal light",
    "starlight",
    "planets",
    "moon",
    "earth",
    "limb",
    "sunlight",
    "moonglow",
    "earthshine",
];

/// A configuration of a dark sky with bright stars and labels of all objects.
pub fn dark(mut config: Config) -> Config {
    config.sky.selection = Selection::Bsc;
    config.label_snr = 0.0;
    config.choice.off = DARK_SKY.to_vec();
    config
}

/// An emulator without noise that stores the expected electrons.
pub fn noise_free(mut config: Config) -> Emulator {
    let mut emulator = Emulator::new(&mut config);
    emulator.choice.noise = false;
    emulator.keep_expected = true;
    emulator
}

/// The frames of a configuration with a sequence.
pub struct Frames {
    pub emulator: Emulator,
    pub mission: Mission,
}

impl Frames {
    pub fn of(mut config: Config) -> Frames {
        let mission = flight::mission(&config).unwrap();
        Frames {
            emulator: Emulator::new(&mut config),
            mission,
        }
    }

    /// The vehicle in a frame.
    pub fn vehicle(&self, number: u32) -> VehicleState {
        flight::vehicle(&self.mission, number).unwrap()
    }

    pub fn expose(&mut self, number: u32) -> ExposedFrame {
        let vehicle = self.vehicle(number);
        self.emulator.expose(&vehicle, 0).unwrap()
    }
}

/// Unit vector of right ascension and declination, rad.
pub fn unit(ra: f64, dec: f64) -> Vector3<f64> {
    let ((sin_ra, cos_ra), (sin_dec, cos_dec)) = (ra.sin_cos(), dec.sin_cos());
    Vector3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec)
}

/// The attitude that turns +Z to `direction`, rolled by `roll` rad.
pub fn look_at(direction: Vector3<f64>, roll: f64) -> [f64; 4] {
    let z = direction.normalize();
    let aside = z.cross(&Vector3::new(0.3, -0.5, 0.81)).normalize();
    let x = aside * roll.cos() + z.cross(&aside) * roll.sin();
    let matrix = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(matrix));
    [q.i, q.j, q.k, q.w]
}

/// An attitude with the boresight along `direction`.
pub fn towards(direction: &Vector3<f64>) -> [f64; 4] {
    let turn = UnitQuaternion::rotation_between(direction, &Vector3::z()).unwrap();
    [turn.i, turn.j, turn.k, turn.w]
}
