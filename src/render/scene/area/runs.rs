//! Pixels whose light differs from the interpolation: at edges and detail of a few pixels.

use crate::kernels;
use skyloop_orbit::sgp4_batch::Level;
use std::ops::Range;

/// A part of a row.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Row.
    pub row: usize,
    /// First column.
    pub column: usize,
    /// Difference of its pixels from the interpolation, e-.
    pub e: Vec<f32>,
}

/// A part of a row, and the index of its first pixel's light.
#[derive(Debug, Clone, PartialEq)]
struct Span {
    columns: Range<u32>,
    from: u32,
}

/// Parts of rows that do not overlap.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Runs {
    width: usize,
    /// Index of each row's first span, and of the end.
    rows: Vec<u32>,
    spans: Vec<Span>,
    e: Vec<f32>,
}

impl Runs {
    /// Runs on a detector; where they overlap, their light is added up.
    pub fn new([width, height]: [usize; 2], mut runs: Vec<Run>) -> Runs {
        runs.sort_by_key(|run| (run.row, run.column));
        let mut all = Runs {
            width,
            ..Runs::default()
        };
        if runs.is_empty() {
            return all;
        }
        all.rows.push(0);
        for run in runs {
            all.open(run.row);
            all.join(run.column, &run.e);
        }
        all.open(height);
        all
    }

    /// The sum of several.
    pub fn of_all(size: [usize; 2], all: &[&Runs]) -> Runs {
        if let [one] = all {
            return (*one).clone();
        }
        let runs = all.iter().flat_map(|runs| runs.iter());
        let runs = runs.map(|(first, e)| Run {
            row: first / size[0],
            column: first % size[0],
            e: e.to_vec(),
        });
        Runs::new(size, runs.collect())
    }

    /// Begins a row.
    fn open(&mut self, row: usize) {
        self.rows.resize(row + 1, self.spans.len() as u32);
    }

    /// Adds light to the last row; no run of it begins after `column`.
    fn join(&mut self, column: usize, e: &[f32]) {
        let first = self.rows.last().map_or(0, |first| *first as usize);
        let columns = column as u32..(column + e.len()) as u32;
        let from = self.e.len();
        match self.spans[first..].last_mut() {
            Some(last) if columns.start <= last.columns.end => {
                let both = last.columns.end.min(columns.end) - columns.start;
                let at = last.from + (columns.start - last.columns.start);
                let (upon, rest) = e.split_at(both as usize);
                let below = self.e[at as usize..].iter_mut();
                below.zip(upon).for_each(|(sum, e)| *sum += e);
                last.columns.end = last.columns.end.max(columns.end);
                self.e.extend_from_slice(rest);
            }
            _ => {
                self.spans.push(Span {
                    columns,
                    from: from as u32,
                });
                self.e.extend_from_slice(e);
            }
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.spans.is_empty()
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.e.len()
    }

    /// The sum over all pixels, e-.
    pub fn sum(&self) -> f64 {
        self.e.iter().copied().map(f64::from).sum()
    }

    /// The first pixel (row-major index) and the light (e-) of each run.
    pub fn iter(&self) -> impl Iterator<Item = (usize, &[f32])> {
        let rows = 0..self.rows.len().saturating_sub(1);
        rows.flat_map(|row| self.of_row(row))
    }

    /// The same for the runs of a row.
    pub fn of_row(&self, row: usize) -> impl Iterator<Item = (usize, &[f32])> {
        let range = match self.rows.get(row..row + 2) {
            Some([from, past]) => *from as usize..*past as usize,
            _ => 0..0,
        };
        self.spans[range].iter().map(move |span| {
            let first = row * self.width + span.columns.start as usize;
            (first, &self.e[span.from as usize..][..span.columns.len()])
        })
    }

    /// Adds the light of the pixels from `first` (row-major index) on to `electrons`.
    pub fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        if self.is_empty() {
            return;
        }
        let past = first + electrons.len();
        for row in first / self.width..past.div_ceil(self.width) {
            for (from, e) in self.of_row(row) {
                let overlap = from.max(first)..(from + e.len()).min(past);
                if !overlap.is_empty() {
                    let e = &e[overlap.start - from..overlap.end - from];
                    kernels::add(
                        level,
                        e,
                        &mut electrons[overlap.start - first..overlap.end - first],
                    );
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlapping_runs_are_added_up() {
        let run = |row, column, e: &[f32]| Run {
            row,
            column,
            e: e.to_vec(),
        };
        let runs = vec![
            run(2, 5, &[1.0, 2.0]),
            run(0, 0, &[4.0]),
            run(2, 1, &[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
            run(2, 8, &[3.0, 3.0]),
            run(2, 4, &[0.5]),
        ];
        let mut expected = vec![0.0f32; 40];
        for run in &runs {
            for (i, e) in run.e.iter().enumerate() {
                expected[run.row * 10 + run.column + i] += e;
            }
        }
        let runs = Runs::new([10, 4], runs);
        assert_eq!(runs.pixels(), 10);
        assert_eq!(runs.iter().count(), 2);
        let total: f32 = expected.iter().sum();
        assert_eq!(runs.sum(), f64::from(total));
        for count in [1, 3, 10, 40] {
            let mut e = vec![0.0; 40];
            for (i, e) in e.chunks_mut(count).enumerate() {
                runs.add_to(None, i * count, e);
            }
            assert_eq!(e, expected, "{count}");
        }
        let twice = Runs::of_all([10, 4], &[&runs, &runs]);
        assert_eq!(twice.sum(), 2.0 * runs.sum());
        assert_eq!(Runs::of_all([10, 4], &[&Runs::default()]).pixels(), 0);
    }
}
