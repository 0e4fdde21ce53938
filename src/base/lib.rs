//! Shared by renderer and links: keyed random numbers, ranges, and configuration files with error
//! texts that name file, key, value and allowed range.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod abort;
pub mod load;
pub mod range;
pub mod rng;
