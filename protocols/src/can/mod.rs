//! Packets on a CAN bus, classic or FD, without I/O: packets to frames, and frames to packets.
//!
//! 1. [`frame`]: one frame, its length codes and its time on the bus.
//! 2. [`form`]: attitudes, short commands and Acks as plain frames.
//! 3. [`isotp`]: all other packets, in segments.
//! 4. [`node`]: an end of the bus, with space packets on one side and frames on the other.
//! 5. [`slcan`]: frames as lines of text on a serial line; [`adapter`]: an emulated adapter.

pub mod adapter;
mod collector;
mod counts;
pub mod form;
pub mod frame;
pub mod isotp;
pub mod node;
mod receiver;
mod sender;
pub mod slcan;
mod stuffing;

pub use frame::CanFrame;
pub use isotp::Parameters;
pub use node::{Busy, Counts, Lane, Node, Side};
