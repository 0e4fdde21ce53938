//! Faults in any link: packets harmed, lost, doubled, late or out of order, by a schedule or by the client's
//! command. All of it repeats with its seeds, and is written down.
//!
//! The order is wire, faults, capture, emulator: a recording holds what the emulator received and what it sent.

mod book;
mod bus;
mod engine;
mod harm;
mod line;
mod outage;
mod plan;
mod rule;
mod spared;
mod stopped;
mod wire;

pub use book::{Book, MARK as LOG_MARK};
pub use bus::BusFaults;
pub use engine::{Damageable, Faults, How, Injection, Pushed, What};
pub use line::CAPACITY;
pub use plan::{Plan, impossible, name};
pub use rule::Rule;
pub use stopped::{Needs, Shape, Stop};
pub use wire::wrap;
