//! Area light on the pixels, against integration from the camera's constants.

mod blinded;
mod frames;
mod moon;
mod moved;
mod rasterized;
mod skipped;
