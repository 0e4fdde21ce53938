//! When queued packets have left the queue: only the thread of the link sees the end of a frame.

use super::lock::lock;
use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::time::Instant;

/// Packets queued and sent so far, and marks at the ends of frames.
#[derive(Debug, Default)]
pub struct TxComplete {
    /// Packets put into the queue so far, modulo 2^32.
    queued: AtomicU32,
    /// Packets that have left it for good, sent or lost, likewise.
    done: AtomicU32,
    /// How many marks have not been reached.
    open: AtomicUsize,
    book: Mutex<Book>,
}

#[derive(Debug, Default)]
struct Book {
    /// The oldest first: in the order of their places in the queue.
    marks: VecDeque<Marked>,
    /// The frame packet that was lost last, as a count of packets that have left, and why.
    lost: Option<(u32, Unsent)>,
}

/// The packets of a frame in the queue: those after `before`, up to `last`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Mark {
    before: u32,
    last: u32,
}

impl Mark {
    /// Why one of its packets was lost, if the last one that was lost is among them.
    fn loss(&self, lost: Option<(u32, Unsent)>) -> Option<Unsent> {
        let (place, why) = lost?;
        let is_within = is_reached(place, self.last) && !is_reached(place, self.before);
        is_within.then_some(why)
    }
}

/// Why a packet was not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unsent {
    /// Its client has gone, or another has followed it.
    ClientGone,
    /// The client has not proved its address.
    NotProved,
    /// The client does not read.
    NotRead,
    /// The system refused it, or the line was lost.
    Failed,
    /// A fault held it back until the run had ended.
    HeldBack,
    /// The run ended before the link could carry it.
    RunEnded,
}

/// How the packets of a frame left the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exit {
    /// When the last one did.
    pub at: Instant,
    /// Why one of them was not sent.
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

    /// The last packet was refused and does not count. For the thread that queues and marks.
    pub(super) fn refused(&self) {
        self.queued.fetch_sub(1, Ordering::SeqCst);
    }

    /// Hands a packet to a further queue, which books it if `is_taken`. It counts once meanwhile. A
    /// mark set in between is one packet early.
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
        let done = self.done.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        if self.open.load(Ordering::SeqCst) > 0 {
            self.reach(&mut lock(&self.book), done);
        }
    }

    /// A packet of a frame has left the queue and was not sent.
    pub(super) fn lost(&self, why: Unsent) {
        // A mark that finds the packet gone finds its loss too.
        let mut book = lock(&self.book);
        let done = self.done.fetch_add(1, Ordering::SeqCst).wrapping_add(1);
        book.lost = Some((done, why));
        self.reach(&mut book, done);
    }

    fn reach(&self, book: &mut Book, done: u32) {
        let at = Instant::now();
        let open = book.marks.iter_mut().filter(|marked| marked.left.is_none());
        for marked in open.take_while(|marked| is_reached(marked.mark.last, done)) {
            let lost = marked.mark.loss(book.lost);
            marked.left = Some(Exit { at, lost });
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }

    /// Packets that have not left.
    pub(super) fn waiting(&self) -> u32 {
        // In this order: what is queued meanwhile is counted, and none is taken for less than none.
        let done = self.done.load(Ordering::SeqCst);
        self.queued.load(Ordering::SeqCst).wrapping_sub(done)
    }

    /// Packets queued so far, modulo 2^32.
    pub fn place(&self) -> u32 {
        self.queued.load(Ordering::SeqCst)
    }

    /// Marks the packets of a frame: all that were queued after `before`. Their exit is stored
    /// until it is read.
    pub fn mark(&self, before: u32) -> Mark {
        let last = self.place();
        let mark = Mark { before, last };
        let mut book = lock(&self.book);
        // Before reading `done`: a packet that leaves meanwhile finds the mark, or is counted.
        self.open.fetch_add(1, Ordering::SeqCst);
        let reached = is_reached(last, self.done.load(Ordering::SeqCst));
        if reached {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
        let left = reached.then(|| Exit {
            at: Instant::now(),
            lost: mark.loss(book.lost),
        });
        book.marks.push_back(Marked { mark, left });
        mark
    }

    /// How the marked packets left, once. None if they have not, or an older mark is still unread.
    pub fn left(&self, mark: Mark) -> Option<Exit> {
        if !is_reached(mark.last, self.done.load(Ordering::SeqCst)) {
            return None;
        }
        let marks = &mut lock(&self.book).marks;
        let left = marks.front().filter(|oldest| oldest.mark == mark)?.left?;
        marks.pop_front();
        Some(left)
    }

    /// Drops a mark.
    pub fn forget(&self, mark: Mark) {
        let marks = &mut lock(&self.book).marks;
        if let Some(at) = marks.iter().position(|marked| marked.mark == mark)
            && marks.remove(at).is_some_and(|marked| marked.left.is_none())
        {
            self.open.fetch_sub(1, Ordering::SeqCst);
        }
    }
}

fn is_reached(place: u32, done: u32) -> bool {
    done.wrapping_sub(place) as i32 >= 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_is_reached_when_all_before_it_has_left() {
        let tx_complete = TxComplete::default();
        // Over the wrap of the counts.
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
        assert_eq!(tx_complete.left(later), None, "the oldest first");
        let left = tx_complete.left(mark).unwrap();
        assert!((before..=after).contains(&left.at) && left.lost.is_none());
        assert_eq!(tx_complete.left(mark), None, "forgotten");
        let left = tx_complete.left(later).unwrap();
        assert!(left.at >= after && left.lost == Some(Unsent::Failed));
        assert_eq!(tx_complete.open.load(Ordering::SeqCst), 0);
    }

    /// However often a full queue is asked, and however many queues a packet goes through.
    #[test]
    fn what_is_refused_or_handed_on_has_not_left() {
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
            tx_complete.hand_on(offer, |is_taken| *is_taken);
        }
        assert_eq!((tx_complete.waiting(), tx_complete.left(mark)), (3, None));
        (0..2).for_each(|_| tx_complete.done());
        assert_eq!(tx_complete.left(mark), None);
        tx_complete.done();
        assert!(tx_complete.left(mark).is_some());
        assert_eq!(tx_complete.waiting(), 0);
    }

    /// Two packets leave at once, and the later mark is reached first.
    #[test]
    fn a_mark_that_is_reached_first_hides_no_older_one() {
        let tx_complete = TxComplete::default();
        (0..2).for_each(|_| tx_complete.queued());
        let at = Instant::now();
        let marks = [1, 2].map(|last| Mark {
            before: last - 1,
            last,
        });
        for (mark, left) in marks.into_iter().zip([None, Some(Exit { at, lost: None })]) {
            let marks = &mut lock(&tx_complete.book).marks;
            marks.push_back(Marked { mark, left });
        }
        tx_complete.open.store(1, Ordering::SeqCst);
        (0..2).for_each(|_| tx_complete.done());
        assert!(marks.iter().all(|mark| tx_complete.left(*mark).is_some()));
    }

    #[test]
    fn what_has_left_already_is_reached_at_once_and_what_is_forgotten_never() {
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
        assert_eq!(lock(&tx_complete.book).marks.len(), 0);
    }

    /// Frames of three packets; an answer precedes the second. A frame is lost with its own packets
    /// only.
    #[test]
    fn a_frame_is_lost_with_any_of_its_packets() {
        use Unsent::{ClientGone, NotProved};
        // Places of the packets that are lost, and why each frame is.
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
                let leave = |places: std::ops::Range<u32>| {
                    places.for_each(|place| match lost.iter().find(|(at, _)| *at == place) {
                        None => tx_complete.done(),
                        Some((_, why)) => tx_complete.lost(*why),
                    });
                };
                let mut marks = Vec::new();
                for (before, packets, places) in [(0, 3, 0..3), (4, 4, 3..7)] {
                    (0..packets).for_each(|_| tx_complete.queued());
                    if marked_late {
                        leave(places);
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
