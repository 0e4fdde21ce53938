//! The setting for a budget of time.

use super::row::{Row, is_closer};

/// The setting selected for a budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chosen<'a> {
    /// The setting.
    pub row: &'a Row,
    /// Whether it is within the budget; if not, it is the fastest.
    pub fits: bool,
}

/// The most accurate setting whose 99th percentile is within `budget_ms` (with the median, every
/// second frame could be late); the first of equal ones. If none fits, the one with the lowest
/// median. None without rows.
pub fn best(rows: &[Row], budget_ms: f64) -> Option<Chosen<'_>> {
    let fitting = rows.iter().filter(|row| row.p99_ms <= budget_ms);
    let closest = fitting.reduce(|best, row| {
        if is_closer(&row.errors, &best.errors) {
            row
        } else {
            best
        }
    });
    if let Some(row) = closest {
        return Some(Chosen { row, fits: true });
    }
    let fastest = rows.iter().min_by(|a, b| a.p50_ms.total_cmp(&b.p50_ms));
    fastest.map(|row| Chosen { row, fits: false })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cost::row::made;

    #[test]
    fn budget_limits_the_99th_percentile() {
        // The 99th percentile is 1.5 times the given time.
        let rows = made([(1.0, 3.0), (2.0, 2.0), (4.0, 0.0)]);
        let named = |budget_ms| {
            let chosen = best(&rows, budget_ms).unwrap();
            (chosen.row.setting.as_str(), chosen.fits)
        };
        assert_eq!(named(6.0), ("reference", true));
        assert_eq!(named(5.9), ("realtime", true));
        assert_eq!(named(2.9), ("fast", true));
        assert_eq!(named(1.4), ("fast", false));
        assert_eq!(best(&[], 1.0), None);
        let alike = made([(1.0, 2.0), (0.9, 2.0), (4.0, 0.0)]);
        assert_eq!(best(&alike, 2.0).unwrap().row.setting, "fast");
    }
}
