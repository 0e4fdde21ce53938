//! Limits of a long run, the verdicts about them, and its report.

mod drift;
#[cfg(test)]
mod fixture;
mod limits;
mod report;

pub use drift::Drift;
pub use limits::{Camera, Limits, Measured};
pub use report::{Report, suite};
pub use skyloop_firmware_sim::verdict::Verdict;
