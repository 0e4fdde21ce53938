//! Area light on the pixels, against integration from figures alone.

mod blinded;
mod frames;
mod laid;
mod moon;
mod moved;
mod skipped;
