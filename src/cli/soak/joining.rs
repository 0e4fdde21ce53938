//! Matches the departures and arrivals of a soak's frames by camera and number.

use skyloop::host::Memory;
use skyloop::serve::SentFrame;
use skyloop::soak::Camera;
use skyloop::timing::FrameTimes;
use std::collections::BTreeMap;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Extra time for the last packet: after the deadline, or at the end of the run after departure.
const GRACE: Duration = Duration::from_secs(1);
/// Maximum time between the departure and the arrival of a frame.
const LONGEST: Duration = Duration::from_secs(60);

/// A frame that arrived whole: its camera, its number, and the time.
pub type Arrival = (usize, u32, Instant);

/// Times at the clients, from each frame's trigger to the arrival of its last packet, and the
/// memory of the process. A frame that never arrives whole has missed its deadline.
#[derive(Default)]
pub struct Joining {
    /// Departures without arrival, and arrivals without departure, by camera and number.
    in_flight: BTreeMap<(usize, u32), (SentFrame, Instant)>,
    early_arrivals: BTreeMap<(usize, u32), Instant>,
    cameras: Vec<Camera>,
    begin: Option<Instant>,
    /// Number of recorded exposures without a frame, by camera.
    missed: BTreeMap<usize, u32>,
    /// The last sent frame of each camera, and its deadline.
    last: BTreeMap<usize, (u32, Option<Instant>)>,
    /// Time of the first arrival.
    pub first: Option<Instant>,
    /// Memory during the run.
    pub memory: Memory,
}

impl Joining {
    /// For a run of `cameras` with this length.
    pub fn new(cameras: Vec<Camera>, length: Duration) -> Joining {
        Joining {
            cameras,
            memory: Memory::over(length),
            ..Joining::default()
        }
    }

    /// Joins until all senders have ended.
    pub fn join(&mut self, left: Receiver<(usize, SentFrame)>, arrivals: Receiver<Arrival>) {
        let begin = *self.begin.get_or_insert_with(Instant::now);
        for (camera, departure) in left {
            let frame = departure.times.frame;
            self.without_frame(camera, departure.missed, frame, "before it");
            self.last.insert(camera, (frame, departure.deadline));
            self.left(camera, departure, Instant::now());
            arrivals
                .try_iter()
                .for_each(|arrival| self.arrived(arrival));
            self.drop_overdue(Instant::now());
            self.memory.sample(begin.elapsed());
        }
        let over = Instant::now() + GRACE;
        while !self.in_flight.is_empty() {
            let rest = over.saturating_duration_since(Instant::now());
            let Ok(arrival) = arrivals.recv_timeout(rest) else {
                break;
            };
            self.arrived(arrival);
        }
    }

    fn left(&mut self, camera: usize, departure: SentFrame, now: Instant) {
        let key = (camera, departure.times.frame);
        match self.early_arrivals.remove(&key) {
            Some(at) => self.record(camera, &departure, at),
            // A frame that was not sent completely cannot arrive whole.
            None if !departure.times.whole => self.add(camera, &departure.times),
            None => {
                self.in_flight.insert(key, (departure, now));
            }
        }
    }

    fn arrived(&mut self, (camera, frame, at): Arrival) {
        self.first.get_or_insert(at);
        match self.in_flight.remove(&(camera, frame)) {
            Some((departure, _)) => self.record(camera, &departure, at),
            None => {
                self.early_arrivals.insert((camera, frame), at);
            }
        }
    }

    /// Records overdue frames as lost, so that memory stays bounded.
    fn drop_overdue(&mut self, now: Instant) {
        self.lose(|departure, left| {
            let latest = left + LONGEST;
            let due = departure.deadline.map_or(latest, |due| due.min(latest));
            due + GRACE < now
        });
        // Arrivals whose departure was not reported.
        self.early_arrivals.retain(|_, at| *at + LONGEST > now);
    }

    /// Records the frames in flight that `is_lost` selects.
    fn lose(&mut self, is_lost: impl Fn(&SentFrame, Instant) -> bool) {
        let cameras = &mut self.cameras;
        self.in_flight.retain(|(camera, frame), (departure, left)| {
            let is_lost = is_lost(departure, *left);
            if let Some(camera) = cameras.get_mut(*camera).filter(|_| is_lost) {
                camera.latencies.add(&FrameTimes::incomplete(*frame));
            }
            !is_lost
        });
    }

    /// Records the exposures that a camera has skipped until now.
    fn without_frame(&mut self, camera: usize, missed: u32, frame: u32, side: &'static str) {
        let recorded = self.missed.entry(camera).or_default();
        let count = missed.saturating_sub(std::mem::replace(recorded, missed));
        if let Some(camera) = self.cameras.get_mut(camera) {
            camera.latencies.add_without_frame(count, frame, side);
        }
    }

    fn record(&mut self, camera: usize, departure: &SentFrame, at: Instant) {
        let times = (departure.times).ended(departure.trigger, departure.deadline, at);
        self.add(camera, &times);
        if let (Some(begin), Some(exposure)) = (self.begin, departure.exposure)
            && let Some(camera) = self.cameras.get_mut(camera)
        {
            let since = at.saturating_duration_since(begin);
            camera.drift.add(since, exposure.end, at);
        }
    }

    fn add(&mut self, camera: usize, times: &FrameTimes) {
        if let Some(camera) = self.cameras.get_mut(camera) {
            camera.latencies.add(times);
        }
    }

    /// Records the remaining frames. A frame counts as lost unless it was sent within the last
    /// [`GRACE`] before the clients `ended`, and its deadline had not passed. `missed`: exposures
    /// without a frame of each camera, and its period.
    pub fn end(mut self, ended: Instant, missed: &[(u32, Duration)]) -> Vec<Camera> {
        self.lose(|departure, left| {
            left + GRACE < ended || departure.deadline.is_some_and(|due| due < ended)
        });
        for (camera, (missed, period)) in missed.iter().enumerate() {
            let (last, deadline) = self.last.get(&camera).copied().unwrap_or_default();
            let due = deadline.map_or(u32::MAX, |deadline| {
                let since = ended.saturating_duration_since(deadline);
                (since.as_secs_f64() / period.as_secs_f64()) as u32
            });
            let recorded = self.missed.get(&camera).copied().unwrap_or_default();
            let after = missed.saturating_sub(recorded).min(due);
            self.without_frame(camera, recorded + after, last, "after it");
        }
        self.cameras
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(100);

    fn left(frame: u32, trigger: Instant, deadline: Instant) -> SentFrame {
        SentFrame {
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

    /// Memory is bounded if packets are lost or departures are not reported.
    #[test]
    fn missing_arrivals_count_and_memory_is_bounded() {
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
                // A frame of another emulator.
                1 => joining.arrived((0, u32::MAX - frame, trigger)),
                _ => {}
            }
            joining.drop_overdue(trigger + 100 * MS);
            // X-Val: three in four of the 11 that are due within a second; one in four of 600 a
            // minute.
            let (in_flight, early) = (joining.in_flight.len(), joining.early_arrivals.len());
            assert!(in_flight <= 10 && early <= 151, "{in_flight} {early}");
        }
        let end = begin + 100 * MS * 10_000;
        let cameras = joining.end(end + GRACE, &[(0, PERIOD)]);
        let latencies = &cameras[0].latencies;
        // X-Val: one in four arrived, in time.
        assert_eq!((latencies.frames, latencies.missed), (10_000, 7_500));
        assert_eq!(latencies.incomplete, 7_500);
    }

    /// Lost frames count, even if their deadlines have not passed.
    #[test]
    fn lost_frames_count_before_their_deadlines() {
        let (begin, hour) = (Instant::now(), Duration::from_secs(3600));
        let at = |s: u32| begin + Duration::from_secs(s.into());
        let mut joining = Joining::new(vec![Camera::default()], hour);
        // Reported as lost; lost in flight; in flight at the end.
        for (frame, s, whole) in [(0, 0, false), (1, 0, true), (2, 90, true), (3, 99, true)] {
            let mut departure = left(frame, at(s), at(s) + hour);
            departure.times.whole = whole;
            joining.left(0, departure, at(s));
        }
        let incomplete = |joining: &Joining| joining.cameras[0].latencies.incomplete;
        joining.drop_overdue(at(60));
        assert_eq!(incomplete(&joining), 1);
        joining.drop_overdue(at(70));
        assert_eq!(incomplete(&joining), 2);
        let cameras = joining.end(at(100), &[(0, PERIOD)]);
        // X-Val: the last one was still within GRACE.
        assert_eq!(cameras[0].latencies.frames, 3);
        assert_eq!(cameras[0].latencies.missed, 3);
    }

    /// An exposure that ended with the run had no time for its frame.
    #[test]
    fn exposures_without_a_frame_count_after_their_deadlines() {
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
