//! Tracks when queued packets have left the queue: only the thread of the link sees it.

use super::lock::lock;
use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::time::Instant;

/// Numbers of queued and sent packets, and marks at the ends of frames.
#[derive(Debug, Default)]
pub struct TxComplete {
    /// Packets put into the queue so far, modulo 2^32.
    queued: AtomicU32,
    /// Packets that have left it, sent or lost, modulo 2^32.
    done: AtomicU32,
    /// Number of marks not reached yet.
    open: AtomicUsize,
    state: Mutex<Marks>,
}

#[derive(Debug, Default)]
struct Marks {
    /// In the order of their positions in the queue.
    marks: VecDeque<Marked>,
    /// Position of the frame packet lost last, as a count of packets that have left, and the
    /// reason.
    lost: Option<(u32, Unsent)>,
}

/// The packets of a frame in the queue: after `before`, up to `last`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    before: u32,
    last: u32,
}

impl Mark {
    /// Why a packet was lost, if the packet lost last belongs to this frame.
    fn loss(&self, lost: Option<(u32, Unsent)>) -> Option<Unsent> {
        let (position, why) = lost?;
        let is_within = is_reached(position, self.last) && !is_reached(position, self.before);
        is_within.then_some(why)
    }
}

/// Why a packet was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsent {
    /// The client has gone, or another has followed.
    ClientGone,
    /// The client has not proved its address.
    NotProved,
    /// The client does not read.
    NotRead,
    /// The system refused to send it, or the line was lost.
    Failed,
    /// A fault held it back until the end of the run.
    HeldBack,
    /// The run ended before the link could carry it.
    RunEnded,
}

/// How the packets of a frame left the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exit {
    /// When the last one left.
    pub at: Instant,
    /// Why one of them was not sent, if so.
    pub lost: Option<Unsent>,
}

#[derive(Debug)]
struct Marked {
    mark: Mark,
    left: Option<Exit>,
}

impl TxComplete {
    pub(super) fn queued(&self) {
        self.queued.fetch_add(1, Ordering::SeqCst);
    }

    /// Takes back the last `queued`. Only the thread that queues and marks may call it.
    pub(super) fn refused(&self) {
        self.queued.fetch_sub(1, Ordering::SeqCst);
    }

    /// Offers a queued packet to a further queue, which counts it too. So its first count is taken
    /// back, unless it is refused. A mark set meanwhile is one packet early.
    pub(super) fn forward<T>(
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
        let done = self.done.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        if self.open.load(Ordering::SeqCst) > 0 {
            self.reach(&mut lock(&self.state), done);
        }
    }

    /// A packet of a frame has left the queue and was not sent.
    pub(super) fn lost(&self, why: Unsent) {
        // Under the lock: a mark that finds the packet gone also finds its loss.
        let mut state = lock(&self.state);
        let done = self.done.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        state.lost = Some((done, why));
        self.reach(&mut state, done);
    }

    fn reach(&self, state: &mut Marks, done: u32) {
        let at = Instant::now();
        let open = state
            .marks
            .iter_mut()
            .filter(|marked| marked.left.is_none());
        for marked in open.take_while(|marked| is_reached(marked.mark.last, done)) {
            let lost = marked.mark.loss(state.lost);
            marked.left = Some(Exit { at, lost });
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// Number of packets that have not left.
    pub(super) fn waiting(&self) -> u32 {
        // `done` first: a packet queued meanwhile counts, and the difference is never negative.
        let done = self.done.load(Ordering::SeqCst);
        self.queued.load(Ordering::SeqCst).wrapping_sub(done)
    }

    /// Packets queued so far, modulo 2^32.
    pub fn place(&self) -> u32 {
        self.queued.load(Ordering::SeqCst)
    }

    /// Marks the packets of a frame: all queued after `before`. Their exit is stored until it is
    /// read.
    pub fn mark(&self, before: u32) -> Mark {
        let last = self.place();
        let mark = Mark { before, last };
        let mut state = lock(&self.state);
        // Before reading `done`: a packet that leaves meanwhile finds the mark or is in the count.
        self.open.fetch_add(1, Ordering::SeqCst);
        let reached = is_reached(last, self.done.load(Ordering::SeqCst));
        if reached {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
        let left = reached.then(|| Exit {
            at: Instant::now(),
            lost: mark.loss(state.lost),
        });
        state.marks.push_back(Marked { mark, left });
        mark
    }

    /// Takes the exit of the marked packets. `None` if they have not left, or an older mark is
    /// unread.
    pub fn left(&self, mark: Mark) -> Option<Exit> {
        if !is_reached(mark.last, self.done.load(Ordering::SeqCst)) {
            return None;
        }
        let marks = &mut lock(&self.state).marks;
        let left = marks.front().filter(|oldest| oldest.mark == mark)?.left?;
        marks.pop_front();
        Some(left)
    }

    /// Drops a mark.
    pub fn forget(&self, mark: Mark) {
        let marks = &mut lock(&self.state).marks;
        if let Some(at) = marks.iter().position(|marked| marked.mark == mark)
            && marks.remove(at).is_some_and(|marked| marked.left.is_none())
        {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

fn is_reached(position: u32, done: u32) -> bool {
    done.wrapping_sub(position) as i32 >= 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mark_is_reached_when_all_packets_before_it_have_left() {
        let tx_complete = TxComplete::default();
        // The counts wrap.
        for count in [&tx_complete.queued, &tx_complete.done] {
            count.store(u32::MAX - 1, Ordering::SeqCst);
        }
        (0..3).for_each(|_| tx_complete.queued());
        let mark = tx_complete.mark(u32::MAX - 1);
        tx_complete.queued();
        let later = tx_complete.mark(1);
        assert_eq!((tx_complete.waiting(), tx_complete.left(mark)), (4, None));
        (0..2).for_each(|_| tx_complete.done());
        assert_eq!(tx_complete.left(mark), None);
        let before = Instant::now();
        tx_complete.done();
        let after = Instant::now();
        tx_complete.lost(Unsent::Failed);
        assert_eq!(tx_complete.left(later), None, "an older mark is unread");
        let left = tx_complete.left(mark).unwrap();
        assert!((before..=after).contains(&left.at) && left.lost.is_none());
        assert_eq!(tx_complete.left(mark), None, "taken");
        let left = tx_complete.left(later).unwrap();
        assert!(left.at >= after && left.lost == Some(Unsent::Failed));
        assert_eq!(tx_complete.open.load(Ordering::SeqCst), 0);
    }

    /// A full queue may refuse often, and a packet may pass several queues.
    #[test]
    fn refused_and_forwarded_packets_have_not_left() {
        let tx_complete = TxComplete::default();
        (0..3).for_each(|_| tx_complete.queued());
        let mark = tx_complete.mark(0);
        for _ in 0..100 {
            tx_complete.queued();
            tx_complete.refused();
        }
        for is_taken in [true, false, true, true] {
            let offer = || {
                tx_complete.queued();
                if !is_taken {
                    tx_complete.refused();
                }
                is_taken
            };
            tx_complete.forward(offer, |is_taken| *is_taken);
        }
        assert_eq!((tx_complete.waiting(), tx_complete.left(mark)), (3, None));
        (0..2).for_each(|_| tx_complete.done());
        assert_eq!(tx_complete.left(mark), None);
        tx_complete.done();
        assert!(tx_complete.left(mark).is_some());
        assert_eq!(tx_complete.waiting(), 0);
    }

    /// Two packets leave at once, so the later mark may be reached first.
    #[test]
    fn later_mark_reached_first_does_not_hide_the_older_one() {
        let tx_complete = TxComplete::default();
        (0..2).for_each(|_| tx_complete.queued());
        let at = Instant::now();
        let marks = [1, 2].map(|last| Mark {
            before: last - 1,
            last,
        });
        for (mark, left) in marks.into_iter().zip([None, Some(Exit { at, lost: None })]) {
            let marks = &mut lock(&tx_complete.state).marks;
            marks.push_back(Marked { mark, left });
        }
        tx_complete.open.store(1, Ordering::SeqCst);
        (0..2).for_each(|_| tx_complete.done());
        assert!(marks.iter().all(|mark| tx_complete.left(*mark).is_some()));
    }

    #[test]
    fn mark_of_sent_packets_is_reached_at_once_and_a_dropped_one_never() {
        let tx_complete = TxComplete::default();
        tx_complete.queued();
        tx_complete.done();
        let mark = tx_complete.mark(0);
        assert!(
            tx_complete
                .left(mark)
                .is_some_and(|left| left.lost.is_none())
        );
        tx_complete.queued();
        let mark = tx_complete.mark(1);
        tx_complete.forget(mark);
        tx_complete.done();
        assert_eq!(tx_complete.left(mark), None);
        assert_eq!(tx_complete.open.load(Ordering::SeqCst), 0);
        assert_eq!(lock(&tx_complete.state).marks.len(), 0);
    }

    /// Frames of three packets; an answer precedes the second frame.
    #[test]
    fn frame_is_lost_with_any_of_its_own_packets() {
        use Unsent::{ClientGone, NotProved};
        // Positions of the lost packets, and the reason for each frame.
        for (lost, expected) in [
            (vec![], [None; 2]),
            (vec![(0, NotProved)], [Some(NotProved), None]),
            (vec![(4, ClientGone)], [None, Some(ClientGone)]),
            (
                vec![(2, NotProved), (5, ClientGone)],
                [Some(NotProved), Some(ClientGone)],
            ),
        ] {
            for marked_late in [false, true] {
                let tx_complete = TxComplete::default();
                let leave = |positions: std::ops::Range<u32>| {
                    positions.for_each(|position| {
                        match lost.iter().find(|(at, _)| *at == position) {
                            None => tx_complete.done(),
                            Some((_, why)) => tx_complete.lost(*why),
                        }
                    });
                };
                let mut marks = Vec::new();
                for (before, packets, positions) in [(0, 3, 0..3), (4, 4, 3..7)] {
                    (0..packets).for_each(|_| tx_complete.queued());
                    if marked_late {
                        leave(positions);
                    }
                    marks.push(tx_complete.mark(before));
                }
                if !marked_late {
                    leave(0..7);
                }
                let found = marks
                    .iter()
                    .map(|mark| tx_complete.left(*mark).unwrap().lost);
                assert_eq!(found.collect::<Vec<_>>(), expected, "{lost:?}");
            }
        }
    }
}
