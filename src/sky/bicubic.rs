//! A smooth function through the values of a table.
//!
//! Bicubic Hermite polynomials: each cell's has value, both slopes and their cross derivative at its four corners, so that the whole is
//! smooth (C1) and meets the table. The slopes at a place are those of the parabola through it and its two neighbours.

/// Values over the grid of `x` and `y`.
#[derive(Debug, Clone)]
pub(super) struct Bicubic {
    x: Vec<f64>,
    y: Vec<f64>,
    /// Value, derivative by x, by y, by both; `y` runs fastest.
    nodes: Vec<[f64; 4]>,
}

impl Bicubic {
    /// Through `value(i, j)` at `x[i]`, `y[j]`, two places or more on each side, growing. Flat at the first and last `x` and at the
    /// first `y`; at the last `y` the slope and its derivative by x are `last(x)`.
    pub(super) fn new(
        x: Vec<f64>,
        y: Vec<f64>,
        value: impl Fn(usize, usize) -> f64,
        last: impl Fn(f64) -> [f64; 2],
    ) -> Self {
        let columns: Vec<Vec<f64>> = (0..x.len())
            .map(|i| (0..y.len()).map(|j| value(i, j)).collect())
            .collect();
        let up: Vec<Vec<f64>> = columns
            .iter()
            .zip(&x)
            .map(|(column, x)| slopes(&y, column, last(*x)[0]))
            .collect();
        let by_x = |of: &[Vec<f64>], j: usize| {
            let row: Vec<f64> = of.iter().map(|column| column[j]).collect();
            slopes(&x, &row, 0.0)
        };
        let along: Vec<Vec<f64>> = (0..y.len()).map(|j| by_x(&columns, j)).collect();
        let twist: Vec<Vec<f64>> = (0..y.len()).map(|j| by_x(&up, j)).collect();

        let mut nodes = Vec::with_capacity(x.len() * y.len());
        for (i, x) in x.iter().enumerate() {
            for j in 0..y.len() {
                let both = if j + 1 == y.len() {
                    last(*x)[1]
                } else {
                    twist[j][i]
                };
                nodes.push([columns[i][j], along[j][i], up[i][j], both]);
            }
        }
        Bicubic { x, y, nodes }
    }

    /// The value at `x`, `y`.
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let (i, along) = cell(&self.x, x);
        let (j, up) = cell(&self.y, y);
        // Value and slope along x at two neighbours in x, at height y.
        let side = |i: usize| {
            let first = i * self.y.len() + j;
            let ([a, a_x, a_y, a_xy], [b, b_x, b_y, b_xy]) =
                (self.nodes[first], self.nodes[first + 1]);
            [
                up[0] * a + up[1] * b + up[2] * a_y + up[3] * b_y,
                up[0] * a_x + up[1] * b_x + up[2] * a_xy + up[3] * b_xy,
            ]
        };
        let ([a, a_x], [b, b_x]) = (side(i), side(i + 1));
        along[0] * a + along[1] * b + along[2] * a_x + along[3] * b_x
    }
}

/// The interval of `places` for `at`, and Hermite's cubics there: for the values at its ends, then for the slopes.
fn cell(places: &[f64], at: f64) -> (usize, [f64; 4]) {
    let above = places.partition_point(|place| *place <= at);
    let k = above.clamp(1, places.len() - 1) - 1;
    let width = places[k + 1] - places[k];
    let t = (at - places[k]) / width;
    let (rise, rest) = (t * t * (3.0 - 2.0 * t), 1.0 - t);
    let weights = [
        1.0 - rise,
        rise,
        t * rest * rest * width,
        -t * t * rest * width,
    ];
    (k, weights)
}

/// Slopes of `values` at `x`: 0 at the first place, `last` at the last, of parabolas between.
fn slopes(x: &[f64], values: &[f64], last: f64) -> Vec<f64> {
    let mut slopes = vec![0.0; x.len()];
    for k in 1..x.len() - 1 {
        let (before, after) = (x[k] - x[k - 1], x[k + 1] - x[k]);
        let (rise, next) = (
            (values[k] - values[k - 1]) / before,
            (values[k + 1] - values[k]) / after,
        );
        slopes[k] = (rise * after + next * before) / (before + after);
    }
    if let Some(end) = slopes.last_mut() {
        *end = last;
    }
    slopes
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A product of parabolas with the right ends comes back, and the table's values always.
    #[test]
    fn parabolas_come_back() {
        let x = vec![-1.0, -0.4, 0.1, 0.7, 1.5];
        let y = vec![0.0, 0.3, 1.0, 1.2];
        let f = |x: f64, y: f64| (2.0 - x + 3.0 * x * x) * (1.0 + 2.0 * y * y);
        let table = Bicubic::new(
            x.clone(),
            y.clone(),
            |i, j| f(x[i], y[j]),
            |x| {
                [
                    (2.0 - x + 3.0 * x * x) * 4.0 * 1.2,
                    (6.0 * x - 1.0) * 4.0 * 1.2,
                ]
            },
        );
        for &x in &x {
            for &y in &y {
                assert!((table.at(x, y) - f(x, y)).abs() < 1e-12);
            }
        }
        // In the cells whose slopes by x are not set at an end.
        for (x, y) in [(-0.2, 0.1), (0.0, 0.9), (0.5, 1.1), (0.69, 0.01)] {
            assert!((table.at(x, y) - f(x, y)).abs() < 1e-12, "{x} {y}");
        }
    }
}
