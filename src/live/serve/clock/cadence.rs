//! The camera's cadence: when each exposure ends, and its scene time.

use super::due::Due;
use hifitime::Epoch;
use skyloop_base::range::nearest;
use skyloop_link::lock;
use skyloop_orbit::time::seconds;
use skyloop_render::camera::{EXPOSURE_S, RATE_HZ};
use std::sync::Mutex;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// This machine's time becomes the scene time if the first attitude differs by at most this, s.
const SAME_CLOCK_S: f64 = 10.0;

/// When each exposure ends, and its scene time.
#[derive(Debug)]
pub(crate) struct Cadence {
    period: Duration,
    /// Time from the end of an exposure to the deadline of its frame; none: a period.
    latency: Option<Duration>,
    /// End of the present exposure; none without one.
    next: Option<Instant>,
    /// Whether no exposure follows it until a rate is set, as after a single shot.
    is_last: bool,
    /// End of the exposure that waits for its frame, and its scene time if a pause began since.
    ended: Option<(Instant, Option<Epoch>)>,
    /// End of the commanded single shot, until its frame is taken.
    single_shot: Option<Instant>,
    /// A scene time, and the instant at which it is reached.
    zero: Option<(Epoch, Instant)>,
    /// Whether the scene time is stopped, so that no exposure ends.
    paused: bool,
    /// Whether the scene time is extrapolated since a pause: the next time stamp sets it.
    extrapolated: bool,
    /// Exposures without a frame.
    pub missed: u32,
}

impl Cadence {
    /// A cadence that starts when the scene time is set. Rates are clamped to [`RATE_HZ`].
    pub fn new(rate_hz: f64, latency: Option<Duration>) -> Cadence {
        Cadence {
            period: period(rate_hz),
            latency,
            next: None,
            is_last: false,
            ended: None,
            single_shot: None,
            zero: None,
            paused: false,
            extrapolated: false,
            missed: 0,
        }
    }

    /// Whether the next time stamp sets the scene time: the first, or the first after a pause.
    pub fn awaits_time(&self) -> bool {
        self.zero.is_none() || self.extrapolated
    }

    /// Sets the scene time by a client's first attitude, or by this machine's time if they differ
    /// by at most [`SAME_CLOCK_S`]. The first exposure ends a period later.
    pub fn set(&mut self, attitude: Epoch, arrived: Instant) {
        if !self.awaits_time() {
            return;
        }
        let system = system_time(arrived);
        let apart_s = (attitude - system).to_seconds().abs();
        let scene = if apart_s <= SAME_CLOCK_S {
            system
        } else {
            attitude
        };
        self.start(scene, arrived);
    }

    /// Sets the scene time at `at`. The first exposure ends a period later, except in a pause.
    pub fn start(&mut self, scene: Epoch, at: Instant) {
        self.advance(at);
        self.zero = Some((scene, at));
        if !std::mem::replace(&mut self.extrapolated, self.paused) {
            // A waiting exposure takes the new scene time, except after a pause.
            self.ended = self.ended.map(|(end, _)| (end, None));
        }
        if !self.is_last && !self.paused {
            self.next = Some(at + self.period);
        }
    }

    /// Stops the scene time and drops the present exposure. A waiting exposure keeps its frame.
    pub fn pause(&mut self, at: Instant) {
        self.advance(at);
        // An exposure that waits since an earlier pause already has its scene time.
        let scene = |(end, scene): (Instant, Option<Epoch>)| (end, scene.or(self.scene_at(end)));
        self.ended = self.ended.map(scene);
        self.zero = self.scene_at(at).map(|scene| (scene, at));
        (self.paused, self.extrapolated, self.next) = (true, true, None);
        self.drop_single_shot();
    }

    /// Counts a single shot as missed, unless it has ended and waits for its frame.
    fn drop_single_shot(&mut self) {
        let ended = self.ended.map(|(end, _)| end);
        let dropped = self.single_shot.take_if(|end| Some(*end) != ended);
        self.missed = self.missed.wrapping_add(u32::from(dropped.is_some()));
    }

    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Continues the scene time until a time stamp sets it; the first exposure ends a period later.
    pub fn resume(&mut self, at: Instant) {
        if !std::mem::take(&mut self.paused) {
            return;
        }
        self.zero = self.zero.map(|(scene, _)| (scene, at));
        let follows = self.zero.is_some() && !self.is_last;
        self.next = follows.then(|| at + self.period);
    }

    pub fn latency(&self) -> Duration {
        self.latency.unwrap_or(self.period)
    }

    /// The latency at a rate that may differ from the present one.
    pub fn latency_at(&self, rate_hz: f64) -> Duration {
        self.latency.unwrap_or_else(|| period(rate_hz))
    }

    /// The scene time at an instant, once it is known.
    pub fn scene_at(&self, at: Instant) -> Option<Epoch> {
        let (scene, zero) = self.zero?;
        if self.paused {
            return Some(scene);
        }
        let since = match at.checked_duration_since(zero) {
            Some(since) => since.as_secs_f64(),
            None => -zero.duration_since(at).as_secs_f64(),
        };
        Some(scene + seconds(since))
    }

    /// The instant of a scene time, once it is known; none during a pause.
    pub fn instant_of(&self, epoch: Epoch) -> Option<Instant> {
        let (scene, zero) = self.zero.filter(|_| !self.paused)?;
        let since_s = (epoch - scene).to_seconds();
        let since = Duration::try_from_secs_f64(since_s.abs()).ok()?;
        if since_s < 0.0 {
            zero.checked_sub(since)
        } else {
            zero.checked_add(since)
        }
    }

    /// Advances the scene time by `ahead_s`; exposures keep their scene times.
    pub fn advance_scene_time(&mut self, ahead_s: f64) {
        let earlier = |at: Instant| {
            let by = Duration::from_secs_f64(ahead_s.abs().min(1.0));
            if ahead_s < 0.0 {
                at + by
            } else {
                at.checked_sub(by).unwrap_or(at)
            }
        };
        if let Some((_, zero)) = &mut self.zero {
            *zero = earlier(*zero);
        }
        for end in [&mut self.next, &mut self.single_shot] {
            *end = end.map(earlier);
        }
        self.ended = self.ended.map(|(end, scene)| (earlier(end), scene));
    }

    /// Forgets the scene time: the next client sets it.
    pub fn clear(&mut self, rate_hz: f64, now: Instant) {
        self.end(now);
        *self = Cadence {
            missed: self.missed,
            ..Cadence::new(rate_hz, self.latency)
        };
    }

    /// Counts the exposures that have ended by `now` as missed.
    pub fn end(&mut self, now: Instant) {
        self.advance(now);
        self.drop_single_shot();
        let waited = u32::from(self.ended.take().is_some());
        self.missed = self.missed.wrapping_add(waited);
        self.single_shot = None;
    }

    /// Sets the rate. The next exposure ends a period after the last one, or after `arrived` if
    /// that is past or no exposure is in progress. A present single shot counts as the last one.
    pub fn set_rate(&mut self, rate_hz: f64, arrived: Instant) {
        self.advance(arrived);
        let before = std::mem::replace(&mut self.period, period(rate_hz));
        self.is_last = false;
        self.next = match self.next {
            None if self.paused => None,
            None => self.zero.map(|_| arrived + self.period),
            end if end == self.single_shot => end,
            Some(end) => {
                let last = end.checked_sub(before).unwrap_or(arrived);
                let next = last + self.period;
                Some(if next < arrived {
                    arrived + self.period
                } else {
                    next
                })
            }
        };
    }

    /// Exposes one frame from `arrived` on, clamped to [`EXPOSURE_S`]; then none until a rate.
    pub fn single_shot(&mut self, exposure_s: f64, arrived: Instant) {
        self.advance(arrived);
        self.next = Some(arrived + Duration::from_secs_f64(nearest(exposure_s, EXPOSURE_S)));
        self.single_shot = self.next;
        self.is_last = true;
    }

    /// Whether a single shot is exposed or waits for its frame.
    pub fn single_shot_is_open(&self) -> bool {
        self.single_shot.is_some()
    }

    /// Time until the next exposure ends; long if none is in progress.
    pub fn until_due(&self, now: Instant) -> Duration {
        const RESTING: Duration = Duration::from_secs(3600);
        let due = self.ended.map(|(end, _)| end).or(self.next);
        due.map_or(RESTING, |due| due.saturating_duration_since(now))
    }

    /// Takes the exposure that has ended, if there is one.
    pub fn take_due(&mut self, exposure_s: f64, now: Instant) -> Option<Due> {
        self.zero?;
        self.advance(now);
        let (end, in_scene) = self.ended.take()?;
        self.single_shot = self.single_shot.filter(|shot_end| *shot_end != end);
        let mid = in_scene.or_else(|| self.scene_at(end))? - seconds(exposure_s / 2.0);
        Some(Due {
            mid,
            end,
            deadline: Some(end + self.latency()),
            trigger: 0,
            latched: None,
            camera: None,
        })
    }

    /// Ends the exposures that end by `now`. One of them waits for its frame: a single shot first,
    /// else the newest. The others are missed.
    pub fn advance(&mut self, now: Instant) {
        let Some(end) = self.next.filter(|end| *end <= now) else {
            return;
        };
        let more = if self.is_last {
            0
        } else {
            let periods = now.duration_since(end).as_nanos() / self.period.as_nanos().max(1);
            u32::try_from(periods).unwrap_or(u32::MAX)
        };
        let newest = end + self.period.saturating_mul(more);
        self.next = (!self.is_last).then(|| newest + self.period);
        let waited = u32::from(self.ended.is_some());
        self.missed = self.missed.wrapping_add(more).wrapping_add(waited);
        self.ended = Some((self.single_shot.unwrap_or(newest), None));
    }
}

fn period(rate_hz: f64) -> Duration {
    Duration::from_secs_f64(1.0 / nearest(rate_hz, RATE_HZ))
}

/// This machine's time at an instant, the same for all clocks of a run to the nanosecond.
fn system_time(at: Instant) -> Epoch {
    static READ: Mutex<Option<(Instant, Epoch)>> = Mutex::new(None);
    const HOLDS: Duration = Duration::from_secs(10);
    let mut read = lock(&READ);
    let now = Instant::now();
    let (then, epoch) = match *read {
        Some((then, epoch)) if now.saturating_duration_since(then) < HOLDS => (then, epoch),
        _ => {
            let since = SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .unwrap_or_default();
            let epoch = Epoch::from_unix_duration(hifitime::Duration::from(since));
            *read = Some((now, epoch));
            (now, epoch)
        }
    };
    match at.checked_duration_since(then) {
        Some(later) => epoch + hifitime::Duration::from(later),
        None => epoch - hifitime::Duration::from(then.duration_since(at)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock and the instant when it was set to [`scene`]. Times are ms since then.
    struct Rig {
        clock: Cadence,
        zero: Instant,
    }

    fn scene() -> Epoch {
        Epoch::from_gregorian_utc_hms(2019, 6, 15, 23, 35, 50)
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    impl Rig {
        fn of(mut clock: Cadence) -> Rig {
            let zero = Instant::now();
            clock.set(scene(), zero);
            Rig { clock, zero }
        }

        fn new(rate_hz: f64) -> Rig {
            Rig::of(Cadence::new(rate_hz, None))
        }

        fn due(&mut self, now: u64) -> Option<Due> {
            self.clock.take_due(0.0, self.zero + ms(now))
        }

        /// End in scene time, ms, of the exposure that is taken at `now`.
        fn taken(&mut self, now: u64) -> Option<i64> {
            let mid = self.due(now)?.mid;
            Some(((mid - scene()).to_seconds() * 1e3).round() as i64)
        }

        fn set_rate(&mut self, rate_hz: f64, now: u64) {
            self.clock.set_rate(rate_hz, self.zero + ms(now));
        }

        fn pause(&mut self, now: u64) {
            self.clock.pause(self.zero + ms(now));
        }

        fn resume(&mut self, now: u64) {
            self.clock.resume(self.zero + ms(now));
        }

        fn start(&mut self, scene_s: f64, now: u64) {
            let scene = scene() + seconds(scene_s);
            self.clock.start(scene, self.zero + ms(now));
        }
    }

    #[test]
    fn exposure_waiting_at_a_pause_has_its_own_scene_time() {
        // Taken during the pause, and after it.
        for resumed in [false, true] {
            let mut rig = Rig::new(50.0);
            rig.pause(35);
            if resumed {
                rig.resume(1000);
            }
            assert_eq!(rig.taken(1001), Some(20), "{resumed}");
            assert_eq!(rig.taken(1002), None);
            rig.resume(2000);
            let next = if resumed { 1030 } else { 2030 };
            // X-Val: the scene stopped at 35 ms, and a period of 20 ms follows.
            assert_eq!(rig.taken(next), Some(55), "{resumed}");
        }
    }

    #[test]
    fn waiting_exposure_is_unaffected_by_further_pauses_and_time_stamps() {
        let mut rig = Rig::new(50.0);
        rig.pause(35);
        rig.resume(1000);
        rig.pause(1002);
        assert_eq!(rig.taken(1500), Some(20), "paused twice");
        // A time stamp during the pause, and one after it.
        for resumed in [false, true] {
            let mut rig = Rig::new(50.0);
            rig.pause(35);
            if resumed {
                rig.resume(1000);
            }
            rig.start(0.038, 1003);
            rig.resume(1004);
            assert_eq!(rig.taken(1005), Some(20), "{resumed}");
        }
        // Without a pause, a new scene time applies to the ended exposure.
        let mut rig = Rig::new(50.0);
        rig.start(100.0, 25);
        assert_eq!(rig.taken(26), Some(99_995));
    }

    #[test]
    fn exposures_end_at_the_period_with_their_scene_time() {
        let unset = Cadence::new(50.0, None).take_due(0.01, Instant::now());
        assert!(unset.is_none());
        let Rig { mut clock, zero } = Rig::new(50.0);
        assert!(clock.take_due(0.01, zero + ms(19)).is_none());
        let due = clock.take_due(0.01, zero + ms(25)).unwrap();
        // It ends 20 ms after the attitude; its middle is 5 ms earlier.
        assert!(((due.mid - scene()).to_seconds() - 0.015).abs() < 1e-9);
        assert_eq!(clock.until_due(zero + ms(25)), ms(15));
        // The frame is late from 40 ms on.
        assert_eq!(due.end, zero + ms(20));
        assert_eq!(due.deadline, Some(zero + ms(40)));
        let mut rig = Rig { clock, zero };
        assert_eq!(rig.taken(95), Some(80), "the newest");
        assert_eq!(rig.clock.missed, 2, "ended at 40 and 60 ms");
        rig.clock.clear(50.0, zero + ms(145));
        // Also those of 100, 120 and 140 ms.
        assert_eq!((rig.clock.missed, rig.taken(200)), (5, None));
        // A configured latency sets the deadline.
        let mut rig = Rig::of(Cadence::new(10.0, Some(ms(30))));
        assert_eq!(rig.due(105).unwrap().deadline, Some(rig.zero + ms(130)));
    }

    #[test]
    fn new_rate_counts_from_the_last_exposure_without_extra_misses() {
        let mut rig = Rig::new(10.0);
        assert_eq!(rig.taken(100), Some(100));
        rig.set_rate(20.0, 130);
        assert_eq!(rig.taken(150), Some(150));
        rig.set_rate(1.0, 160);
        assert_eq!(rig.taken(1150), Some(1150));
        rig.set_rate(100.0, 1850);
        assert_eq!(rig.taken(1860), Some(1860), "from the command");
        assert_eq!(rig.clock.missed, 0);
        // Missed: 1870 to 1890 ms; the one of 1900 ms waits for its frame.
        rig.set_rate(1.0, 1905);
        assert_eq!(rig.clock.missed, 3);
        assert_eq!(rig.taken(1906), Some(1900));
        assert_eq!(rig.taken(2900), Some(2900));
    }

    #[test]
    fn invalid_rates_and_exposures_are_clamped() {
        // X-Val: the lowest rate, 1e-4 Hz, has a period of 1e4 s.
        for slow in [f64::NAN, 0.0, -1.0, f64::NEG_INFINITY, 1e-300] {
            let Rig { mut clock, zero } = Rig::new(slow);
            assert_eq!(clock.until_due(zero), Duration::from_secs(10_000));
            clock.set_rate(f64::INFINITY, zero);
            assert_eq!(clock.until_due(zero), Duration::from_micros(100));
        }
        for [exposure_s, ended_s] in [[f64::NAN, 1e-9], [-1.0, 1e-9], [f64::INFINITY, 1e4]] {
            let Rig { mut clock, zero } = Rig::new(10.0);
            clock.single_shot(exposure_s, zero);
            assert_eq!(clock.until_due(zero), Duration::from_secs_f64(ended_s));
            clock.take_due(exposure_s, zero + Duration::from_secs(20_000));
        }
    }

    #[test]
    fn single_shot_is_never_skipped() {
        let mut rig = Rig::new(10.0);
        rig.clock.single_shot(0.25, rig.zero + ms(350));
        assert_eq!(rig.clock.missed, 2, "ended at 100 and 200 ms");
        assert_eq!(rig.taken(360), Some(300));
        assert!(rig.clock.single_shot_is_open() && rig.taken(599).is_none());
        rig.set_rate(20.0, 500);
        assert!(
            rig.clock.single_shot_is_open(),
            "a new rate does not end it"
        );
        let due = rig.due(725).unwrap();
        assert_eq!(due.end, rig.zero + ms(600));
        // X-Val: a period of 20 Hz after its end.
        assert_eq!(due.deadline, Some(rig.zero + ms(650)));
        assert!(!rig.clock.single_shot_is_open());
        assert_eq!(rig.clock.missed, 4, "also ended at 650 and 700 ms");
        assert_eq!(rig.taken(750), Some(750));
        rig.clock.single_shot(0.1, rig.zero + ms(760));
        assert_eq!(rig.taken(5000), Some(860));
        assert_eq!(rig.taken(9000), None, "the cadence rests");
        rig.set_rate(10.0, 9000);
        assert_eq!(rig.taken(9100), Some(9100));
        assert_eq!(rig.clock.missed, 4);
    }

    #[test]
    fn advanced_scene_time_does_not_change_exposure_times() {
        for ahead_s in [0.03, -0.03] {
            let Rig { mut clock, zero } = Rig::new(10.0);
            clock.advance_scene_time(ahead_s);
            let off = (clock.scene_at(zero).unwrap() - scene()).to_seconds() - ahead_s;
            assert!(off.abs() < 1e-9, "{off}");
            // X-Val: 100 ms after the first attitude, in scene time.
            let end = zero + Duration::from_secs_f64(0.1 - ahead_s);
            assert!(clock.take_due(0.0, end - ms(1)).is_none());
            let due = clock.take_due(0.0, end + ms(1)).unwrap();
            assert!(((due.mid - scene()).to_seconds() - 0.1).abs() < 1e-8);
            let back = clock.instant_of(due.mid).unwrap();
            assert!(back.max(due.end) - back.min(due.end) < Duration::from_micros(1));
        }
    }
}
