//! When the rows of a detector collect light: all together, or one after the other.

use std::ops::Range;

/// When each row collects light, in parts (0..1) of the time from the first row's opening to the last row's closing.
/// Rows beyond the detector's edges are taken to open and close with the row at the edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rows {
    /// Rows of the detector.
    pub count: usize,
    /// How long a row collects light.
    pub exposure: f64,
    /// From one row's opening to the next one's; 0: all rows together.
    pub step: f64,
}

/// Rows that collect light at one instant; unbounded where a row at the detector's edge is one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Lit {
    /// The first.
    pub first: i64,
    /// The one past the last.
    pub past: i64,
}

impl Lit {
    /// Every row.
    pub const ALL: Lit = Lit {
        first: i64::MIN,
        past: i64::MAX,
    };

    /// Those of `rows` among them.
    pub fn among(&self, rows: &Range<i64>) -> Range<i64> {
        let first = rows.start.max(self.first);
        first..rows.end.min(self.past).max(first)
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

    /// One after the other: each for `exposure_s`, the last `readout_s` after the first.
    pub fn in_turn(count: usize, exposure_s: f64, readout_s: f64) -> Rows {
        let open_s = exposure_s + readout_s;
        Rows {
            count,
            exposure: exposure_s / open_s,
            step: readout_s / (open_s * count.saturating_sub(1).max(1) as f64),
        }
    }

    /// Whether all rows open and close together.
    pub fn are_together(&self) -> bool {
        self.step == 0.0
    }

    /// When the row at `y` (px) opens; between rows as if it were one.
    pub fn opens(&self, y: f64) -> f64 {
        self.middle(y) - self.exposure / 2.0
    }

    /// When it closes.
    pub fn closes(&self, y: f64) -> f64 {
        self.middle(y) + self.exposure / 2.0
    }

    fn middle(&self, y: f64) -> f64 {
        let last = self.last();
        0.5 + (y.clamp(0.0, last) - last / 2.0) * self.step
    }

    fn last(&self) -> f64 {
        self.count.saturating_sub(1) as f64
    }

    /// The rows that collect light at an instant.
    pub fn lit(&self, part: f64) -> Lit {
        if self.are_together() {
            return Lit::ALL;
        }
        let last = self.last();
        // |part - middle(row)| <= exposure / 2, solved for the row.
        let row = |part: f64| (part - 0.5) / self.step + last / 2.0;
        let first = row(part - self.exposure / 2.0).ceil();
        let past = row(part + self.exposure / 2.0).floor() + 1.0;
        Lit {
            first: if first <= 0.0 { i64::MIN } else { first as i64 },
            past: if past > last { i64::MAX } else { past as i64 },
        }
    }

    /// The instants inside of `from..to` at which a row within `reach` of the rows `low..high` (px) opens or closes,
    /// in order, between `from` and `to` themselves.
    pub fn instants(&self, [from, to]: [f64; 2], [low, high]: [f64; 2], out: &mut Vec<f64>) {
        out.clear();
        out.push(from);
        if !self.are_together() {
            let last = self.last();
            let row = |y: f64| y.clamp(0.0, last) as i64;
            for r in row(low.floor())..=row(high.ceil()) {
                let edges = [self.opens(r as f64), self.closes(r as f64)];
                out.extend(edges.into_iter().filter(|e| *e > from && *e < to));
            }
            out.sort_by(f64::total_cmp);
        }
        out.push(to);
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
    fn the_first_row_opens_first_and_the_last_closes_last() {
        assert!(ROLLING.opens(0.0).abs() < 1e-15 && (ROLLING.closes(10.0) - 1.0).abs() < 1e-15);
        assert_eq!(ROLLING.opens(-40.0), ROLLING.opens(0.0));
        assert_eq!(ROLLING.closes(40.0), ROLLING.closes(10.0));
        assert!((ROLLING.opens(5.0) - 0.25).abs() < 1e-15);
    }

    #[test]
    fn the_lit_rows_are_those_whose_window_holds_the_instant() {
        for i in 0..1000 {
            let part = (f64::from(i) + 0.5) / 1000.0;
            let lit = ROLLING.lit(part);
            for r in -3..14 {
                let y = r as f64;
                let open = ROLLING.opens(y) <= part && part <= ROLLING.closes(y);
                assert_eq!((lit.first..lit.past).contains(&r), open, "{part} {r}");
            }
        }
        assert_eq!(Rows::together(11).lit(0.3), Lit::ALL);
    }

    #[test]
    fn between_two_instants_the_lit_rows_near_by_stay_the_same() {
        let mut instants = Vec::new();
        ROLLING.instants([0.1, 0.72], [2.3, 6.4], &mut instants);
        assert_eq!((instants[0], instants[instants.len() - 1]), (0.1, 0.72));
        for ends in instants.windows(2) {
            let at = |share: f64| {
                let lit = ROLLING.lit(ends[0] + share * (ends[1] - ends[0]));
                lit.among(&(2..8))
            };
            assert_eq!(at(0.01), at(0.99), "{ends:?}");
        }
    }
}
