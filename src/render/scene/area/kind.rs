//! Kinds of area sources: the effect, and the function that finds the light.

use super::plane::{Plane, received};
use super::radiance::{Area, Found, Radiance};
use super::surroundings::Surroundings;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::view::View;
use crate::scene::world::World;
use nalgebra::Vector3;
use std::fmt;

/// Samples of the radiance along a side of the field, before it is rasterized.
const SAMPLES: usize = 4;

/// A kind of area source.
#[derive(Clone, Copy)]
pub struct Kind {
    /// Its effect.
    pub effect: EffectId,
    /// Finds its light.
    pub radiance: fn(&World, &View, &Surroundings) -> Found,
    /// The reason to give if light was found, but lights no pixel.
    pub unlit: &'static str,
}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.effect.fmt(f)
    }
}

/// The area sources of those `kinds` whose effect `runs`.
pub(crate) fn areas(
    view: &View,
    world: &World,
    kinds: impl Iterator<Item = Kind>,
    runs: &EffectSet,
) -> Vec<Area> {
    let ideal = Plane::new(view, &EffectSet::default(), Vector3::zeros());
    let around = Surroundings::of(view);
    let kinds = kinds.filter(|kind| runs.has(kind.effect));
    let areas = kinds.map(|kind| {
        let radiance = (kind.radiance)(world, view, &around);
        let peak_e = match &radiance {
            Ok(radiance) => 2.0 * brightest_e(radiance.as_ref(), &ideal),
            Err(_) => 0.0,
        };
        Area {
            effect: kind.effect,
            unlit: kind.unlit,
            radiance,
            peak_e,
        }
    });
    areas.collect()
}

/// The light of the brightest of a few sample pixels over the field, e-.
fn brightest_e(radiance: &dyn Radiance, plane: &Plane<'_>) -> f64 {
    let [columns, rows] = plane.detector().sides();
    let (scale_e, sky) = (plane.scale_e(radiance), plane.to_sky(0.0));
    let part = |i: usize| i as f64 / (SAMPLES - 1) as f64;
    let samples = (0..SAMPLES * SAMPLES).map(|i| {
        let at = [
            part(i % SAMPLES) * (columns - 1.0),
            part(i / SAMPLES) * (rows - 1.0),
        ];
        plane
            .solid_angle_sr(at)
            .map_or(0.0, |(seen, solid_angle_sr)| {
                received(radiance, &(sky * seen), solid_angle_sr) * scale_e
            })
    });
    samples.fold(0.0, f64::max)
}
