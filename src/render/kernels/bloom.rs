//! Blooming: charge beyond the full well spills along its column. The surplus of a pixel moves half
//! up and half down, and on from there, until it finds room or leaves at the column's ends.
//!
//! This is the divisible sandpile in one dimension (Levine and Peres 2009, Potential Analysis 30,
//! 1): its final state does not depend on the order of the steps. With the surplus `s = charge -
//! well` of each pixel and a curve of second difference `gamma'' = 2 s`, the charge that spilled
//! over is the height of the curve's concave hull above it, and
//!
//! ```text
//! flow from pixel i to i + 1 = (gamma[i + 1] - gamma[i] - slope of the hull there) / 2
//! ```
//!
//! In a column of whole electrons, whole electrons move: charge is conserved exactly, and a pixel
//! may hold one electron more than the well. In an expectation, fractions move too. Validity: a CCD
//! without anti-blooming drains, whose channel stops hold better than its gates (Janesick 2001,
//! Scientific Charge-Coupled Devices); no charge-transfer loss. Price: linear in the column's
//! pixels.

/// Buffers of one column, reused for the next.
#[derive(Default)]
pub struct Bloom {
    /// The curve, with one more position at each end of the column.
    gamma: Vec<f64>,
    /// Sum of the surplus up to each pixel, e-.
    surplus: Vec<f64>,
    /// The hull's corners.
    hull: Vec<usize>,
}

impl Bloom {
    /// Spills the charge of `column` (e-) above `well` (e-). Returns the charge lost at the first
    /// and the last pixel, e-.
    pub(crate) fn blooming(&mut self, column: &mut [f32], well: f64) -> [f64; 2] {
        if !column.iter().any(|e| f64::from(*e) > well) {
            return [0.0; 2];
        }
        self.build(column, well);
        let whole = column.iter().all(|e| e.fract() == 0.0);
        // The slope is constant along each edge of the hull: it gives the flow between neighbours.
        let (mut flow_in, mut ends) = (0.0, [0.0; 2]);
        let mut into = 0;
        for corner in self.hull.windows(2) {
            let (a, b) = (corner[0], corner[1]);
            let slope = (self.gamma[b] - self.gamma[a]) / (b - a) as f64;
            for position in a..b {
                // Between position and position + 1; pixel i has position i + 1.
                let flow = self.surplus[position] - slope / 2.0;
                let flow = if whole { libm::round(flow) } else { flow };
                if position == 0 {
                    ends[0] = -flow;
                } else {
                    let pixel = &mut column[into];
                    *pixel = (f64::from(*pixel) + flow_in - flow) as f32;
                    into += 1;
                }
                flow_in = flow;
            }
        }
        ends[1] = flow_in;
        ends
    }

    fn build(&mut self, column: &[f32], well: f64) {
        let Bloom {
            gamma,
            surplus,
            hull,
        } = self;
        gamma.clear();
        gamma.extend([0.0; 2]);
        surplus.clear();
        surplus.push(0.0);
        hull.clear();
        let (mut height, mut sum) = (0.0, 0.0);
        for e in column {
            sum += f64::from(*e) - well;
            height += 2.0 * sum;
            surplus.push(sum);
            gamma.push(height);
        }
        // Upper hull by the monotone chain (Andrew 1979).
        for position in 0..gamma.len() {
            while let [.., a, b] = hull[..] {
                let (run, rise) = ((b - a) as f64, gamma[b] - gamma[a]);
                let below = rise * (position - a) as f64 <= (gamma[position] - gamma[a]) * run;
                if !below {
                    break;
                }
                hull.pop();
            }
            hull.push(position);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bloomed(column: &[f32], well: f64) -> (Vec<f32>, [f64; 2]) {
        let mut column = column.to_vec();
        let ends = Bloom::default().blooming(&mut column, well);
        (column, ends)
    }

    /// Reference: each overfull pixel gives half of its surplus to each neighbour, until none is
    /// overfull.
    fn toppled(column: &[f32], well: f64) -> (Vec<f64>, [f64; 2]) {
        let mut column: Vec<f64> = column.iter().map(|e| f64::from(*e)).collect();
        let (mut ends, last) = ([0.0; 2], column.len() - 1);
        loop {
            let mut moved = 0.0;
            for i in 0..=last {
                let surplus = column[i] - well;
                if surplus > 1e-9 {
                    moved += surplus;
                    column[i] = well;
                    if i == 0 {
                        ends[0] += surplus / 2.0;
                    } else {
                        column[i - 1] += surplus / 2.0;
                    }
                    if i == last {
                        ends[1] += surplus / 2.0;
                    } else {
                        column[i + 1] += surplus / 2.0;
                    }
                }
            }
            if moved < 1e-6 {
                return (column, ends);
            }
        }
    }

    #[test]
    fn a_bright_pixel_fills_its_neighbours_evenly() {
        let mut column = [0.0f32; 11];
        column[5] = 1000.0;
        let (after, ends) = bloomed(&column, 200.0);
        assert_eq!(ends, [0.0; 2]);
        assert_eq!(after[3..8], [200.0; 5]);
        assert_eq!(after[..3], [0.0; 3]);
        // At an end one half leaves.
        let mut column = [0.0f32; 11];
        column[0] = 300.0;
        let (after, ends) = bloomed(&column, 200.0);
        assert_eq!((after[0], after[1], ends), (200.0, 50.0, [50.0, 0.0]));
        // A full column loses all surplus; a column below the well is unchanged.
        let (after, ends) = bloomed(&[250.0; 40], 200.0);
        assert_eq!((after, ends), (vec![200.0; 40], [1000.0; 2]));
        let below: Vec<f32> = (0..40).map(|i| 199.5 - i as f32).collect();
        assert_eq!(bloomed(&below, 200.0), (below.clone(), [0.0; 2]));
    }

    proptest! {
        #[test]
        fn blooming_conserves_charge_and_is_symmetric(
            column in prop::collection::vec(
                prop_oneof![4 => 0u32..900, 1 => 900u32..1100, 1 => 1000u32..9000], 1..24),
        ) {
            let column: Vec<f32> = column.iter().map(|e| *e as f32).collect();
            let well = 1000.0;
            let (after, ends) = bloomed(&column, well);
            let sum = |c: &[f32]| c.iter().map(|e| f64::from(*e)).sum::<f64>();
            prop_assert_eq!(sum(&after) + ends[0] + ends[1], sum(&column));
            prop_assert!(after.iter().all(|e| *e >= 0.0 && f64::from(*e) <= well + 1.0));
            prop_assert!(ends[0] >= 0.0 && ends[1] >= 0.0);

            let (slow, slow_ends) = toppled(&column, well);
            for (fast, slow) in after.iter().zip(&slow) {
                prop_assert!((f64::from(*fast) - slow).abs() <= 1.0 + 1e-3, "{} {}", fast, slow);
            }
            prop_assert!((ends[0] - slow_ends[0]).abs() <= 0.6 && (ends[1] - slow_ends[1]).abs() <= 0.6);

            let mut mirrored = column.clone();
            mirrored.reverse();
            let (mut back, [last, first]) = bloomed(&mirrored, well);
            back.reverse();
            for (a, b) in after.iter().zip(&back) {
                prop_assert!((a - b).abs() <= 1.0);
            }
            prop_assert!((first - ends[0]).abs() <= 1.0 && (last - ends[1]).abs() <= 1.0);
        }
    }
}
