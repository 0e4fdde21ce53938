//! What the renderer and the links share: keyed random numbers, ranges, and configuration files with
//! error texts that name file, key, value and allowed range.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod abort;
pub mod load;
pub mod range;
pub mod rng;
