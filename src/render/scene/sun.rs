//! The Sun, which is never in the image: how far from the boresight it is, and whether it fills the frame.

use super::{View, World};
use crate::sky::bodies::AU_M;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;

/// The Sun as the view's observer sees it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SeenSun {
    /// From the boresight at mid-exposure, rad.
    pub angle: f64,
    /// The part of its disc that the Earth does not hide, 0..1.
    pub lit: f64,
    /// Its irradiance in the band, all of it, ph/s/m^2.
    pub irradiance: f64,
    /// Whether it is nearer to the boresight than the camera's exclusion angle, and not hidden: the frame is full of its light.
    pub excluded: bool,
}

impl SeenSun {
    /// That of a view whose observer is known.
    pub(super) fn of(world: &World, view: &View) -> SeenSun {
        let sun_m = view.observer.sun_m(&world.corrections);
        let boresight = view.pointing(0.0).matrix().transpose() * Vector3::z();
        let angle = libm::atan2(boresight.cross(&sun_m).norm(), boresight.dot(&sun_m));
        // Without an orbit the observer is at the Earth's centre, and sees through it.
        let lit = view.vehicle.orbit.map_or(1.0, |state| {
            let earth = Earth::at(view.exposure.mid);
            earth.illumination(state.position_m, view.observer.bodies.sun_apparent_m())
        });
        let optics = &view.camera.optics;
        SeenSun {
            angle,
            lit,
            irradiance: optics.band.sun_irradiance() * AU_M * AU_M / sun_m.norm_squared(),
            excluded: lit > 0.0 && angle < optics.stray.sun_exclusion,
        }
    }
}
