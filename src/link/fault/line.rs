//! The delay line: items that are not due yet, in a ring of fixed size.

use std::collections::VecDeque;
use std::time::Duration;

/// Maximum number of items of a direction.
pub const CAPACITY: usize = 1024;
/// Maximum wait of an item for the next one to overtake it.
const HOLD: Duration = Duration::from_millis(50);

/// How an item is queued.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// After all earlier items in order.
    Sequential,
    /// By its due time alone; it may overtake.
    Free,
    /// After the next item.
    Swapped,
}

/// Items sorted by due time.
pub(super) struct Line<T> {
    ring: VecDeque<(Duration, T)>,
    /// Due time of the last item in order.
    last: Duration,
    /// The item that waits to be overtaken, and until when.
    held: Option<(Duration, T)>,
}

impl<T> Line<T> {
    pub fn new() -> Line<T> {
        Line {
            ring: VecDeque::with_capacity(CAPACITY),
            last: Duration::ZERO,
            held: None,
        }
    }

    pub fn room(&self) -> usize {
        CAPACITY - self.len()
    }

    pub fn len(&self) -> usize {
        self.ring.len() + usize::from(self.held.is_some())
    }

    pub fn put(&mut self, item: T, due: Duration, order: Order) {
        match order {
            Order::Swapped if self.held.is_none() => {
                self.held = Some((due + HOLD, item));
                return;
            }
            Order::Free => self.insert(item, due),
            Order::Sequential | Order::Swapped => {
                self.last = self.last.max(due);
                self.insert(item, self.last);
            }
        }
        if let Some((_, held)) = self.held.take() {
            self.last = self.last.max(due);
            self.insert(held, self.last);
        }
    }

    /// Inserts an item after all that are due no later.
    fn insert(&mut self, item: T, due: Duration) {
        let position = self.ring.partition_point(|(other, _)| *other <= due);
        self.ring.insert(position, (due, item));
    }

    /// Takes the next item due at `now`.
    pub fn pop_due(&mut self, now: Duration) -> Option<T> {
        if let Some((until, held)) = self.held.take_if(|(until, _)| *until <= now) {
            // No item came to overtake it.
            self.last = self.last.max(until);
            self.insert(held, self.last);
        }
        if self.ring.front().is_some_and(|(due, _)| *due <= now) {
            return self.ring.pop_front().map(|(_, item)| item);
        }
        None
    }

    pub fn next_due(&self) -> Option<Duration> {
        let front = self.ring.front().map(|(due, _)| *due);
        let held = self.held.as_ref().map(|(until, _)| *until);
        front.into_iter().chain(held).min()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// All that is due at `now`.
    fn due(line: &mut Line<u32>, now: Duration) -> Vec<u32> {
        std::iter::from_fn(|| line.pop_due(now)).collect()
    }

    #[test]
    fn order_is_preserved_when_the_delay_shrinks() {
        let mut line = Line::new();
        line.put(1, ms(20), Order::Sequential);
        line.put(2, ms(5), Order::Sequential);
        assert_eq!(line.next_due(), Some(ms(20)));
        assert!(due(&mut line, ms(19)).is_empty());
        assert_eq!(due(&mut line, ms(20)), [1, 2]);
        // Free items leave at their due time; equal ones in order of arrival.
        line.put(3, ms(40), Order::Sequential);
        line.put(4, ms(30), Order::Free);
        line.put(5, ms(30), Order::Free);
        assert_eq!(due(&mut line, ms(30)), [4, 5]);
        assert_eq!(due(&mut line, ms(40)), [3]);
    }

    #[test]
    fn swapped_item_follows_the_next_or_leaves_alone() {
        let mut line = Line::new();
        line.put(1, ms(10), Order::Swapped);
        line.put(2, ms(12), Order::Sequential);
        line.put(3, ms(13), Order::Sequential);
        assert_eq!(due(&mut line, ms(13)), [2, 1, 3]);
        // Two in a row: the second overtakes the first.
        line.put(4, ms(20), Order::Swapped);
        line.put(5, ms(20), Order::Swapped);
        assert_eq!(due(&mut line, ms(20)), [5, 4]);
        line.put(6, ms(30), Order::Swapped);
        assert_eq!((line.len(), line.next_due()), (1, Some(ms(30) + HOLD)));
        assert!(due(&mut line, ms(79)).is_empty());
        assert_eq!(due(&mut line, ms(80)), [6]);
    }

    #[test]
    fn ring_wraps_at_constant_capacity() {
        let mut line = Line::new();
        let mut out = Vec::new();
        // Three times the capacity, half of it in the ring at a time.
        for i in 0..3 * CAPACITY as u32 {
            let now = ms(u64::from(i));
            line.put(i, now + ms(CAPACITY as u64 / 2), Order::Sequential);
            out.extend(due(&mut line, now));
            assert!(line.len() <= CAPACITY / 2 && line.room() >= CAPACITY / 2);
        }
        out.extend(due(&mut line, ms(10 * CAPACITY as u64)));
        assert!(out.iter().copied().eq(0..3 * CAPACITY as u32));
        assert_eq!(line.ring.capacity(), CAPACITY);
    }
}
