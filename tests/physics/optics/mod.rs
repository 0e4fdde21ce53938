//! The optics against independent programs, against integration, and what a camera file may not say of them.

mod cameras;
mod labels;
mod projection;
mod psf;
mod refused;
