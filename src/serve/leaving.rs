//! Frames whose last packet is in a link's queue: when it leaves, the frame's times are known.

use super::Server;
use super::picture::Picture;
use crate::link::Mark;
use crate::metrics::Snapshot;
use crate::timing::FrameTimes;
use std::time::Instant;

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
    /// Its times but those of its end.
    left: Left,
    whole: bool,
    /// Whether it was given up because the run has ended.
    is_cut_off: bool,
    /// Links in whose queues it is, with the place of its last packet.
    marks: Vec<(usize, Mark)>,
    /// When it had left those that it has left.
    last: Option<Instant>,
}

impl Leaving {
    pub fn of(picture: &Picture) -> Leaving {
        Leaving {
            left: Left {
                times: FrameTimes {
                    attitude_age_s: picture.asked.age_s,
                    first_pixel: picture.since_trigger(picture.first_pixel),
                    last_pixel: picture.since_trigger(picture.last_pixel),
                    first_octet: picture.since_trigger(picture.first_octet),
                    ..FrameTimes::incomplete(picture.number)
                },
                trigger: picture.trigger(),
                deadline: picture.asked.due.deadline,
            },
            whole: picture.whole,
            is_cut_off: picture.is_cut_off && !picture.whole,
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
        // Of too many the oldest is taken for one that never leaves.
        if self.leaving.len() > MOST
            && let Some(oldest) = self.leaving.first_mut()
        {
            for (at, mark) in oldest.marks.drain(..) {
                if let Some(departed) = departed(at) {
                    departed.forget(mark);
                }
            }
            oldest.whole = false;
        }
        while let Some(at) = self
            .leaving
            .iter()
            .position(|leaving| leaving.marks.is_empty())
        {
            let leaving = self.leaving.remove(at);
            self.book(leaving);
        }
    }

    fn book(&mut self, leaving: Leaving) {
        if leaving.is_cut_off {
            return;
        }
        let mut left = leaving.left;
        if let Some(last) = leaving.last.filter(|_| leaving.whole) {
            left.times = left.times.ended(left.trigger, left.deadline, last);
        } else if left.deadline.is_none() {
            left.times.spare_s = f64::INFINITY;
        }
        let times = left.times;
        let missed = &mut self.counters.deadlines_missed;
        *missed = missed.wrapping_add(u32::from(times.spare_s < 0.0));
        self.stats.latencies.add(&times);
        self.last = Some(times);
        if let Some(told) = &mut self.on_left {
            told(&left);
        }
        if let Some(metrics) = &self.metrics {
            let sync = self.clock.sync(Instant::now());
            let mut snapshot = Snapshot::of(&self.stats.latencies);
            snapshot.counters = self.counters().iter().collect();
            snapshot.attitude_age_s = Some(times.attitude_age_s);
            snapshot.clock_offset_s = Some(sync.offset_s);
            snapshot.deadline_spare_s = Some(times.spare_s).filter(|spare_s| spare_s.is_finite());
            metrics.publish(snapshot);
        }
    }
}
