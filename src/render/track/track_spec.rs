//! Resolution and window of a track's sampling.

use super::rows::Rows;

/// Resolution and window of a track's sampling, and its row timing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackSpec {
    /// Initial pieces, in each of which the source moves by a few degrees at most.
    pub pieces: usize,
    /// The Gaussian that spreads its light, if it is the same everywhere.
    pub even: Option<Even>,
    /// Longest panel, px; at least 1e-3, also if it is not a number.
    pub step_px: f64,
    /// Longest track of one panel, px.
    pub panel_px: f64,
    /// Longest track of one point, px.
    pub point_px: f64,
    /// Reach of its light, px.
    pub reach_px: f64,
    /// The part of the detector plane whose light matters.
    pub window: Window,
    /// Times at which rows collect light.
    pub rows: Rows,
}

/// The Gaussian that spreads the light, if it is the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Even {
    /// Its standard deviation, px; at least 0.01, also if it is not a number.
    pub sigma_px: f64,
    /// The brightest pixel of the still image, e-.
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
    /// Whether a piece through `points`, within `pad` of its chords, may enter the window.
    pub(crate) fn is_near(&self, points: &[[f64; 2]], pad: f64) -> bool {
        [0, 1].into_iter().all(|axis| {
            let along = points.iter().map(|point| point[axis]);
            let low = along.clone().fold(f64::MAX, f64::min);
            let high = along.fold(f64::MIN, f64::max);
            high + pad >= self.low[axis] && low - pad <= self.high[axis]
        })
    }
}
