//! The camera's own cadence by the wall clock.

use hifitime::{Epoch, Unit};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A client whose first attitude differs from this machine's clock by more than this plays a scene of another
/// time; frames then carry its time, running at the wall's pace.
const SAME_CLOCK_S: f64 = 10.0;

/// When the next frame is due, and what time it then is in the scene.
#[derive(Debug)]
pub struct WallClock {
    period: Duration,
    /// End of the next exposure; none while the cadence stands still.
    due: Option<Instant>,
    /// Whether the cadence stops after the next frame.
    single: bool,
    /// Scene time and the instant that it was read at.
    zero: Option<(Epoch, Instant)>,
    /// Exposures that nobody could take because the emulator was late.
    pub missed: u32,
}

impl WallClock {
    /// A clock that ticks `rate_hz` times a second once it is set.
    pub fn new(rate_hz: f64) -> WallClock {
        WallClock {
            period: period(rate_hz),
            due: None,
            single: false,
            zero: None,
            missed: 0,
        }
    }

    /// Learns the scene's time from a client's first attitude; the first frame follows a period later.
    pub fn set(&mut self, attitude: Epoch, arrived: Instant) {
        if self.zero.is_some() {
            return;
        }
        let since = hifitime::Duration::from(arrived.elapsed());
        let system = system_time() - since;
        let apart_s = (attitude - system).to_seconds().abs();
        let scene = if apart_s <= SAME_CLOCK_S {
            system
        } else {
            attitude
        };
        self.zero = Some((scene, arrived));
        self.due = Some(arrived + self.period);
    }

    /// Forgets the scene's time: the next client sets it anew.
    pub fn clear(&mut self, rate_hz: f64) {
        *self = WallClock {
            missed: self.missed,
            ..WallClock::new(rate_hz)
        };
    }

    /// Lets frames run at another rate: from the end of the last exposure, or of the single shot under way, or
    /// from now on where the cadence rests.
    pub fn set_rate(&mut self, rate_hz: f64, arrived: Instant) {
        let before = std::mem::replace(&mut self.period, period(rate_hz));
        let single = std::mem::take(&mut self.single);
        self.due = match self.due {
            Some(due) if single => Some(due),
            Some(due) => Some(due.checked_sub(before).unwrap_or(arrived) + self.period),
            None => self.zero.map(|_| arrived + self.period),
        };
    }

    /// One frame whose exposure starts at `arrived`, then none until a rate is set.
    pub fn single_shot(&mut self, exposure_s: f64, arrived: Instant) {
        self.single = true;
        self.due = Some(arrived + Duration::from_secs_f64(exposure_s));
    }

    /// Whether a single shot is being exposed.
    pub fn single_shot_is_open(&self) -> bool {
        self.single && self.due.is_some()
    }

    /// Time until the next exposure has ended; long while the cadence stands still.
    pub fn until_due(&self) -> Duration {
        const STANDING: Duration = Duration::from_secs(3600);
        self.due.map_or(STANDING, |due| {
            due.saturating_duration_since(Instant::now())
        })
    }

    /// If an exposure has ended: its middle in the scene's time. Exposures that were missed are passed over.
    pub fn take_due(&mut self, exposure_s: f64) -> Option<Epoch> {
        let (due, (scene, zero)) = (self.due?, self.zero?);
        let now = Instant::now();
        if now < due {
            return None;
        }
        let late = now.duration_since(due).as_nanos() / self.period.as_nanos().max(1);
        let late = if self.single {
            0
        } else {
            u32::try_from(late).unwrap_or(u32::MAX)
        };
        self.missed = self.missed.wrapping_add(late);
        let end = due + self.period.saturating_mul(late);
        self.due = (!self.single).then(|| end + self.period);
        let since = end.duration_since(zero).as_secs_f64();
        Some(scene + Unit::Second * (since - exposure_s / 2.0))
    }
}

fn period(rate_hz: f64) -> Duration {
    Duration::from_secs_f64(1.0 / rate_hz)
}

fn system_time() -> Epoch {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Epoch::from_unix_duration(hifitime::Duration::from(since))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_fall_due_at_the_period_and_carry_the_scenes_time() {
        let mut clock = WallClock::new(50.0);
        let scene = Epoch::from_gregorian_utc_hms(2019, 6, 15, 23, 35, 50);
        assert!(
            clock.take_due(0.01).is_none(),
            "no frame before the first attitude"
        );
        clock.set(scene, Instant::now());
        std::thread::sleep(Duration::from_millis(25));
        let mid = clock.take_due(0.01).unwrap();
        // End of the first exposure: one period of 20 ms after the attitude; its middle 5 ms earlier.
        assert!(((mid - scene).to_seconds() - 0.015).abs() < 1e-9);
        std::thread::sleep(Duration::from_millis(50));
        let later = clock.take_due(0.01).unwrap();
        let periods = (later - mid).to_seconds() / 0.02;
        assert!((periods - periods.round()).abs() < 1e-6 && periods > 1.5);
        assert_eq!(f64::from(clock.missed), periods.round() - 1.0);
    }
}
