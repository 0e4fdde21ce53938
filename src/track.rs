//! The path of a point source's image over the exposure.

use crate::fidelity::Fidelity;

/// The path of a source's image over the exposure on the unbounded detector plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// At the exposure's start (or where the source comes before the camera), px.
    pub start: [f64; 2],
    /// At the exposure's end (or where the source goes behind the camera), px.
    pub end: [f64; 2],
    /// Points that stand for the exposure.
    pub samples: Vec<Sample>,
}

/// A point of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Where, px.
    pub at: [f64; 2],
    /// The part of the exposure that it stands for (1).
    pub weight: f64,
}

/// The part of the detector plane whose light matters: tracks are sampled finely only there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Least column and row, px.
    pub low: [f64; 2],
    /// Greatest column and row, px.
    pub high: [f64; 2],
}

/// Points (0..1) of the two-point Gauss rule, whose weights are equal.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Most panels of a piece: enough for a focal length of 100,000 px at a sigma of 0.7 px and 3 degrees a piece.
const MAX_PANELS: f64 = 16_384.0;

impl Track {
    /// The track of an image that is drawn where it stands at mid-exposure, wherever its ends are.
    pub fn still(at: [f64; 2], start: Option<[f64; 2]>, end: Option<[f64; 2]>) -> Track {
        Track {
            start: start.unwrap_or(at),
            end: end.unwrap_or(at),
            samples: vec![Sample { at, weight: 1.0 }],
        }
    }

    /// Samples `at` (0: the exposure's start, 1: its end; none: behind the camera) in `pieces` pieces, each
    /// short enough to be nearly straight. Pieces that come near `window` are sampled finely enough for
    /// `fidelity`. None where the source is behind the camera all the time.
    pub fn sample(
        at: impl Fn(f64) -> Option<[f64; 2]>,
        pieces: usize,
        sigma_px: f64,
        window: &Window,
        fidelity: &Fidelity,
    ) -> Option<Track> {
        let part = |i: usize| i as f64 / pieces as f64;
        let knots: Vec<Option<[f64; 2]>> = (0..=pieces).map(|i| at(part(i))).collect();
        let start = *knots.iter().flatten().next()?;
        let end = *knots.iter().flatten().next_back()?;
        let length: f64 = knots
            .windows(2)
            .map(|ends| distance(ends[0], ends[1]))
            .sum();
        if length <= fidelity.skip_px
            && let Some(mid) = at(0.5)
        {
            return Some(Track {
                start,
                end,
                samples: vec![Sample {
                    at: mid,
                    weight: 1.0,
                }],
            });
        }
        let step = fidelity.track_step_sigma * sigma_px;
        let mut samples = Vec::new();
        for (i, ends) in knots.windows(2).enumerate() {
            let length = distance(ends[0], ends[1]);
            let panels = if window.is_near(ends, length) {
                length / step
            } else {
                1.0
            };
            let panels = panels.ceil().clamp(1.0, MAX_PANELS) as usize;
            let weight = 1.0 / (pieces * panels * GAUSS.len()) as f64;
            let parts =
                (0..panels).flat_map(|panel| GAUSS.map(|g| (panel as f64 + g) / panels as f64));
            samples.extend(
                parts
                    .filter_map(|inside| at(part(i) + inside / pieces as f64))
                    .map(|at| Sample { at, weight }),
            );
        }
        Some(Track {
            start,
            end,
            samples,
        })
    }

    /// The flux-weighted centre of all the light, px.
    pub fn centroid(&self) -> [f64; 2] {
        let total: f64 = self.samples.iter().map(|sample| sample.weight).sum();
        // Relative to the start, so that digits survive far from the origin.
        [0, 1].map(|axis| {
            let moment = |sample: &Sample| sample.weight * (sample.at[axis] - self.start[axis]);
            self.start[axis]
                + self.samples.iter().map(moment).sum::<f64>() / total.max(f64::MIN_POSITIVE)
        })
    }
}

impl Window {
    /// Whether a nearly straight piece may come into the window.
    fn is_near(&self, ends: &[Option<[f64; 2]>], length: f64) -> bool {
        // An arc of 3 degrees bulges by less than a hundredth of its length.
        let pad = 0.02 * length;
        let mut ends = ends.iter().flatten();
        let Some(first) = ends.next() else {
            return false;
        };
        let last = ends.next().unwrap_or(first);
        [0, 1].into_iter().all(|axis| {
            let (low, high) = (first[axis].min(last[axis]), first[axis].max(last[axis]));
            high + pad >= self.low[axis] && low - pad <= self.high[axis]
        })
    }
}

/// Distance (px) between the ends of a piece; 0 where one of them is behind the camera.
fn distance(a: Option<[f64; 2]>, b: Option<[f64; 2]>) -> f64 {
    match (a, b) {
        (Some(a), Some(b)) => (b[0] - a[0]).hypot(b[1] - a[1]),
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Window = Window {
        low: [-5.0, -5.0],
        high: [260.0, 260.0],
    };

    #[test]
    fn a_circle_is_sampled_along_its_arc_and_centred_on_its_middle() {
        let circle = |t: f64| {
            let angle = std::f64::consts::TAU * t;
            Some([128.0 + 50.0 * angle.cos(), 128.0 + 50.0 * angle.sin()])
        };
        let track = Track::sample(circle, 126, 0.7, &WINDOW, &Fidelity::REALTIME).unwrap();
        let [x, y] = track.centroid();
        assert!((x - 128.0).hypot(y - 128.0) < 1e-9);
        // 314 px in panels of at most 0.35 px, two samples each.
        assert!(track.samples.len() > 1790 && track.samples.len() < 2100);
        assert!((track.samples.iter().map(|s| s.weight).sum::<f64>() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_passes_far_away_costs_little_and_what_goes_behind_the_camera_loses_that_part() {
        let far = |t: f64| Some([1e6 * (t - 0.3), 1e6 + 1e5 * t]);
        let track = Track::sample(far, 100, 0.7, &WINDOW, &Fidelity::REALTIME).unwrap();
        assert_eq!(track.samples.len(), 200);
        let half = |t: f64| (t < 0.5).then_some([100.0 + 10.0 * t, 100.0]);
        let track = Track::sample(half, 10, 0.7, &WINDOW, &Fidelity::REALTIME).unwrap();
        let seen: f64 = track.samples.iter().map(|s| s.weight).sum();
        assert!((seen - 0.5).abs() < 0.11, "{seen}");
        assert_eq!(
            Track::sample(|_| None, 10, 0.7, &WINDOW, &Fidelity::REALTIME),
            None
        );
    }
}
