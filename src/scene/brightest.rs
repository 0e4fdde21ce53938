//! How much light the brightest pixel may hold: a bound that costs far less than drawing the sources.

use super::Source;
use crate::camera::Detector;

/// Side of the cells (px) in which the light of sources is added up.
const CELL: usize = 8;

/// A bound (e-) of the light on any pixel times its `weight` (by row-major index; none: 1): in each cell the sum of the
/// greatest pixels of all sources that touch it. Where one source outshines its neighbours it is nearly the greatest pixel itself.
pub(super) fn pixel_e<'a>(
    detector: &Detector,
    sources: impl Iterator<Item = &'a Source>,
    weight: Option<&dyn Fn(usize) -> f64>,
) -> f64 {
    let columns = detector.width.div_ceil(CELL);
    let mut cells = vec![0.0; columns * detector.height.div_ceil(CELL)];
    for source in sources.filter(|source| source.electrons > 0.0) {
        let greatest = match weight {
            None => {
                let shares = source.footprint.shares().iter();
                f64::from(shares.copied().fold(0.0, f32::max))
            }
            Some(weight) => {
                let rows = source.footprint.rows(0..detector.height);
                let weighted = rows.flat_map(|(row, column, shares)| {
                    let pixels = (row * detector.width + column..).zip(shares);
                    pixels.map(|(pixel, share)| f64::from(*share) * weight(pixel))
                });
                weighted.fold(0.0, f64::max)
            }
        };
        let brightest = greatest * source.electrons;
        let lit = |(_, _, shares): &(usize, usize, &[f32])| !shares.is_empty();
        let rows = source.footprint.rows(0..detector.height).filter(lit);
        let mut rows = rows.peekable();
        // The rows that lie in one row of cells: from their least column to their greatest.
        while let Some((row, first, shares)) = rows.next() {
            let (mut low, mut past) = (first, first + shares.len());
            while let Some((_, first, shares)) = rows.next_if(|(r, _, _)| r / CELL == row / CELL) {
                (low, past) = (low.min(first), past.max(first + shares.len()));
            }
            let from = row / CELL * columns;
            for cell in &mut cells[from + low / CELL..=from + (past - 1) / CELL] {
                *cell += brightest;
            }
        }
    }
    cells.into_iter().fold(0.0, f64::max)
}
