//! Tabulated states and the states between them.

use crate::{StateVector, time};
use hifitime::Epoch;
use nalgebra::Vector3;

/// The states of one object in one or more segments, GCRF.
#[derive(Clone, Debug)]
pub struct Ephemeris {
    /// In the order of the file; where two share an instant, the first answers.
    pub(crate) segments: Vec<Segment>,
}

/// A stretch of states that one interpolation may run through.
#[derive(Clone, Debug)]
pub(crate) struct Segment {
    /// In order of time, at least one.
    pub nodes: Vec<Node>,
    /// Degree of the interpolating polynomial.
    pub degree: usize,
    /// Interval that is answered, ns since 1900 TAI, both ends included.
    pub start_ns: i128,
    pub stop_ns: i128,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// ns since 1900-01-01T00:00 TAI.
    pub tai_ns: i128,
    pub state: StateVector,
}

/// The covered interval nearest to an epoch that is not covered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NotCovered {
    /// Start of the interval, UTC.
    pub start: Epoch,
    /// End of the interval, UTC.
    pub stop: Epoch,
}

impl Ephemeris {
    /// The state at `t`, GCRF, m and m/s.
    ///
    /// Position and velocity are each interpolated by Lagrange's polynomial
    /// through the `degree + 1` nodes around `t`: as many before as after,
    /// fewer near the ends of a segment. A segment with fewer nodes uses all.
    ///
    /// Error: `t` is in no segment; nothing is extrapolated.
    pub fn state(&self, t: Epoch) -> Result<StateVector, NotCovered> {
        let ns = t.to_tai_duration().total_nanoseconds();
        match self.segments.iter().find(|s| s.distance_ns(ns) == 0) {
            Some(segment) => Ok(segment.interpolate(ns)),
            None => Err(self.nearest(ns)),
        }
    }

    /// The first and the last instant that it covers; there may be gaps between them.
    pub fn interval(&self) -> Option<(Epoch, Epoch)> {
        let starts = self.segments.iter().map(|segment| segment.start_ns);
        let stops = self.segments.iter().map(|segment| segment.stop_ns);
        let (first, last) = starts.min().zip(stops.max())?;
        Some((time::from_tai_ns(first), time::from_tai_ns(last)))
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
    /// How far outside the answered interval an instant is; 0 inside.
    fn distance_ns(&self, ns: i128) -> i128 {
        (self.start_ns - ns).max(ns - self.stop_ns).max(0)
    }

    fn interpolate(&self, ns: i128) -> StateVector {
        let window = self.window(ns);
        // seconds from the asked instant: small numbers, exact differences
        let x = |node: &Node| (node.tai_ns - ns) as f64 / 1e9;
        let mut state = StateVector {
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::zeros(),
        };
        for (j, node) in window.iter().enumerate() {
            // w_j = prod_{k != j} x_k / (x_k - x_j), Lagrange's basis at x = 0
            let weight: f64 = (window.iter().enumerate())
                .filter(|&(k, _)| k != j)
                .map(|(_, other)| x(other) / (x(other) - x(node)))
                .product();
            state.position_m += node.state.position_m * weight;
            state.velocity_m_s += node.state.velocity_m_s * weight;
        }
        state
    }

    /// The `degree + 1` nodes centred on an instant, moved inward at the ends.
    fn window(&self, ns: i128) -> &[Node] {
        let count = (self.degree + 1).min(self.nodes.len());
        let after = self.nodes.partition_point(|node| node.tai_ns <= ns);
        // an odd count is centred on the nearer of the two neighbours
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
