//! What lights pixels, points and areas alike: electrons, and the share of them on each pixel.

use super::area::Light;
use super::{AreaLight, EffectSet, Scene, Source};
use crate::footprint::Footprint;

/// Light on pixels.
#[derive(Debug, Clone, Copy)]
pub struct Lit<'a> {
    /// All of it, e-.
    pub electrons: f64,
    /// Where it falls.
    pub footprint: &'a Footprint,
}

impl<'a> From<&'a Source> for Lit<'a> {
    fn from(source: &'a Source) -> Lit<'a> {
        Lit {
            electrons: source.electrons,
            footprint: &source.footprint,
        }
    }
}

impl<'a> From<&'a Light> for Lit<'a> {
    fn from(light: &'a Light) -> Lit<'a> {
        Lit {
            electrons: 1.0,
            footprint: light.footprint(),
        }
    }
}

impl Scene {
    /// All that lights pixels in a frame that has only those effects that `parts` has.
    pub fn lights<'a>(&'a self, parts: &'a EffectSet) -> impl Iterator<Item = Lit<'a>> {
        let sources = self.sources.iter();
        let sources = sources.filter(|source| parts.has(source.body.effect()));
        let areas = self.area_lights(parts).into_iter();
        sources.map(Lit::from).chain(areas.map(Lit::from))
    }

    /// The light of its area sources: of all of them as one, if it has them all.
    pub(super) fn area_lights(&self, parts: &EffectSet) -> Vec<&Light> {
        let is_in = |area: &&AreaLight| parts.has(area.kind.effect);
        if self.areas.iter().all(|area| is_in(&area)) {
            return self.areas_light.light().into_iter().collect();
        }
        let areas = self.areas.iter().filter(is_in);
        areas.filter_map(AreaLight::light).collect()
    }

    /// The light of the area sources that it has not.
    pub(super) fn area_lights_without(&self, parts: &EffectSet) -> Vec<&Light> {
        let areas = self.areas.iter();
        let areas = areas.filter(|area| !parts.has(area.kind.effect));
        areas.filter_map(AreaLight::light).collect()
    }
}
