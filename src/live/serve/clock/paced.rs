//! Exposures at the camera's cadence or at triggers, in this machine's time or the client's.

use super::cadence::Cadence;
use super::discipline::{Correction, Discipline, is_clock_step};
use super::due::{Due, MAX_WAITING, Sync, TimeCheck, TriggerRequest, full, no_triggers};
use super::exposure_clock::ExposureClock;
use crate::serve::history::Latched;
use crate::serve::refusal::Refusal;
use hifitime::Epoch;
use skyloop_orbit::time::seconds;
use skyloop_protocols::{Mode, SyncState};
use skyloop_render::camera::Camera;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Maximum lead of a Trigger before the client's time, s. A later one would block the queue.
const MAX_AHEAD_S: f64 = 86_400.0;

/// Exposures at a cadence or at triggers.
pub(super) struct Paced {
    cadence: Cadence,
    /// The client's clock; none: this machine's clock, from the first attitude on.
    client: Option<ClientClock>,
    /// Triggers that wait for the end of their exposures, sorted by it; none: frames follow the
    /// cadence.
    triggers: Option<Vec<TriggerRequest>>,
    /// Scene time at the start of the last pause, or the latest time stamp since.
    paused_at: Option<Epoch>,
}

/// The client's clock.
struct ClientClock {
    discipline: Discipline,
    /// Arrival of its last consistent time stamp.
    last_stamp: Option<Instant>,
    /// Silence after which the state is holdover.
    holdover: Duration,
}

impl Paced {
    pub fn wall(cadence: Cadence) -> Paced {
        Paced {
            cadence,
            client: None,
            triggers: None,
            paused_at: None,
        }
    }

    /// Exposures in the client's time; `by_trigger`: triggers request frames.
    pub fn external(cadence: Cadence, by_trigger: bool, holdover: Duration) -> Paced {
        Paced {
            client: Some(ClientClock {
                discipline: Discipline::default(),
                last_stamp: None,
                holdover,
            }),
            triggers: by_trigger.then(Vec::new),
            ..Paced::wall(cadence)
        }
    }

    /// Evaluates the first time stamp after a pause; any time is accepted. A time that is set back
    /// counts as a clock step if triggers wait: they would wait until the old time comes again.
    fn first_after_pause(&mut self, time: Epoch) -> TimeCheck {
        let before = self.paused_at.filter(|paused| time < *paused);
        let is_set_back = before.is_some_and(|paused| is_clock_step(time, paused));
        let waits = self.triggers.as_ref().is_some_and(|all| !all.is_empty());
        if is_set_back && waits {
            self.paused_at = Some(time);
            return TimeCheck::Jumped;
        }
        self.paused_at = before.or(Some(time));
        TimeCheck::Consistent
    }

    /// When the exposure of a trigger ends.
    fn end_of(&self, request: &TriggerRequest) -> Option<Instant> {
        let end = request.start + seconds(request.camera.exposure_s);
        self.cadence.instant_of(end)
    }
}

impl ExposureClock for Paced {
    fn mode(&self) -> Mode {
        if self.client.is_some() {
            Mode::External
        } else {
            Mode::Wall
        }
    }

    fn cadence(&mut self) -> Option<&mut Cadence> {
        self.triggers.is_none().then_some(&mut self.cadence)
    }

    fn latched(&mut self, latched: &Latched, _: &Arc<Camera>) {
        if self.client.is_none() {
            self.cadence.set(latched.vehicle.epoch, latched.arrived);
        }
    }

    fn observe_time(&mut self, time: Epoch, arrived: Instant) -> TimeCheck {
        let Some(client) = &mut self.client else {
            return TimeCheck::Consistent;
        };
        let own = self.cadence.scene_at(arrived);
        let Some(own) = own.filter(|_| !self.cadence.awaits_time()) else {
            client.discipline = Discipline::default();
            client.last_stamp = Some(arrived);
            self.cadence.start(time, arrived);
            return self.first_after_pause(time);
        };
        match client.discipline.observe(time, own) {
            Correction::Slew(ahead_s) => {
                client.last_stamp = Some(arrived);
                self.cadence.advance_scene_time(ahead_s);
                TimeCheck::Consistent
            }
            Correction::Doubt(ahead_s) => TimeCheck::Doubtful(ahead_s),
            Correction::Jump => {
                client.last_stamp = Some(arrived);
                self.cadence.start(time, arrived);
                TimeCheck::Jumped
            }
        }
    }

    fn drop_requests(&mut self) -> u32 {
        let waiting = self.triggers.as_mut();
        waiting.map_or(0, |waiting| waiting.drain(..).count() as u32)
    }

    fn triggered(&mut self, request: TriggerRequest) -> Result<(), Refusal> {
        let Some(waiting) = &mut self.triggers else {
            return Err(no_triggers());
        };
        if waiting.len() >= MAX_WAITING {
            return Err(full("triggers"));
        }
        let now = self.cadence.scene_at(request.arrived);
        let ahead_s = now.map_or(0.0, |now| (request.start - now).to_seconds());
        if ahead_s > MAX_AHEAD_S {
            return Err(Refusal::value(format!(
                "Trigger.start: {ahead_s:.0} s ahead of the client's clock, at most {MAX_AHEAD_S} s; send it nearer to its time"
            )));
        }
        let ends = |request: &TriggerRequest| request.start + seconds(request.camera.exposure_s);
        let end = ends(&request);
        let at = waiting.partition_point(|other| ends(other) <= end);
        waiting.insert(at, request);
        Ok(())
    }

    fn until_due(&self, now: Instant) -> Option<Duration> {
        match &self.triggers {
            None => Some(self.cadence.until_due(now)),
            Some(waiting) => {
                let end = self.end_of(waiting.first()?)?;
                Some(end.saturating_duration_since(now))
            }
        }
    }

    fn take_due(&mut self, camera: &Camera, now: Instant) -> Option<Due> {
        let Some(waiting) = &self.triggers else {
            return self.cadence.take_due(camera.exposure_s, now);
        };
        let first = waiting.first()?;
        let end = self.end_of(first).filter(|end| *end <= now)?;
        // A trigger may arrive after the end of its exposure.
        let end = end.max(first.arrived);
        let latency = self.cadence.latency();
        let request = self.triggers.as_mut()?.remove(0);
        Some(Due {
            mid: request.start + seconds(request.camera.exposure_s / 2.0),
            end,
            deadline: Some(end + latency),
            trigger: request.number,
            latched: None,
            camera: Some(request.camera),
        })
    }

    fn end(&mut self, now: Instant) -> u32 {
        if self.triggers.is_none() {
            self.cadence.end(now);
        }
        self.drop_requests()
    }

    fn missed(&self) -> u32 {
        // With triggers, the cadence only provides the time.
        if self.triggers.is_some() {
            0
        } else {
            self.cadence.missed
        }
    }

    fn awaits_time(&self) -> bool {
        self.cadence.awaits_time()
    }

    fn pause(&mut self, now: Instant) {
        self.cadence.pause(now);
        self.paused_at = self.cadence.scene_at(now);
    }

    fn is_paused(&self) -> bool {
        self.cadence.is_paused()
    }

    fn resume(&mut self, now: Instant) {
        self.cadence.resume(now);
        // The latency of waiting triggers does not include the pause.
        for request in self.triggers.iter_mut().flatten() {
            request.arrived = request.arrived.max(now);
        }
    }

    fn restart(&mut self, rate_hz: f64, now: Instant) -> u32 {
        let waited = self.end(now);
        self.cadence.clear(rate_hz, now);
        self.paused_at = None;
        if let Some(client) = &mut self.client {
            (client.discipline, client.last_stamp) = (Discipline::default(), None);
        }
        waited
    }

    fn sync(&self, now: Instant) -> Sync {
        let Some(client) = &self.client else {
            return Sync::default();
        };
        let is_fresh = |stamp| now.saturating_duration_since(stamp) <= client.holdover;
        Sync {
            state: match client.last_stamp {
                None => SyncState::Waiting,
                Some(stamp) if is_fresh(stamp) => SyncState::Locked,
                Some(_) => SyncState::Holdover,
            },
            offset_s: client.discipline.offset_s(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_config::Config;

    const RATE_HZ: f64 = 20.0;
    const EXPOSURE_S: f64 = 0.01;
    /// Interval of the client's time stamps.
    const TICK_S: f64 = 0.02;

    fn scene() -> Epoch {
        Epoch::from_gregorian_utc_hms(2026, 6, 1, 0, 0, 0)
    }

    /// The emulator's side of a flight at computed instants, independent of real time.
    struct Flight {
        clock: Paced,
        camera: Camera,
        zero: Instant,
        /// Time since `zero`, s.
        now_s: f64,
        /// End of each exposure in scene time, s, and when it was due, s.
        ends: Vec<(f64, f64)>,
    }

    impl Flight {
        fn begin() -> Flight {
            let mut camera = Config::defaults().unwrap().camera;
            camera.exposure_s = EXPOSURE_S;
            Flight {
                clock: Paced::external(Cadence::new(RATE_HZ, None), false, Duration::from_secs(1)),
                camera,
                zero: Instant::now(),
                now_s: 0.0,
                ends: Vec::new(),
            }
        }

        fn now(&self) -> Instant {
            self.zero + Duration::from_secs_f64(self.now_s)
        }

        fn sync(&self) -> Sync {
            self.clock.sync(self.now())
        }

        /// For `length_s` the client sends the time stamps `time_s`, if any.
        fn fly(&mut self, length_s: f64, time_s: impl Fn(f64) -> Option<f64>) -> Vec<TimeCheck> {
            let mut checks = Vec::new();
            for _ in 0..(length_s / TICK_S).round() as u32 {
                self.now_s += TICK_S;
                if let Some(time_s) = time_s(self.now_s) {
                    checks.push(
                        self.clock
                            .observe_time(scene() + seconds(time_s), self.now()),
                    );
                }
                while let Some(due) = self.clock.take_due(&self.camera, self.now()) {
                    let end = due.mid + seconds(EXPOSURE_S / 2.0);
                    let since_s = due.end.saturating_duration_since(self.zero).as_secs_f64();
                    self.ends.push(((end - scene()).to_seconds(), since_s));
                }
            }
            checks
        }

        /// Takes the exposures. Checks that each ended a whole number of periods after `zero_s`,
        /// none twice or missing, at the client's time (`time_s`) within `off_s`.
        fn check_grid(&mut self, zero_s: f64, time_s: impl Fn(f64) -> f64, off_s: f64) -> usize {
            for (end_s, due_s) in &self.ends {
                let periods = (end_s - zero_s) * RATE_HZ;
                assert!((periods - periods.round()).abs() < 1e-5, "{periods}");
                let off = (time_s(*due_s) - end_s).abs();
                assert!(off <= off_s, "{end_s} at {due_s}");
            }
            for two in self.ends.windows(2) {
                let periods = (two[1].0 - two[0].0) * RATE_HZ;
                assert!((periods - 1.0).abs() < 1e-5, "{two:?}");
            }
            assert_eq!(self.clock.missed(), 0);
            std::mem::take(&mut self.ends).len()
        }
    }

    #[test]
    fn exposures_follow_the_clients_time_and_continue_in_silence() {
        let mut flight = Flight::begin();
        assert_eq!(flight.sync().state, SyncState::Waiting);
        flight.fly(1.0, |_| None);
        assert_eq!(flight.ends.len(), 0);
        flight.fly(5.0, |s| Some(s - 1.02));
        assert_eq!(flight.sync().state, SyncState::Locked);
        // X-Val: 4.98 s after the first time stamp, at 20 Hz.
        assert_eq!(flight.check_grid(0.0, |s| s - 1.02, 1e-6), 99);
        flight.fly(2.0, |_| None);
        assert_eq!(flight.sync().state, SyncState::Holdover);
        assert_eq!(flight.check_grid(0.0, |s| s - 1.02, 1e-6), 40);
        flight.fly(0.1, |s| Some(s - 1.02));
        assert_eq!(flight.sync().state, SyncState::Locked);
        flight.check_grid(0.0, |s| s - 1.02, 1e-6);
    }

    #[test]
    fn rate_error_of_the_client_is_followed_within_the_jitter() {
        for pace in [1.05, 1.001, 0.999] {
            let mut flight = Flight::begin();
            let time_s = |s: f64| (s - TICK_S) * pace;
            // A varying delay of up to 4 ms.
            let late_s = |s: f64| 0.004 * (s / TICK_S * 0.618_033_988_75).fract();
            flight.fly(TICK_S, |_| Some(0.0));
            flight.fly(10.0, |s| Some(time_s(s - late_s(s))));
            // X-Val: the window is 0.32 s long, in which a clock 5 % slow loses 16 ms, and each
            // time stamp corrects a quarter of what is left (3 ticks' drift).
            let off_s = 0.005 + 0.4 * (pace - 1.0_f64).abs();
            let count = flight.check_grid(0.0, time_s, off_s);
            let due = (10.0 * pace * RATE_HZ).floor() as usize;
            assert!((due - 1..=due).contains(&count), "{count} of {due}");
            let gained_s = flight.sync().offset_s;
            assert!((gained_s - 10.0 * (pace - 1.0)).abs() < off_s, "{gained_s}");
        }
    }

    #[test]
    fn clock_step_of_an_hour_is_followed_without_missed_exposures() {
        let mut flight = Flight::begin();
        flight.fly(2.0, |s| Some(s - TICK_S));
        flight.check_grid(0.0, |s| s - TICK_S, 1e-6);
        for (hours, before_s) in [(1.0, 0.0), (-1.0, 3600.0)] {
            let time_s = |s: f64| s - TICK_S + before_s + hours * 3600.0;
            let checks = flight.fly(0.4, |s| Some(time_s(s)));
            let jump = checks
                .iter()
                .position(|one| *one == TimeCheck::Jumped)
                .unwrap();
            // X-Val: protocols/docs/icd.md, section 5.5: after 0.25 s, so at the 14th tick of 20
            // ms, the first after 0.26 s.
            assert_eq!(jump, 13);
            let mut before = checks[..jump].iter();
            assert!(before.all(|one| matches!(one, TimeCheck::Doubtful(_))));
            assert!(
                checks[jump + 1..]
                    .iter()
                    .all(|one| *one == TimeCheck::Consistent)
            );
            let zero_s = time_s(flight.now_s - 0.4 + 14.0 * TICK_S);
            // Earlier exposures have the other time, except one at the transition.
            let is_after = |end_s: f64| (1e-3..1000.0).contains(&(end_s - zero_s));
            flight.ends.retain(|(end_s, _)| is_after(*end_s));
            flight.fly(2.0, |s| Some(time_s(s)));
            // X-Val: 0.12 s and 2 s after the confirmation, at 20 Hz.
            assert_eq!(flight.check_grid(zero_s, time_s, 1e-6), 42);
            let offset_s = flight.sync().offset_s;
            let off_s = offset_s - before_s - hours * 3600.0;
            assert!(off_s.abs() < 1e-3, "{offset_s}");
        }
    }

    #[test]
    fn inconsistent_time_stamps_lead_to_holdover() {
        let mut flight = Flight::begin();
        flight.fly(0.5, Some);
        assert_eq!(flight.sync().state, SyncState::Locked);
        // Each differs by another hour.
        let checks = flight.fly(2.0, |s| Some(s + 3600.0 * (s / TICK_S).round()));
        assert!(
            checks
                .iter()
                .all(|one| matches!(one, TimeCheck::Doubtful(_)))
        );
        assert_eq!(flight.sync().state, SyncState::Holdover);
        flight.fly(0.5, Some);
        assert_eq!(flight.sync().state, SyncState::Locked);
    }

    #[test]
    fn late_and_wrong_stamps_do_not_move_exposures() {
        let mut flight = Flight::begin();
        // One in four is right; the others are 0.3 s late, a year ahead, two seconds late.
        let off_s = |s: f64| [0.0, -0.3, 3e7, -2.0][(s / TICK_S).round() as usize % 4];
        flight.fly(0.08, Some);
        flight.fly(4.0, |s| Some(s + off_s(s)));
        assert_eq!(flight.check_grid(TICK_S, |s| s, 1e-6), 81);
        assert_eq!(flight.sync().offset_s, 0.0);
    }
}
