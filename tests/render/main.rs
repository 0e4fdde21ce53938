//! Whole frames and their labels: against brute force, at the edges of numbers, and within the
//! errors that the engine declares.

#[path = "../support/fixtures.rs"]
mod fixtures;
#[path = "../support/oem.rs"]
mod oem;
#[path = "../support/plain_camera.rs"]
mod plain_camera;
#[path = "../support/scenes.rs"]
mod scenes;
#[path = "../support/table.rs"]
mod table;

mod area;
mod bounds;
mod catalogue;
mod fidelity;
mod frames;
mod hard_cases;
mod output;
mod plan;
mod prices;
mod truth;
