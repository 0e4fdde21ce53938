//! The light between a point's middle and the corners of pixels, interpolated in a table.

/// The position of a coordinate between the nodes of a table.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// Index of the first of four nodes.
    pub first: usize,
    /// Cubic weights of the nodes (Lagrange).
    pub weights: [f64; 4],
}

/// A square table of values at nodes, row by row.
#[derive(Debug, Clone, Copy)]
pub struct Nodes<'a> {
    /// The values at the nodes, `side` in each row.
    pub values: &'a [f64],
    /// Nodes of a row.
    pub side: usize,
}

impl<'a> Nodes<'a> {
    /// The four rows around a position.
    #[inline(always)]
    fn rows(&self, down: &Place) -> [&'a [f64]; 4] {
        let row = |k: usize| &self.values[(down.first + k) * self.side..][..self.side];
        [row(0), row(1), row(2), row(3)]
    }
}

/// Interpolates at each position of `across` and one position `down`: `sum_jk w_j v_k F_jk`.
#[inline(always)]
pub(crate) fn body(nodes: &Nodes<'_>, across: &[Place], down: &Place, line: &mut [f64]) {
    let rows = nodes.rows(down);
    for (value, position) in line.iter_mut().zip(across) {
        let mut mixed = [0.0; 4];
        for (row, weight) in rows.iter().zip(&down.weights) {
            let near = &row[position.first..position.first + 4];
            for i in 0..4 {
                mixed[i] = near[i].mul_add(*weight, mixed[i]);
            }
        }
        let w = &position.weights;
        let [even, odd] = [0, 1].map(|i| mixed[i].mul_add(w[i], mixed[i + 2] * w[i + 2]));
        *value = even + odd;
    }
}

/// The same, node by node.
#[inline(always)]
pub(crate) fn twin(nodes: &Nodes<'_>, across: &[Place], down: &Place, line: &mut [f64]) {
    let at = |j: usize, i: usize| nodes.values[j * nodes.side + i];
    for (value, position) in line.iter_mut().zip(across) {
        let mixed = |i: usize| {
            let rows = down.weights.iter().enumerate();
            rows.fold(0.0, |sum, (k, weight)| {
                at(down.first + k, position.first + i).mul_add(*weight, sum)
            })
        };
        let [a, b, c, d] = position.weights;
        *value = mixed(0).mul_add(a, mixed(2) * c) + mixed(1).mul_add(b, mixed(3) * d);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::table_line;
    use skyloop_orbit::sgp4_batch::Level;

    /// Lagrange's weights of a position `t` after the first of four nodes.
    fn position(first: usize, t: f64) -> Place {
        let weight = |k: usize| {
            let others = (0..4).filter(|other| *other != k).map(|other| other as f64);
            others
                .map(|other| (t - other) / (k as f64 - other))
                .product()
        };
        Place {
            first,
            weights: [weight(0), weight(1), weight(2), weight(3)],
        }
    }

    #[test]
    fn all_levels_agree_and_reproduce_a_cubic() {
        let cubic = |x: f64| 0.3 + x * (0.2 + x * (0.05 - 0.01 * x));
        let side = 12;
        let values: Vec<f64> = (0..side * side)
            .map(|i| cubic((i % side) as f64) * cubic((i / side) as f64))
            .collect();
        let nodes = Nodes {
            values: &values,
            side,
        };
        let across: Vec<Place> = (0..9).map(|i| position(i, 1.1 + 0.09 * i as f64)).collect();
        for j in 0..9 {
            let down = position(j, 1.9 - 0.1 * j as f64);
            let line = |level: Option<Level>| {
                let mut line = vec![f64::NAN; across.len()];
                table_line(level, &nodes, &across, &down, &mut line);
                line
            };
            let twin = line(None);
            for level in Level::available() {
                assert_eq!(line(Some(level)), twin, "{level:?}");
            }
            for (i, found) in twin.into_iter().enumerate() {
                // X-Val: by hand, the product of the cubics, which Lagrange's formula reproduces.
                let at = |first: usize, t: f64| cubic(first as f64 + t);
                let truth = at(i, 1.1 + 0.09 * i as f64) * at(j, 1.9 - 0.1 * j as f64);
                assert!((found - truth).abs() < 1e-13, "{i} {j}: {found} {truth}");
            }
        }
    }
}
