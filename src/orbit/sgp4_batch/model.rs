//! Interface of the blocks of all kinds of orbits.

use super::constants::ModelConstants;
use super::lanes::{Lanes, Part};
use super::orbit_kind::OrbitKind;
use super::secular::{Secular, When};
use super::short_period::Perturbed;
use crate::elements::Elements;
use pulp::Simd;

/// A block of one kind of orbits.
pub trait Model: Default + Send + Sync {
    const KIND: OrbitKind;

    fn set(&mut self, i: usize, elements: &Elements, constants: &ModelConstants);
    /// Integrates to less than a step before an instant, and stores the integrator's state.
    fn advance<S: Simd>(&mut self, _: Part<S>, _: When) {}
    fn secular(&self) -> &Secular;
    /// The mean elements `t` min after the epochs, with all but the short-period perturbations.
    fn perturbed<S: Simd>(&self, part: Part<S>, t: Lanes<S>) -> Perturbed<S>;
}
