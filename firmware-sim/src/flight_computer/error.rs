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
        "{link}: no answer to a fault request within {} s: earlier faults may block the link; request those last, or limit their \
         duration (--fault KIND:in|out:VALUE:S)",
        waited.as_secs_f64()
    )]
    FaultUnanswered { link: String, waited: Duration },
    #[error(
        "{links}: nothing received for {silent_s:.0} s, over {attitudes} attitudes: has the emulator ended, or does a fault \
         block the link?"
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
    #[error("{} is outside the time code, 1958 to 2094: choose another epoch", utc_text(*epoch))]
    Time { epoch: Epoch },
    #[error("a closed loop holds one attitude by the wall clock: {remedy}")]
    Loop { remedy: &'static str },
    #[error("{what} is {value:e}; it must be finite and above 0")]
    Setting { what: &'static str, value: f64 },
}
