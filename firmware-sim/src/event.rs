//! Events of a run for its caller.

use std::fmt;
use std::time::Duration;

use crate::cause::Cause;
use crate::detector::Detections;
use crate::reassembly::{AssemblyError, Progress};
use crate::received::ReceivedFrame;
use crate::report::NackRecord;
use crate::score::Score;

/// Reason for a lost frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Loss {
    /// It was incomplete at the time-out.
    TimedOut {
        /// Received parts, if the header arrived.
        progress: Option<Progress>,
        /// Cause, if it is known.
        cause: Option<Cause>,
    },
    /// It arrived damaged.
    Damaged(AssemblyError),
    /// Its number was skipped (wall clock): the emulator dropped it, or all its packets were lost.
    Skipped,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TimedOut { progress, cause } => {
                match progress {
                    None => write!(f, "no packet of it arrived before the time-out")?,
                    Some(Progress {
                        frame,
                        blocks: (b, of_b),
                        label_parts: (l, of_l),
                        end,
                    }) => {
                        write!(
                            f,
                            "frame {frame} was incomplete at the time-out: {b} of {of_b} pixel blocks, {l} of {of_l} label parts"
                        )?;
                        if !end {
                            write!(f, ", no FrameEnd")?;
                        }
                    }
                }
                match cause {
                    None => Ok(()),
                    Some(cause) => write!(f, "; {cause}"),
                }
            }
            Self::Damaged(error) => error.fmt(f),
            Self::Skipped => write!(f, "the emulator went on to the next frame"),
        }
    }
}

/// Event of a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A complete frame, detected and scored.
    Frame {
        /// Header and received pixels.
        frame: &'a ReceivedFrame,
        /// Detections in the pixels.
        detections: &'a Detections,
        /// The label text, if it was sent and is valid; [`ReceivedFrame::objects`] gives numeric
        /// objects.
        labels: Option<&'a str>,
        /// Detections against labels, if the labels can be read.
        score: Option<&'a Score>,
        /// From the sending of the attitude to the last pixel block, if the attitude is known.
        latency: Option<Duration>,
    },
    /// A frame is lost.
    Lost {
        /// Sequence number of the frame's attitude (stepped) or of the latest one (wall clock).
        sequence: u32,
        /// Reason.
        loss: Loss,
    },
    /// The emulator refused a packet.
    Nack(&'a NackRecord),
    /// Another problem, as text.
    Problem(String),
    /// Opportunity to stop the run; this or [`Event::Progress`] comes at least five times a second.
    Tick,
    /// Stepped mode: frame packets have arrived since the last event.
    Progress,
}
