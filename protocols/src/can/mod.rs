//! Packets on a CAN bus, classic or FD, without any I/O: frames in, packets out, and back.
//!
//! 1. [`frame`]: one frame, its length codes and its time on the bus.
//! 2. [`node`]: an end of the bus: whole space packets on one side, frames on the other.

pub mod frame;
pub mod node;

pub use frame::CanFrame;
pub use node::{Busy, Counts, Lane, Node, Side};
