//! Tables of light against lines of sight, and against the Sun's height.

use std::sync::OnceLock;

/// Places in a row.
const PLACES: usize = 17;
/// The sine of the Sun's height within which a row has most of its places: twilight.
const TWILIGHT: f64 = 0.15;

/// The least entry of a table, ph/s/m^2/sr: nothing that a camera sees.
const LEAST: f64 = 1.0;

/// Light against one kind of line: logarithms of equidistant values, of those that have been asked for.
#[derive(Debug, Clone)]
pub struct Table {
    logs: Vec<OnceLock<f64>>,
}

/// The Sun's part against its height over one line's place, of those heights that have been asked for.
#[derive(Debug, Clone)]
pub struct Row {
    /// Weights of the Sun's cosines to the observer's zenith and to the line's horizontal direction in that to the place's zenith.
    weights: [f64; 2],
    /// Where the row's places begin, and how far they reach, see [`crowd`].
    from: f64,
    span: f64,
    /// The part of the table's scattered light by the Sun's direct light, and by the day side's.
    parts: [OnceLock<[f64; 2]>; PLACES],
}

impl Table {
    /// Of so many values.
    pub fn of(count: usize) -> Table {
        Table {
            logs: (0..count).map(|_| OnceLock::new()).collect(),
        }
    }

    /// The value at 0..1, by cubics through four of those that `value` gives for 0..1.
    pub fn at(&self, part: f64, value: impl Fn(f64) -> f64) -> f64 {
        let last = self.logs.len().saturating_sub(1);
        let along = part.clamp(0.0, 1.0) * last as f64;
        let i = (along as usize).min(last.saturating_sub(1));
        let log = |k: usize| {
            let log = || libm::log(value(k as f64 / last as f64).max(LEAST));
            *self.logs[k].get_or_init(log)
        };
        let four = [i.saturating_sub(1), i, (i + 1).min(last), (i + 2).min(last)].map(log);
        let weights = cubic(along - i as f64);
        libm::exp((0..4).map(|j| weights[j] * four[j]).sum())
    }
}

impl Row {
    /// Of the sines of the Sun's height from the one of `ends` to the other.
    pub fn of(weights: [f64; 2], ends: [f64; 2]) -> Row {
        let [from, to] = ends.map(crowd);
        Row {
            weights,
            from,
            span: to - from,
            parts: Default::default(),
        }
    }

    /// The parts for the Sun's cosines to the observer's zenith and to the line's horizontal direction; `parts` gives them for sines of the Sun's
    /// height.
    pub fn at(&self, sun: [f64; 2], parts: impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
        let height = self.weights[0] * sun[0] + self.weights[1] * sun[1];
        let last = PLACES - 1;
        let part = if self.span.abs() > 1e-9 {
            ((crowd(height) - self.from) / self.span).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let along = part * last as f64;
        let i = (along as usize).min(last - 1);
        let place = |k: usize| {
            let height = || uncrowd(self.from + self.span * k as f64 / last as f64);
            *self.parts[k].get_or_init(|| parts(height()))
        };
        let four = [i.saturating_sub(1), i, i + 1, (i + 2).min(last)].map(place);
        let weights = cubic(along - i as f64);
        [0, 1].map(|k| {
            (0..4)
                .map(|j| weights[j] * four[j][k])
                .sum::<f64>()
                .max(0.0)
        })
    }

    /// The Sun's cosine to the line's horizontal direction, at the sine `height` of its height, that to the observer's zenith being `along`.
    pub fn across(&self, height: f64, along: f64) -> f64 {
        match self.weights[1].abs() > 1e-9 {
            true => (height - self.weights[0] * along) / self.weights[1],
            false => 0.0,
        }
    }
}

/// What rows of the lines on either side of `at` give, in proportion; `row` gives that of the i-th line.
pub fn sun_parts(lines: &[f64], row: impl Fn(usize) -> [f64; 2], at: f64) -> [f64; 2] {
    let last = lines.len() - 1;
    let next = lines.partition_point(|line| *line < at);
    if next == 0 || next > last {
        return row(next.min(last));
    }
    let part = (at - lines[next - 1]) / (lines[next] - lines[next - 1]);
    let (a, b) = (row(next - 1), row(next));
    [0, 1].map(|k| a[k] + (b[k] - a[k]) * part)
}

/// Weights of four equidistant values for a place `t` (0..1) between the middle two (Catmull & Rom 1974).
fn cubic(t: f64) -> [f64; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [
        (2.0 * t2 - t - t3) / 2.0,
        (2.0 - 5.0 * t2 + 3.0 * t3) / 2.0,
        (t + 4.0 * t2 - 3.0 * t3) / 2.0,
        (t3 - t2) / 2.0,
    ]
}

/// A scale of the sine of the Sun's height that is wide in twilight.
fn crowd(height: f64) -> f64 {
    height / (height * height + TWILIGHT * TWILIGHT).sqrt()
}

/// The inverse of [`crowd`].
fn uncrowd(place: f64) -> f64 {
    TWILIGHT * place / ((1.0 - place) * (1.0 + place)).max(1e-12).sqrt()
}
