// Generated from protocols/schema by `cargo run -p skyloop-schema`: do not edit.
//! What `schema/packets.toml` says: codes, messages, how they are read and written.

pub mod answers;
pub mod codes;
pub mod commands;
pub mod counters;
pub mod ends;
pub mod frames;
