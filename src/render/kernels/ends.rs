//! The columns of each row that the circles of a streak's points touch.

use super::dots::{Circle, Dot};
use super::real::Real;

/// Rows whose ends are computed in parallel lanes.
pub const ROWS: usize = 16;
/// A distance beyond every circle, px.
const BEYOND_PX: f32 = 1e6;

/// The columns of each row that the dots' circles touch, from `low` up to `past`; `low` is greater
/// in untouched rows. The number of rows allows blocks of [`ROWS`].
#[derive(Debug)]
pub struct Ends<'a> {
    /// The first row.
    pub first_row: i32,
    /// The first column.
    pub low: &'a mut [i32],
    /// The column after the last.
    pub past: &'a mut [i32],
}

/// Widens each row's range of columns to include those that the dots' circles touch.
#[inline(always)]
pub(crate) fn ends_body(circle: &Circle, dots: &[Dot], ends: &mut Ends<'_>) {
    let squared = circle.radius * circle.radius;
    for dot in dots {
        let top = (dot.first[1] - ends.first_row) as u32 as usize;
        for block in 0..circle.side.div_ceil(ROWS) {
            let row = block * ROWS;
            let rows = top + row..top + row + ROWS;
            let (mut from, mut to) = ([0; ROWS], [0; ROWS]);
            for i in 0..ROWS {
                [from[i], to[i]] =
                    columns(dot, dot.off[1] as f32 - (row as f32 + i as f32), squared);
            }
            let low = &mut ends.low[rows.clone()];
            for i in 0..ROWS {
                low[i] = low[i].min(from[i]);
            }
            let past = &mut ends.past[rows];
            for i in 0..ROWS {
                past[i] = past[i].max(to[i]);
            }
        }
    }
}

/// The range of columns that the circle of a dot touches in a row whose middle is `away` (px) from
/// the dot; far beyond the circle if it touches none.
///
/// ```text
/// x -+ (r^2 - d^2)^(1/2),   d = max(|away| - 1/2, 0)
/// ```
#[inline(always)]
fn columns(dot: &Dot, away: f32, squared: f32) -> [i32; 2] {
    let d = (away.abs() - 0.5).max(0.0);
    let rest = f32::mul_add(-d, d, squared);
    // Roots of all lanes, without a branch.
    let none = if rest > 0.0 { 0.0 } else { BEYOND_PX };
    let half = rest.max(0.0).sqrt() - none;
    let x = dot.off[0] as f32;
    let [column, _] = dot.first;
    [
        (x - half).nearest().0 + column,
        (x + half).nearest().0 + column + 1,
    ]
}

/// The same, row by row.
#[inline(always)]
pub(crate) fn ends_twin(circle: &Circle, dots: &[Dot], ends: &mut Ends<'_>) {
    let squared = circle.radius * circle.radius;
    for dot in dots {
        let top = (dot.first[1] - ends.first_row) as u32 as usize;
        for row in 0..circle.side.next_multiple_of(ROWS) {
            let [low, past] = columns(dot, dot.off[1] as f32 - row as f32, squared);
            ends.low[top + row] = ends.low[top + row].min(low);
            ends.past[top + row] = ends.past[top + row].max(past);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::reach_dots;
    use skyloop_orbit::sgp4_batch::Level;

    /// Number of rows and first row, with room for circles around the rows 0..50.
    const HIGH: i32 = 90;
    const FIRST: i32 = -16;

    fn ends(level: Option<Level>, radius: f64, dots: &[Dot]) -> [Vec<i32>; 2] {
        let mut ends = [vec![i32::MAX; HIGH as usize], vec![i32::MIN; HIGH as usize]];
        let [low, past] = &mut ends;
        let mut all = Ends {
            first_row: FIRST,
            low,
            past,
        };
        reach_dots(level, &Circle::new(radius), dots, &mut all);
        ends
    }

    #[test]
    fn all_levels_reach_the_same() {
        let dot = |i: i32, radius: f64| {
            let at = [30.0 + 0.37 * f64::from(i), 25.3 - 0.21 * f64::from(i)];
            Dot::new(at, 1.0, radius)
        };
        for radius in [3.1, 4.9, 7.2, 14.3] {
            let dots: Vec<Dot> = (0..40).map(|i| dot(i, radius)).collect();
            let reached = ends(None, radius, &dots);
            assert!(
                reached[0]
                    .iter()
                    .zip(&reached[1])
                    .any(|(low, past)| low < past)
            );
            for level in Level::available() {
                assert_eq!(ends(Some(level), radius, &dots), reached, "{level:?}");
            }
        }
    }

    #[test]
    fn ends_agree_with_touched_pixels() {
        for radius in [0.2, 3.0, 5.2, 11.7] {
            for at in [[30.3, 24.9], [29.5, 25.5], [40.07, 17.61]] {
                let [low, past] = ends(Some(Level::best()), radius, &[Dot::new(at, 1.0, radius)]);
                for row in FIRST..FIRST + HIGH {
                    // X-Val: pixel by pixel, the nearest point of its square.
                    let away = |i: i32, at: f64| ((f64::from(i) - at).abs() - 0.5).max(0.0);
                    let is_touched =
                        |i: &i32| away(*i, at[0]).hypot(away(row, at[1])) < radius - 1e-5;
                    let i = (row - FIRST) as usize;
                    let found: Vec<i32> = (low[i]..past[i].max(low[i])).collect();
                    let touched: Vec<i32> = (0..100).filter(is_touched).collect();
                    // Pixels touched only at an edge or a corner may count.
                    let more = found.len() - touched.len();
                    assert!(touched.iter().all(|pixel| found.contains(pixel)));
                    let meets = [at[0] - radius, at[0] + radius]
                        .iter()
                        .any(|x| (x + 0.5).fract() == 0.0);
                    assert!(more == 0 || meets && more <= 2, "{radius} {at:?} {row}");
                }
            }
        }
    }
}
