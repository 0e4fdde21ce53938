//! Frames whose last packet is in a link's queue: when it leaves, the frame's times are known.

use super::Server;
use super::picture::Picture;
use crate::link::Mark;
use skyloop_protocols::Timing;
use std::time::Instant;

/// Frames whose times are waited for at most: as many as links' queues may hold, and some.
const MOST: usize = 64;

/// A frame that leaves.
pub(super) struct Leaving {
    frame: u32,
    whole: bool,
    deadline: Option<Instant>,
    trigger: Instant,
    timing: Timing,
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
            deadline: picture.asked.due.deadline,
            trigger: picture.trigger(),
            timing: picture.timing(Instant::now()),
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
        let last = left.last.filter(|_| left.whole);
        let missed = left
            .deadline
            .is_some_and(|deadline| last.is_none_or(|last| last > deadline));
        self.counters.deadlines_missed = self
            .counters
            .deadlines_missed
            .wrapping_add(u32::from(missed));
        self.stats.late += u32::from(missed);
        if let Some(last) = last {
            let latency = last.saturating_duration_since(left.trigger);
            self.stats.answer.add(latency);
            self.last_timing = left.timing;
        }
    }
}
