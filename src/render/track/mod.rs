//! The path of a point source's image over the exposure.
//!
//! A track is cut into pieces that are nearly straight and have nearly constant speed, and these
//! into panels a fraction of the point spread function long. A panel is an interval of time: its
//! light is that of this time at any image speed, integrated by the two-point Gauss rule.
//! Where one Gaussian spreads the light everywhere and all rows collect it together, a whole piece
//! has a rule of higher order instead (`rule`).

mod adaptive_sampling;
mod path;
mod rows;
pub(crate) mod rule;
mod sample;
mod track_spec;

pub use rows::{Lit, Rows, Turns};
pub use sample::{Place, Sample};
pub use track_spec::{Even, TrackSpec, Window};

use crate::fidelity::Fidelity;
use adaptive_sampling::{MIN_SIGMA_PX, Sampler, length};
use std::cell::Cell;

thread_local! {
    /// The samples of an earlier track, reused: the allocator is slow on blocks of some kB.
    static SAMPLES: Cell<Vec<Sample>> = const { Cell::new(Vec::new()) };
}

/// The path of a source's image on the unbounded detector plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Position when its row opens (or when the source enters the camera's half space), px.
    pub start: [f64; 2],
    /// Position when its row closes (or when the source leaves the camera's half space), px.
    pub end: [f64; 2],
    /// Points that carry its light.
    pub samples: Vec<Sample>,
}

impl Track {
    /// The track of an image that stands still.
    pub fn still(position: Place) -> Track {
        Track {
            start: position.at,
            end: position.at,
            samples: vec![Sample {
                at: position.at,
                weight: position.light,
                lit: Lit::ALL,
                parts: Vec::new(),
            }],
        }
    }

    /// The same samples with other ends.
    pub fn between(mut self, [start, end]: [[f64; 2]; 2]) -> Track {
        (self.start, self.end) = (start, end);
        self
    }

    /// Multiplies its light.
    pub(crate) fn scale(&mut self, factor: f64) {
        let samples = self.samples.iter_mut();
        samples.for_each(|sample| sample.weight *= factor);
    }

    /// Stores the vector of its samples for a later track.
    pub(crate) fn recycle(mut self) {
        // A vector of one sample is not worth storing.
        if self.samples.len() > 1 {
            self.samples.clear();
            SAMPLES.set(self.samples);
        }
    }

    /// Samples `place` (0: the first row opens, 1: the last one closes; none: behind the camera) as
    /// finely as `track_spec` requires near its window. None if the source is always behind the
    /// camera.
    pub fn sample(
        place: impl Fn(f64) -> Option<Place>,
        track_spec: &TrackSpec,
        fidelity: &Fidelity,
    ) -> Option<Track> {
        let mut sampler = Sampler {
            position: &place,
            spec: track_spec,
            length_px: 0.0,
            even: None,
        };
        let knots = sampler.knots();
        let seen = knots
            .iter()
            .filter_map(|(part, position)| Some((*part, (*position)?)));
        let collects = |(part, position): &(f64, Place)| sampler.collects(*part, position.at[1]);
        let start = seen
            .clone()
            .find(collects)
            .or_else(|| seen.clone().next())?;
        let end = seen
            .clone()
            .rfind(collects)
            .or_else(|| seen.clone().next_back())?;
        let (start, end) = (start.1.at, end.1.at);

        let between = knots.windows(2);
        sampler.length_px = between.map(|ends| length(&[ends[0].1, ends[1].1])).sum();
        let track = |samples: Vec<Sample>| {
            Some(Track {
                start,
                end,
                samples,
            })
        };
        if sampler.length_px <= fidelity.skip_px
            && let Some(mid) = place(0.5)
        {
            return track(Track::still(mid).samples);
        }
        if track_spec.rows.are_together()
            && sampler.length_px <= track_spec.point_px
            && let Some(point) = sampler.point(&knots)
        {
            return track(vec![point]);
        }
        let even = track_spec.even.filter(|_| track_spec.rows.are_together());
        sampler.even = even.map(|Even { sigma_px, height_e }| {
            let sigma_px = sigma_px.max(MIN_SIGMA_PX);
            // Two adjacent pieces both err at their common end.
            let error = fidelity.streak_error(sampler.length_px / sigma_px, height_e) / 2.0;
            (sigma_px, error)
        });
        let mut samples = SAMPLES.take();
        sampler.pieces(&knots, &mut samples);
        track(samples)
    }
}

#[cfg(test)]
mod tests {
    use super::path::distance;

    use super::*;

    const TRACK_SPEC: TrackSpec = TrackSpec {
        pieces: 10,
        even: None,
        step_px: 0.35,
        panel_px: 0.35,
        point_px: 0.0,
        reach_px: 4.0,
        window: Window {
            low: [-5.0, -5.0],
            high: [260.0, 260.0],
        },
        rows: Rows {
            count: 256,
            exposure: 1.0,
            step: 0.0,
        },
    };

    fn sample(at: impl Fn(f64) -> Option<[f64; 2]>, pieces: usize) -> Option<Track> {
        let position = |t: f64| at(t).map(|at| Place { at, light: 1.0 });
        Track::sample(
            position,
            &TrackSpec {
                pieces,
                ..TRACK_SPEC
            },
            &Fidelity::REALTIME,
        )
    }

    fn light(track: &Track) -> f64 {
        track.samples.iter().map(|s| s.weight).sum()
    }

    #[test]
    fn circle_is_sampled_along_its_arc_and_centred() {
        let circle = |t: f64| {
            let angle = std::f64::consts::TAU * t;
            Some([128.0 + 50.0 * angle.cos(), 128.0 + 50.0 * angle.sin()])
        };
        // For any number of initial pieces.
        for pieces in [2, 7, 126] {
            let track = sample(circle, pieces).unwrap();
            let mean = |axis: usize| {
                let moments = track.samples.iter().map(|s| s.weight * s.at[axis]);
                moments.sum::<f64>() / light(&track)
            };
            assert!((mean(0) - 128.0).hypot(mean(1) - 128.0) < 1e-6);
            // 314 px in panels of at most 0.35 px, two samples each.
            let samples = track.samples.len();
            assert!(samples > 1790 && samples < 2300, "{samples}");
            assert!((light(&track) - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn panels_stay_within_the_step_at_any_speed() {
        // The image is 30 times as fast at the end as at the start.
        let fast = |t: f64| Some([1.0 + 250.0 * (t + 14.5 * t * t) / 15.5, 100.0]);
        let track = sample(fast, 2).unwrap();
        let longest = track
            .samples
            .chunks(2)
            .map(|pair| distance(pair[0].at, pair[1].at))
            .fold(0.0, f64::max);
        // The Gauss points of a panel stand 0.577 of its length apart.
        assert!(longest <= 0.577_351 * 0.35 * 1.001, "{longest}");
        assert!((light(&track) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn short_track_is_one_panel_and_if_faint_one_point() {
        let slow = |t: f64| Some([10.0 + 0.1 * t + 0.01 * t * t, 20.0 - 0.2 * t]);
        let two = sample(slow, 2).unwrap();
        let position = |t: f64| slow(t).map(|at| Place { at, light: 0.5 + t });
        let sampled = |point_px: f64| {
            let track_spec = TrackSpec {
                pieces: 2,
                point_px,
                ..TRACK_SPEC
            };
            Track::sample(position, &track_spec, &Fidelity::REALTIME).unwrap()
        };
        let (panel, point) = (sampled(0.0), sampled(0.3));
        assert_eq!(
            [&two, &panel, &point].map(|track| track.samples.len()),
            [2, 2, 1]
        );
        let centre = |track: &Track| {
            let moments = track.samples.iter().map(|s| s.weight * s.at[0]);
            moments.sum::<f64>() / light(track)
        };
        // X-Val: by hand, the means of 0.1 t + 0.01 t^2, alone and with the weight 0.5 + t.
        assert!((centre(&two) - (10.0 + 0.05 + 0.01 / 3.0)).abs() < 1e-12);
        assert!((centre(&panel) - (10.0 + 0.025 + 0.1 / 3.0 + 0.005 / 3.0 + 0.0025)).abs() < 1e-12);
        assert!((centre(&point) - centre(&panel)).abs() < 1e-12);
        assert!((light(&panel) - 1.0).abs() < 1e-12 && (light(&point) - 1.0).abs() < 1e-12);
        // A bent track is not one panel, however short.
        let bent = |t: f64| Some([10.0 + 0.3 * t * (1.0 - t), 20.0]);
        assert!(sample(bent, 2).unwrap().samples.len() > 2);
    }

    #[test]
    fn far_track_is_sampled_coarsely_and_cut_behind_the_camera() {
        let far = |t: f64| Some([1e6 * (t - 0.3), 1e6 + 1e5 * t]);
        let track = sample(far, 100).unwrap();
        assert_eq!(track.samples.len(), 200);
        let half = |t: f64| (t < 0.5132).then_some([100.0 + 10.0 * t, 100.0]);
        let track = sample(half, 10).unwrap();
        assert!((light(&track) - 0.5132).abs() < 1e-6, "{}", light(&track));
        assert_eq!(sample(|_| None, 10), None);
    }

    #[test]
    fn fast_track_is_sampled_finely_in_the_window_only() {
        let pass = |t: f64| Some([128.0 + 1e6 * (t - 0.5), 100.0]);
        let track = sample(pass, 2).unwrap();
        // 265 px of the window and two ends of up to 256 px more, two samples a panel of 0.35 px.
        let samples = track.samples.len();
        assert!(samples > 1500 && samples < 4600, "{samples}");
        assert!((light(&track) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn motion_along_the_rolling_shutter_lengthens_the_exposure() {
        // 256 rows in half of the time: the image moves by 51 rows in that time, so an exposure of
        // 0.5 becomes longer by the factor 1 / (1 - 102 / 510).
        let rows = Rows {
            count: 256,
            exposure: 0.5,
            step: 0.5 / 255.0,
        };
        let track_spec = TrackSpec { rows, ..TRACK_SPEC };
        let position = |t: f64| {
            let at = [100.0, 128.0 + 102.0 * (t - 0.5)];
            Some(Place { at, light: 1.0 })
        };
        let track = Track::sample(position, &track_spec, &Fidelity::REALTIME).unwrap();
        let open = rows.opens(track.start[1]);
        assert!((open - (0.5 + (track.start[1] - 128.0) / 102.0)).abs() < 1e-9);
        let exposed = (track.end[1] - track.start[1]) / 102.0;
        assert!(
            (exposed - 0.5 / (1.0 - 102.0 / 510.0)).abs() < 1e-9,
            "{exposed}"
        );
    }
}
