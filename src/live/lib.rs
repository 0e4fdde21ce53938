//! A run in real time: [`serve`] executes commands from the links and sends frames by their
//! deadlines, [`realtime`] requests priority, [`timing`] measures, [`metrics`] and [`stats`]
//! publish the measurements, [`host`] reads the load of the machine, and [`soak`] checks limits.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod host;
pub mod metrics;
pub mod realtime;
pub mod serve;
pub mod soak;
pub mod stats;
pub mod timing;
