//! Sources that are points or small discs, and their images.

use super::area::radiance::Area;
use super::effect_set::EffectId;
use super::solar_system::{Element, VisiblePlanet};
use crate::attitude::angle_between;
use crate::footprint::{Footprint, Light};
use crate::sky::population::SeenObject;
use crate::sky::star_field::SeenStar;
use nalgebra::Vector3;
use std::sync::Arc;

/// The kind of a source.
#[derive(Debug, Clone)]
pub enum Body {
    /// A star of the catalogue.
    Star(SeenStar),
    /// A resident space object.
    Rso(Arc<SeenObject>),
    /// The Moon or a planet.
    Planet(Box<VisiblePlanet>),
}

impl Body {
    /// The effect that draws it.
    pub(crate) fn effect(&self) -> EffectId {
        match self {
            Body::Star(_) => EffectId::Stars,
            Body::Rso(_) => EffectId::Rsos,
            Body::Planet(body) if body.is_moon() => EffectId::Moon,
            Body::Planet(_) => EffectId::Planets,
        }
    }

    /// Mean wavelength of its light over the band's reference: all but stars have the Sun's colour.
    pub(crate) fn wavelength_ratio(&self) -> f64 {
        match self {
            Body::Star(star) => star.wavelength_ratio,
            Body::Rso(_) | Body::Planet(_) => 1.0,
        }
    }

    /// Its apparent line of sight (ICRF axes, any length) at a part of the view's time (0: start,
    /// 1: end). For stars always that of mid-exposure.
    pub(crate) fn line(&self, part: f64) -> Vector3<f64> {
        match self {
            Body::Star(star) => star.direction,
            Body::Rso(object) => object.line_m(part),
            Body::Planet(body) => body.direction(part),
        }
    }

    /// The angle of its own apparent motion in the view's time, rad.
    fn own_motion(&self) -> f64 {
        match self {
            Body::Star(_) => 0.0,
            Body::Rso(_) | Body::Planet(_) => {
                let line = |part: f64| self.line(part);
                let [start, mid, end] = [0.0, 0.5, 1.0].map(line);
                angle_between(&start, &mid) + angle_between(&mid, &end)
            }
        }
    }

    /// A unique key.
    pub fn identity(&self) -> (&'static str, usize) {
        match self {
            Body::Star(star) => ("star", star.index),
            Body::Rso(object) => ("rso", object.index),
            Body::Planet(body) => (body.name, 0),
        }
    }

    /// The elements of its disc; none of a point.
    pub(crate) fn elements(&self) -> &[Element] {
        match self {
            Body::Planet(body) => &body.elements,
            Body::Star(_) | Body::Rso(_) => &[],
        }
    }

    /// Its light by direction, if it is too large for elements.
    pub(crate) fn area(&self) -> Option<&Area> {
        match self {
            Body::Planet(body) => body.area.as_ref(),
            Body::Star(_) | Body::Rso(_) => None,
        }
    }

    /// Number of points of its image, or a number of points of equal cost.
    pub(crate) fn points(&self) -> usize {
        match self {
            Body::Planet(body) => body.points,
            Body::Star(_) | Body::Rso(_) => 1,
        }
    }
}

/// Reasons why no light of a source arrives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hidden {
    /// It is behind the Earth.
    ByEarth,
    /// It is behind the Moon.
    ByMoon,
    /// It is in the Earth's umbra.
    InShadow,
}

/// A point source in the field.
#[derive(Debug, Clone)]
pub struct Source {
    /// Its kind.
    pub body: Body,
    /// Its image when its row opens (or where it enters the camera's half space), px.
    pub start: [f64; 2],
    /// Its image when its row closes (or where it leaves the camera's half space), px.
    pub end: [f64; 2],
    /// Flux-weighted centre of all its light, px.
    pub centroid: [f64; 2],
    /// Its share on each pixel.
    pub footprint: Footprint,
    /// Electrons of all light that arrives at the aperture in the exposure.
    pub arriving_e: f64,
    /// Expected electrons after vignetting and shutter in the exposure, on and off the detector.
    pub electrons: f64,
    /// The same if it were neither hidden nor shaded.
    pub clear_e: f64,
    /// Why no light arrives, if hidden.
    pub hidden: Option<Hidden>,
    /// Signal-to-noise ratio on the detector.
    pub snr: f64,
    /// The same if it were neither hidden nor shaded: decides whether labels list it.
    pub clear_snr: f64,
}

impl Source {
    /// Length of its path from start through centroid to end, px.
    pub fn length_px(&self) -> f64 {
        let distance = |a: [f64; 2], b: [f64; 2]| libm::hypot(a[0] - b[0], a[1] - b[1]);
        distance(self.start, self.centroid) + distance(self.centroid, self.end)
    }
}

/// A source near the field, before its image is formed.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Its kind.
    pub body: Body,
    /// Electrons of all its light in the exposure, if it were neither hidden nor shaded.
    pub clear_e: f64,
    /// The arriving fraction of that light (1).
    pub light: f64,
    /// Why none arrives, if hidden.
    pub hidden: Option<Hidden>,
    /// The angle of its own apparent motion in the view's time, rad.
    pub(super) own_motion: f64,
}

impl Candidate {
    /// A body with its light, and the part that arrives.
    pub(crate) fn new(body: Body, clear_e: f64, light: f64, hidden: Option<Hidden>) -> Candidate {
        Candidate {
            own_motion: body.own_motion(),
            body,
            clear_e,
            light,
            hidden,
        }
    }

    /// The amount and the colour of its light.
    pub(crate) fn light(&self) -> Light {
        Light {
            electrons: self.clear_e,
            wavelength_ratio: self.body.wavelength_ratio(),
        }
    }

    /// Electrons of its light that arrives.
    pub(crate) fn electrons(&self) -> f64 {
        match self.hidden {
            Some(_) => 0.0,
            None => self.clear_e * self.light,
        }
    }
}
