//! Wall-clock mode: attitudes are sent at their rate, frames are received at any time.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::pause::Pause;
use super::{FlightComputer, GRANT_AGAIN, RunError, Watch};
use crate::event::{Event, Loss};
use crate::exchange::Incoming;
use skyloop_protocols::{Command, WireTime};

/// Maximum number of packets taken before a due attitude.
const TAKEN_BETWEEN: u32 = 32;

impl FlightComputer {
    pub(super) fn run_wall(
        &mut self,
        rate_hz: Option<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let (begin, rate_hz) = (self.begin, rate_hz.unwrap_or(0.0));
        let (mut sequence, mut last_sign, mut last_grant) = (0u32, begin, begin);
        let mut frames = Numbers::default();
        let mut flow = ControlFlow::Continue(());
        let mut commands = self.pause.map(commands).into_iter().flatten().peekable();
        let mut paused = false;
        // Packets since the last attitude; none: the queue is empty.
        let mut taken = None;
        while flow.is_continue()
            && watch(Event::Tick).is_continue()
            && self.report.frames.saturating_add(self.report.lost) < self.mission.frames
        {
            let due = due(sequence, rate_hz);
            // The clock is read once per turn: there are tens of thousands of turns a second.
            let now = Instant::now();
            let elapsed = now.saturating_duration_since(begin);
            // At too high a rate an attitude is always due; packets must be taken nevertheless.
            let is_due = elapsed >= due && taken.is_none_or(|packets| packets >= TAKEN_BETWEEN);
            if is_due {
                let elapsed_s = elapsed.as_secs_f64();
                self.send_attitude(sequence, self.by_the_clock(elapsed_s))?;
                // After a pause, missed attitudes are skipped, not sent in a burst.
                let period = (elapsed_s * rate_hz) as u32;
                sequence = sequence.max(period).saturating_add(1);
                taken = Some(0);
            }
            if let Some((_, command)) = commands.next_if(|(at, _)| elapsed >= *at) {
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
            let wait = if is_due {
                Duration::ZERO
            } else {
                let left = due.saturating_sub(elapsed);
                left.clamp(Duration::from_micros(100), GRANT_AGAIN)
            };
            let incoming = self.links.receive(wait)?;
            taken = taken
                .filter(|_| incoming.is_some())
                .map(|packets| packets + 1);
            if let Some(Incoming::Frame(frame)) = &incoming {
                last_sign = Instant::now();
                frames.arrived(frame.header.frame);
            }
            flow = self.handle(incoming, watch);
            let links = &self.links;
            for _ in 0..frames.settle(|number| links.is_in_flight(number)) {
                // The current frame counts, even if `watch` stops the run.
                let _ = self.lose(self.last_sent(), Loss::Skipped, watch);
            }
        }
        Ok(flow)
    }

    fn handle(&mut self, incoming: Option<Incoming>, watch: &mut Watch<'_>) -> ControlFlow<()> {
        match incoming {
            None => ControlFlow::Continue(()),
            Some(Incoming::Frame(frame)) => {
                let flow = self.take(&frame, watch);
                self.links.recycle(*frame);
                flow
            }
            Some(Incoming::Unusable(error)) if error.is_damaged_frame() => {
                self.lose(self.last_sent(), Loss::Damaged(error), watch)
            }
            Some(other) => self.note(other, watch),
        }
    }
}

/// Pause and resume commands with their times, in order.
fn commands(pause: Pause) -> [(Duration, Command); 2] {
    let Pause { after, lasts } = pause;
    [
        (after, Command::Pause),
        (after.saturating_add(lasts), Command::Resume),
    ]
}

/// When an attitude is due; without a rate even the first is never due.
fn due(sequence: u32, rate_hz: f64) -> Duration {
    if rate_hz > 0.0 {
        let due = Duration::try_from_secs_f64(f64::from(sequence) / rate_hz);
        due.unwrap_or(Duration::MAX)
    } else {
        Duration::MAX
    }
}

/// Detects skipped frame numbers.
#[derive(Debug, Default)]
struct Numbers {
    last: Option<u32>,
    /// Skipped, not yet counted: some may be in flight.
    skipped: Vec<u32>,
}

impl Numbers {
    fn arrived(&mut self, number: u32) {
        /// A larger step means that the emulator's counter was restarted.
        const MAX: u32 = 1000;
        let ahead = self.last.map_or(1, |last| number.wrapping_sub(last));
        if (1..=MAX).contains(&ahead) {
            let numbers = (1..ahead).rev().map(|before| number.wrapping_sub(before));
            self.skipped.extend(numbers);
        } else if ahead.wrapping_neg() <= MAX {
            // A skipped frame has been recovered.
            self.skipped.retain(|skipped| *skipped != number);
            return;
        } else {
            self.skipped.clear();
        }
        self.last = Some(number);
    }

    /// Removes skipped frames that are no longer in flight. Returns their number.
    fn settle(&mut self, mut is_in_flight: impl FnMut(u32) -> bool) -> usize {
        let before = self.skipped.len();
        self.skipped.retain(|number| is_in_flight(*number));
        before - self.skipped.len()
    }
}

#[cfg(test)]
mod tests {
    use super::Numbers;

    #[test]
    fn skipped_frames_count_once_they_are_not_in_flight() {
        let mut numbers = Numbers::default();
        let arrive = |numbers: &mut Numbers, all: &[u32]| {
            all.iter().for_each(|number| numbers.arrived(*number));
        };
        arrive(&mut numbers, &[7, 10]);
        assert_eq!(numbers.settle(|number| number == 9), 1);
        numbers.arrived(9);
        assert_eq!(numbers.settle(|_| false), 0, "9 was recovered");
        arrive(&mut numbers, &[12, 14]);
        assert_eq!(numbers.settle(|_| false), 2);
        // Another emulator restarts its counter.
        arrive(&mut numbers, &[15, 200_000, 3, 4]);
        assert_eq!(numbers.settle(|_| false), 0);
        let mut numbers = Numbers::default();
        arrive(&mut numbers, &[u32::MAX, 1]);
        assert_eq!(numbers.settle(|_| false), 1);
    }
}
