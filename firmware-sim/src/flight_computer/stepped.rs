//! Lock-step: the next attitude leaves when the last one's frame is in.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use skyloop_protocols::apid;

use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::{Incoming, TICK};
use crate::port::Port;

impl<P: Port> FlightComputer<P> {
    pub(super) fn run_stepped(
        &mut self,
        most_hz: Option<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let begin = Instant::now();
        for sequence in 0..self.mission.frames {
            if let Some(hz) = most_hz
                && pause(begin, f64::from(sequence) / hz, watch).is_break()
            {
                return Ok(ControlFlow::Break(()));
            }
            let count = self.send_attitude(sequence, self.mission.epoch(sequence))?;
            if self.await_frame(sequence, count, watch)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Listens until the frame of one attitude is whole, refused or lost.
    fn await_frame(
        &mut self,
        sequence: u32,
        count: u16,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let deadline = Instant::now() + self.mission.timeout;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return self.time_out(sequence, watch);
            }
            if watch(Event::Tick).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            match self.exchange.receive(left.min(GRANT_AGAIN))? {
                None => self.exchange.grant()?,
                Some(Incoming::Frame(frame)) if frame.header.attitude_sequence == sequence => {
                    return Ok(self.take(&frame, watch));
                }
                Some(Incoming::Nack(nack))
                    if (nack.apid, nack.sequence_count) == (apid::ATTITUDE, count) =>
                {
                    self.report.refused += 1;
                    return Ok(self.note_nack(nack, watch));
                }
                Some(Incoming::Useless(error)) if error.is_damaged_frame() => {
                    return Ok(self.lose(sequence, Loss::Damaged(error), watch));
                }
                Some(other) => {
                    if self.note(other, watch).is_break() {
                        return Ok(ControlFlow::Break(()));
                    }
                }
            }
        }
    }
}

/// Sleeps until `due_s` seconds after `begin`.
fn pause(begin: Instant, due_s: f64, watch: &mut Watch<'_>) -> ControlFlow<()> {
    let due = Duration::try_from_secs_f64(due_s).unwrap_or(Duration::MAX);
    loop {
        let left = due.saturating_sub(begin.elapsed());
        if left.is_zero() {
            return ControlFlow::Continue(());
        }
        watch(Event::Tick)?;
        std::thread::sleep(left.min(TICK));
    }
}
