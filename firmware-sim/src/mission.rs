//! What the flight computer is to do.

use std::time::Duration;

use hifitime::Epoch;

use crate::profile::{OrbitSource, Profile};

/// What the flight computer is to do.
#[derive(Clone)]
pub struct Mission {
    /// Time of the first attitude: in stepped mode the middle of the first exposure.
    pub start: Epoch,
    /// Step between the times of two attitudes in stepped mode, s, above 0.
    pub period_s: f64,
    /// Frames to ask for or, by the wall clock, to wait for.
    pub frames: u32,
    /// Where to point.
    pub profile: Profile,
    /// Where to be. Without it no position is sent.
    pub orbit: Option<OrbitSource>,
    /// How long to wait for a whole frame; also for the first answer.
    pub timeout: Duration,
    /// What sets the pace.
    pub pace: Pace,
}

/// What sets the pace of the attitudes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// The next attitude leaves when the last one's frame is in.
    Stepped {
        /// Attitudes a second at most, Hz, above 0.
        most_hz: Option<f64>,
    },
    /// Attitudes leave by the wall clock, their time running on from [`Mission::start`]; frames come as they come.
    Wall {
        /// Attitudes a second, Hz, above 0.
        rate_hz: f64,
    },
}
