//! Stepped mode: each attitude is sent after the previous one's frame.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_protocols::{Reason, apid};

use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::{Incoming, TICK};
use crate::report::NackRecord;

/// An attitude whose frame is awaited.
struct Attempt {
    sequence: u32,
    epoch: Epoch,
    /// Sequence counts of its copies.
    copies: Vec<u16>,
    /// Number of copies that arrived damaged.
    damaged: u32,
    begin: Instant,
    /// When the last copy was sent, or the last frame packet arrived.
    moved: Instant,
}

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
        let epoch = self.mission.epoch(sequence);
        let copies = vec![self.send_attitude(sequence, epoch)?];
        self.links.set_attitude(Some(sequence));
        let begin = Instant::now();
        let mut attempt = Attempt {
            sequence,
            epoch,
            copies,
            damaged: 0,
            begin,
            moved: begin,
        };
        let mut seen = self.links.last_frame_packet();
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
            attempt.moved = attempt.moved.max(arrived.unwrap_or(begin));
            let timeout = self.repeat_after(sequence) * attempt.copies.len() as u32;
            let silent = attempt.moved.elapsed();
            if silent >= timeout {
                self.repeat(&mut attempt)?;
                self.links.query()?;
                continue;
            }
            let wait = left.min(GRANT_AGAIN).min(timeout - silent);
            match self.links.receive(wait)? {
                None if wait == GRANT_AGAIN => self.links.grant()?,
                None => {}
                Some(incoming) => {
                    if let ControlFlow::Break(flow) = self.reply(&mut attempt, incoming, watch)? {
                        return Ok(flow);
                    }
                }
            }
        }
    }

    /// Sends the attitude again; the emulator repeats the same frame.
    fn repeat(&mut self, attempt: &mut Attempt) -> Result<(), RunError> {
        let copy = self.send_attitude(attempt.sequence, attempt.epoch)?;
        attempt.copies.push(copy);
        self.report.recovery.attitudes += 1;
        attempt.moved = Instant::now();
        Ok(())
    }

    /// Handles a reply; breaks when the attitude has its frame, or will have none.
    fn reply(
        &mut self,
        attempt: &mut Attempt,
        incoming: Incoming,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<ControlFlow<()>>, RunError> {
        /// Damaged copies of an attitude before it counts as refused.
        const MAX_DAMAGED: u32 = 16;
        let sequence = attempt.sequence;
        let is_answer = |nack: &NackRecord| {
            nack.apid == apid::ATTITUDE && attempt.copies.contains(&nack.sequence_count)
        };
        let flow = match incoming {
            Incoming::Frame(frame) if frame.header.attitude_sequence == sequence => {
                if attempt.copies.len() == 1 {
                    let took = frame.header_at.saturating_duration_since(attempt.begin);
                    self.answered_after(took);
                }
                self.remember(sequence);
                return Ok(ControlFlow::Break(self.take(&frame, watch)));
            }
            Incoming::Nack(nack) if is_answer(&nack) => {
                self.report.refused += 1;
                return Ok(ControlFlow::Break(self.note_nack(nack, watch)));
            }
            // Counts as lost in transit.
            Incoming::Damaged(nack) if is_answer(&nack) => {
                attempt.damaged += 1;
                if attempt.damaged > MAX_DAMAGED {
                    self.report.refused += 1;
                    return Ok(ControlFlow::Break(self.note_nack(nack, watch)));
                }
                self.repeat(attempt)?;
                ControlFlow::Continue(())
            }
            // A late copy of an earlier attitude whose frame is complete.
            Incoming::Nack(nack)
                if nack.apid == apid::ATTITUDE && nack.reason == Reason::TimeBackwards =>
            {
                self.report.recovery.refused += 1;
                ControlFlow::Continue(())
            }
            Incoming::Unusable(error) if error.is_damaged_frame() => {
                let flow = self.lose(sequence, Loss::Damaged(error), watch);
                return Ok(ControlFlow::Break(flow));
            }
            Incoming::Frame(frame) if self.taken.contains(&frame.header.attitude_sequence) => {
                self.report.recovery.duplicates += 1;
                ControlFlow::Continue(())
            }
            other => self.note(other, watch),
        };
        Ok(if flow.is_break() {
            ControlFlow::Break(flow)
        } else {
            ControlFlow::Continue(())
        })
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
