//! The Sun, the Moon and the planets as an observer sees them.

use super::area::radiance::Area;
use crate::sky::apparent::parabola;
use nalgebra::Vector3;

/// The Sun as the view's observer sees it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SeenSun {
    /// From the boresight at mid-exposure, rad.
    pub angle: f64,
    /// The visible fraction of its disc, 0..1.
    pub lit: f64,
    /// Irradiance of its whole disc in the band, ph/s/m^2.
    pub irradiance: f64,
    /// Whether it is visible within the camera's exclusion angle: the frame then saturates.
    pub excluded: bool,
}

/// A body of the solar system as the view's observer sees it.
#[derive(Debug, Clone)]
pub struct VisiblePlanet {
    /// Its name.
    pub name: &'static str,
    /// Apparent directions of its light's centre at the start, middle and end of the view's time:
    /// unit vectors, ICRF.
    pub directions: [Vector3<f64>; 3],
    /// Apparent direction of its disc's centre at the middle of the view's time: unit vector, ICRF.
    pub centre: Vector3<f64>,
    /// V magnitude of the whole disc, in full sunlight.
    pub mag: f64,
    /// Angle Sun - body - observer at the middle of the view's time, geometric (without light time
    /// and aberration), rad.
    pub phase: f64,
    /// Distance from the observer, m, also geometric.
    pub range_m: f64,
    /// Angular radius, rad. Planets are drawn as points nevertheless.
    pub angular_radius: f64,
    /// Its elements, if it is larger than a pixel.
    pub elements: Vec<Element>,
    /// Its light by direction, if it is too large for elements.
    pub area: Option<Area>,
    /// Number of points of its image, or a number of points of equal cost.
    pub points: usize,
}

/// A small part of a disc.
#[derive(Debug, Clone, Copy)]
pub struct Element {
    /// Difference of its direction from that of the light's centre (unit vectors), rad.
    pub offset: Vector3<f64>,
    /// Its share of the light that arrives (1).
    pub share: f64,
}

impl VisiblePlanet {
    /// Its direction (any length) at a part of the view's time, on the parabola through start, mid
    /// and end.
    pub(crate) fn direction(&self, part: f64) -> Vector3<f64> {
        parabola(&self.directions, part)
    }

    /// Kind of the Moon.
    pub(crate) const MOON_KIND: &'static str = "moon";
    /// Kind of a planet.
    pub(crate) const PLANET_KIND: &'static str = "planet";

    /// Its kind: `moon` or `planet`.
    pub(crate) fn kind(&self) -> &'static str {
        if self.is_moon() {
            Self::MOON_KIND
        } else {
            Self::PLANET_KIND
        }
    }

    /// Whether it is the Moon.
    pub(crate) fn is_moon(&self) -> bool {
        self.name == MOON
    }
}

/// The Moon's name.
pub const MOON: &str = "Moon";
