//! Tables of light by line of sight, and by the Sun's elevation.

use std::sync::OnceLock;

/// Nodes of a row.
const NODES: usize = 17;
/// Most nodes of a row lie between plus and minus this sine of the Sun's elevation: twilight.
const TWILIGHT: f64 = 0.15;

/// Minimum entry of a table, ph/s/m^2/sr: far below any camera's sensitivity.
const MIN: f64 = 1.0;

/// Values at equidistant nodes and the cubics between them (Catmull & Rom 1974), computed on first
/// use.
#[derive(Debug, Clone)]
struct Cubics<const N: usize> {
    values: Vec<OnceLock<[f64; N]>>,
    /// Coefficients of each interval's cubic, by powers.
    powers: Vec<OnceLock<[[f64; N]; 4]>>,
}

/// Light by the coordinate of one kind of line, as binary logarithms.
#[derive(Debug, Clone)]
pub(crate) struct Table {
    logs: Cubics<1>,
}

/// The factors of sunlight for one line, by the Sun's elevation at the line's reference point.
#[derive(Debug, Clone)]
pub struct Row {
    /// The Sun's cosine to the reference point's zenith is the sum of these weights times its
    /// cosines to the observer's zenith and to the line's horizontal direction.
    weights: [f64; 2],
    /// Start, length and inverse length of the row's range on the scale of [`to_twilight_scale`];
    /// the inverse is 0 for an empty range.
    from: f64,
    span: f64,
    per_span: f64,
    /// Light from direct sunlight and from the day side, relative to the table's scattered light.
    parts: Cubics<2>,
}

/// Values that are computed on first use.
fn blank<T>(count: usize) -> Vec<OnceLock<T>> {
    (0..count).map(|_| OnceLock::new()).collect()
}

impl<const N: usize> Cubics<N> {
    /// With `count` values, two or more.
    fn of(count: usize) -> Cubics<N> {
        Cubics {
            values: blank(count),
            powers: blank(count - 1),
        }
    }

    /// The value at 0..1 of the range; `value` computes nodes at 0..1.
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
    /// With `count` values, two or more.
    pub fn of(count: usize) -> Table {
        Table {
            logs: Cubics::of(count),
        }
    }

    /// The value at 0..1, by cubics through four nodes; `value` computes nodes at 0..1.
    #[inline]
    pub fn at(&self, part: f64, value: impl Fn(f64) -> f64) -> f64 {
        let [log] = self
            .logs
            .at(part, move |part| [libm::log2(value(part).max(MIN))]);
        libm::exp2(log)
    }
}

impl Row {
    /// For sines of the Sun's elevation between the two `ends`.
    pub(crate) fn of(weights: [f64; 2], ends: [f64; 2]) -> Row {
        let [from, to] = ends.map(to_twilight_scale);
        let span = to - from;
        Row {
            weights,
            from,
            span,
            per_span: if span.abs() > 1e-9 { 1.0 / span } else { 0.0 },
            parts: Cubics::of(NODES),
        }
    }

    /// The factors for the Sun's cosines to the observer's zenith and to the line's horizontal
    /// direction; `parts` computes them for sines of the Sun's elevation.
    #[inline]
    pub(crate) fn at(&self, sun: [f64; 2], parts: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let sin_elevation = self.weights[0] * sun[0] + self.weights[1] * sun[1];
        let part = (to_twilight_scale(sin_elevation) - self.from) * self.per_span;
        let [direct, from_below] = self.parts.at(part, move |part| {
            parts(from_twilight_scale(self.from + self.span * part))
        });
        [direct.max(0.0), from_below.max(0.0)]
    }

    /// The Sun's cosine to the line's horizontal direction, for the sine `sin_elevation` of its
    /// elevation and its cosine `along` to the observer's zenith.
    pub(crate) fn across(&self, sin_elevation: f64, along: f64) -> f64 {
        if self.weights[1].abs() > 1e-9 {
            (sin_elevation - self.weights[0] * along) / self.weights[1]
        } else {
            0.0
        }
    }
}

/// The index of the first of the two lines around `at`, and the fraction of the distance to the
/// second.
#[inline]
pub fn between(lines: &[f64], at: f64) -> (usize, f64) {
    let above = lines.partition_point(|line| *line < at);
    let i = above.clamp(1, lines.len() - 1) - 1;
    let part = (at - lines[i]) / (lines[i + 1] - lines[i]);
    (i, part.clamp(0.0, 1.0))
}

/// Maps the sine of the Sun's elevation to a scale on which twilight is wide.
fn to_twilight_scale(sin_elevation: f64) -> f64 {
    sin_elevation / (sin_elevation * sin_elevation + TWILIGHT * TWILIGHT).sqrt()
}

/// The inverse of [`to_twilight_scale`].
fn from_twilight_scale(position: f64) -> f64 {
    TWILIGHT * position / ((1.0 - position) * (1.0 + position)).max(1e-12).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn cubics_follow_a_parabola_and_compute_only_neighbours() {
        let requested = Cell::new(0);
        let parabola = |x: f64| [3.0 - 2.0 * x + 5.0 * x * x, 1.0 - x];
        let value = |x: f64| {
            requested.set(requested.get() + 1);
            parabola(x)
        };
        let cubics = Cubics::<2>::of(11);
        // X-Val: by hand, the parabola itself: Catmull-Rom cubics have its slopes at their ends.
        for part in [0.512, 0.5, 0.58] {
            let [found, exact] = [cubics.at(part, value), parabola(part)];
            assert!(
                (0..2).all(|k| (found[k] - exact[k]).abs() < 1e-14),
                "{part}"
            );
        }
        assert_eq!(requested.get(), 4);
        for i in 0..=10 {
            let part = f64::from(i) / 10.0;
            let [found, exact] = [cubics.at(part, value), parabola(part)];
            assert!((0..2).all(|k| (found[k] - exact[k]).abs() < 1e-14), "{i}");
        }
        assert_eq!(requested.get(), 11);
        // Constant beyond the ends.
        assert_eq!(cubics.at(-3.0, value), cubics.at(0.0, value));
    }
}
