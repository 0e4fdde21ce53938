//! Which of a known number of pieces have come.

/// The pieces of one kind.
#[derive(Debug)]
pub(super) struct Arrivals {
    seen: Vec<bool>,
    missing: usize,
    /// One after the highest that came.
    next: usize,
}

impl Arrivals {
    pub(super) fn of(pieces: usize) -> Self {
        Self {
            seen: vec![false; pieces],
            missing: pieces,
            next: 0,
        }
    }

    /// How many have not come.
    pub(super) fn missing(&self) -> usize {
        self.missing
    }

    /// Whether a piece has come; `None` if there is no such piece.
    pub(super) fn state(&self, piece: usize) -> Option<bool> {
        self.seen.get(piece).copied()
    }

    /// Books a piece that had not come. Says whether a later one came before it.
    pub(super) fn book(&mut self, piece: usize) -> bool {
        if let Some(seen) = self.seen.get_mut(piece) {
            *seen = true;
            self.missing = self.missing.saturating_sub(1);
        }
        let late = piece < self.next;
        self.next = self.next.max(piece + 1);
        late
    }
}
