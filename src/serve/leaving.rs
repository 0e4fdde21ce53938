//! Frames whose last packet is in a link's queue: when it leaves, the frame's times are known.

use super::Server;
use super::picture::Picture;
use crate::link::Mark;
use crate::metrics::Snapshot;
use crate::timing::FrameTimes;
use std::time::{Duration, Instant};

/// Frames whose times are waited for at most: as many as links' queues may hold, and some.
const MOST: usize = 64;

/// A frame that has left, or never will.
#[derive(Debug, Clone, Copy)]
pub struct Left {
    /// Its times.
    pub times: FrameTimes,
    /// What they count from.
    pub trigger: Instant,
    /// When it was late; none: never.
    pub deadline: Option<Instant>,
}

/// A frame that leaves.
pub(super) struct Leaving {
    frame: u32,
    whole: bool,
    /// Whether it was given up because the run has ended.
    is_cut_off: bool,
    deadline: Option<Instant>,
    trigger: Instant,
    /// All but those of its end.
    times: FrameTimes,
    /// Links in whose queues it is, with the place of its last packet.
    marks: Vec<(usize, Mark)>,
    /// When it had left those that it has left.
    last: Option<Instant>,
}

impl Leaving {
    pub fn of(picture: &Picture) -> Leaving {
        Leaving {
            frame: picture.number,
            whole: picture.whole,
            is_cut_off: picture.is_cut_off && !picture.whole,
            deadline: picture.asked.due.deadline,
            trigger: picture.trigger(),
            times: FrameTimes {
                frame: picture.number,
                attitude_age_s: picture.asked.age_s,
                first_pixel: picture.since_trigger(picture.first_pixel),
                last_pixel: picture.since_trigger(picture.last_pixel),
                first_octet: picture.since_trigger(picture.first_octet),
                last_octet: Duration::ZERO,
                spare_s: 0.0,
                whole: false,
            },
            marks: picture.marks.clone(),
            last: None,
        }
    }
}

impl Server {
    /// Books the frames that have left all their links.
    pub(super) fn see_leave(&mut self) {
        let channels = &self.channels;
        let departed = |at: usize| channels.get(at).map(|channel| &channel.wire.tally.departed);
        for leaving in &mut self.leaving {
            let last = &mut leaving.last;
            leaving.marks.retain(|(at, mark)| {
                let left = departed(*at).and_then(|departed| departed.left(*mark));
                *last = (*last).max(left);
                left.is_none()
            });
        }
        if self.leaving.len() > MOST {
            let given_up = self.leaving.remove(0);
            for (at, mark) in given_up.marks {
                if let Some(departed) = departed(at) {
                    departed.forget(mark);
                }
            }
        }
        while let Some(at) = self
            .leaving
            .iter()
            .position(|leaving| leaving.marks.is_empty())
        {
            let left = self.leaving.remove(at);
            self.book(&left);
        }
    }

    fn book(&mut self, left: &Leaving) {
        if left.is_cut_off {
            return;
        }
        let last = left.last.filter(|_| left.whole);
        let spare_s = match (left.deadline, last) {
            (None, _) => f64::INFINITY,
            (Some(deadline), Some(last)) => spare_s(deadline, last),
            (Some(_), None) => f64::NEG_INFINITY,
        };
        let times = FrameTimes {
            frame: left.frame,
            last_octet: last.map_or(Duration::ZERO, |last| {
                last.saturating_duration_since(left.trigger)
            }),
            spare_s,
            whole: last.is_some(),
            ..left.times
        };
        let missed = &mut self.counters.deadlines_missed;
        *missed = missed.wrapping_add(u32::from(spare_s < 0.0));
        self.stats.latencies.add(&times);
        self.last = Some(times);
        if let Some(told) = &mut self.on_left {
            told(&Left {
                times,
                trigger: left.trigger,
                deadline: left.deadline,
            });
        }
        if let Some(metrics) = &self.metrics {
            let sync = self.clock.sync(Instant::now());
            let mut snapshot = Snapshot::of(&self.stats.latencies);
            snapshot.counters = self.counters().iter().collect();
            snapshot.attitude_age_s = Some(times.attitude_age_s);
            snapshot.clock_offset_s = Some(sync.offset_s);
            snapshot.deadline_spare_s = spare_s.is_finite().then_some(spare_s);
            metrics.publish(snapshot);
        }
    }
}

/// Time left, s; below 0: late by so much.
pub(super) fn spare_s(deadline: Instant, at: Instant) -> f64 {
    match deadline.checked_duration_since(at) {
        Some(left) => left.as_secs_f64(),
        None => -at.duration_since(deadline).as_secs_f64(),
    }
}
