//! The optics against independent programs and integration. Invalid camera files are refused.

mod cameras;
mod labels;
mod projection;
mod psf;
mod refused;
