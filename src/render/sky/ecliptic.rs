//! The ecliptic: mean ecliptic and equinox of J2000.0.
//!
//! Its axes are those of the ICRF rotated about the equinox by the obliquity; the frame bias (0.02
//! arcsec) is omitted. The ecliptic of date moves from that of J2000.0 by 47 arcsec per century,
//! which is negligible for light that changes over degrees.

use nalgebra::Vector3;

/// Sine and cosine of the mean obliquity at J2000.0, 84381.406 arcsec (IAU 2006; Capitaine et al.
/// 2003, A&A 412, 567).
const SIN_OBLIQUITY: f64 = 0.397_776_969_112_606;
const COS_OBLIQUITY: f64 = 0.917_482_143_065_242;

/// The north pole of the ecliptic: unit vector, axes of the ICRF.
pub(crate) const POLE: Vector3<f64> = Vector3::new(0.0, -SIN_OBLIQUITY, COS_OBLIQUITY);

/// Components along the axes of the ecliptic (equinox, 90 degrees of longitude, pole) of a vector
/// along those of the ICRF.
pub(crate) fn from_icrf(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        v.x,
        COS_OBLIQUITY * v.y + SIN_OBLIQUITY * v.z,
        COS_OBLIQUITY * v.z - SIN_OBLIQUITY * v.y,
    )
}

/// From ecliptic axes to those of the ICRF.
pub fn to_icrf(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(
        v.x,
        COS_OBLIQUITY * v.y - SIN_OBLIQUITY * v.z,
        COS_OBLIQUITY * v.z + SIN_OBLIQUITY * v.y,
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_rotated_by_the_obliquity() {
        let obliquity = (84_381.406_f64 / 3600.0).to_radians();
        assert!((SIN_OBLIQUITY - obliquity.sin()).abs() < 1e-15);
        assert!((COS_OBLIQUITY - obliquity.cos()).abs() < 1e-15);
        assert!((from_icrf(&POLE) - Vector3::z()).norm() < 1e-15);
        let v = Vector3::new(0.3, -0.5, 0.7);
        assert!((to_icrf(&from_icrf(&v)) - v).norm() < 1e-15);
    }
}
