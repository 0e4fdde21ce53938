//! How much light the brightest pixel may hold: a bound that costs far less than drawing the sources.

use super::Source;
use crate::camera::Detector;

/// Side of the cells (px) in which the light of sources is added up.
pub const CELL: usize = 8;

/// A bound (e-) of the light on any pixel times its `weight` (by row-major index; none: 1), for each column of cells: in each cell
/// the sum of what every source gives to its greatest pixel there.
pub(super) fn pixels_e<'a>(
    detector: &Detector,
    sources: impl Iterator<Item = &'a Source>,
    weight: Option<&dyn Fn(usize) -> f64>,
) -> Vec<f64> {
    let columns = detector.width.div_ceil(CELL);
    let mut cells = vec![0.0; columns * detector.height.div_ceil(CELL)];
    let mut greatest = vec![0.0f64; columns];
    for source in sources.filter(|source| source.electrons > 0.0) {
        let mut rows = source.footprint.rows(0..detector.height).peekable();
        while let Some((row, first, shares)) = rows.next() {
            let mut share = |column: usize, share: f64| {
                let cell = &mut greatest[column / CELL];
                *cell = cell.max(share);
            };
            match weight {
                None => {
                    // Up to the end of each cell.
                    let mut from = first;
                    let mut rest = shares;
                    while !rest.is_empty() {
                        let (here, next) = rest.split_at(rest.len().min(CELL - from % CELL));
                        share(from, here.iter().copied().fold(0.0, f32::max).into());
                        (from, rest) = (from + here.len(), next);
                    }
                }
                Some(weight) => {
                    for (column, light) in (first..).zip(shares) {
                        let pixel = row * detector.width + column;
                        share(column, f64::from(*light) * weight(pixel));
                    }
                }
            }
            // The source's last row in these cells.
            if rows
                .peek()
                .is_none_or(|(next, ..)| next / CELL != row / CELL)
            {
                let cells = &mut cells[row / CELL * columns..];
                for (cell, greatest) in cells.iter_mut().zip(&mut greatest) {
                    *cell += source.electrons * *greatest;
                    *greatest = 0.0;
                }
            }
        }
    }
    let of = |column| cells.iter().skip(column).step_by(columns);
    (0..columns)
        .map(|column| of(column).copied().fold(0.0, f64::max))
        .collect()
}

/// The share of a source's greatest pixel.
pub(super) fn greatest_share(source: &Source) -> f64 {
    let shares = source.footprint.shares().iter();
    f64::from(shares.copied().fold(0.0, f32::max))
}

/// A bound (e-) of what any pixel gets, each source giving so much at most to any pixel that its image touches or that
/// lies so many pixels beside it.
pub(super) fn summed_e<'a>(
    detector: &Detector,
    lights: impl Iterator<Item = (&'a Source, f64, usize)>,
) -> f64 {
    let columns = detector.width.div_ceil(CELL);
    let mut cells = vec![0.0; columns * detector.height.div_ceil(CELL)];
    for (source, e, beside) in lights.filter(|(_, e, _)| *e > 0.0) {
        let lit = |(_, _, shares): &(usize, usize, &[f32])| !shares.is_empty();
        let rows = source.footprint.rows(0..detector.height).filter(lit);
        let mut rows = rows.peekable();
        let last = (source.footprint.rows(0..detector.height))
            .filter(lit)
            .last()
            .map_or(0, |(row, ..)| row);
        // The cells' rows that it reaches, each from its least column to its greatest.
        let Some((first, ..)) = rows.peek() else {
            continue;
        };
        let top = first.saturating_sub(beside) / CELL;
        let bottom = (last + beside).min(detector.height - 1) / CELL;
        let mut reached = vec![(usize::MAX, 0); bottom + 1 - top];
        for (row, column, shares) in rows {
            let low = column.saturating_sub(beside) / CELL;
            let high = (column + shares.len() - 1 + beside).min(detector.width - 1) / CELL;
            let near = row.saturating_sub(beside) / CELL..=((row + beside) / CELL).min(bottom);
            for cells in near {
                let (from, to) = &mut reached[cells - top];
                (*from, *to) = ((*from).min(low), (*to).max(high));
            }
        }
        for (i, (from, to)) in reached.into_iter().enumerate() {
            if from <= to {
                let row = (top + i) * columns;
                cells[row + from..=row + to]
                    .iter_mut()
                    .for_each(|cell| *cell += e);
            }
        }
    }
    cells.into_iter().fold(0.0, f64::max)
}
