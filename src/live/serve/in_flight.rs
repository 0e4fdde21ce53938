//! Frames whose last packet is in a link's queue. Their times are known when it leaves. A client
//! that takes nothing does not affect other links.

use super::channel::Channel;
use super::frame_job::FrameJob;
use super::telemetry::SentFrame;
use crate::stats::Pending;
use crate::timing::FrameTimes;
use skyloop_link::{Exit, Mark, QUEUE};
use std::time::Duration;

/// A frame in a link's queue.
pub(super) struct InFlightFrame {
    /// Its times, except the end.
    pub left: SentFrame,
    /// Time from the trigger until the frame was rendered and the device's delay was over.
    pub ready: Duration,
    pub link: usize,
    /// Position of its last packet in the link's queue, and its entry in the link's counters; none:
    /// it was not queued completely.
    pub queued: Option<(Mark, Pending)>,
    /// The exchange of its client.
    pub exchange: u32,
    /// Whether the frame is counted as delivered.
    pub is_delivered: bool,
}

impl InFlightFrame {
    pub fn new(
        job: &FrameJob,
        link: usize,
        exchange: u32,
        queued: Option<(Mark, Pending)>,
    ) -> InFlightFrame {
        let last_pixel = job.since_trigger(job.last_pixel);
        InFlightFrame {
            left: SentFrame {
                times: FrameTimes {
                    attitude_age_s: job.source.pointing.age_s,
                    first_pixel: job.since_trigger(job.first_pixel),
                    last_pixel,
                    first_byte: job.since_trigger(job.first_byte),
                    ..FrameTimes::incomplete(job.number)
                },
                trigger: job.trigger(),
                deadline: job.source.due.deadline,
                missed: 0,
                exposure: job.opening.as_ref().map(|opening| opening.exposure),
            },
            ready: last_pixel.max(job.since_trigger(Some(job.source.release))),
            link,
            exchange,
            queued,
            is_delivered: false,
        }
    }
}

/// The frames in flight, the oldest first.
#[derive(Default)]
pub(super) struct InFlight(Vec<InFlightFrame>);

impl InFlight {
    pub fn push(&mut self, frame: InFlightFrame) {
        self.0.push(frame);
    }

    /// Takes a frame that has left its link, with its exit, or a frame that never will leave.
    pub fn take_tx_complete(
        &mut self,
        channels: &[Channel],
    ) -> Option<(InFlightFrame, Option<Exit>)> {
        // A link's queue has no more frames than packets, so the oldest was lost.
        if self.0.len() > QUEUE * channels.len() {
            let oldest = self.0.remove(0);
            if let (Some((mark, _)), Some(channel)) = (&oldest.queued, channels.get(oldest.link)) {
                channel.wire.tally.tx_complete.forget(*mark);
            }
            return Some((oldest, None));
        }
        let (at, exit) = self.0.iter().enumerate().find_map(|(at, frame)| {
            let Some((mark, _)) = &frame.queued else {
                return Some((at, None));
            };
            let exit = channels
                .get(frame.link)?
                .wire
                .tally
                .tx_complete
                .left(*mark)?;
            Some((at, Some(exit)))
        })?;
        Some((self.0.remove(at), exit))
    }

    pub fn take_oldest(&mut self) -> Option<InFlightFrame> {
        (!self.0.is_empty()).then(|| self.0.remove(0))
    }

    /// Notes on all links whether a frame counts as delivered.
    pub fn set_delivered(&mut self, number: u32, is_delivered: bool) {
        let frames = self.0.iter_mut();
        for frame in frames.filter(|frame| frame.left.times.frame == number) {
            frame.is_delivered = is_delivered;
        }
    }
}
