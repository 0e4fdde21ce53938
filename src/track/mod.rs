//! The path of a point source's image over the exposure.
//!
//! A track is cut into pieces that are nearly straight and nearly even, and these into panels a fraction of the
//! point spread function long. A panel stands for a stretch of time, not of length, and so carries the light of that
//! time wherever the image hurries or lingers; it is integrated by the two-point Gauss rule.

mod rows;
mod sample;

pub use rows::{Lit, Rows, Turns};
pub use sample::{Place, Sample};

use crate::fidelity::Fidelity;

/// The path of a source's image on the unbounded detector plane.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// Where it is when its row opens (or where the source comes before the camera), px.
    pub start: [f64; 2],
    /// Where it is when its row closes (or where the source goes behind the camera), px.
    pub end: [f64; 2],
    /// Points that stand for its light.
    pub samples: Vec<Sample>,
}

/// What a track is sampled for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Course {
    /// Pieces to begin with, in which the source turns by a few degrees at most.
    pub pieces: usize,
    /// Longest panel, px.
    pub step_px: f64,
    /// How far its light reaches, px.
    pub reach_px: f64,
    /// Where light matters.
    pub window: Window,
    /// When rows collect light.
    pub rows: Rows,
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
/// Points and weights of the four-point Gauss rule on 0..1.
const FOUR: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];
/// A piece is cut in two where its middle lies further than this part of its length from the middle of its chord:
/// it bends, or its speed changes by more than a sixth.
const BEND: f64 = 0.02;
/// Longest piece (px): of what passes by at speed, little more is sampled finely than what crosses the window.
const LONGEST_PX: f64 = 256.0;
/// A piece of which nothing is seen is cut in two where what its light is uncertain by may move the centre of all by more than this, px.
const FAR_PX: f64 = 1e-5;
/// How often a piece is cut in two at most.
const DEPTH: u32 = 24;

/// An instant (0..1) of a track and where the image is then; none: behind the camera.
type Knot = (f64, Option<Place>);

impl Track {
    /// The track of an image that stands still.
    pub fn still(place: Place) -> Track {
        Track {
            start: place.at,
            end: place.at,
            samples: vec![Sample {
                at: place.at,
                weight: place.light,
                lit: Lit::ALL,
                parts: Vec::new(),
            }],
        }
    }

    /// The same light between other ends.
    pub fn between(mut self, [start, end]: [[f64; 2]; 2]) -> Track {
        (self.start, self.end) = (start, end);
        self
    }

    /// Multiplies its light.
    pub fn scale(&mut self, factor: f64) {
        let samples = self.samples.iter_mut();
        samples.for_each(|sample| sample.weight *= factor);
    }

    /// Samples `place` (0: the first row opens, 1: the last one closes; none: behind the camera) as finely as the course asks
    /// wherever it comes near the course's window. None where the source is behind the camera all the time.
    pub fn sample(
        place: impl Fn(f64) -> Option<Place>,
        course: &Course,
        fidelity: &Fidelity,
    ) -> Option<Track> {
        let mut walk = Walk {
            place: &place,
            course,
            length_px: 0.0,
        };
        let knots = walk.knots();
        let seen = knots
            .iter()
            .filter_map(|(part, place)| Some((*part, (*place)?)));
        let collects = |(part, place): &(f64, Place)| walk.collects(*part, place.at[1]);
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
        walk.length_px = between.map(|ends| length(&[ends[0].1, ends[1].1])).sum();
        if walk.length_px <= fidelity.skip_px
            && let Some(mid) = place(0.5)
        {
            let samples = Track::still(mid).samples;
            return Some(Track {
                start,
                end,
                samples,
            });
        }
        let mut samples = Vec::new();
        for ends in knots.windows(2) {
            walk.piece(ends[0], ends[1], DEPTH, &mut samples);
        }
        Some(Track {
            start,
            end,
            samples,
        })
    }
}

/// The sampling of one track.
struct Walk<'a, F> {
    place: &'a F,
    course: &'a Course,
    /// Of all of it.
    length_px: f64,
}

impl<F: Fn(f64) -> Option<Place>> Walk<'_, F> {
    fn knot(&self, part: f64) -> Knot {
        (part, (self.place)(part))
    }

    /// Whether a row at `y` collects light then; rounding counts as in time.
    fn collects(&self, part: f64, y: f64) -> bool {
        let rows = &self.course.rows;
        part >= rows.opens(y) - 1e-9 && part <= rows.closes(y) + 1e-9
    }

    /// The ends of the pieces to begin with; with one-after-the-other rows also the instants at which the image's own
    /// row opens and closes.
    fn knots(&self) -> Vec<Knot> {
        let pieces = self.course.pieces.max(1);
        let even: Vec<Knot> = (0..=pieces)
            .map(|i| self.knot(i as f64 / pieces as f64))
            .collect();
        let rows = &self.course.rows;
        if rows.are_together() {
            return even;
        }
        let mut knots = Vec::with_capacity(even.len() + 2);
        for ends in even.windows(2) {
            knots.push(ends[0]);
            let mut inside: Vec<Knot> = [Rows::opens, Rows::closes]
                .into_iter()
                .filter_map(|edge| self.crossing(ends[0], ends[1], |y| edge(rows, y)))
                .collect();
            inside.sort_by(|a, b| a.0.total_cmp(&b.0));
            knots.extend(inside);
        }
        knots.extend(even.last());
        knots
    }

    /// The instant between `a` and `b` that is `edge` of the row where the image then is.
    fn crossing(&self, a: Knot, b: Knot, edge: impl Fn(f64) -> f64) -> Option<Knot> {
        let late = |(part, place): &Knot| place.map(|place| *part >= edge(place.at[1]));
        let (mut a, mut b) = (a, b);
        if late(&a)? == late(&b)? {
            return None;
        }
        for _ in 0..48 {
            let mid = self.knot((a.0 + b.0) / 2.0);
            if late(&mid)? == late(&a)? {
                a = mid;
            } else {
                b = mid;
            }
        }
        Some(b)
    }

    /// Whether a row that its light reaches, less than `bend` away from the rows `ys`, may open or close in that time.
    fn is_cut(&self, [from, to]: [f64; 2], ys: [f64; 3], bend: f64) -> bool {
        let Course { rows, reach_px, .. } = self.course;
        let reach = reach_px + bend + 1.0;
        let low = ys.iter().copied().fold(f64::MAX, f64::min) - reach;
        let high = ys.iter().copied().fold(f64::MIN, f64::max) + reach;
        let meets = |first: f64, last: f64| first <= to && last >= from;
        !rows.are_together()
            && (meets(rows.opens(low), rows.opens(high))
                || meets(rows.closes(low), rows.closes(high)))
    }

    /// Samples the piece from `a` to `b`.
    fn piece(&self, a: Knot, b: Knot, depth: u32, samples: &mut Vec<Sample>) {
        if b.0 <= a.0 {
            return;
        }
        let mid = self.knot((a.0 + b.0) / 2.0);
        let (mut panels, mut near) = (1.0, false);
        let split;
        match (a.1, mid.1, b.1) {
            (None, None, None) => return,
            (Some(from), Some(middle), Some(to)) => {
                let ends = [from.at, middle.at, to.at];
                let length = length(&[a.1, mid.1, b.1]);
                let chord = [0, 1].map(|k| (from.at[k] + to.at[k]) / 2.0);
                let bend = distance(middle.at, chord);
                let seen = self
                    .course
                    .window
                    .is_near(&ends, bend.max(BEND * length / 2.0));
                near = seen || self.is_cut([a.0, b.0], ends.map(|at| at[1]), bend);
                let longest = if seen {
                    LONGEST_PX
                } else {
                    4.0 * self.course.reach_px
                };
                split = near && (bend > BEND * length || length > longest);
                // Of a parabola the fastest end is faster than the mean by 4 bend / length.
                panels = (length + 4.0 * bend) / self.course.step_px;
            }
            // The source comes from behind the camera or goes there.
            _ => split = true,
        }
        if split && depth > 0 {
            self.piece(a, mid, depth - 1, samples);
            self.piece(mid, b, depth - 1, samples);
            return;
        }
        if !near {
            // No row near by opens or closes: they all do as the image's own.
            let own = mid.1.is_some_and(|mid_place| {
                self.course.rows.are_together() || self.collects(mid.0, mid_place.at[1])
            });
            if own {
                self.far_piece(a, mid, b, depth, samples);
            }
            return;
        }
        let panels = panels.ceil().max(1.0) as usize;
        for i in 0..panels {
            let part = |i: usize| a.0 + (b.0 - a.0) * (i as f64 / panels as f64);
            let ends = [part(i), part(i + 1)];
            if self.course.rows.are_together() {
                self.panel(ends, Lit::ALL, samples);
                continue;
            }
            // One more step for the bend inside of a panel.
            let reach = self.course.reach_px + 1.0 + self.course.step_px;
            let ys = ends.map(|part| (self.place)(part).map_or(f64::NAN, |p| p.at[1]));
            let near = [ys[0].min(ys[1]) - reach, ys[0].max(ys[1]) + reach];
            self.cut_panel(ends, &self.course.rows.turns(ends, near), samples);
        }
    }

    /// Samples a piece that nothing is seen of: two points tell its light and their centre, unless the optics' transmission bends or breaks on
    /// the way, where Simpson's rule tells another light.
    fn far_piece(&self, a: Knot, mid: Knot, b: Knot, depth: u32, samples: &mut Vec<Sample>) {
        let from = samples.len();
        self.panel([a.0, b.0], Lit::ALL, samples);
        let (Some(first), Some(middle), Some(last)) = (a.1, mid.1, b.1) else {
            return;
        };
        let told: f64 = samples[from..].iter().map(|sample| sample.weight).sum();
        let simpson = (first.light + 4.0 * middle.light + last.light) / 6.0;
        let apart = told - simpson * (b.0 - a.0) / self.course.rows.exposure;
        if apart.abs() * self.length_px > FAR_PX && depth > 0 {
            samples.truncate(from);
            self.piece(a, mid, depth - 1, samples);
            self.piece(mid, b, depth - 1, samples);
        }
    }

    /// The light of the time from `from` to `to`.
    fn panel(&self, [from, to]: [f64; 2], lit: Lit, samples: &mut Vec<Sample>) {
        let weight = (to - from) / (self.course.rows.exposure * GAUSS.len() as f64);
        let places = GAUSS.map(|g| (self.place)(from + (to - from) * g));
        samples.extend(places.into_iter().flatten().map(|place| Sample {
            at: place.at,
            weight: weight * place.light,
            lit,
            parts: Vec::new(),
        }));
    }

    /// The light of a time of which rows collect parts. All share four points, and each row's weights are the integrals over
    /// its part of the polynomials L_k that are 1 at one point and 0 at the others:
    ///
    /// ```text
    /// int_part f dt = sum_k f(t_k) int_part L_k dt,   error <= 4e-5 h^4 max |d^4 f / dt^4| of the part, for a panel of length h
    /// ```
    fn cut_panel(&self, [from, to]: [f64; 2], turns: &Turns, samples: &mut Vec<Sample>) {
        if turns.others.is_empty() {
            if turns.throughout != Lit::NONE {
                self.panel([from, to], turns.throughout, samples);
            }
            return;
        }
        for (k, (point, weight)) in FOUR.into_iter().enumerate() {
            let Some(place) = (self.place)(from + (to - from) * point) else {
                continue;
            };
            let part = |ends: &[f64; 2]| {
                let [a, b] = ends.map(|end| (end - from) / (to - from));
                let ends = GAUSS.map(|g| polynomial(k, a + (b - a) * g));
                (b - a) * (ends[0] + ends[1]) / (2.0 * weight)
            };
            let others = turns.others.iter();
            samples.push(Sample {
                at: place.at,
                weight: weight * (to - from) / self.course.rows.exposure * place.light,
                lit: turns.throughout,
                parts: others.map(|(lit, ends)| (*lit, part(ends))).collect(),
            });
        }
    }
}

/// Of the polynomials of third degree the one that is 1 at the point `k` of [`FOUR`] and 0 at the others.
fn polynomial(k: usize, u: f64) -> f64 {
    let others = (0..FOUR.len()).filter(|j| *j != k);
    let factors = others.map(|j| (u - FOUR[j].0) / (FOUR[k].0 - FOUR[j].0));
    factors.product()
}

impl Window {
    /// Whether a piece through `points` may come into the window, which it leaves its chords towards by at most `pad`.
    fn is_near(&self, points: &[[f64; 2]], pad: f64) -> bool {
        [0, 1].into_iter().all(|axis| {
            let along = points.iter().map(|point| point[axis]);
            let low = along.clone().fold(f64::MAX, f64::min);
            let high = along.fold(f64::MIN, f64::max);
            high + pad >= self.low[axis] && low - pad <= self.high[axis]
        })
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1])
}

/// Length (px) of the line through the places; nothing is added where one of two is behind the camera.
fn length(places: &[Option<Place>]) -> f64 {
    let between = places.windows(2).map(|ends| match ends {
        [Some(a), Some(b)] => distance(a.at, b.at),
        _ => 0.0,
    });
    between.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COURSE: Course = Course {
        pieces: 10,
        step_px: 0.35,
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
        let place = |t: f64| at(t).map(|at| Place { at, light: 1.0 });
        Track::sample(place, &Course { pieces, ..COURSE }, &Fidelity::REALTIME)
    }

    fn light(track: &Track) -> f64 {
        track.samples.iter().map(|s| s.weight).sum()
    }

    #[test]
    fn a_circle_is_sampled_along_its_arc_and_centred_on_its_middle() {
        let circle = |t: f64| {
            let angle = std::f64::consts::TAU * t;
            Some([128.0 + 50.0 * angle.cos(), 128.0 + 50.0 * angle.sin()])
        };
        // However few pieces it begins with.
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
    fn no_panel_is_longer_than_the_step_where_the_image_hurries() {
        // It is 30 times as fast at its end as at its start.
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
    fn what_passes_far_away_costs_little_and_what_goes_behind_the_camera_loses_that_part() {
        let far = |t: f64| Some([1e6 * (t - 0.3), 1e6 + 1e5 * t]);
        let track = sample(far, 100).unwrap();
        assert_eq!(track.samples.len(), 200);
        let half = |t: f64| (t < 0.5132).then_some([100.0 + 10.0 * t, 100.0]);
        let track = sample(half, 10).unwrap();
        assert!((light(&track) - 0.5132).abs() < 1e-6, "{}", light(&track));
        assert_eq!(sample(|_| None, 10), None);
    }

    #[test]
    fn what_crosses_the_window_at_speed_is_sampled_there_and_hardly_elsewhere() {
        let pass = |t: f64| Some([128.0 + 1e6 * (t - 0.5), 100.0]);
        let track = sample(pass, 2).unwrap();
        // 265 px of the window and two ends of up to 256 px more, two samples a panel of 0.35 px.
        let samples = track.samples.len();
        assert!(samples > 1500 && samples < 4600, "{samples}");
        assert!((light(&track) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn moving_with_the_rows_lengthens_the_exposure_of_an_image() {
        // 256 rows in half of the time: the image moves by 51 rows in it, an exposure of half by 1 / (1 - 102 / 510).
        let rows = Rows {
            count: 256,
            exposure: 0.5,
            step: 0.5 / 255.0,
        };
        let course = Course { rows, ..COURSE };
        let place = |t: f64| {
            let at = [100.0, 128.0 + 102.0 * (t - 0.5)];
            Some(Place { at, light: 1.0 })
        };
        let track = Track::sample(place, &course, &Fidelity::REALTIME).unwrap();
        let open = rows.opens(track.start[1]);
        assert!((open - (0.5 + (track.start[1] - 128.0) / 102.0)).abs() < 1e-9);
        let exposed = (track.end[1] - track.start[1]) / 102.0;
        assert!(
            (exposed - 0.5 / (1.0 - 102.0 / 510.0)).abs() < 1e-9,
            "{exposed}"
        );
    }
}
