//! The points at which a track is sampled, and the rows that collect their light.

use super::rows::Lit;
use std::ops::Range;

/// Position of an image, and the share of its light that arrives there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// On the unbounded detector plane, px.
    pub at: [f64; 2],
    /// Share of its light that the optics transmit there (1).
    pub light: f64,
}

/// A point of a track.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    /// Position, px.
    pub at: [f64; 2],
    /// Its light, in units of the light that arrives at the aperture in one exposure (1).
    pub weight: f64,
    /// The rows that collect it.
    pub lit: Lit,
    /// Further rows that collect only a part of it, each with that part (1).
    pub parts: Vec<(Lit, f64)>,
}

impl Sample {
    /// Whether its position and light are finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.at.iter().all(|x| x.is_finite()) && self.weight.is_finite()
    }

    /// The range of `rows` that collect some of its light.
    pub(crate) fn rows(&self, rows: &Range<i64>) -> Range<i64> {
        let mut all = self.lit.among(rows);
        for (lit, _) in &self.parts {
            let part = lit.among(rows);
            if all.is_empty() {
                all = part;
            } else if !part.is_empty() {
                all = all.start.min(part.start)..all.end.max(part.end);
            }
        }
        all
    }

    /// Writes the share of its light that each of `rows` collects into `shares`.
    pub(crate) fn shares(&self, rows: &Range<i64>, shares: &mut Vec<f64>) {
        shares.clear();
        shares.resize((rows.end - rows.start).max(0) as usize, 0.0);
        let mut fill = |lit: &Lit, share: f64| {
            let Range { start, end } = lit.among(rows);
            shares[(start - rows.start) as usize..(end - rows.start) as usize].fill(share);
        };
        fill(&self.lit, 1.0);
        self.parts.iter().for_each(|(lit, share)| fill(lit, *share));
    }
}
