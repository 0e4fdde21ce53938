//! Tabulated states and their interpolation.

use crate::{StateVector, time};
use hifitime::Epoch;
use nalgebra::Vector3;

/// The states of one object in one or more segments, GCRF.
#[derive(Clone, Debug)]
pub struct Ephemeris {
    /// In the order of the file; the first segment that covers an instant is used.
    pub(crate) segments: Vec<Segment>,
}

/// A sequence of states; interpolation stays within a segment.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// First line in the file.
    pub line: usize,
    /// In order of time, at least one.
    pub nodes: Vec<Node>,
    pub method: Method,
    /// Covered interval, ns since 1900 TAI, both ends included.
    pub start_ns: i128,
    pub stop_ns: i128,
    /// Line numbers and remarks on assumptions.
    pub remarks: Vec<(usize, String)>,
}

/// Interpolation and its number of nodes. Near the ends of a segment the nodes lie to one side. A
/// segment with fewer nodes uses all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Method {
    /// Lagrange's polynomial, of degree `n - 1`, through `n` positions, and another through their
    /// velocities.
    Lagrange(usize),
    /// Hermite's polynomial, of degree `2 n - 1`, through `n` positions with their velocities. The
    /// velocity is its derivative.
    Hermite(usize),
}

/// Smallest difference between the positions of two degrees that counts as divergence, m. It allows
/// for positions rounded to 1 m, since high degrees amplify the rounding.
const DIVERGED_M: f64 = 100.0;

impl Method {
    /// Degree of the polynomial.
    pub fn degree(self) -> usize {
        match self {
            Method::Lagrange(count) => count - 1,
            Method::Hermite(count) => 2 * count - 1,
        }
    }

    /// The next lower degree (7, 3 or 1), for the test of convergence.
    pub fn lower(self) -> Option<Method> {
        match self {
            Method::Lagrange(9..) => Some(Method::Lagrange(8)),
            Method::Lagrange(5..) => Some(Method::Lagrange(4)),
            Method::Hermite(5..) => Some(Method::Hermite(4)),
            Method::Hermite(3..) => Some(Method::Hermite(2)),
            Method::Hermite(_) | Method::Lagrange(3..) => Some(Method::Lagrange(2)),
            Method::Lagrange(_) => None,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// ns since 1900-01-01T00:00 TAI.
    pub tai_ns: i128,
    pub state: StateVector,
}

/// The error at an instant in no segment: the nearest covered interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotCovered {
    /// Start of the interval, UTC.
    pub start: Epoch,
    /// End of the interval, UTC.
    pub stop: Epoch,
}

impl Ephemeris {
    /// The state at `t`, GCRF, m and m/s, by the file's interpolation.
    ///
    /// # Errors
    ///
    /// `t` is in no segment; nothing is extrapolated.
    pub fn state(&self, t: Epoch) -> Result<StateVector, NotCovered> {
        let ns = time::tai_ns(t);
        match self.segments.iter().find(|s| s.distance_ns(ns) == 0) {
            Some(segment) => Ok(segment.interpolate(segment.method, ns)),
            None => Err(self.nearest(ns)),
        }
    }

    /// Remarks on assumptions, such as the Earth's rotation: the line of the first segment, and the
    /// text.
    pub(crate) fn remarks(&self) -> Vec<(usize, &str)> {
        let mut all: Vec<(usize, &str)> = Vec::new();
        for (line, text) in self.segments.iter().flat_map(|segment| &segment.remarks) {
            if all.iter().all(|(_, known)| known != text) {
                all.push((*line, text));
            }
        }
        all
    }

    /// The first and the last covered instant; there may be gaps between them.
    pub fn interval(&self) -> Option<(Epoch, Epoch)> {
        let starts = self.segments.iter().map(|segment| segment.start_ns);
        let stops = self.segments.iter().map(|segment| segment.stop_ns);
        let (first, last) = starts.min().zip(stops.max())?;
        Some((time::from_tai_ns(first), time::from_tai_ns(last)))
    }

    /// The covered intervals in order: segments that overlap or touch are merged.
    pub(crate) fn covered(&self) -> Vec<[Epoch; 2]> {
        let segments = self.segments.iter();
        let mut spans: Vec<[i128; 2]> = segments.map(|one| [one.start_ns, one.stop_ns]).collect();
        spans.sort_unstable();
        spans.dedup_by(|[start, stop], [_, before]| {
            let joins = *start <= *before;
            if joins {
                *before = (*before).max(*stop);
            }
            joins
        });
        let spans = spans.into_iter();
        spans.map(|span| span.map(time::from_tai_ns)).collect()
    }

    fn nearest(&self, ns: i128) -> NotCovered {
        let nearest = self.segments.iter().min_by_key(|s| s.distance_ns(ns));
        let (start, stop) = nearest.map_or((ns, ns), |s| (s.start_ns, s.stop_ns));
        NotCovered {
            start: time::from_tai_ns(start),
            stop: time::from_tai_ns(stop),
        }
    }
}

impl Segment {
    /// Distance of an instant from the covered interval; 0 inside.
    fn distance_ns(&self, ns: i128) -> i128 {
        (self.start_ns - ns).max(ns - self.stop_ns).max(0)
    }

    /// The largest difference in position between this degree and the next lower one, m, at the
    /// middles between nodes where the interpolation does not converge. It does not converge where
    /// this difference exceeds [`DIVERGED_M`] and the difference between the two lower degrees.
    pub fn divergence_m(&self) -> Option<f64> {
        let lower = self.method.lower()?;
        let lowest = lower.lower()?;
        let pairs = self.nodes.iter().zip(self.nodes.iter().skip(1));
        let middles = pairs.map(|(a, b)| a.tai_ns + (b.tai_ns - a.tai_ns) / 2);
        let off_m = middles.filter_map(|ns| {
            let at = |method| self.interpolate(method, ns).position_m;
            let middle = at(lower);
            let [up, down] = [self.method, lowest].map(|method| (at(method) - middle).norm());
            // NaN does not converge.
            let converges = up <= DIVERGED_M.max(down);
            (!converges).then_some(up)
        });
        off_m.max_by(f64::total_cmp)
    }

    fn interpolate(&self, method: Method, ns: i128) -> StateVector {
        let (Method::Lagrange(count) | Method::Hermite(count)) = method;
        let window = self.window(count, ns);
        // Seconds from the given instant: small numbers, exact differences.
        let x = |node: &Node| (node.tai_ns - ns) as f64 / 1e9;
        let mut state = StateVector {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
        };
        for (j, node) in window.iter().enumerate() {
            let (xj, r, v) = (x(node), node.state.position_m, node.state.velocity_m_s);
            // Lagrange's basis L_j(t) = prod_{k != j} (t - x_k) / (x_j - x_k): its value and
            // derivative at t = 0, and its derivative at x_j, sum_{k != j} 1 / (x_j - x_k)
            let (mut value, mut slope, mut own_slope) = (1.0, 0.0, 0.0);
            for (_, other) in window.iter().enumerate().filter(|&(k, _)| k != j) {
                let per = 1.0 / (xj - x(other));
                let factor = -x(other) * per;
                slope = slope * factor + value * per;
                value *= factor;
                own_slope += per;
            }
            match method {
                Method::Lagrange(_) => {
                    state.position_m += r * value;
                    state.velocity_m_s += v * value;
                }
                // r(t) = sum_j L_j(t)^2 ((1 - 2 L_j'(x_j) (t - x_j)) r_j + (t - x_j) v_j)
                // (Burden & Faires, Numerical Analysis, 9th edition, theorem 3.9), and dr/dt
                Method::Hermite(_) => {
                    let (square, square_slope) = (value * value, 2.0 * value * slope);
                    let share = 1.0 + 2.0 * own_slope * xj;
                    state.position_m += (r * share - v * xj) * square;
                    state.velocity_m_s +=
                        (r * share - v * xj) * square_slope + (v - r * (2.0 * own_slope)) * square;
                }
            }
        }
        state
    }

    /// The `count` nodes around an instant, shifted inward at the ends.
    fn window(&self, count: usize, ns: i128) -> &[Node] {
        let count = count.min(self.nodes.len());
        let after = self.nodes.partition_point(|node| node.tai_ns <= ns);
        // An odd count is centred on the nearer neighbour.
        let nearer_before = match (self.nodes.get(after.wrapping_sub(1)), self.nodes.get(after)) {
            (Some(before), Some(next)) => ns - before.tai_ns < next.tai_ns - ns,
            _ => true,
        };
        let shift = count % 2 == 1 && nearer_before;
        let first = after
            .saturating_sub(count / 2 + usize::from(shift))
            .min(self.nodes.len() - count);
        &self.nodes[first..first + count]
    }
}
