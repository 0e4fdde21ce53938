//! By the wall clock: attitudes leave at their rate, frames come as they come.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::Incoming;
use crate::port::Port;

impl<P: Port> FlightComputer<P> {
    pub(super) fn run_wall(
        &mut self,
        rate_hz: f64,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let begin = Instant::now();
        let (mut sequence, mut last_sign, mut last_grant) = (0u32, begin, begin);
        let mut last_frame: Option<u32> = None;
        let mut flow = ControlFlow::Continue(());
        while flow.is_continue()
            && watch(Event::Tick).is_continue()
            && self.report.frames.saturating_add(self.report.lost) < self.mission.frames
        {
            let due =
                Duration::try_from_secs_f64(f64::from(sequence) / rate_hz).unwrap_or(Duration::MAX);
            if begin.elapsed() >= due {
                let elapsed_s = begin.elapsed().as_secs_f64();
                let epoch = self.mission.start + hifitime::Duration::from_seconds(elapsed_s);
                self.send_attitude(sequence, epoch)?;
                // After a pause the attitudes missed in it are passed over, not sent in a burst.
                let period = (elapsed_s * rate_hz) as u32;
                sequence = sequence.max(period).saturating_add(1);
                continue;
            }
            if last_sign.elapsed() >= self.mission.timeout {
                last_sign = Instant::now();
                flow = self.time_out(self.last_sent(), watch)?;
                continue;
            }
            if last_grant.elapsed() >= GRANT_AGAIN {
                last_grant = Instant::now();
                self.exchange.grant()?;
            }
            let wait = due
                .saturating_sub(begin.elapsed())
                .min(GRANT_AGAIN)
                .max(Duration::from_micros(100));
            flow = match self.exchange.receive(wait)? {
                None => ControlFlow::Continue(()),
                Some(Incoming::Frame(frame)) => {
                    last_sign = Instant::now();
                    let number = frame.header.frame;
                    self.pass_over(last_frame.replace(number), number, watch);
                    self.take(&frame, watch)
                }
                Some(Incoming::Useless(error)) if error.is_damaged_frame() => {
                    self.lose(self.last_sent(), Loss::Damaged(error), watch)
                }
                Some(other) => self.note(other, watch),
            };
        }
        Ok(flow)
    }

    /// Counts the frames whose numbers are missing between two.
    fn pass_over(&mut self, last: Option<u32>, number: u32, watch: &mut Watch<'_>) {
        /// A larger step is another emulator's count.
        const MOST: u32 = 1000;
        let skipped = last.map_or(0, |last| number.wrapping_sub(last).wrapping_sub(1));
        for _ in 0..if skipped < MOST { skipped } else { 0 } {
            // The frame that told is taken all the same.
            let _ = self.lose(self.last_sent(), Loss::Skipped, watch);
        }
    }
}
