//! Why a run cannot go on.

use std::time::Duration;

use hifitime::Epoch;
use skyloop_orbit::time::utc_text;
use thiserror::Error;

use crate::port::PortError;
use crate::profile::ProfileError;
use crate::report::{NackRecord, Report};

/// Why a run cannot go on.
#[derive(Debug, Error)]
pub enum RunError {
    /// The link is gone.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Nobody answered a Reset.
    #[error(
        "{link}: no answer within {} s: is an emulator (skyloop run) listening on this link, and at this baud rate? {hint}",
        waited.as_secs_f64()
    )]
    NoAnswer {
        /// The link's name.
        link: String,
        /// What fits the case.
        hint: &'static str,
        /// How long it was waited for.
        waited: Duration,
    },
    /// The links leave something out.
    #[error("no link has the role {role}: add it to the roles= of one, or give another link")]
    Role {
        /// What is missing.
        role: &'static str,
    },
    /// The emulator does not send what is asked for.
    #[error("the emulator refuses what is asked for: {}; change --output or what is given with it", nack.detail)]
    Refused {
        /// Its words.
        nack: NackRecord,
    },
    /// The emulator does not inject a fault.
    #[error("the emulator refuses the fault: {}", nack.detail)]
    FaultRefused {
        /// Its words.
        nack: NackRecord,
    },
    /// Nobody answered a Fault.
    #[error(
        "{link}: no answer to a fault within {} s: the faults before it may let nothing through; begin with the others, or give it a \
         time",
        waited.as_secs_f64()
    )]
    FaultUnanswered {
        /// The link's name.
        link: String,
        /// How long it was waited for.
        waited: Duration,
    },
    /// The emulator has fallen silent.
    #[error(
        "{links}: nothing has come for {silent_s:.0} s, of {attitudes} attitudes: has the emulator ended, or does a fault \
         stop the line?"
    )]
    Silent {
        /// The names of all links.
        links: String,
        /// How long, s.
        silent_s: f64,
        /// Attitudes in a row of which nothing came.
        attitudes: u32,
    },
    /// The mission had begun; what came of it is in the report.
    #[error("{source}")]
    CutShort {
        /// The report until then.
        report: Box<Report>,
        /// What went wrong.
        source: Box<RunError>,
    },
    /// There is no attitude or no state for a frame.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// An epoch that the wire's time field does not hold.
    #[error("{} is outside the wire's time, 1958 to 2094: choose another epoch", utc_text(*epoch))]
    Time {
        /// The epoch.
        epoch: Epoch,
    },
    /// A closed loop that is not by the wall clock, or of a profile that turns.
    #[error("a closed loop holds one attitude by the wall clock: {remedy}")]
    Loop {
        /// What to do.
        remedy: &'static str,
    },
    /// A setting out of its range.
    #[error("{what} is {value:e}; it must be finite and above 0")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}
