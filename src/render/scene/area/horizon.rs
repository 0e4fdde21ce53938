//! The Earth's limb relative to the field.

use super::radiance::Edge;
use crate::scene::view::View;
use crate::sky::shadow::{EARTH_FLATTENING, EARTH_RADIUS_M, Earth, LimbCone};
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// The Earth as the view's observer sees it.
#[derive(Debug, Clone, Copy)]
pub struct Horizon {
    limb: LimbCone,
    /// From the observer to the Earth's centre, m.
    distance_m: f64,
    /// Angular velocity of the direction of its centre, rad/s, ICRF.
    pub turning: Vector3<f64>,
    /// The least and the greatest angle of the moving field from the limb, rad; negative inside of
    /// it.
    reach: [f64; 2],
}

impl Horizon {
    /// The Earth as a view's observer sees it; none without an orbit.
    pub(crate) fn of(view: &View) -> Option<Horizon> {
        view.vehicle.orbit?;
        let (r, v) = (view.observer.position_m, view.observer.velocity_m_s);
        let limb = Earth::at(view.exposure.mid).limb_cone(r)?;
        let turning = r.cross(&v) / r.norm_squared();
        let motion = view.turn + turning.norm() * view.open_s;
        // The point spread function brings light from outside the detector.
        let cone = view.camera.cone_rad(MARGIN_PX) + motion / 2.0;
        let boresight = view.pointing(0.0).matrix().transpose() * Vector3::z();
        let off = limb.angle(&boresight);
        let slack = cone + SLACK;
        Some(Horizon {
            limb,
            distance_m: r.norm(),
            turning,
            reach: [off - slack, off + slack],
        })
    }

    /// Whether the Earth fills the field.
    pub(crate) fn fills(&self) -> bool {
        self.reach[1] < 0.0
    }

    /// Whether some of the Earth may be in the field.
    pub(crate) fn is_in_field(&self) -> bool {
        self.reach[0] < 0.0
    }

    /// Whether the limb may be in the field.
    pub(crate) fn has_limb(&self) -> bool {
        self.reach[0] < 0.0 && self.reach[1] > 0.0
    }

    /// The limb, where it may be in the field.
    pub(crate) fn as_edge(&self) -> Option<&dyn Edge> {
        self.has_limb().then_some(self)
    }

    /// Bound of the angle above the limb at which a height (m) is seen, rad; pi for an observer
    /// below it.
    pub(crate) fn height_of(&self, height_m: f64) -> f64 {
        let top = (EARTH_RADIUS_M + height_m) / self.distance_m;
        if top >= 1.0 {
            return std::f64::consts::PI;
        }
        libm::asin(top) - libm::asin((self.polar_radius_m() / self.distance_m).min(1.0))
    }

    /// The lowest height in the field off the Earth's disc, m: the inverse of
    /// [`Horizon::height_of`].
    pub(crate) fn lowest_m(&self) -> f64 {
        let limb = libm::asin((self.polar_radius_m() / self.distance_m).min(1.0));
        let angle = (limb + self.nearest()).clamp(0.0, FRAC_PI_2);
        self.distance_m * libm::sin(angle) - EARTH_RADIUS_M
    }

    /// The polar radius of the Earth, m.
    fn polar_radius_m(&self) -> f64 {
        EARTH_RADIUS_M * (1.0 - EARTH_FLATTENING)
    }

    /// The least angle of the field from the limb, rad.
    pub fn nearest(&self) -> f64 {
        self.reach[0]
    }
}

impl Edge for Horizon {
    fn angle(&self, direction: &Vector3<f64>) -> f64 {
        self.limb.angle(direction)
    }

    fn radius(&self) -> f64 {
        self.limb.radius
    }
}

/// Greatest distance outside the detector from which light comes, px.
const MARGIN_PX: f64 = 25.0;
/// Error of angles far from the limb of the ellipsoid, rad.
const SLACK: f64 = 0.006;
