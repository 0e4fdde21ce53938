//! The world coordinates of a frame: the FITS projection with the same directions, TAN for a
//! pinhole and ARC for a fisheye, with the polynomials of [`Sip`] if the lens distorts.

use super::sip::Sip;
use nalgebra::{Matrix3, Vector3};
use skyloop_render::attitude::degrees_of_turn;
use skyloop_render::camera::{Camera, Model};

/// Parameters of a zenithal FITS projection (Calabretta & Greisen 2002, A&A 395, 1077),
/// LONPOLE = 180 deg.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Wcs {
    /// FITS name of the projection.
    pub name: &'static str,
    /// Distortion of the lens.
    pub sip: Option<Sip>,
    /// `CRPIX`: the principal point; FITS counts pixels from 1.
    pub reference_px: [f64; 2],
    /// `CRVAL`: right ascension and declination of the boresight, deg.
    pub reference_deg: [f64; 2],
    /// `CD`, deg/px, by rows.
    pub cd_deg_px: [[f64; 2]; 2],
}

impl Wcs {
    /// The projection of `camera` with the rotation `r` from ICRF to camera.
    ///
    /// With the boresight `B` at (a, d), east `E = (-sin a, cos a, 0)` and north
    /// `N = (-sin d cos a, -sin d sin a, cos d)`, TAN maps a direction u to
    /// `(xi, eta) = 180/pi (E.u / B.u, N.u / B.u)` (their Eqs. (54), (12), (13)). The pinhole's
    /// direction at pixel (x, y) is `u ~ B + (x - cx)/f Xc + (y - cy)/f Yc`, where Xc, Yc and B are
    /// the rows of r. As E.B = N.B = 0,
    ///
    /// ```text
    /// CD = 180 / (pi f)  [ E.Xc  E.Yc ]
    ///                    [ N.Xc  N.Yc ]
    /// ```
    ///
    /// exactly, at any roll and at the poles, where the right ascension of the boresight is
    /// arbitrary. ARC has the angle from the boresight instead of its tangent (their Eq. (67)), as
    /// the fisheye has, and so the same matrix.
    pub fn new(camera: &Camera, r: &Matrix3<f64>) -> Wcs {
        let optics = &camera.optics;
        let row = |i: usize| r.row(i).transpose();
        let (column, line, boresight): (Vector3<f64>, _, _) = (row(0), row(1), row(2));
        let ra = libm::atan2(boresight.y, boresight.x);
        let dec = libm::atan2(boresight.z, libm::hypot(boresight.x, boresight.y));
        let ((sin_a, cos_a), (sin_d, cos_d)) = (libm::sincos(ra), libm::sincos(dec));
        let east = Vector3::new(-sin_a, cos_a, 0.0);
        let north = Vector3::new(-sin_d * cos_a, -sin_d * sin_a, cos_d);
        let scale = (1.0 / optics.focal_px).to_degrees();
        let cd = |axis: &Vector3<f64>| [scale * axis.dot(&column), scale * axis.dot(&line)];
        Wcs {
            name: match optics.projection.model() {
                Model::Fisheye { .. } => "ARC",
                Model::Pinhole | Model::BrownConrady { .. } => "TAN",
            },
            sip: Sip::of(camera),
            reference_px: optics.principal_px.map(|px| px + 1.0),
            reference_deg: [degrees_of_turn(ra), dec.to_degrees()],
            cd_deg_px: [cd(&east), cd(&north)],
        }
    }
}
