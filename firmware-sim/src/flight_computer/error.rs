//! Errors that end a run.

use std::time::Duration;

use hifitime::Epoch;
use skyloop_orbit::time::utc_text;
use thiserror::Error;

use crate::port::PortError;
use crate::profile::ProfileError;
use crate::report::{NackRecord, Report};

/// Error that ends a run.
#[derive(Debug, Error)]
#[expect(missing_docs, reason = "the messages say it")]
pub enum RunError {
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(
        "{link}: no answer within {} s: is an emulator (skyloop run) listening on this link, and at this baud rate? {hint}",
        waited.as_secs_f64()
    )]
    NoAnswer {
        link: String,
        hint: &'static str,
        waited: Duration,
    },
    #[error("no link has the role {role}: add it to the roles= of one, or give another link")]
    Role { role: &'static str },
    #[error("the emulator refuses the requested output: {}; change --output or its options", nack.detail)]
    Refused { nack: NackRecord },
    #[error("the emulator refuses the fault: {}", nack.detail)]
    FaultRefused { nack: NackRecord },
    #[error(
        "{link}: no answer to a fault within {} s: the faults before it may let nothing through; begin with the others, or give it a \
         time",
        waited.as_secs_f64()
    )]
    FaultUnanswered { link: String, waited: Duration },
    #[error(
        "{links}: nothing has come for {silent_s:.0} s, of {attitudes} attitudes: has the emulator ended, or does a fault \
         stop the line?"
    )]
    Silent {
        links: String,
        silent_s: f64,
        attitudes: u32,
    },
    /// The mission had started; the report covers it so far.
    #[error("{source}")]
    CutShort {
        report: Box<Report>,
        source: Box<RunError>,
    },
    #[error(transparent)]
    Profile(#[from] ProfileError),
    #[error("{} is outside the wire's time, 1958 to 2094: choose another epoch", utc_text(*epoch))]
    Time { epoch: Epoch },
    #[error("a closed loop holds one attitude by the wall clock: {remedy}")]
    Loop { remedy: &'static str },
    #[error("{what} is {value:e}; it must be finite and above 0")]
    Setting { what: &'static str, value: f64 },
}
