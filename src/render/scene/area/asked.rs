//! Counters of the work of rasterizing an area source.

use std::ops::AddAssign;

/// How many evaluations rasterizing took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Requested {
    /// Of the radiance, one for each place.
    pub lights: usize,
    /// Further ones, for places that move.
    pub smeared: usize,
    /// Of the angle from an edge.
    pub edges: usize,
    /// Of the share of light that one pixel spreads to another.
    pub spreads: usize,
}

impl AddAssign for Requested {
    fn add_assign(&mut self, other: Requested) {
        self.lights += other.lights;
        self.smeared += other.smeared;
        self.edges += other.edges;
        self.spreads += other.spreads;
    }
}
