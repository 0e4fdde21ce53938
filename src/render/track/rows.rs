//! The times at which the rows of a detector collect light: all together, or one after the other.

use std::ops::Range;

/// The times at which each row collects light, in parts (0..1) of the time from the first row's
/// opening to the last row's closing. A row beyond the detector counts as the row at its edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rows {
    /// Rows of the detector.
    pub count: usize,
    /// Exposure of one row.
    pub exposure: f64,
    /// From one row's opening to the next one's; 0: all rows together.
    pub step: f64,
}

/// Rows that collect light at one instant; unbounded if the row at the detector's edge is included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lit {
    /// The first.
    pub first: i64,
    /// The one past the last.
    pub past: i64,
}

/// Rows that collect light in an interval of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Turns {
    /// Rows that collect throughout.
    pub throughout: Lit,
    /// Rows that collect in a part of it, with its ends.
    pub others: Vec<(Lit, [f64; 2])>,
}

impl Default for Lit {
    fn default() -> Self {
        Lit::NONE
    }
}

impl Lit {
    /// No row.
    pub(crate) const NONE: Lit = Lit { first: 0, past: 0 };
    /// Every row.
    pub(crate) const ALL: Lit = Lit {
        first: i64::MIN,
        past: i64::MAX,
    };

    /// Those of `rows` that are included.
    pub(crate) fn among(&self, rows: &Range<i64>) -> Range<i64> {
        let first = self.first.min(rows.end).max(rows.start);
        first..self.past.min(rows.end).max(first)
    }
}

impl Rows {
    /// All rows together, all the time.
    pub fn together(count: usize) -> Rows {
        Rows {
            count,
            exposure: 1.0,
            step: 0.0,
        }
    }

    /// A rolling shutter: each row is open for `exposure_s`, the last `readout_s` after the first.
    pub fn in_turn(count: usize, exposure_s: f64, readout_s: f64) -> Rows {
        let open_s = exposure_s + readout_s;
        Rows {
            count,
            exposure: exposure_s / open_s,
            step: readout_s / (open_s * count.saturating_sub(1).max(1) as f64),
        }
    }

    /// Whether all rows open and close together.
    pub(crate) fn are_together(&self) -> bool {
        self.step == 0.0
    }

    /// The time at which the row at `y` (px) opens; linear between rows.
    pub(crate) fn opens(&self, y: f64) -> f64 {
        self.middle(y) - self.exposure / 2.0
    }

    /// The time at which it closes.
    pub(crate) fn closes(&self, y: f64) -> f64 {
        self.middle(y) + self.exposure / 2.0
    }

    fn middle(&self, y: f64) -> f64 {
        let last = self.last();
        0.5 + (y.clamp(0.0, last) - last / 2.0) * self.step
    }

    fn last(&self) -> f64 {
        self.count.saturating_sub(1) as f64
    }

    /// The rows within `low..high` (px) that collect light in the time `from..to`: those that
    /// collect throughout, and the others with their part of it. `throughout` is unbounded if it
    /// contains all of these rows.
    pub(crate) fn turns(&self, [from, to]: [f64; 2], [low, high]: [f64; 2]) -> Turns {
        let last = self.last() as i64;
        let row = |y: f64| (y as i64).clamp(0, last);
        let mut turns = Turns::default();
        let mut throughout: Option<Range<i64>> = None;
        let near = row(low.floor())..row(high.ceil()) + 1;
        for r in near.clone() {
            let opens = self.opens(r as f64).max(from);
            let closes = self.closes(r as f64).min(to);
            if [opens, closes] == [from, to] {
                // Rows open in sequence: those between two open rows are open too.
                let first = throughout.map_or(r, |rows| rows.start);
                throughout = Some(first..r + 1);
            } else if opens < closes {
                turns.others.push((self.lit(r..r + 1), [opens, closes]));
            }
        }
        turns.throughout = throughout.map_or(Lit::NONE, |rows| {
            if rows == near {
                Lit::ALL
            } else {
                self.lit(rows)
            }
        });
        turns
    }

    /// The given rows; those beyond the detector's edge follow the row at the edge.
    fn lit(&self, rows: Range<i64>) -> Lit {
        let beyond = rows.end > self.last() as i64;
        Lit {
            first: if rows.start <= 0 {
                i64::MIN
            } else {
                rows.start
            },
            past: if beyond { i64::MAX } else { rows.end },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // 11 rows, exposed for 0.5 each, one every 0.05.
    const ROLLING: Rows = Rows {
        count: 11,
        exposure: 0.5,
        step: 0.05,
    };

    #[test]
    fn first_row_opens_first_and_last_row_closes_last() {
        assert!(ROLLING.opens(0.0).abs() < 1e-15 && (ROLLING.closes(10.0) - 1.0).abs() < 1e-15);
        assert_eq!(ROLLING.opens(-40.0), ROLLING.opens(0.0));
        assert_eq!(ROLLING.closes(40.0), ROLLING.closes(10.0));
        assert!((ROLLING.opens(5.0) - 0.25).abs() < 1e-15);
    }

    /// Checks that each of `rows` collects in exactly the time in which it is open.
    fn check(ends: [f64; 2], near: [f64; 2], rows: Range<i64>) {
        let turns = ROLLING.turns(ends, near);
        for r in rows {
            let is_lit = |lit: &Lit| lit.among(&(r..r + 1)) == (r..r + 1);
            let own = turns.others.iter().filter(|(lit, _)| is_lit(lit));
            let mut own: Vec<[f64; 2]> = own.map(|(_, part)| *part).collect();
            own.extend(is_lit(&turns.throughout).then_some(ends));
            let y = r as f64;
            let open = [
                ROLLING.opens(y).max(ends[0]),
                ROLLING.closes(y).min(ends[1]),
            ];
            let expected = if open[0] < open[1] {
                vec![open]
            } else {
                vec![]
            };
            assert_eq!(own, expected, "{ends:?} {r}");
        }
    }

    #[test]
    fn rows_collect_while_they_are_open() {
        for i in 0..100 {
            let from = f64::from(i) / 100.0;
            for length in [0.003, 0.04, 0.3, 1.0] {
                check([from, (from + length).min(1.0)], [-2.0, 12.0], -3..14);
                check([from, (from + length).min(1.0)], [2.3, 6.4], 2..8);
            }
        }
    }

    #[test]
    fn rows_open_throughout_are_grouped() {
        // X-Val: row r opens at 0.05 r and closes at 0.5 + 0.05 r: 3 is the first that closes after
        // 0.64, 7 the last to open before 0.36.
        let turns = ROLLING.turns([0.36, 0.64], [0.0, 10.0]);
        assert_eq!(turns.throughout, Lit { first: 3, past: 8 });
        assert_eq!(turns.others.len(), 6);
        let together = Rows::together(11).turns([0.1, 0.3], [2.0, 5.0]);
        assert_eq!(together.throughout.among(&(2..6)), 2..6);
        assert!(together.others.is_empty());
    }
}
