//! A run in real time: [`serve`] takes commands from the links and sends frames by their deadlines,
//! [`realtime`] asks the system for priority, [`timing`] holds what was measured, [`metrics`] and
//! [`stats`] show it, [`host`] says what the machine did meanwhile, and [`soak`] gives the verdict.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod host;
pub mod metrics;
pub mod realtime;
pub mod serve;
pub mod soak;
pub mod stats;
pub mod timing;
