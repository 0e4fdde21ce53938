//! Joins the departures and arrivals of a soak's frames by camera and number.

use skyloop::host::Memory;
use skyloop::serve::Left;
use skyloop::soak::Camera;
use skyloop::timing::FrameTimes;
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// How long a last packet may take after the deadline, or at the end after its departure.
const PARTING: Duration = Duration::from_secs(1);
/// Maximum time that a departure waits for its arrival, or an arrival for its departure.
const LONGEST: Duration = Duration::from_secs(60);

/// A frame that came whole: its camera, its number, and when.
pub type Arrival = (usize, u32, Instant);

/// Times at the clients, from each frame's trigger to the arrival of its last packet, and the
/// memory of the process. A frame that never arrives whole has missed its deadline.
#[derive(Default)]
pub struct Joining {
    /// Departures without arrival, and arrivals without departure, by camera and number.
    way: BTreeMap<(usize, u32), (Left, Instant)>,
    came: BTreeMap<(usize, u32), Instant>,
    cameras: Vec<Camera>,
    begin: Option<Instant>,
    /// Exposures without a frame that were booked, by camera.
    missed: BTreeMap<usize, u32>,
    /// The last frame of each that has left, and its deadline.
    last: BTreeMap<usize, (u32, Option<Instant>)>,
    /// When the first came.
    pub first: Option<Instant>,
    /// What was held meanwhile.
    pub memory: Memory,
}

impl Joining {
    /// Of `cameras`, for so long.
    pub fn new(cameras: Vec<Camera>, length: Duration) -> Joining {
        Joining {
            cameras,
            memory: Memory::over(length),
            ..Joining::default()
        }
    }

    /// Joins until all senders have ended.
    pub fn join(&mut self, left: Receiver<(usize, Left)>, arrivals: Receiver<Arrival>) {
        let begin = *self.begin.get_or_insert_with(Instant::now);
        for (camera, told) in left {
            let frame = told.times.frame;
            self.without_frame(camera, told.missed, frame, "before it");
            self.last.insert(camera, (frame, told.deadline));
            self.left(camera, told, Instant::now());
            arrivals
                .try_iter()
                .for_each(|arrival| self.arrived(arrival));
            self.give_up(Instant::now());
            self.memory.see(begin.elapsed());
        }
        let over = Instant::now() + PARTING;
        while !self.way.is_empty() {
            let rest = over.saturating_duration_since(Instant::now());
            let Ok(arrival) = arrivals.recv_timeout(rest) else {
                break;
            };
            self.arrived(arrival);
        }
    }

    fn left(&mut self, camera: usize, told: Left, now: Instant) {
        let key = (camera, told.times.frame);
        match self.came.remove(&key) {
            Some(at) => self.book(camera, &told, at),
            // It never will.
            None if !told.times.whole => self.add(camera, &told.times),
            None => {
                self.way.insert(key, (told, now));
            }
        }
    }

    fn arrived(&mut self, (camera, frame, at): Arrival) {
        self.first.get_or_insert(at);
        match self.way.remove(&(camera, frame)) {
            Some((told, _)) => self.book(camera, &told, at),
            None => {
                self.came.insert((camera, frame), at);
            }
        }
    }

    /// Books overdue frames, so that memory stays bounded.
    fn give_up(&mut self, now: Instant) {
        self.lose(|told, left| {
            let latest = left + LONGEST;
            let due = told.deadline.map_or(latest, |due| due.min(latest));
            due + PARTING < now
        });
        // The client has it, and no departure was reported.
        self.came.retain(|_, at| *at + LONGEST > now);
    }

    /// Books the departed frames that `is_lost` selects.
    fn lose(&mut self, is_lost: impl Fn(&Left, Instant) -> bool) {
        let cameras = &mut self.cameras;
        self.way.retain(|(camera, frame), (told, left)| {
            let is_lost = is_lost(told, *left);
            if let Some(camera) = cameras.get_mut(*camera).filter(|_| is_lost) {
                camera.latencies.add(&FrameTimes::incomplete(*frame));
            }
            !is_lost
        });
    }

    /// Books the exposures that a camera has skipped until now.
    fn without_frame(&mut self, camera: usize, missed: u32, frame: u32, side: &'static str) {
        let booked = self.missed.entry(camera).or_default();
        let count = missed.saturating_sub(std::mem::replace(booked, missed));
        if let Some(camera) = self.cameras.get_mut(camera) {
            camera.latencies.add_without_frame(count, frame, side);
        }
    }

    fn book(&mut self, camera: usize, told: &Left, at: Instant) {
        let times = told.times.ended(told.trigger, told.deadline, at);
        self.add(camera, &times);
        if let (Some(begin), Some(exposure)) = (self.begin, told.exposure)
            && let Some(camera) = self.cameras.get_mut(camera)
        {
            let since = at.saturating_duration_since(begin);
            camera.drift.see(since, exposure.end, at);
        }
    }

    fn add(&mut self, camera: usize, times: &FrameTimes) {
        if let Some(camera) = self.cameras.get_mut(camera) {
            camera.latencies.add(times);
        }
    }

    /// Books the rest. A frame that never arrived counts, unless it had just left and still had
    /// time when the clients `ended`. `missed`: exposures without a frame of each camera, and its
    /// period.
    pub fn end(mut self, ended: Instant, missed: &[(u32, Duration)]) -> Vec<Camera> {
        self.lose(|told, left| {
            left + PARTING < ended || told.deadline.is_some_and(|due| due < ended)
        });
        for (camera, (missed, period)) in missed.iter().enumerate() {
            let (last, deadline) = self.last.get(&camera).copied().unwrap_or_default();
            let due = deadline.map_or(u32::MAX, |deadline| {
                let since = ended.saturating_duration_since(deadline);
                (since.as_secs_f64() / period.as_secs_f64()) as u32
            });
            let booked = self.missed.get(&camera).copied().unwrap_or_default();
            let after = missed.saturating_sub(booked).min(due);
            self.without_frame(camera, booked + after, last, "after it");
        }
        self.cameras
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(100);

    fn left(frame: u32, trigger: Instant, deadline: Instant) -> Left {
        Left {
            times: FrameTimes {
                whole: true,
                ..FrameTimes::incomplete(frame)
            },
            trigger,
            deadline: Some(deadline),
            missed: 0,
            exposure: None,
        }
    }

    /// Memory stays bounded if packets are lost or departures are not reported.
    #[test]
    fn what_never_comes_counts_and_is_not_kept() {
        const MS: Duration = Duration::from_millis(1);
        let begin = Instant::now();
        let camera = Camera {
            name: "A".to_string(),
            ..Camera::default()
        };
        let mut joining = Joining::new(vec![camera], Duration::from_secs(3600));
        for frame in 0..10_000 {
            let trigger = begin + 100 * MS * frame;
            joining.left(0, left(frame, trigger, trigger + 100 * MS), trigger);
            match frame % 4 {
                0 => joining.arrived((0, frame, trigger + 5 * MS)),
                // Of another emulator's count.
                1 => joining.arrived((0, u32::MAX - frame, trigger)),
                _ => {}
            }
            joining.give_up(trigger + 100 * MS);
            // X-Val: three in four of the 11 that are due within a second; one in four of 600 a
            // minute.
            assert!(joining.way.len() <= 10, "{}", joining.way.len());
            assert!(joining.came.len() <= 151, "{}", joining.came.len());
        }
        let end = begin + 100 * MS * 10_000;
        let cameras = joining.end(end + PARTING, &[(0, PERIOD)]);
        let latencies = &cameras[0].latencies;
        // X-Val: one in four came, in time.
        assert_eq!((latencies.frames, latencies.missed), (10_000, 7_500));
        assert_eq!(latencies.incomplete, 7_500);
    }

    /// Lost frames count, however late their deadlines are.
    #[test]
    fn what_is_lost_counts_in_time_or_not() {
        let (begin, hour) = (Instant::now(), Duration::from_secs(3600));
        let at = |s: u32| begin + Duration::from_secs(s.into());
        let mut joining = Joining::new(vec![Camera::default()], hour);
        // Told as lost; lost on its way; on its way at the end.
        for (frame, s, whole) in [(0, 0, false), (1, 0, true), (2, 90, true), (3, 99, true)] {
            let mut told = left(frame, at(s), at(s) + hour);
            told.times.whole = whole;
            joining.left(0, told, at(s));
        }
        let incomplete = |joining: &Joining| joining.cameras[0].latencies.incomplete;
        joining.give_up(at(60));
        assert_eq!(incomplete(&joining), 1);
        joining.give_up(at(70));
        assert_eq!(incomplete(&joining), 2);
        let cameras = joining.end(at(100), &[(0, PERIOD)]);
        // X-Val: PARTING, which the last one was still within.
        assert_eq!(cameras[0].latencies.frames, 3);
        assert_eq!(cameras[0].latencies.missed, 3);
    }
    /// An exposure that ended as the run did had no time for its frame.
    #[test]
    fn exposures_without_a_frame_count_when_their_deadlines_have_passed() {
        let begin = Instant::now();
        let counted = |ended: Duration| {
            let mut joining = Joining::new(vec![Camera::default()], Duration::from_secs(60));
            joining.last.insert(0, (7, Some(begin)));
            let cameras = joining.end(begin + ended, &[(3, PERIOD)]);
            cameras[0].latencies.without_frame
        };
        // X-Val: by hand: their deadlines are 100, 200 and 300 ms after the last frame's.
        for (ended_ms, count) in [(0, 0), (99, 0), (101, 1), (250, 2), (350, 3), (9000, 3)] {
            assert_eq!(
                counted(Duration::from_millis(ended_ms)),
                count,
                "{ended_ms}"
            );
        }
    }
}
