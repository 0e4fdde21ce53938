//! What a track is sampled for.

use super::rows::Rows;

/// What a track is sampled for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Pieces to begin with, in which the source turns by a few degrees at most.
    pub pieces: usize,
    /// For a Gaussian that is the same everywhere.
    pub even: Option<Even>,
    /// Longest panel, px; of less than 1e-3, or of what is no number, 1e-3.
    pub step_px: f64,
    /// Longest track that is one panel from its start to its end, px.
    pub panel_px: f64,
    /// Longest track for which one point stands, px.
    pub point_px: f64,
    /// How far its light reaches, px.
    pub reach_px: f64,
    /// Where light matters.
    pub window: Window,
    /// When rows collect light.
    pub rows: Rows,
}

/// What tracks are sampled for where a Gaussian spreads their light that is the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Even {
    /// Its standard deviation, px; of less than 0.01, or of what is no number, 0.01.
    pub sigma_px: f64,
    /// What the brightest pixel would get if the image stood still, e-.
    pub height_e: f64,
}

/// The part of the detector plane whose light matters: tracks are sampled finely only there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Least column and row, px.
    pub low: [f64; 2],
    /// Greatest column and row, px.
    pub high: [f64; 2],
}

impl Window {
    /// Whether a piece through `points` may come into the window, which it leaves its chords
    /// towards by at most `pad`.
    pub fn is_near(&self, points: &[[f64; 2]], pad: f64) -> bool {
        [0, 1].into_iter().all(|axis| {
            let along = points.iter().map(|point| point[axis]);
            let low = along.clone().fold(f64::MAX, f64::min);
            let high = along.fold(f64::MIN, f64::max);
            high + pad >= self.low[axis] && low - pad <= self.high[axis]
        })
    }
}
