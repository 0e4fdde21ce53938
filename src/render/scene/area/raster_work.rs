//! Counters of the work to rasterize an area source.

use std::ops::AddAssign;

/// Numbers of evaluations.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct RasterWork {
    /// Of the radiance, one for each position.
    pub lights: usize,
    /// Of the radiance along moving positions, beyond these.
    pub smeared: usize,
    /// Of the angle from an edge.
    pub edges: usize,
    /// Of the share of light that one pixel spreads to another.
    pub spreads: usize,
}

impl AddAssign for RasterWork {
    fn add_assign(&mut self, other: RasterWork) {
        self.lights += other.lights;
        self.smeared += other.smeared;
        self.edges += other.edges;
        self.spreads += other.spreads;
    }
}
