//! From direction to pixel: pinhole projection, aperture and transmission.

use super::{Band, LocalPsf, Psf};
use nalgebra::Vector3;

/// The optics of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Optics {
    /// Focal length in pixels (focal length / pixel pitch).
    pub focal_px: f64,
    /// Where the boresight meets the detector, px.
    pub principal_px: [f64; 2],
    /// Diameter of the entrance pupil, m.
    pub aperture_m: f64,
    /// Share of the light in the band that passes (1).
    pub transmission: f64,
    /// The band.
    pub band: Band,
    /// The point spread function.
    pub psf: Psf,
}

impl Optics {
    /// `A_app` of Clark et al. 2021, Eq. (2): `pi D^2 / 4`, m^2.
    pub fn aperture_area_m2(&self) -> f64 {
        std::f64::consts::PI * self.aperture_m * self.aperture_m / 4.0
    }

    /// The point spread function at a pixel; for `wavelength_ratio` see [`Psf::at`].
    pub fn psf_at(&self, pixel: [f64; 2], wavelength_ratio: f64) -> LocalPsf<'_> {
        let field_px = [0, 1].map(|axis| pixel[axis] - self.principal_px[axis]);
        self.psf.at(field_px, wavelength_ratio)
    }

    /// The pixel `[column, row]` of a direction in camera axes; none behind the camera.
    ///
    /// Pinhole: `x = cx + f X / Z`, `y = cy + f Y / Z`.
    pub fn project(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        if direction.z <= 1e-6 * direction.norm() {
            return None;
        }
        Some([
            self.principal_px[0] + self.focal_px * direction.x / direction.z,
            self.principal_px[1] + self.focal_px * direction.y / direction.z,
        ])
    }

    /// The unit direction in camera axes of a pixel; the inverse of [`Optics::project`].
    pub fn direction(&self, pixel: [f64; 2]) -> Vector3<f64> {
        Vector3::new(
            (pixel[0] - self.principal_px[0]) / self.focal_px,
            (pixel[1] - self.principal_px[1]) / self.focal_px,
            1.0,
        )
        .normalize()
    }
}
