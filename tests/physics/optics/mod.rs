//! The optics against independent programs, against integration, and what a camera file may not say of them.

#[path = "../reference/mod.rs"]
mod reference;

mod cameras;
mod labels;
mod projection;
mod psf;
mod refused;
