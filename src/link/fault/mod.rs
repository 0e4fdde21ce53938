//! Fault injection for any link: items are damaged, lost, duplicated, delayed or reordered, by a
//! schedule or by command. Faults are reproducible by their seeds, and logged.
//!
//! The order is wire, faults, capture, emulator: a recording holds the packets that the emulator
//! received and sent.

mod bus;
mod engine;
mod exempt_answers;
mod fault_log;
mod injection;
mod injector;
mod item_state;
mod line;
mod outage;
mod plan;
mod rule;
mod stopped;
mod wire;

pub use bus::BusFaults;
pub use fault_log::{FaultLog, MARK as LOG_MARK};
pub use line::CAPACITY;
pub use plan::{Plan, impossible, name};
pub use stopped::{Needs, Stop};
pub use wire::wrap;
