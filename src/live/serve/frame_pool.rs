//! Pool of sent frames. Buffers are reused, so memory use does not depend on how many frames are in
//! flight.

use std::collections::VecDeque;

/// Sent frames, the oldest first.
#[derive(Debug)]
pub(super) struct FramePool<T>(VecDeque<T>);

impl<T> FramePool<T> {
    pub fn new() -> Self {
        Self(VecDeque::new())
    }

    pub fn put(&mut self, frame: T) {
        self.0.push_back(frame);
    }

    /// A frame to recycle, if the pool and the `in_flight` frames exceed `max`.
    pub fn take_surplus(&mut self, in_flight: usize, max: usize) -> Option<T> {
        if self.0.len() + in_flight > max {
            self.0.pop_front()
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_frames_does_not_depend_on_how_many_are_in_flight() {
        const MAX: usize = 2;
        let (mut pool, mut in_flight, mut rendered) = (FramePool::new(), VecDeque::new(), 0);
        // How many frames stay in flight after each frame: mostly none, sometimes the maximum.
        for (i, stay) in [0, 0, 0, 2, 2, 1, 0, 2, 0, 0].into_iter().enumerate() {
            rendered += 1;
            in_flight.push_back(rendered);
            let total = in_flight.len() + pool.0.len();
            assert_eq!(total, (i + 1).min(MAX + 1));
            while in_flight.len() > stay {
                pool.put(in_flight.pop_front().unwrap());
            }
            // At most one frame is recycled at a time: the renderer can use one only.
            let mut recycled = 0;
            while pool.take_surplus(in_flight.len(), MAX).is_some() {
                recycled += 1;
            }
            assert!(recycled <= 1, "{i}");
        }
        assert!(pool.take_surplus(0, 9).is_none());
    }
}
