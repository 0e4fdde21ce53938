//! By the wall clock: attitudes leave at their rate, frames come as they come.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::pause::Pause;
use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::Incoming;
use skyloop_protocols::{Command, WireTime};

/// So many packets at most are taken, of those that wait, before an attitude that is due.
const TAKEN_BETWEEN: u32 = 32;

impl FlightComputer {
    pub(super) fn run_wall(
        &mut self,
        rate_hz: Option<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let begin = self.begin;
        let (mut sequence, mut last_sign, mut last_grant) = (0u32, begin, begin);
        let mut frames = Numbers::default();
        let mut flow = ControlFlow::Continue(());
        // What is told at which moment, the next first.
        let pause = self.pause.into_iter();
        let told = pause.flat_map(|Pause { after, lasts }| {
            [
                (after, Command::Pause),
                (after.saturating_add(lasts), Command::Resume),
            ]
        });
        let mut told = told.peekable();
        let mut paused = false;
        // Packets since the last attitude; none: nothing waits to be taken.
        let mut taken = None;
        while flow.is_continue()
            && watch(Event::Tick).is_continue()
            && self.report.frames.saturating_add(self.report.lost) < self.mission.frames
        {
            let rate_hz = rate_hz.unwrap_or(0.0);
            // Of none the first comes never, too.
            let due = if rate_hz > 0.0 {
                Duration::try_from_secs_f64(f64::from(sequence) / rate_hz)
            } else {
                Ok(Duration::MAX)
            };
            let due = due.unwrap_or(Duration::MAX);
            // The clock is read once per turn, as turns come tens of thousands of times a second.
            let now = Instant::now();
            let elapsed = now.saturating_duration_since(begin);
            // At too high a rate an attitude is always due: packets are taken all the same.
            let is_due = elapsed >= due && taken.is_none_or(|packets| packets >= TAKEN_BETWEEN);
            if is_due {
                let elapsed_s = elapsed.as_secs_f64();
                self.send_attitude(sequence, self.by_the_clock(elapsed_s))?;
                // After a pause the attitudes missed in it are passed over, not sent in a burst.
                let period = (elapsed_s * rate_hz) as u32;
                sequence = sequence.max(period).saturating_add(1);
                taken = Some(0);
            }
            if let Some((_, command)) = told.next_if(|(at, _)| elapsed >= *at) {
                paused = command == Command::Pause;
                self.links.send(&command, WireTime::default())?;
            }
            if paused {
                last_sign = now;
            }
            if now.saturating_duration_since(last_sign) >= self.mission.timeout {
                last_sign = now;
                flow = self.time_out(self.last_sent(), watch)?;
                continue;
            }
            if now.saturating_duration_since(last_grant) >= GRANT_AGAIN {
                last_grant = now;
                self.links.grant()?;
            }
            let wait = match is_due {
                true => Duration::ZERO,
                false => due
                    .saturating_sub(elapsed)
                    .clamp(Duration::from_micros(100), GRANT_AGAIN),
            };
            let came = self.links.receive(wait)?;
            taken = taken.filter(|_| came.is_some()).map(|packets| packets + 1);
            flow = match came {
                None => ControlFlow::Continue(()),
                Some(Incoming::Frame(frame)) => {
                    last_sign = Instant::now();
                    frames.arrived(frame.header.frame);
                    let flow = self.take(&frame, watch);
                    self.links.take_back(*frame);
                    flow
                }
                Some(Incoming::Useless(error)) if error.is_damaged_frame() => {
                    self.lose(self.last_sent(), Loss::Damaged(error), watch)
                }
                Some(other) => self.note(other, watch),
            };
            let links = &self.links;
            for _ in 0..frames.settle(|number| links.is_in_flight(number)) {
                // The frame that told is taken all the same.
                let _ = self.lose(self.last_sent(), Loss::Skipped, watch);
            }
        }
        Ok(flow)
    }
}

/// The numbers of the frames that came, and of those passed over.
#[derive(Debug, Default)]
struct Numbers {
    last: Option<u32>,
    /// Passed over, not yet counted: some of them may be under way.
    passed_over: Vec<u32>,
}

impl Numbers {
    /// Books a whole frame.
    fn arrived(&mut self, number: u32) {
        /// A larger step is another emulator's count.
        const MAX: u32 = 1000;
        let ahead = self.last.map_or(1, |last| number.wrapping_sub(last));
        if (1..=MAX).contains(&ahead) {
            let skipped = (1..ahead).rev().map(|before| number.wrapping_sub(before));
            self.passed_over.extend(skipped);
        } else if ahead.wrapping_neg() <= MAX {
            // It was passed over, and has been mended.
            self.passed_over.retain(|passed| *passed != number);
            return;
        } else {
            self.passed_over.clear();
        }
        self.last = Some(number);
    }

    /// Gives out how many of those passed over are not under way any more.
    fn settle(&mut self, mut is_in_flight: impl FnMut(u32) -> bool) -> usize {
        let before = self.passed_over.len();
        self.passed_over.retain(|number| is_in_flight(*number));
        before - self.passed_over.len()
    }
}

#[cfg(test)]
mod tests {
    use super::Numbers;

    #[test]
    fn a_frame_passed_over_is_counted_when_it_is_not_under_way() {
        let mut numbers = Numbers::default();
        [7, 10]
            .into_iter()
            .for_each(|number| numbers.arrived(number));
        assert_eq!(numbers.settle(|number| number == 9), 1);
        numbers.arrived(9);
        assert_eq!(numbers.settle(|_| false), 0, "9 was mended");
        [12, 14]
            .into_iter()
            .for_each(|number| numbers.arrived(number));
        assert_eq!(numbers.settle(|_| false), 2);
        // Another emulator counts anew.
        [15, 200_000, 3, 4]
            .into_iter()
            .for_each(|number| numbers.arrived(number));
        assert_eq!(numbers.settle(|_| false), 0);
        let mut numbers = Numbers::default();
        [u32::MAX, 1]
            .into_iter()
            .for_each(|number| numbers.arrived(number));
        assert_eq!(numbers.settle(|_| false), 1);
    }
}
