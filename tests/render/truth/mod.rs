//! The renderer and its labels against each other and against brute force.

mod brute;
#[path = "../support/fixtures.rs"]
mod fixtures;
mod labels;
mod light;
mod passing;
mod rolling;
mod shade;
#[path = "../support/sky.rs"]
mod sky;
mod smear;
mod transfer;
