//! Reflection of a surface: Lambert's law, and a lobe about the mirror direction.

use std::f64::consts::PI;

/// Reflective properties of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Reflectance `rho` (1).
    pub reflectance: f64,
    /// Hejduk's diffuse mixing coefficient `B_diff` (1).
    pub diffuse: f64,
    /// Hejduk's specular mixing coefficient `B_spec` (1).
    pub specular: f64,
    /// Distribution of the specular light.
    pub lobe: Lobe,
}

/// Width of the specular light about the mirror direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Lobe {
    /// A mirror: the lobe ends at the angular radius of the Sun's disc.
    Mirror,
    /// A glossy surface: the lobe ends at this angle (rad), from [`Lobe::NARROWEST`] to pi / 2.
    Smooth(f64),
}

/// Distribution of the specular light of a surface element over directions: a cap about the mirror
/// direction.
///
/// With `x = (1 - cos a) / (1 - cos w)`, `a` the angle from the mirror direction and `w` the cap's
/// radius, its density (1/sr) is
///
/// ```text
/// L = (k + 1) (1 - x)^k / (2 pi (1 - cos w))   for x < 1, else 0
/// ```
///
/// whose integral over all directions is 1 for any `w`. A mirror (`k = 0`) shows the Sun's disc:
/// its radiance is the Sun's, so a lossless one fills the Sun's solid angle and no more. A glossy
/// surface has `k = 2`, which ends smoothly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Cap {
    /// Radius of the cap, rad.
    edge: f64,
    /// `1 - cos` of it.
    depth: f64,
    /// Whether the power `k` is 2; else it is 0.
    smooth: bool,
}

impl Lobe {
    /// The narrowest smooth lobe, rad. Its peak density is three times its mean: narrower than
    /// sqrt(3) times the Sun's radius (0.470 deg in January, rounded up here) it would be brighter
    /// than the Sun.
    pub const NARROWEST: f64 = 0.5 * PI / 180.0;

    /// Its distribution for an angular radius `sun_radius` (rad) of the Sun's disc.
    pub(crate) fn cap(self, sun_radius: f64) -> Cap {
        let (edge, smooth) = match self {
            Lobe::Mirror => (sun_radius, false),
            Lobe::Smooth(edge) => (edge.clamp(Lobe::NARROWEST, PI / 2.0), true),
        };
        let half = libm::sin(edge / 2.0);
        Cap {
            edge,
            depth: 2.0 * half * half,
            smooth,
        }
    }
}

impl Cap {
    /// Radius, rad.
    pub fn edge(&self) -> f64 {
        self.edge
    }

    /// Cosine of the radius.
    pub fn cos_edge(&self) -> f64 {
        1.0 - self.depth
    }

    /// Density (1/sr) by the cosine of the angle from the mirror direction.
    pub fn density(&self, cos: f64) -> f64 {
        let within = 1.0 - (1.0 - cos) / self.depth;
        if within <= 0.0 {
            return 0.0;
        }
        let mean = 1.0 / (2.0 * PI * self.depth);
        if self.smooth {
            3.0 * within * within * mean
        } else {
            mean
        }
    }
}

impl Surface {
    /// Eq. (6) of a lit and visible surface element, per area (1/sr):
    /// `rho (B_diff F_diff + B_spec F_spec)` with
    ///
    /// ```text
    /// F_diff = (n . s) (n . o) / pi
    /// F_spec = (n . s) [L(r . o) + L(-s . o)],   r = 2 (n . s) n - s
    /// ```
    ///
    /// for the cosines `sun = n . s` and `seen = n . o`, both above 0, `apart = s . o`, and its
    /// lobe's `cap`. At grazing incidence a part of the lobe would enter the surface. The second
    /// term of `F_spec` reflects that part, so that no light is lost.
    pub(crate) fn reflected(&self, sun: f64, seen: f64, apart: f64, cap: &Cap) -> f64 {
        let mirrored = 2.0 * sun * seen - apart;
        let lobes = cap.density(mirrored) + cap.density(-apart);
        self.reflectance * (self.diffuse * sun * seen / PI + self.specular * sun * lobes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sky::bodies::{AU_M, SUN_RADIUS_M};

    #[test]
    fn lobe_conserves_light_and_is_at_most_as_bright_as_the_sun() {
        const STEPS: usize = 200_000;
        // X-Val: the Earth's orbit has an eccentricity of 0.0167.
        for distance_m in [0.983 * AU_M, AU_M, 1.017 * AU_M] {
            let sun_radius = (SUN_RADIUS_M / distance_m).asin();
            let solid_angle = PI * (SUN_RADIUS_M / distance_m).powi(2);
            for lobe in [
                Lobe::Mirror,
                Lobe::Smooth(0.0),
                Lobe::Smooth(0.3),
                Lobe::Smooth(PI / 2.0),
            ] {
                let cap = lobe.cap(sun_radius);
                // Equal steps of the cosine are equal steps of the solid angle.
                let ring = 2.0 * PI * cap.depth / STEPS as f64;
                let at = |i: usize| 1.0 - cap.depth * (i as f64 + 0.5) / STEPS as f64;
                let all: f64 = (0..STEPS).map(|i| cap.density(at(i)) * ring).sum();
                assert!((all - 1.0).abs() < 1e-6, "{lobe:?}: {all}");
                assert!(cap.density(1.0) <= 1.0001 / solid_angle, "{lobe:?}");
                assert_eq!(cap.density(cap.cos_edge() - 1e-9), 0.0);
            }
        }
    }
}
