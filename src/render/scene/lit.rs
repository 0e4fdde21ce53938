//! Light of a point or an area source: electrons, and their share on each pixel.

use super::area::light::Light;
use super::source::Source;
use crate::footprint::Footprint;

/// Light on pixels.
#[derive(Debug, Clone, Copy)]
pub struct Lit<'a> {
    /// Total, e-.
    pub electrons: f64,
    /// Its shares of the pixels.
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
