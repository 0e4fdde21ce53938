//! Noise draws: all words against the normal and Poisson's distribution. Philox's words are tested
//! in `src/base/rng/mod.rs`, the kernels that draw for many pixels in `tests/physics/draws.rs`.

mod drawn;
mod runs;
mod theory;
mod words;
