//! Direction to pixel: projection, aperture, transmission and point spread function.

use super::band::Band;
use super::projection::{Model, Projection};
use super::psf::{LocalPsf, Psf};
use super::stray::Stray;
use super::vignetting::Vignetting;
use nalgebra::Vector3;

/// The optics of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Optics {
    /// Focal length in pixels (focal length / pixel pitch).
    pub focal_px: f64,
    /// Position of the boresight on the detector, px.
    pub principal_px: [f64; 2],
    /// Diameter of the entrance pupil, m.
    pub aperture_m: f64,
    /// Share of the light in the band that passes (1).
    pub transmission: f64,
    /// The band.
    pub band: Band,
    /// From direction to the detector plane.
    pub projection: Projection,
    /// Transmission off the boresight.
    pub vignetting: Vignetting,
    /// The point spread function.
    pub psf: Psf,
    /// Scatter from outside the image, and the Sun's exclusion angle.
    pub stray: Stray,
}

impl Optics {
    /// `A_app` of Clark et al. 2021, Eq. (2): `pi D^2 / 4`, m^2.
    pub fn aperture_area_m2(&self) -> f64 {
        std::f64::consts::PI * self.aperture_m * self.aperture_m / 4.0
    }

    /// The point spread function at a pixel; for `wavelength_ratio` see [`Psf::at`].
    pub fn psf_at(&self, pixel: [f64; 2], wavelength_ratio: f64) -> LocalPsf<'_> {
        self.psf.at(self.offset(pixel), wavelength_ratio)
    }

    /// The centroid of the light of a source whose image is at a pixel.
    #[inline]
    pub(crate) fn lit(&self, pixel: [f64; 2]) -> [f64; 2] {
        if self.psf.is_symmetric() {
            return pixel;
        }
        let [x, y] = self.psf.offset_px(self.offset(pixel));
        [pixel[0] + x, pixel[1] + y]
    }

    /// The pixel `[column, row]` of a direction in camera axes; none where it has no image.
    pub fn project(&self, direction: &Vector3<f64>) -> Option<[f64; 2]> {
        self.project_by(&self.projection, direction)
    }

    /// Its projection, or the ideal one if `distorts` is false.
    pub(crate) fn projection_if(&self, distorts: bool) -> Projection {
        if distorts {
            self.projection
        } else {
            self.projection.ideal()
        }
    }

    /// [`Optics::project`] by another projection, such as the ideal one: `x = cx + f x'`,
    /// `y = cy + f y'`.
    pub fn project_by(
        &self,
        projection: &Projection,
        direction: &Vector3<f64>,
    ) -> Option<[f64; 2]> {
        let [x, y] = projection.image(direction)?;
        let [cx, cy] = self.principal_px;
        if *projection.model() == Model::Pinhole {
            // Saves one rounding.
            return Some([
                cx + self.focal_px * direction.x / direction.z,
                cy + self.focal_px * direction.y / direction.z,
            ]);
        }
        Some([cx + self.focal_px * x, cy + self.focal_px * y])
    }

    /// The unit direction (camera axes) of a pixel: the inverse of [`Optics::project`]. For a pixel
    /// beyond the projection's end, the last valid direction on the line from the principal point.
    pub fn direction(&self, pixel: [f64; 2]) -> Vector3<f64> {
        if let Some(direction) = self.seen_at(pixel) {
            return direction;
        }
        let at = self.offset(pixel).map(|px| px / self.focal_px);
        let (mut inside, mut outside) = (0.0, 1.0);
        let mut direction = Vector3::z();
        for _ in 0..50 {
            let part = (inside + outside) / 2.0;
            match self.projection.direction(at.map(|x| part * x)) {
                Some(found) => (inside, direction) = (part, found),
                None => outside = part,
            }
        }
        direction
    }

    /// The direction of a pixel, if it has one.
    pub fn seen_at(&self, pixel: [f64; 2]) -> Option<Vector3<f64>> {
        let at = self.offset(pixel).map(|px| px / self.focal_px);
        self.projection.direction(at)
    }

    /// Whether a pixel has a direction.
    pub fn sees(&self, pixel: [f64; 2]) -> bool {
        self.seen_at(pixel).is_some()
    }

    /// From the principal point to a pixel, px.
    pub(super) fn offset(&self, pixel: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| pixel[axis] - self.principal_px[axis])
    }
}
