//! The Earth's disc: sunlight from its day side.
//!
//! Each piece of the WGS84 ellipsoid reflects as a Lambert surface. Its radiance over the Sun's
//! irradiance at 1 au is, in any band,
//!
//! ```text
//! L / E_sun = A cos(i) / pi * (1 au / d)^2     [1/sr]
//! ```
//!
//! with `A` the albedo, `i` the angle between the ellipsoid's normal and the Sun, `d` the Sun's
//! distance: Lambert's law. Its integral over a sphere is Eq. (7) of Clark et al. 2021. The night
//! side is dark. Their Eq. (3) gives the radiance of m magnitudes per square arcsecond,
//! `L = E_zero 10^(-0.4 m) (180 / pi)^2 3600^2`.
//!
//! Not modelled: clouds, oceans and continents (real albedos are 0.05 to 0.9; this is their mean),
//! sun glint on water, the brightening of the real disc toward full phase, the penumbra at the
//! terminator (0.5 deg). Light scattered above the ground is in [`atmosphere`](super::atmosphere).

use super::bodies::AU_M;
use super::shadow::{EARTH_RADIUS_M, Earth};
use nalgebra::Vector3;
use std::f64::consts::PI;

/// Bond albedo of the Earth, air and clouds included: 0.31 (107 of 342 W/m^2; Kiehl & Trenberth
/// 1997, BAMS 78, 197) to 0.29 by later budgets.
pub const EARTH_ALBEDO: f64 = 0.3;

/// Golden angle, rad: points of a spiral with this step in azimuth cover a disc evenly.
const GOLDEN_ANGLE: f64 = PI * (3.0 - 2.236_067_977_499_79);

/// The Earth for one observer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EarthDisc {
    observer_m: Vector3<f64>,
    sun_m: Vector3<f64>,
    earth: Earth,
}

/// A part of the Earth's disc.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Patch {
    /// Unit vector toward its middle, GCRF axes.
    pub direction: Vector3<f64>,
    /// Irradiance on a surface that faces it, over the Sun's irradiance at 1 au (1).
    pub irradiance: f64,
}

impl EarthDisc {
    /// The Earth from `observer_m`, lit from `sun_m`
    /// ([`Bodies::sun_apparent_m`](super::bodies::Bodies::sun_apparent_m)); both GCRF, m. None for
    /// an observer inside the Earth, such as the fictitious one at its centre.
    pub fn new(observer_m: Vector3<f64>, sun_m: Vector3<f64>, earth: Earth) -> Option<Self> {
        (!earth.contains(observer_m)).then_some(EarthDisc {
            observer_m,
            sun_m,
            earth,
        })
    }

    /// Radiance along `direction` (GCRF axes, any length) over the Sun's irradiance at 1 au, 1/sr;
    /// 0 where the line misses the Earth or ends on its night side, and for input that is not
    /// finite.
    pub fn reflectance(&self, direction: &Vector3<f64>) -> f64 {
        let Some(point_m) = self.earth.meets(self.observer_m, *direction) else {
            return 0.0;
        };
        let to_sun = self.sun_m - point_m;
        let distance2 = to_sun.norm_squared();
        let cos_i = self.earth.normal(point_m).dot(&to_sun) / distance2.sqrt();
        (EARTH_ALBEDO * cos_i / PI * (AU_M * AU_M / distance2)).max(0.0)
    }

    /// Minimum and maximum angle (rad) of the limb from the direction of the Earth's centre, see
    /// [`Earth::outline`].
    pub fn edge(&self) -> [f64; 2] {
        self.earth.outline(self.observer_m, 0.0)
    }

    /// The lit part of the disc in at most `n` patches of nearly the same solid angle, with their
    /// irradiances on a surface that faces them.
    ///
    /// Sums of smooth functions over a thousand patches err by some 0.1 %, over a hundred by 1 %.
    pub fn patches(&self, n: usize) -> Vec<Patch> {
        let patch = |k: usize| {
            let (direction, solid_angle) =
                self.within((k as f64 + 0.5) / n as f64, k as f64 * GOLDEN_ANGLE);
            let irradiance = self.reflectance(&direction) * solid_angle / n as f64;
            (irradiance > 0.0).then_some(Patch {
                direction,
                irradiance,
            })
        };
        (0..n).filter_map(patch).collect()
    }

    /// The direction (unit vector) at the position angle `turn` (rad) with the fraction `part` of
    /// the disc nearer to its centre; and the solid angle (sr) of the disc at the local scale.
    ///
    /// In stretched space the Earth is a sphere, its disc a cone of half angle rho, sin(rho) = a /
    /// r, and solid angle 4 pi sin^2(rho / 2). The part within an angle theta from its axis is
    /// (sin(theta / 2) / sin(rho / 2))^2. Unstretching multiplies a solid angle in direction d by
    /// det(S)^-1 |S^-1 d|^-3.
    fn within(&self, part: f64, turn: f64) -> (Vector3<f64>, f64) {
        let observer = self.earth.to_sphere(self.observer_m);
        let distance = observer.norm();
        let axis = observer / -distance;
        let sin = (EARTH_RADIUS_M / distance).min(1.0);
        let half = sin * sin / (2.0 * (1.0 + ((1.0 - sin) * (1.0 + sin)).sqrt())); // sin^2(rho / 2)
        let sin_half2 = half * part;
        let side = self.earth.across(axis, turn);
        let sin_theta = 2.0 * (sin_half2 * (1.0 - sin_half2)).sqrt();
        let stretched = axis * (1.0 - 2.0 * sin_half2) + side * sin_theta;
        let direction = self.earth.unstretched(stretched);
        let length = direction.norm();
        let shrink = self.earth.unstretched(self.earth.pole()).norm();
        let solid_angle = 4.0 * PI * half * shrink / (length * length * length);
        (direction / length, solid_angle)
    }
}
