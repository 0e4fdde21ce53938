//! What has left and is kept until its memory is needed: a run holds as many frames whether one is under way or all that may be, so that what it holds
//! does not grow when they are.

use std::collections::VecDeque;

/// The oldest first.
#[derive(Debug)]
pub(super) struct Kept<T>(VecDeque<T>);

impl<T> Kept<T> {
    pub fn new() -> Self {
        Self(VecDeque::new())
    }

    /// Keeps one that has left.
    pub fn keep(&mut self, one: T) {
        self.0.push_back(one);
    }

    /// One to let go, where with those `under_way` there are more than the `most` that may be beside the one that is made.
    pub fn spare(&mut self, under_way: usize, most: usize) -> Option<T> {
        match self.0.len() + under_way > most {
            true => self.0.pop_front(),
            false => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_whether_one_is_under_way_or_all() {
        const MOST: usize = 2;
        let (mut kept, mut under_way, mut made) = (Kept::new(), VecDeque::new(), 0);
        // How many stay under way after each frame: mostly none, sometimes as many as may.
        for (i, stay) in [0, 0, 0, 2, 2, 1, 0, 2, 0, 0].into_iter().enumerate() {
            made += 1;
            under_way.push_back(made);
            // The one that is made, and as many beside it once there were so many.
            let at_once = under_way.len() + kept.0.len();
            assert_eq!(at_once, (i + 1).min(MOST + 1));
            while under_way.len() > stay {
                kept.keep(under_way.pop_front().unwrap());
            }
            // The memory of one for the next: never that of two at once, of which one would be lost.
            let mut let_go = 0;
            while kept.spare(under_way.len(), MOST).is_some() {
                let_go += 1;
            }
            assert!(let_go <= 1, "{i}");
        }
        assert!(kept.spare(0, 9).is_none());
    }
}
