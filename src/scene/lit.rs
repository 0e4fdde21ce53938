//! What lights pixels, points and areas alike: electrons, and the share of them on each pixel.

use super::area::Together;
use super::{AreaLight, Scene, Simulated, Source};
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

impl<'a> From<&'a AreaLight> for Lit<'a> {
    fn from(area: &'a AreaLight) -> Lit<'a> {
        Lit {
            electrons: 1.0,
            footprint: area.footprint(),
        }
    }
}

impl<'a> From<&'a Together> for Lit<'a> {
    fn from(areas: &'a Together) -> Lit<'a> {
        Lit {
            electrons: 1.0,
            footprint: areas.footprint(),
        }
    }
}

impl Scene {
    /// All that lights pixels in a frame that has only those effects that `parts` has: all area sources as one, if it has them all.
    pub fn lights<'a>(&'a self, parts: &'a Simulated) -> impl Iterator<Item = Lit<'a>> {
        let sources = self.sources.iter();
        let sources = sources.filter(|source| source.body.is_in(parts));
        let is_in = |area: &AreaLight| (area.kind.is_in)(parts);
        let all = self.areas.iter().all(is_in);
        let together = all.then_some(&self.areas_light);
        let areas = self.areas.iter().filter(move |area| !all && is_in(area));
        let areas = together
            .into_iter()
            .map(Lit::from)
            .chain(areas.map(Lit::from));
        sources.map(Lit::from).chain(areas)
    }
    /// What of its light one has not that has only those effects that `parts` has.
    pub(super) fn lights_without<'a>(
        &'a self,
        parts: &'a Simulated,
    ) -> impl Iterator<Item = Lit<'a>> {
        let sources = self.sources.iter();
        let sources = sources.filter(|source| !source.body.is_in(parts));
        let areas = self.areas.iter();
        let areas = areas.filter(|area| !(area.kind.is_in)(parts) && area.electrons > 0.0);
        sources.map(Lit::from).chain(areas.map(Lit::from))
    }
}
