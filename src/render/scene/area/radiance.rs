//! Light by direction: an area source before it is rasterized.

use crate::scene::effect_set::EffectId;
use nalgebra::Vector3;
use std::borrow::Cow;
use std::fmt::Debug;
use std::sync::Arc;

/// The light of an area source, or why there is none.
pub type Found = Result<Arc<dyn Radiance>, Cow<'static, str>>;

/// Light that depends on its direction alone.
pub trait Radiance: Debug + Send + Sync {
    /// Photon radiance in the band from a direction (unit vector, ICRF) at mid-exposure,
    /// ph/s/m^2/sr. For scattered light ([`Radiance::is_of_pixels`]): e-/s of a pixel in that
    /// direction. Ignores [`Radiance::is_hidden_inside`].
    fn toward(&self, direction: &Vector3<f64>) -> f64;

    /// Whether the inside of the edge is dark, and the rest so smooth that the middle of a pixel
    /// represents it.
    fn is_hidden_inside(&self) -> bool {
        false
    }

    /// The light that arrives from a direction: [`Radiance::toward`] where it is not hidden.
    fn seen(&self, direction: &Vector3<f64>) -> f64 {
        let edge = self.edge().filter(|_| self.is_hidden_inside());
        if edge.is_some_and(|edge| edge.angle(direction) < 0.0) {
            0.0
        } else {
            self.toward(direction)
        }
    }

    /// The edge at which the light jumps, if it may be in the field.
    fn edge(&self) -> Option<&dyn Edge> {
        None
    }

    /// Angular velocity of the pattern relative to ICRF, rad/s.
    fn turning(&self) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Size of the smallest detail other than edges, rad. 0: unknown.
    fn detail(&self) -> f64 {
        0.0
    }

    /// Whether it is independent of solid angle and transmission of the optics.
    fn is_of_pixels(&self) -> bool {
        false
    }
}

/// An edge at which light jumps.
pub trait Edge {
    /// Angle of a direction from the edge, rad: positive outside, negative inside.
    fn angle(&self, direction: &Vector3<f64>) -> f64;

    /// Radius of the circle that the edge nearly is, rad.
    fn radius(&self) -> f64;
}

/// An area source before it is rasterized.
#[derive(Debug, Clone)]
pub struct Area {
    /// Its effect.
    pub effect: EffectId,
    /// The reason to give if `radiance` was found, but lights no pixel.
    pub unlit: &'static str,
    /// Its light, or why there is none.
    pub radiance: Found,
    /// Twice the light of the brightest of a few sample pixels over the field, e-.
    pub peak_e: f64,
}

impl Area {
    /// Whether an edge of it may be in the field.
    pub(crate) fn has_edges(&self) -> bool {
        matches!(&self.radiance, Ok(radiance) if radiance.edge().is_some())
    }

    /// Its smallest detail, rad; infinite without light.
    pub(crate) fn detail(&self) -> f64 {
        let radiance = self.radiance.as_ref();
        radiance.map_or(f64::INFINITY, |radiance| radiance.detail())
    }

    /// Angular speed of its own motion, rad/s.
    pub(crate) fn angular_speed(&self) -> f64 {
        let radiance = self.radiance.as_ref();
        radiance.map_or(0.0, |radiance| radiance.turning().norm())
    }
}
