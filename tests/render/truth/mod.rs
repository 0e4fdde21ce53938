//! The renderer and its labels against each other and against brute force.

pub mod brute;
mod labels;
mod light;
mod passing;
mod rolling;
mod shade;
mod smear;
mod transfer;
