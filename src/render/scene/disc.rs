//! The Moon's disc if it is too large for points: rasterized like an area source.

use super::area::radiance::{Area, Edge, Radiance};
use super::effect_set::EffectId;
use super::moonlight::sunlit;
use crate::sky::Observer;
use crate::sky::moon::MoonDisc;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;
use std::sync::Arc;

const UNLIT: &str = "no lit part of the Moon is in the field";

/// The disc as one observer sees it.
#[derive(Debug)]
pub(crate) struct LargeDisc {
    /// Its position and brightness by direction.
    pub disc: MoonDisc,
    /// The observer.
    pub observer: Observer,
    /// The Earth, which may hide or shadow it.
    pub earth: Earth,
    /// Whether the Earth hides some of it.
    pub behind: bool,
    /// Photon irradiance of all its light, in full sunlight, ph/s/m^2.
    pub irradiance: f64,
    /// Angular velocity of its direction, ICRF, rad/s.
    pub turning: Vector3<f64>,
}

impl LargeDisc {
    /// The area source; `peak_e` is twice the light of its brightest pixel, e-.
    pub fn area(self, peak_e: f64) -> Area {
        Area {
            effect: EffectId::Moon,
            unlit: UNLIT,
            radiance: Ok(Arc::new(self)),
            peak_e,
        }
    }
}

impl Radiance for LargeDisc {
    fn toward(&self, direction: &Vector3<f64>) -> f64 {
        let share = self.disc.brightness(direction);
        let position_m = self.observer.position_m;
        if share == 0.0 || self.behind && self.earth.occults_direction(position_m, *direction) {
            return 0.0;
        }
        self.irradiance * share * sunlit(direction, &self.disc, &self.earth, &self.observer)
    }

    fn edge(&self) -> Option<&dyn Edge> {
        Some(self)
    }

    fn turning(&self) -> Vector3<f64> {
        self.turning
    }
}

impl Edge for LargeDisc {
    fn angle(&self, direction: &Vector3<f64>) -> f64 {
        let toward = &self.disc.direction;
        let off = libm::atan2(toward.cross(direction).norm(), toward.dot(direction));
        let limb = off - self.disc.angular_radius;
        if !self.behind {
            return limb;
        }
        limb.max(-self.earth.limb_angle(self.observer.position_m, direction))
    }

    fn radius(&self) -> f64 {
        self.disc.angular_radius
    }
}
