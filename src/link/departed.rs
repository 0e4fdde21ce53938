//! When what was queued has left: the end of a frame's way, which the link's own thread alone sees.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Packets that were queued and have left, and the moments that somebody wants to know.
#[derive(Debug, Default)]
pub struct Departed {
    /// Packets put into the queue so far, modulo 2^32.
    queued: AtomicU32,
    /// Packets that have left it for good, sent or lost, likewise.
    done: AtomicU32,
    /// Where all packets since have been lost: the first of them, as a count of `done`, plus [`LOSING`]; else 0.
    losing: AtomicU64,
    /// How many marks have not been reached.
    open: AtomicUsize,
    /// The oldest first: in the order of their places in the queue.
    marks: Mutex<VecDeque<Marked>>,
}

/// Behind the counts of packets.
const LOSING: u64 = 1 << 32;

/// A place in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark(u32);

/// How a packet left the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exit {
    /// When.
    pub at: Instant,
    /// It was lost: its client had gone, or the system refused it.
    pub is_lost: bool,
}

#[derive(Debug)]
struct Marked {
    mark: Mark,
    left: Option<Exit>,
}

impl Departed {
    pub(super) fn queued(&self) {
        self.queued.fetch_add(1, Ordering::SeqCst);
    }

    /// The packet that was queued last was refused: it has not been queued at all. By the thread that queues and marks.
    pub(super) fn refused(&self) {
        self.queued.fetch_sub(1, Ordering::SeqCst);
    }

    /// Hands a packet on to a further queue, which books it, too, where `offer` says that it took it: it is one all the while. A mark that is set in between comes
    /// one packet too early, which is then on its way.
    pub(super) fn hand_on<T>(
        &self,
        offer: impl FnOnce() -> T,
        is_taken: impl FnOnce(&T) -> bool,
    ) -> T {
        self.refused();
        let answer = offer();
        if !is_taken(&answer) {
            self.queued();
        }
        answer
    }

    /// A packet has left the queue.
    pub(super) fn done(&self) {
        self.leave(false);
    }

    /// A packet has left the queue and was not sent.
    pub(super) fn lost(&self) {
        self.leave(true);
    }

    fn leave(&self, is_lost: bool) {
        // Before the count: a mark that finds the packet gone finds this too.
        let first = self.done.load(Ordering::SeqCst).wrapping_add(1);
        let losing = self.losing.load(Ordering::SeqCst);
        if is_lost != (losing > 0) {
            let losing = if is_lost {
                LOSING + u64::from(first)
            } else {
                0
            };
            self.losing.store(losing, Ordering::SeqCst);
        }
        let done = self.done.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        if self.open.load(Ordering::SeqCst) == 0 {
            return;
        }
        let at = Instant::now();
        let mut marks = self.lock();
        let open = marks.iter_mut().filter(|marked| marked.left.is_none());
        for marked in open.take_while(|marked| is_reached(marked.mark, done)) {
            marked.left = Some(Exit { at, is_lost });
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// Packets that have not left.
    pub(super) fn waiting(&self) -> u32 {
        // In this order: what is queued meanwhile is counted, and none is taken for less than none.
        let done = self.done.load(Ordering::SeqCst);
        self.queued.load(Ordering::SeqCst).wrapping_sub(done)
    }

    /// Marks the packet that was queued last: how it left, after all before it, is stored until it is read.
    pub(crate) fn mark(&self) -> Mark {
        let mark = Mark(self.queued.load(Ordering::SeqCst));
        let mut marks = self.lock();
        // Before the look at what has left: a packet that leaves meanwhile finds the mark, or the look finds the packet.
        self.open.fetch_add(1, Ordering::SeqCst);
        let reached = is_reached(mark, self.done.load(Ordering::SeqCst));
        if reached {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
        let left = reached.then(|| Exit {
            at: Instant::now(),
            is_lost: self.is_losing(mark),
        });
        marks.push_back(Marked { mark, left });
        mark
    }

    /// Whether the marked packet, which has left, and all behind it were lost.
    fn is_losing(&self, mark: Mark) -> bool {
        let losing = self.losing.load(Ordering::SeqCst);
        losing > 0 && is_reached(Mark(losing as u32), mark.0)
    }

    /// How the marked packet left; none if it has not, or an older mark has not been read. The mark is then forgotten.
    pub(crate) fn left(&self, mark: Mark) -> Option<Exit> {
        if !is_reached(mark, self.done.load(Ordering::SeqCst)) {
            return None;
        }
        let mut marks = self.lock();
        let left = marks.front().filter(|oldest| oldest.mark == mark)?.left?;
        marks.pop_front();
        Some(left)
    }

    /// Nobody wants to know any more.
    pub(crate) fn forget(&self, mark: Mark) {
        let mut marks = self.lock();
        if let Some(at) = marks.iter().position(|marked| marked.mark == mark)
            && marks.remove(at).is_some_and(|marked| marked.left.is_none())
        {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Marked>> {
        // What a thread that panicked leaves behind is a list like any other.
        self.marks.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn is_reached(mark: Mark, done: u32) -> bool {
    done.wrapping_sub(mark.0) as i32 >= 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_reached_when_all_before_it_has_left() {
        let departed = Departed::default();
        // Over the wrap of the counts.
        for count in [&departed.queued, &departed.done] {
            count.store(u32::MAX - 1, Ordering::SeqCst);
        }
        (0..3).for_each(|_| departed.queued());
        let mark = departed.mark();
        departed.queued();
        let later = departed.mark();
        assert_eq!((departed.waiting(), departed.left(mark)), (4, None));
        (0..2).for_each(|_| departed.done());
        assert_eq!(departed.left(mark), None);
        let before = Instant::now();
        departed.done();
        let after = Instant::now();
        departed.lost();
        assert_eq!(departed.left(later), None, "the oldest first");
        let left = departed.left(mark).unwrap();
        assert!((before..=after).contains(&left.at) && !left.is_lost);
        assert_eq!(departed.left(mark), None, "forgotten");
        let left = departed.left(later).unwrap();
        assert!(left.at >= after && left.is_lost);
        assert_eq!(departed.open.load(Ordering::SeqCst), 0);
    }

    /// However often a full queue is asked, and however many queues a packet goes through.
    #[test]
    fn what_is_refused_or_handed_on_has_not_left() {
        let departed = Departed::default();
        (0..3).for_each(|_| departed.queued());
        let mark = departed.mark();
        for _ in 0..100 {
            departed.queued();
            departed.refused();
        }
        for is_taken in [true, false, true, true] {
            let offer = || {
                departed.queued();
                if !is_taken {
                    departed.refused();
                }
                is_taken
            };
            departed.hand_on(offer, |is_taken| *is_taken);
        }
        assert_eq!((departed.waiting(), departed.left(mark)), (3, None));
        (0..2).for_each(|_| departed.done());
        assert_eq!(departed.left(mark), None);
        departed.done();
        assert!(departed.left(mark).is_some());
        assert_eq!(departed.waiting(), 0);
    }

    /// A packet leaves while the one before it is booked: its mark is reached at once, the older one a moment later.
    #[test]
    fn a_mark_that_is_reached_first_hides_no_older_one() {
        let departed = Departed::default();
        (0..2).for_each(|_| departed.queued());
        let at = Instant::now();
        for (place, left) in [(1, None), (2, Some(Exit { at, is_lost: false }))] {
            let mark = Mark(place);
            departed.lock().push_back(Marked { mark, left });
        }
        departed.open.store(1, Ordering::SeqCst);
        (0..2).for_each(|_| departed.done());
        assert!(departed.left(Mark(1)).is_some() && departed.left(Mark(2)).is_some());
    }

    #[test]
    fn what_has_left_already_is_reached_at_once_and_what_is_forgotten_never() {
        let departed = Departed::default();
        departed.queued();
        departed.done();
        let mark = departed.mark();
        assert!(departed.left(mark).is_some_and(|left| !left.is_lost));
        for (is_lost, behind) in [(true, 0), (true, 1), (false, 0), (true, 2)] {
            departed.queued();
            departed.leave(is_lost);
            let place = departed.mark();
            for _ in 0..behind {
                departed.queued();
                departed.lost();
            }
            let last = departed.mark();
            for mark in [place, last] {
                let left = departed.left(mark);
                assert!(left.is_some_and(|left| left.is_lost == is_lost));
            }
        }
        departed.queued();
        let mark = departed.mark();
        departed.forget(mark);
        departed.done();
        assert_eq!(departed.left(mark), None);
        assert_eq!(departed.open.load(Ordering::SeqCst), 0);
        assert_eq!(departed.lock().len(), 0);
    }
}
