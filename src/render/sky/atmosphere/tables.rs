//! Tables of light against lines of sight, and against the Sun's height.

use std::sync::OnceLock;

/// Places in a row.
const PLACES: usize = 17;
/// The sine of the Sun's height within which a row has most of its places: twilight.
const TWILIGHT: f64 = 0.15;

/// The least entry of a table, ph/s/m^2/sr: nothing that a camera sees.
const MIN: f64 = 1.0;

/// Values at equidistant places and the cubics between them (Catmull & Rom 1974), of those that
/// have been asked for.
#[derive(Debug, Clone)]
struct Cubics<const N: usize> {
    values: Vec<OnceLock<[f64; N]>>,
    /// Of each interval by powers of its part.
    powers: Vec<OnceLock<[[f64; N]; 4]>>,
}

/// Light against one kind of line: logarithms, of base 2.
#[derive(Debug, Clone)]
pub struct Table {
    logs: Cubics<1>,
}

/// The Sun's part against its height over one line's place.
#[derive(Debug, Clone)]
pub struct Row {
    /// Weights of the Sun's cosines to the observer's zenith and to the line's horizontal direction
    /// in that to the place's zenith.
    weights: [f64; 2],
    /// Where the row's places begin, how far they reach, and one over that, see [`crowd`]; 0 where
    /// they are all one.
    from: f64,
    span: f64,
    per_span: f64,
    /// The part of the table's scattered light by the Sun's direct light, and by the day side's.
    parts: Cubics<2>,
}

/// So many that have not been asked for.
fn blank<T>(count: usize) -> Vec<OnceLock<T>> {
    (0..count).map(|_| OnceLock::new()).collect()
}

impl<const N: usize> Cubics<N> {
    /// Of so many values, two or more.
    fn of(count: usize) -> Cubics<N> {
        Cubics {
            values: blank(count),
            powers: blank(count - 1),
        }
    }

    /// What stands at 0..1 of all places; `value` gives it there for the place itself.
    #[inline]
    fn at(&self, part: f64, value: impl Fn(f64) -> [f64; N]) -> [f64; N] {
        let count = self.powers.len();
        let along = part.clamp(0.0, 1.0) * count as f64;
        let i = (along as u32 as usize).min(count - 1);
        let t = along - i as f64;
        let [a, b, c, d] = self.powers[i].get_or_init(move || self.between(i, value));
        let mut sum = *d;
        for k in 0..N {
            sum[k] = a[k] + t * (b[k] + t * (c[k] + t * sum[k]));
        }
        sum
    }

    /// The cubic of an interval.
    fn between(&self, i: usize, value: impl Fn(f64) -> [f64; N]) -> [[f64; N]; 4] {
        let last = self.powers.len();
        let position = |k: usize| *self.values[k].get_or_init(|| value(k as f64 / last as f64));
        let [a, b, c, d] = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(position);
        let mut powers = [b; 4];
        for k in 0..N {
            powers[1][k] = (c[k] - a[k]) / 2.0;
            powers[2][k] = a[k] - 2.5 * b[k] + 2.0 * c[k] - d[k] / 2.0;
            powers[3][k] = (d[k] - a[k] + 3.0 * (b[k] - c[k])) / 2.0;
        }
        powers
    }
}

impl Table {
    /// Of so many values, two or more.
    pub fn of(count: usize) -> Table {
        Table {
            logs: Cubics::of(count),
        }
    }

    /// The value at 0..1, by cubics through four of those that `value` gives for 0..1.
    #[inline]
    pub fn at(&self, part: f64, value: impl Fn(f64) -> f64) -> f64 {
        let [log] = self
            .logs
            .at(part, move |part| [libm::log2(value(part).max(MIN))]);
        libm::exp2(log)
    }
}

impl Row {
    /// Of the sines of the Sun's height from the one of `ends` to the other.
    pub fn of(weights: [f64; 2], ends: [f64; 2]) -> Row {
        let [from, to] = ends.map(crowd);
        let span = to - from;
        Row {
            weights,
            from,
            span,
            per_span: if span.abs() > 1e-9 { 1.0 / span } else { 0.0 },
            parts: Cubics::of(PLACES),
        }
    }

    /// The parts for the Sun's cosines to the observer's zenith and to the line's horizontal
    /// direction; `parts` gives them for sines of the Sun's height.
    #[inline]
    pub fn at(&self, sun: [f64; 2], parts: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let height = self.weights[0] * sun[0] + self.weights[1] * sun[1];
        let part = (crowd(height) - self.from) * self.per_span;
        let [direct, from_below] = self.parts.at(part, move |part| {
            parts(uncrowd(self.from + self.span * part))
        });
        [direct.max(0.0), from_below.max(0.0)]
    }

    /// The Sun's cosine to the line's horizontal direction, at the sine `height` of its height,
    /// that to the observer's zenith being `along`.
    pub fn across(&self, height: f64, along: f64) -> f64 {
        if self.weights[1].abs() > 1e-9 {
            (height - self.weights[0] * along) / self.weights[1]
        } else {
            0.0
        }
    }
}

/// The first of the two lines on either side of `at`, and which part of the way to the second it
/// lies.
#[inline]
pub fn between(lines: &[f64], at: f64) -> (usize, f64) {
    let above = lines.partition_point(|line| *line < at);
    let i = above.clamp(1, lines.len() - 1) - 1;
    let part = (at - lines[i]) / (lines[i + 1] - lines[i]);
    (i, part.clamp(0.0, 1.0))
}

/// A scale of the sine of the Sun's height that is wide in twilight.
fn crowd(height: f64) -> f64 {
    height / (height * height + TWILIGHT * TWILIGHT).sqrt()
}

/// The inverse of [`crowd`].
fn uncrowd(position: f64) -> f64 {
    TWILIGHT * position / ((1.0 - position) * (1.0 + position)).max(1e-12).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn cubics_follow_a_parabola_go_through_their_places_and_ask_for_what_is_near() {
        let requested = Cell::new(0);
        let parabola = |x: f64| [3.0 - 2.0 * x + 5.0 * x * x, 1.0 - x];
        let value = |x: f64| {
            requested.set(requested.get() + 1);
            parabola(x)
        };
        let cubics = Cubics::<2>::of(11);
        // X-Val: by hand, the parabola itself: Catmull and Rom's cubics are of its slope at their
        // ends.
        for part in [0.512, 0.5, 0.58] {
            let [told, truth] = [cubics.at(part, value), parabola(part)];
            assert!((0..2).all(|k| (told[k] - truth[k]).abs() < 1e-14), "{part}");
        }
        assert_eq!(requested.get(), 4);
        for i in 0..=10 {
            let part = f64::from(i) / 10.0;
            let [told, truth] = [cubics.at(part, value), parabola(part)];
            assert!((0..2).all(|k| (told[k] - truth[k]).abs() < 1e-14), "{i}");
        }
        assert_eq!(requested.get(), 11);
        // Beyond the ends as at them.
        assert_eq!(cubics.at(-3.0, value), cubics.at(0.0, value));
    }
}
