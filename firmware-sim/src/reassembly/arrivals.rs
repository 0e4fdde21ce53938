//! Which of a known number of pieces have come, and which were asked for again.

use std::ops::Range;

#[derive(Debug)]
pub(super) struct Arrivals {
    pieces: Vec<Piece>,
    missing: usize,
    /// One after the highest that came.
    next: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Piece {
    Missing,
    Requested,
    Here,
}

/// How a piece came.
pub(super) struct Arrival {
    /// A later one came before it.
    pub(super) late: bool,
    /// It was asked for again.
    pub(super) requested: bool,
}

impl Arrivals {
    pub(super) fn of(pieces: usize) -> Self {
        Self {
            pieces: vec![Piece::Missing; pieces],
            missing: pieces,
            next: 0,
        }
    }

    pub(super) fn missing(&self) -> usize {
        self.missing
    }

    /// One after the highest that came.
    pub(super) fn next(&self) -> usize {
        self.next
    }

    /// Whether a piece has come; `None` if there is no such piece.
    pub(super) fn state(&self, piece: usize) -> Option<bool> {
        self.pieces.get(piece).map(|piece| *piece == Piece::Here)
    }

    /// Books a piece that had not come.
    pub(super) fn book(&mut self, piece: usize) -> Arrival {
        let mut requested = false;
        if let Some(state) = self.pieces.get_mut(piece) {
            requested = *state == Piece::Requested;
            *state = Piece::Here;
            self.missing = self.missing.saturating_sub(1);
        }
        let late = piece < self.next;
        self.next = self.next.max(piece + 1);
        Arrival { late, requested }
    }

    /// Whether a piece below `end` is missing that was not asked for.
    pub(super) fn has_gap(&self, end: usize) -> bool {
        let below = self.pieces.get(..end).unwrap_or(&self.pieces);
        self.missing > 0 && below.contains(&Piece::Missing)
    }

    /// The runs of missing pieces below `end`, those asked for before only if `again`, and marks them as asked for.
    /// It stops where `runs` runs or `most` pieces are full.
    pub(super) fn ask(
        &mut self,
        end: usize,
        again: bool,
        runs: usize,
        mut most: usize,
    ) -> Vec<Range<usize>> {
        let mut found: Vec<Range<usize>> = Vec::new();
        if self.missing == 0 {
            return found;
        }
        for (index, piece) in self.pieces.iter_mut().enumerate().take(end) {
            let wanted = *piece == Piece::Missing || again && *piece == Piece::Requested;
            if !wanted {
                continue;
            }
            if most == 0 {
                break;
            }
            let full = found.len() == runs;
            match found.last_mut() {
                Some(run) if run.end == index => run.end += 1,
                _ if full => break,
                _ => found.push(index..index + 1),
            }
            *piece = Piece::Requested;
            most -= 1;
        }
        found
    }
}
