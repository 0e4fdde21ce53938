//! Divides a track into pieces that are nearly straight and have nearly constant speed, these into
//! panels, and those into points.

use super::path::{Path, distance};
use super::rows::{Lit, Rows, Turns};
use super::rule;
use super::sample::{Place, Sample};
use super::track_spec::TrackSpec;

/// Points (0..1) of the two-point Gauss rule, whose weights are equal.
const GAUSS: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];
/// Points and weights of the four-point Gauss rule on 0..1.
const FOUR: [(f64, f64); 4] = [
    (0.069_431_844_202_973_71, 0.173_927_422_568_726_93),
    (0.330_009_478_207_571_87, 0.326_072_577_431_273_07),
    (0.669_990_521_792_428_1, 0.326_072_577_431_273_07),
    (0.930_568_155_797_026_3, 0.173_927_422_568_726_93),
];
/// A piece is halved if its middle is further than this part of its length from the middle of its
/// chord: it is curved, or its speed changes by more than a sixth.
const BEND: f64 = 0.02;
/// Longest piece, px: a fast track is sampled finely over little more than its part in the window.
const LONGEST_PX: f64 = 256.0;
/// A bend of at most this counts as none, px: above the rounding of still images.
const MIN_PX: f64 = 1e-9;
/// Lower limit of the longest panel, px: on pixels, narrower spreads hardly differ.
const MIN_STEP_PX: f64 = 1e-3;
/// Narrowest Gaussian, px: a narrower one lies on one pixel or its edge.
pub(crate) const MIN_SIGMA_PX: f64 = 0.01;
/// A piece outside of the window is halved if the uncertainty of its light may move the centroid of
/// all light by more than this, px.
const FAR_PX: f64 = 1e-5;
/// Position evaluations for fitting a path through a piece.
const PATH_EVALUATIONS: usize = 3;
/// Greatest number of halvings of a piece.
const DEPTH: u32 = 24;

/// An instant (0..1) of a track and the image's position then; none behind the camera.
pub(crate) type Knot = (f64, Option<Place>);

/// The sampling of one track.
pub(crate) struct Sampler<'a, F> {
    pub position: &'a F,
    pub spec: &'a TrackSpec,
    /// Length of the whole track.
    pub length_px: f64,
    /// If one Gaussian spreads the light everywhere: its standard deviation (px) and the permitted
    /// relative error of a piece (1).
    pub even: Option<(f64, f64)>,
}

impl<F: Fn(f64) -> Option<Place>> Sampler<'_, F> {
    fn knot(&self, part: f64) -> Knot {
        (part, (self.position)(part))
    }

    /// Longest panel, px.
    fn step_px(&self) -> f64 {
        self.spec.step_px.max(MIN_STEP_PX)
    }

    /// Whether a row at `y` collects light at `part`, with a margin for rounding.
    pub(crate) fn collects(&self, part: f64, y: f64) -> bool {
        let rows = &self.spec.rows;
        rows.are_together() || part >= rows.opens(y) - 1e-9 && part <= rows.closes(y) + 1e-9
    }

    /// The ends of the initial pieces; with a rolling shutter also the instants at which the row of
    /// the image opens and closes.
    pub(crate) fn knots(&self) -> Vec<Knot> {
        let pieces = self.spec.pieces.max(1);
        let even: Vec<Knot> = (0..=pieces)
            .map(|i| self.knot(i as f64 / pieces as f64))
            .collect();
        let rows = &self.spec.rows;
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

    /// The instant between `a` and `b` at which the row of the image opens or closes; `edge` gives
    /// that time for a row (px).
    fn crossing(&self, a: Knot, b: Knot, edge: impl Fn(f64) -> f64) -> Option<Knot> {
        let late = |(part, position): &Knot| position.map(|place| *part >= edge(place.at[1]));
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

    /// Whether a row near the rows `ys`, within `bend` and the light's reach, may open or close
    /// between `from` and `to`.
    fn is_cut(&self, [from, to]: [f64; 2], ys: [f64; 3], bend: f64) -> bool {
        let TrackSpec { rows, reach_px, .. } = self.spec;
        if rows.are_together() {
            return false;
        }
        let reach = reach_px + bend + 1.0;
        let low = ys.iter().copied().fold(f64::MAX, f64::min) - reach;
        let high = ys.iter().copied().fold(f64::MIN, f64::max) + reach;
        let meets = |first: f64, last: f64| first <= to && last >= from;
        meets(rows.opens(low), rows.opens(high)) || meets(rows.closes(low), rows.closes(high))
    }

    /// One point for the whole track between the knots. Its light and centre by Simpson's rule are
    /// as exact as two Gauss points. None unless the track is one straight piece with a middle.
    pub fn point(&self, knots: &[Knot]) -> Option<Sample> {
        let [a, mid, b] = *<&[Knot; 3]>::try_from(knots).ok()?;
        let [from, middle, to] = places([a, mid, b])?;
        let bend = distance(middle.at, [0, 1].map(|k| (from.at[k] + to.at[k]) / 2.0));
        let is_even = mid.0 == (a.0 + b.0) / 2.0;
        if !is_even || bend > (BEND * self.length_px).max(MIN_PX) {
            return None;
        }
        let light = (from.light + 4.0 * middle.light + to.light) / 6.0;
        // If no light arrives, the point is the middle.
        let part = |end: &Place| {
            if light > 0.0 {
                end.light / (6.0 * light)
            } else {
                0.0
            }
        };
        let [first, last] = [part(&from), part(&to)];
        Some(Sample {
            at: [0, 1].map(|k| {
                let [before, behind] = [from.at[k] - middle.at[k], to.at[k] - middle.at[k]];
                middle.at[k] + (first * before + last * behind)
            }),
            weight: light * (b.0 - a.0) / self.spec.rows.exposure,
            lit: Lit::ALL,
            parts: Vec::new(),
        })
    }

    /// Samples the pieces between `knots`.
    pub(crate) fn pieces(&self, knots: &[Knot], samples: &mut Vec<Sample>) {
        match *knots {
            // A short track is one piece, and one panel if nearly straight. So is a track whose
            // pieces need no panels.
            [first, mid, last]
                if mid.0 == (first.0 + last.0) / 2.0
                    && (self.length_px <= self.spec.panel_px || self.even.is_some()) =>
            {
                self.piece_by(first, mid, last, DEPTH, samples);
            }
            _ => {
                for ends in knots.windows(2) {
                    self.piece(ends[0], ends[1], DEPTH, samples);
                }
            }
        }
    }

    /// Samples the piece from `a` to `b`.
    pub(crate) fn piece(&self, a: Knot, b: Knot, depth: u32, samples: &mut Vec<Sample>) {
        if b.0 > a.0 {
            let mid = self.knot((a.0 + b.0) / 2.0);
            self.piece_by(a, mid, b, depth, samples);
        }
    }

    /// Samples the piece from `a` to `b` with its middle `mid`.
    pub(crate) fn piece_by(
        &self,
        a: Knot,
        mid: Knot,
        b: Knot,
        depth: u32,
        samples: &mut Vec<Sample>,
    ) {
        let (mut panels, mut near) = (1.0, false);
        // The rows of the image at the start, middle and end, and its bend between them, if known.
        let mut passed = None;
        let split;
        match (a.1, mid.1, b.1) {
            (None, None, None) => return,
            (Some(from), Some(middle), Some(to)) => {
                let ends = [from.at, middle.at, to.at];
                let length = length(&[a.1, mid.1, b.1]);
                let chord = [0, 1].map(|k| (from.at[k] + to.at[k]) / 2.0);
                let (ys, bend) = (ends.map(|at| at[1]), distance(middle.at, chord));
                passed = Some((ys, bend));
                let seen = self
                    .spec
                    .window
                    .is_near(&ends, bend.max(BEND * length / 2.0));
                // A position that is not finite is never near.
                near = bend.is_finite() && (seen || self.is_cut([a.0, b.0], ys, bend));
                let longest = if seen {
                    LONGEST_PX
                } else {
                    4.0 * self.spec.reach_px
                };
                split = near && (bend > (BEND * length).max(MIN_PX) || length > longest);
                // On a parabola the greatest speed is 1 + 4 bend / length times the mean.
                panels = (length + 4.0 * bend) / self.step_px();
            }
            // The source enters or leaves the half space in front of the camera.
            _ => split = true,
        }
        if split && depth > 0 {
            self.piece(a, mid, depth - 1, samples);
            self.piece(mid, b, depth - 1, samples);
            return;
        }
        if !near {
            // No row nearby opens or closes: all behave as the row of the image.
            let own = mid.1.is_some_and(|mid_place| {
                self.spec.rows.are_together() || self.collects(mid.0, mid_place.at[1])
            });
            if own {
                self.far_piece(a, mid, b, depth, samples);
            }
            return;
        }
        if let (false, Some(even), Some(known)) = (split, self.even, places([a, mid, b])) {
            return self.even_piece([a.0, b.0], known, even, samples);
        }
        // A piece that still needs a split at the greatest depth is a jump of the image: one panel.
        let panels = if split { 1.0 } else { panels };
        let panels = panels.ceil().max(1.0) as usize;
        for i in 0..panels {
            let part = |i: usize| a.0 + (b.0 - a.0) * (i as f64 / panels as f64);
            let ends = [part(i), part(i + 1)];
            if let Some((ys, _)) = passed.filter(|(ys, bend)| !self.is_cut(ends, *ys, *bend)) {
                // All rows nearby collect light, or none.
                if self.collects((ends[0] + ends[1]) / 2.0, ys[1]) {
                    self.panel(ends, Lit::ALL, samples);
                }
                continue;
            }
            // A margin for the bend within a panel.
            let reach = self.spec.reach_px + 1.0 + self.step_px();
            let ys = ends.map(|part| (self.position)(part).map_or(f64::NAN, |p| p.at[1]));
            let near = [ys[0].min(ys[1]) - reach, ys[0].max(ys[1]) + reach];
            self.cut_panel(ends, &self.spec.rows.turns(ends, near), samples);
        }
    }

    /// Samples the time from `from` to `to` for a Gaussian; `known` are the positions at its ends
    /// and middle.
    fn even_piece(
        &self,
        [from, to]: [f64; 2],
        known: [Place; 3],
        (sigma_px, error): (f64, f64),
        samples: &mut Vec<Sample>,
    ) {
        let position = |part: f64| (self.position)(from + (to - from) * part);
        let [first, middle, last] = known.map(|position| position.at);
        let chord = [0, 1].map(|k| (first[k] + last[k]) / 2.0);
        let length = distance(first, middle) + distance(middle, last);
        // On a parabola the greatest speed is 1 + 4 bend / length times the mean.
        let sigmas = (length + 4.0 * distance(middle, chord)) / sigma_px;
        // A few points cost no more than fitting a path.
        let is_short = rule::are_few(sigmas, error, PATH_EVALUATIONS);
        let path = (!is_short).then(|| Path::through(known, position, sigma_px * error));
        let path = path.flatten();
        let weight = (to - from) / self.spec.rows.exposure;
        samples.reserve(rule::expected_count(sigmas));
        rule::points(sigmas, error, |part, share| {
            let at = match &path {
                Some(path) => Some(path.at(part)),
                None => position(part),
            };
            if let Some(position) = at {
                samples.push(Sample {
                    at: position.at,
                    weight: weight * share * position.light,
                    lit: Lit::ALL,
                    parts: Vec::new(),
                });
            }
        });
    }

    /// Samples a piece outside of the window: two points give its light and centre. If Simpson's
    /// rule differs, the transmission is not smooth along the piece, and it is halved.
    fn far_piece(&self, a: Knot, mid: Knot, b: Knot, depth: u32, samples: &mut Vec<Sample>) {
        let from = samples.len();
        self.panel([a.0, b.0], Lit::ALL, samples);
        let (Some(first), Some(middle), Some(last)) = (a.1, mid.1, b.1) else {
            return;
        };
        let sampled: f64 = samples[from..].iter().map(|sample| sample.weight).sum();
        let simpson = (first.light + 4.0 * middle.light + last.light) / 6.0;
        let apart = sampled - simpson * (b.0 - a.0) / self.spec.rows.exposure;
        // Differences in the last digits are rounding.
        let differs = apart.abs() > 8.0 * f64::EPSILON * sampled;
        if differs && apart.abs() * self.length_px > FAR_PX && depth > 0 {
            samples.truncate(from);
            self.piece(a, mid, depth - 1, samples);
            self.piece(mid, b, depth - 1, samples);
        }
    }

    fn panel(&self, [from, to]: [f64; 2], lit: Lit, samples: &mut Vec<Sample>) {
        let weight = (to - from) / (self.spec.rows.exposure * GAUSS.len() as f64);
        let places = GAUSS.map(|g| (self.position)(from + (to - from) * g));
        samples.extend(places.into_iter().flatten().map(|position| Sample {
            at: position.at,
            weight: weight * position.light,
            lit,
            parts: Vec::new(),
        }));
    }

    /// Samples an interval in which some rows open or close. All rows share four points; each row's
    /// weights are the integrals over its part of the polynomials L_k that are 1 at one point and 0
    /// at the others. For a panel of length h:
    ///
    /// ```text
    /// int_part f dt = sum_k f(t_k) int_part L_k dt,   error <= 4e-5 h^4 max |d^4 f / dt^4|
    /// ```
    fn cut_panel(&self, [from, to]: [f64; 2], turns: &Turns, samples: &mut Vec<Sample>) {
        if turns.others.is_empty() {
            if turns.throughout != Lit::NONE {
                self.panel([from, to], turns.throughout, samples);
            }
            return;
        }
        for (k, (point, weight)) in FOUR.into_iter().enumerate() {
            let Some(position) = (self.position)(from + (to - from) * point) else {
                continue;
            };
            let part = |ends: &[f64; 2]| {
                let [a, b] = ends.map(|end| (end - from) / (to - from));
                let ends = GAUSS.map(|g| polynomial(k, a + (b - a) * g));
                (b - a) * (ends[0] + ends[1]) / (2.0 * weight)
            };
            let others = turns.others.iter();
            samples.push(Sample {
                at: position.at,
                weight: weight * (to - from) / self.spec.rows.exposure * position.light,
                lit: turns.throughout,
                parts: others.map(|(lit, ends)| (*lit, part(ends))).collect(),
            });
        }
    }
}

/// The positions, if all three knots have one.
fn places(knots: [Knot; 3]) -> Option<[Place; 3]> {
    let [(_, Some(a)), (_, Some(b)), (_, Some(c))] = knots else {
        return None;
    };
    Some([a, b, c])
}

/// The cubic polynomial that is 1 at the point `k` of [`FOUR`] and 0 at the others.
fn polynomial(k: usize, u: f64) -> f64 {
    let others = (0..FOUR.len()).filter(|j| *j != k);
    let factors = others.map(|j| (u - FOUR[j].0) / (FOUR[k].0 - FOUR[j].0));
    factors.product()
}

/// Length of the line through the positions, px; without segments that end behind the camera.
pub(crate) fn length(places: &[Option<Place>]) -> f64 {
    let between = places.windows(2).map(|ends| match ends {
        [Some(a), Some(b)] => distance(a.at, b.at),
        _ => 0.0,
    });
    between.sum()
}
