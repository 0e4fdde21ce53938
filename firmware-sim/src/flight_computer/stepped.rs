//! Stepped mode: each attitude is sent after the previous one's frame.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use skyloop_protocols::{Reason, apid};

use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::{Incoming, TICK};

impl FlightComputer {
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
            if self.step(sequence, watch)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Sends one attitude, repeated if necessary, until its frame is complete, refused or lost.
    fn step(&mut self, sequence: u32, watch: &mut Watch<'_>) -> Result<ControlFlow<()>, RunError> {
        /// Damaged copies of an attitude before it counts as refused.
        const MAX_DAMAGED: u32 = 16;
        let epoch = self.mission.epoch(sequence);
        let mut copies = vec![self.send_attitude(sequence, epoch)?];
        self.links.set_attitude(Some(sequence));
        let begin = Instant::now();
        let mut moved = begin;
        let (mut damaged, mut seen) = (0, self.links.last_frame_packet());
        loop {
            let left = self.mission.timeout.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return self.time_out(sequence, watch);
            }
            let arrived = self.links.last_frame_packet();
            let tick = if arrived > seen {
                Event::Progress
            } else {
                Event::Tick
            };
            seen = arrived;
            if watch(tick).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            moved = moved.max(arrived.unwrap_or(begin));
            let timeout = self.repeat_after(sequence) * copies.len() as u32;
            let silent = moved.elapsed();
            if silent >= timeout {
                // The emulator repeats the same frame.
                copies.push(self.send_attitude(sequence, epoch)?);
                self.report.recovery.attitudes += 1;
                self.links.query()?;
                moved = Instant::now();
                continue;
            }
            let wait = left.min(GRANT_AGAIN).min(timeout - silent);
            let flow = match self.links.receive(wait)? {
                None => {
                    if wait == GRANT_AGAIN {
                        self.links.grant()?;
                    }
                    ControlFlow::Continue(())
                }
                Some(Incoming::Frame(frame)) if frame.header.attitude_sequence == sequence => {
                    if copies.len() == 1 {
                        self.answered_after(frame.header_at.saturating_duration_since(begin));
                    }
                    self.remember(sequence);
                    return Ok(self.take(&frame, watch));
                }
                Some(Incoming::Nack(nack))
                    if nack.apid == apid::ATTITUDE && copies.contains(&nack.sequence_count) =>
                {
                    self.report.refused += 1;
                    return Ok(self.note_nack(nack, watch));
                }
                // Counts as lost in transit.
                Some(Incoming::Damaged(nack))
                    if nack.apid == apid::ATTITUDE && copies.contains(&nack.sequence_count) =>
                {
                    damaged += 1;
                    if damaged > MAX_DAMAGED {
                        self.report.refused += 1;
                        return Ok(self.note_nack(nack, watch));
                    }
                    copies.push(self.send_attitude(sequence, epoch)?);
                    self.report.recovery.attitudes += 1;
                    moved = Instant::now();
                    ControlFlow::Continue(())
                }
                // A late copy of an earlier attitude whose frame is complete.
                Some(Incoming::Nack(nack))
                    if nack.apid == apid::ATTITUDE && nack.reason == Reason::TimeBackwards =>
                {
                    self.report.recovery.refused += 1;
                    ControlFlow::Continue(())
                }
                Some(Incoming::Useless(error)) if error.is_damaged_frame() => {
                    return Ok(self.lose(sequence, Loss::Damaged(error), watch));
                }
                Some(Incoming::Frame(frame))
                    if self.taken.contains(&frame.header.attitude_sequence) =>
                {
                    self.report.recovery.duplicates += 1;
                    ControlFlow::Continue(())
                }
                Some(other) => self.note(other, watch),
            };
            if flow.is_break() {
                return Ok(flow);
            }
        }
    }

    /// Time without a reply before an attitude is repeated.
    fn repeat_after(&self, sequence: u32) -> Duration {
        /// In units of the mean reply time.
        const TIMES: u32 = 4;
        const MIN: Duration = Duration::from_millis(150);
        // Once a frame has begun, missing packets are requested first.
        let max = self.mission.timeout / 4;
        match self.usual_answer {
            Some(usual) if !self.links.has_begun(sequence) => {
                let min = MIN.max(3 * self.links.spacing());
                (TIMES * usual).max(min).min(max)
            }
            None if !self.links.has_begun(sequence) => max / 2,
            _ => max,
        }
    }

    /// Updates the mean time from an attitude to the first packet of its frame, over some eight
    /// frames.
    fn answered_after(&mut self, time: Duration) {
        let usual = self.usual_answer.map(|usual| (usual * 7 + time) / 8);
        self.usual_answer = Some(usual.unwrap_or(time));
    }

    /// Remembers the attitude of a received frame, to recognize duplicates.
    fn remember(&mut self, sequence: u32) {
        /// More frames than are in flight at once.
        const REMEMBERED: usize = 64;
        if self.taken.len() >= REMEMBERED {
            self.taken.pop_front();
        }
        self.taken.push_back(sequence);
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
