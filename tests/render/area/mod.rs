//! Area light on the pixels, against integration from figures alone.

mod blinded;
#[path = "../support/fixtures.rs"]
mod fixtures;
mod frames;
mod laid;
mod moon;
mod moved;
mod skipped;
