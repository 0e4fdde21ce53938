//! Models against independent references and closed forms: directions, light, optics, noise and
//! the detector; and the values that camera files may not have.

#[path = "../support/earth.rs"]
mod earth;
#[path = "../support/fixtures.rs"]
mod fixtures;
#[path = "../support/oem.rs"]
mod oem;
#[path = "../support/plain_camera.rs"]
mod plain_camera;
#[path = "../reference/mod.rs"]
mod reference;
#[path = "../support/table.rs"]
mod table;

mod apparent;
mod cameras;
mod catalog;
mod detector;
mod directions;
mod draws;
mod earth_light;
mod limb;
mod look_at;
mod noise;
mod optics;
mod passes;
mod refused;
mod rso;
mod shadow;
