//! A smooth function through the values of a table.
//!
//! Bicubic Hermite polynomials: that of each cell has the value, both slopes and the cross
//! derivative of the table at its four corners. So the function is smooth (C1) and exact at the
//! nodes. The slopes at a node are those of the parabola through it and its two neighbours.

/// Values over the grid of `x` and `y`.
#[derive(Debug, Clone)]
pub(super) struct Bicubic {
    x: Axis,
    y: Axis,
    /// The coefficients of each cell, the index along `y` fastest: `[k][l]` is that of `x^k y^l`,
    /// with `x` and `y` the position in the cell (0..1).
    cells: Vec<[[f64; 4]; 4]>,
}

/// The nodes along one side of the grid.
#[derive(Debug, Clone)]
struct Axis {
    places: Vec<f64>,
    /// Inverse width of each interval.
    per_width: Vec<f64>,
    /// Inverse width of the narrowest interval.
    per_bucket: f64,
    /// The interval at the start of each bucket. Buckets are as wide as the narrowest interval, so
    /// each has at most one node.
    buckets: Vec<usize>,
}

impl Bicubic {
    /// Through `value(i, j)` at `x[i]`, `y[j]`, two or more ascending nodes along each axis. Slope
    /// 0 at the first and last `x` and at the first `y`; at the last `y` the slope along y and its
    /// derivative by x are `last(x)`.
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

        // Value, derivative by x, by y, by both.
        let node = |i: usize, j: usize| {
            let both = if j + 1 == y.len() {
                last(x[i])[1]
            } else {
                twist[j][i]
            };
            [columns[i][j], along[j][i], up[i][j], both]
        };
        let mut cells = Vec::with_capacity((x.len() - 1) * (y.len() - 1));
        for (i, across) in x.windows(2).enumerate() {
            for (j, down) in y.windows(2).enumerate() {
                let size = [across[1] - across[0], down[1] - down[0]];
                let corners = [[0, 0], [0, 1], [1, 0], [1, 1]];
                cells.push(powers(size, corners.map(|[k, l]| node(i + k, j + l))));
            }
        }
        let [x, y] = [x, y].map(Axis::of);
        Bicubic { x, y, cells }
    }

    /// The value at `x`, `y`.
    #[inline]
    pub(super) fn at(&self, x: f64, y: f64) -> f64 {
        let (i, x) = self.x.cell(x);
        let (j, y) = self.y.cell(y);
        let cell = &self.cells[i * self.y.per_width.len() + j];
        horner(cell.map(|powers| horner(powers, y)), x)
    }
}

impl Axis {
    /// From two or more rising nodes.
    fn of(places: Vec<f64>) -> Axis {
        let widths = places.windows(2).map(|pair| pair[1] - pair[0]);
        let narrowest = widths.clone().fold(f64::INFINITY, f64::min);
        let (first, last) = (places[0], places[places.len() - 1]);
        let count = ((last - first) / narrowest).ceil() as usize;
        let starts = (0..count).map(|k| first + k as f64 * narrowest);
        let below = |at: f64| places.partition_point(|position| *position <= at);
        Axis {
            per_width: widths.map(|width| 1.0 / width).collect(),
            per_bucket: 1.0 / narrowest,
            buckets: starts
                .map(|at| below(at).clamp(1, places.len() - 1) - 1)
                .collect(),
            places,
        }
    }

    /// The interval that contains `at`, and the position in it (0..1).
    #[inline]
    fn cell(&self, at: f64) -> (usize, f64) {
        let bucket = ((at - self.places[0]) * self.per_bucket) as u32 as usize;
        let first = self.buckets[bucket.min(self.buckets.len() - 1)];
        let is_next = first + 2 < self.places.len() && at >= self.places[first + 1];
        let k = first + usize::from(is_next);
        (k, (at - self.places[k]) * self.per_width[k])
    }
}

/// The sum of `powers[k] t^k`.
#[inline]
fn horner(powers: [f64; 4], t: f64) -> f64 {
    powers[0] + t * (powers[1] + t * (powers[2] + t * powers[3]))
}

/// Coefficients of Hermite's cubic on 0..1, from its values and then its slopes at both ends.
fn hermite([a, b, a_t, b_t]: [f64; 4]) -> [f64; 4] {
    [
        a,
        a_t,
        3.0 * (b - a) - 2.0 * a_t - b_t,
        2.0 * (a - b) + a_t + b_t,
    ]
}

/// The coefficients of a cell of the given width along x and height along y, from the nodes at its
/// corners; the second corner is the next along y.
fn powers([width, height]: [f64; 2], corners: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
    // By powers of y at both ends along x: the value, and the slope along x.
    let side = |a: [f64; 4], b: [f64; 4]| {
        [
            hermite([a[0], b[0], a[2] * height, b[2] * height]),
            hermite([a[1], b[1], a[3] * height, b[3] * height]).map(|slope| slope * width),
        ]
    };
    let [a, b, c, d] = corners;
    let ([near, near_x], [far, far_x]) = (side(a, b), side(c, d));
    let along = [0, 1, 2, 3].map(|l| hermite([near[l], far[l], near_x[l], far_x[l]]));
    [0, 1, 2, 3].map(|k| [0, 1, 2, 3].map(|l| along[l][k]))
}

/// Slopes of `values` at `x`: 0 at the first node, `last` at the last, from parabolas between.
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

    /// A product of parabolas with matching ends is exact, and so are the table's values.
    #[test]
    fn parabolas_are_reproduced() {
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
        // In cells without a prescribed slope by x.
        for (x, y) in [(-0.2, 0.1), (0.0, 0.9), (0.5, 1.1), (0.69, 0.01)] {
            assert!((table.at(x, y) - f(x, y)).abs() < 1e-12, "{x} {y}");
        }
    }
}
