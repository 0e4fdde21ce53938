//! The charge of all particles in each pixel.

use crate::camera::{Detector, Event};
use rayon::prelude::*;
use skyloop_base::abort::WorkLimit;
use std::ops::Range;

/// The pixels that particles hit, row by row.
#[derive(Debug)]
pub struct Struck {
    /// Columns of the detector.
    width: usize,
    /// `(row-major index, e-)` of each hit pixel, in order, by rows of the detector; empty without
    /// particles.
    rows: Vec<Vec<(u32, u32)>>,
    /// The most charge in one pixel, e-.
    max_e: u32,
}

impl Struck {
    /// The pixels hit by `events`; incomplete once the frame is cancelled.
    pub(crate) fn of(events: &[Event], detector: &Detector, limit: &WorkLimit) -> Struck {
        let some = usize::from(!events.is_empty());
        let mut rows = vec![Vec::new(); some * detector.height];
        for event in events.iter().take_while(|_| !limit.is_cancelled()) {
            for hit in &event.pixels {
                rows[hit.0 as usize / detector.width].push(*hit);
            }
        }
        let complete = rows.par_iter_mut().filter(|_| !limit.is_cancelled());
        let max_e = complete.map(add_up).max();
        Struck {
            width: detector.width,
            rows,
            max_e: max_e.unwrap_or(0),
        }
    }

    /// The most charge in one pixel, e-.
    pub(crate) fn max_e(&self) -> f64 {
        f64::from(self.max_e)
    }

    /// `(row-major index, e-)` of each hit pixel, in order.
    pub(crate) fn hits(&self) -> impl Iterator<Item = (u32, u32)> {
        self.rows.iter().flatten().copied()
    }

    /// The hit pixels among `pixels`.
    pub(crate) fn among(&self, pixels: Range<usize>) -> impl Iterator<Item = (u32, u32)> {
        let rows = pixels.start / self.width..pixels.end.div_ceil(self.width);
        let rows = self.rows.get(rows).into_iter().flatten();
        let hits = rows.flat_map(move |hits| {
            let position = |end: usize| hits.partition_point(|(pixel, _)| (*pixel as usize) < end);
            // Hits of a cancelled frame may be out of order.
            hits.get(position(pixels.start)..position(pixels.end))
        });
        hits.flatten().copied()
    }
}

/// Sorts a row's hits, adds up those of the same pixel, and returns the greatest sum, e-.
fn add_up(row: &mut Vec<(u32, u32)>) -> u32 {
    row.sort_unstable();
    row.dedup_by(|hit, sum| {
        let same = hit.0 == sum.0;
        if same {
            // The sum saturates far beyond any full well.
            sum.1 = sum.1.saturating_add(hit.1);
        }
        same
    });
    row.iter().map(|(_, e)| *e).max().unwrap_or(0)
}
