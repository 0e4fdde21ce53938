//! Bound of the brightest pixel by cells of pixels: far faster than drawing the sources.

use crate::camera::Detector;
use crate::reduce;
use crate::scene::lit::Lit;
use crate::scene::source::Source;
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use std::collections::VecDeque;
use std::ops::Range;

/// Side of the cells in which the light of sources is added up, px.
pub const CELL: usize = 8;

/// Number of parts into which a scene's lights are divided, and least number of lights of a part.
const PARTS: usize = 4;
const MIN_LIGHTS: usize = 256;
/// Lights of at least so many pixels are divided into bands of so many rows.
const WIDE: usize = 1 << 16;
const BAND: usize = 16 * CELL;

/// Least number of rows of cells for a task.
const ROWS: usize = 32;

/// The factor of a pixel's light, by row-major index.
pub(crate) type Weight<'a> = &'a (dyn Fn(usize) -> f64 + Sync);

/// Bound of the light on any pixel times its `weight` (none: 1), for each column of cells, e-.
pub(crate) fn pixels_e<'a>(
    detector: &Detector,
    lights: impl Iterator<Item = Lit<'a>>,
    weight: Option<Weight<'_>>,
    limit: &WorkLimit,
) -> Vec<f64> {
    greatest_e(detector, &cells_of(detector, lights, weight, limit))
}

/// For each cell the sum over lights of their brightest pixel in it, e-; in parts, to be added up.
pub(crate) fn cells_of<'a>(
    detector: &Detector,
    lights: impl Iterator<Item = Lit<'a>>,
    weight: Option<Weight<'_>>,
    limit: &WorkLimit,
) -> Vec<Vec<f64>> {
    let lights = lights.filter(|light| light.electrons > 0.0);
    let (wide, lights): (Vec<Lit<'_>>, Vec<Lit<'_>>) =
        lights.partition(|light| light.footprint.shares().len() >= WIDE);
    // The sums do not depend on the number of threads.
    let all = 0..detector.height;
    let parts = lights.par_chunks(lights.len().div_ceil(PARTS).max(MIN_LIGHTS));
    let mut parts: Vec<Vec<f64>> = parts
        .map(|lights| cells_e(detector, lights, weight, all.clone(), limit))
        .collect();
    if !wide.is_empty() {
        let bands = (0..detector.height.div_ceil(BAND)).into_par_iter();
        let bands = bands.map(|band| {
            let rows = band * BAND..((band + 1) * BAND).min(detector.height);
            cells_e(detector, &wide, weight, rows, limit)
        });
        parts.push(bands.collect::<Vec<Vec<f64>>>().concat());
    }
    parts
}

/// The greatest cell of each column of cells, for the sum of `parts`.
pub(crate) fn greatest_e(detector: &Detector, parts: &[Vec<f64>]) -> Vec<f64> {
    let columns = detector.width.div_ceil(CELL);
    let none = || vec![0.0f64; columns];
    let rows = (0..detector.height.div_ceil(CELL)).into_par_iter();
    let greatest = rows.with_min_len(ROWS).fold(
        || [none(), none()],
        |[mut greatest, mut sum], row| {
            sum.fill(0.0);
            for cells in parts {
                let cells = &cells[row * columns..][..columns];
                sum.iter_mut().zip(cells).for_each(|(sum, e)| *sum += e);
            }
            let both = greatest.iter_mut().zip(&sum);
            both.for_each(|(greatest, e)| raise(greatest, *e));
            [greatest, sum]
        },
    );
    greatest
        .map(|[greatest, _]| greatest)
        .reduce(none, |mut a, b| {
            a.iter_mut().zip(b).for_each(|(a, b)| raise(a, b));
            a
        })
}

/// The cells of some rows: the sum over lights of their brightest pixel in each, e-.
fn cells_e(
    detector: &Detector,
    lights: &[Lit<'_>],
    weight: Option<Weight<'_>>,
    rows: Range<usize>,
    limit: &WorkLimit,
) -> Vec<f64> {
    let columns = detector.width.div_ceil(CELL);
    let top = rows.start / CELL;
    let mut cells = vec![0.0; columns * (rows.end.div_ceil(CELL) - top)];
    // The brightest pixel of each column in the current row of cells; the range of lit columns.
    let mut greatest = vec![0.0f32; columns * CELL];
    let mut lit = (usize::MAX, 0);
    for light in lights.iter().take_while(|_| !limit.is_cancelled()) {
        let mut rows = light.footprint.rows(rows.clone()).peekable();
        while let Some((row, first, shares)) = rows.next() {
            let pairs = greatest[first..].iter_mut().zip(shares);
            match weight {
                None => pairs.for_each(|(max, share)| raise(max, *share)),
                Some(weight) => {
                    let pixel = row * detector.width + first;
                    pairs.zip(pixel..).for_each(|((max, share), pixel)| {
                        raise(max, round_up(f64::from(*share) * weight(pixel)))
                    });
                }
            }
            if !shares.is_empty() {
                lit = (lit.0.min(first), lit.1.max(first + shares.len()));
            }
            // The light's last row in these cells.
            if rows
                .peek()
                .is_none_or(|(next, ..)| next / CELL != row / CELL)
            {
                let from = lit.0.min(lit.1) / CELL;
                let cells = &mut cells[(row / CELL - top) * columns + from..];
                let past = lit.1.next_multiple_of(CELL);
                let lit_columns = greatest[from * CELL..past].as_chunks_mut::<CELL>().0;
                for (cell, columns) in cells.iter_mut().zip(lit_columns) {
                    *cell += light.electrons * f64::from(greatest_of(*columns));
                    *columns = [0.0; CELL];
                }
                lit = (usize::MAX, 0);
            }
        }
    }
    cells
}

/// The greatest of a cell's columns, by halves, so that it is vectorized.
fn greatest_of(mut columns: [f32; CELL]) -> f32 {
    let mut half = CELL / 2;
    while half > 0 {
        for i in 0..half {
            let other = columns[half + i];
            raise(&mut columns[i], other);
        }
        half /= 2;
    }
    columns[0]
}

/// Single precision, rounded up: still a bound.
fn round_up(value: f64) -> f32 {
    let single = value as f32;
    if f64::from(single) < value {
        single.next_up()
    } else {
        single
    }
}

fn raise<T: Copy + PartialOrd>(max: &mut T, to: T) {
    // Not `max`, whose handling of NaN is slow.
    *max = if to > *max { to } else { *max };
}

/// The share of a source's brightest pixel.
pub(crate) fn greatest_share(source: &Source) -> f64 {
    reduce::greatest(source.footprint.shares()).into()
}

/// Calls `each` once with every cell within `margin` pixels of a source's image.
pub(crate) fn cells(
    detector: &Detector,
    source: &Source,
    margin: usize,
    mut each: impl FnMut(usize),
) {
    let columns = detector.width.div_ceil(CELL);
    let lit = |(_, _, shares): &(usize, usize, &[f32])| !shares.is_empty();
    let rows = source.footprint.rows(0..detector.height).filter(lit);
    if source.length_px() < CELL as f64 {
        // A spot: its bounding rectangle.
        let (mut across, mut down) = ((usize::MAX, 0), (usize::MAX, 0));
        for (row, column, shares) in rows {
            across = (
                across.0.min(column),
                across.1.max(column + shares.len() - 1),
            );
            down = (down.0.min(row), down.1.max(row));
        }
        let cells = |(from, to): (usize, usize), pixels: usize| {
            from.saturating_sub(margin) / CELL..(to + margin).min(pixels - 1) / CELL + 1
        };
        let across = cells(across, detector.width);
        for row in cells(down, detector.height) {
            across
                .clone()
                .for_each(|column| each(row * columns + column));
        }
        return;
    }
    // Unfinished rows of cells, each with its first and last column. Earlier rows are complete.
    let (mut open, mut top) = (VecDeque::<(usize, usize)>::new(), None);
    let mut close = |row: usize, (from, to): (usize, usize)| {
        (row * columns + from..=row * columns + to).for_each(&mut each);
    };
    let none = (usize::MAX, 0);
    for (row, column, shares) in rows {
        let low = column.saturating_sub(margin) / CELL;
        let high = (column + shares.len() - 1 + margin).min(detector.width - 1) / CELL;
        let first = row.saturating_sub(margin) / CELL;
        let last = (row + margin).min(detector.height - 1) / CELL;
        let top = top.get_or_insert(first);
        while *top < first {
            if let Some(reached) = open.pop_front().filter(|reached| *reached != none) {
                close(*top, reached);
            }
            *top += 1;
        }
        if open.len() <= last - *top {
            open.resize(last - *top + 1, none);
        }
        for (from, to) in open.iter_mut() {
            (*from, *to) = ((*from).min(low), (*to).max(high));
        }
    }
    for (i, reached) in open.into_iter().enumerate().filter(|(_, of)| *of != none) {
        close(top.unwrap_or(0) + i, reached);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::footprint::Footprint;
    use skyloop_base::load::Folder;

    #[test]
    fn no_pixel_exceeds_its_cell() {
        let camera = Camera::load("cots-wide", &Folder::current()).unwrap();
        let mut detector = camera.detector;
        (detector.width, detector.height) = (20, 12);
        // Each light is on one pixel; every second light is on the same pixel.
        let positions = || (0..2_000_usize).map(|i| if i % 2 == 0 { 100 } else { (i * 7) % 240 });
        let lit: Vec<Footprint> = positions()
            .map(|position| {
                let mut shares = vec![0.0; 240];
                shares[position] = 1.0;
                Footprint::whole(20, shares)
            })
            .collect();
        let lights = lit.iter().map(|footprint| Lit {
            electrons: 3.0,
            footprint,
        });
        let bounds = pixels_e(
            &detector,
            lights,
            Some(&|pixel| pixel as f64),
            &WorkLimit::default(),
        );
        let mut held = vec![0.0; 240];
        positions().for_each(|position| held[position] += 3.0 * position as f64);
        assert_eq!(bounds.len(), 3);
        for (column, bound) in bounds.iter().enumerate() {
            let pixels = held.iter().enumerate();
            let column_pixels = pixels.filter(|(pixel, _)| pixel % 20 / CELL == column);
            let brightest = column_pixels.map(|(_, e)| *e).fold(0.0, f64::max);
            // X-Val: each light is on one of a cell's 64 pixels.
            assert!(
                (brightest..=64.0 * brightest).contains(bound),
                "{bound} {brightest}"
            );
        }
    }
}
