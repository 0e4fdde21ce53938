//! skyloop: a hardware-in-the-loop star-tracker emulator.

pub mod sky;
