//! What a run tells its caller as it goes.

use std::fmt;
use std::time::Duration;

use crate::cause::Cause;
use crate::detector::Detections;
use crate::reassembly::{AssemblyError, Progress};
use crate::received::ReceivedFrame;
use crate::report::NackRecord;
use crate::score::Score;

/// Why a frame is lost.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Loss {
    /// It was not whole in time.
    TimedOut {
        /// What had come of it, if its header had.
        progress: Option<Progress>,
        /// Why, if that can be told.
        cause: Option<Cause>,
    },
    /// It came damaged.
    Damaged(AssemblyError),
    /// Its number was passed over (wall clock): the emulator gave it up, or all its packets were lost.
    Skipped,
}

impl fmt::Display for Loss {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TimedOut { progress, cause } => {
                match progress {
                    None => write!(f, "nothing of it came in time")?,
                    Some(Progress {
                        frame,
                        blocks: (b, of_b),
                        label_parts: (l, of_l),
                        end,
                    }) => {
                        write!(
                            f,
                            "frame {frame} was not whole in time: {b} of {of_b} pixel blocks, {l} of {of_l} label parts"
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

/// What happens during a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A whole frame, detected and scored.
    Frame {
        /// Header and what pixels were sent.
        frame: &'a ReceivedFrame,
        /// What was found in the pixels.
        detections: &'a Detections,
        /// The label text, if text was sent and is text; objects open by [`ReceivedFrame::objects`].
        labels: Option<&'a str>,
        /// Detections against labels, if the labels can be read.
        score: Option<&'a Score>,
        /// Attitude sent to last pixel block received, if the attitude is known.
        latency: Option<Duration>,
    },
    /// A frame is lost.
    Lost {
        /// Sequence number of the (stepped: its, wall clock: the latest) attitude.
        sequence: u32,
        /// Why.
        loss: Loss,
    },
    /// The emulator refused a packet.
    Nack(&'a NackRecord),
    /// Something else went wrong, in words.
    Problem(String),
    /// An occasion to break the run off: this or [`Event::Progress`] comes at least five times a second.
    Tick,
    /// In lock-step: packets of frames have arrived since the last.
    Progress,
}
