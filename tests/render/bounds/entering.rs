//! A star that the lens's distortion moves off the detector. Without distortion all its light is on
//! it.

use std::sync::Arc;

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use skyloop::attitude::VehicleState;
use skyloop::camera::psf::{Shape, Variation};
use skyloop::camera::{Camera, Model, Projection, Psf, Shutter, Vignetting};
use skyloop::fidelity::Choice;
use skyloop::measure::Bench;
use skyloop::sky::catalog::Selection;

use super::{emulator, epoch, verdicts};
use crate::fixtures::{self, cropped, unit};

/// X-Val: Sirius, J2000, Hipparcos (ESA 1997): RA 101.287 deg, declination -16.716 deg.
const SIRIUS_DEG: [f64; 2] = [101.287, -16.716];

fn camera() -> Camera {
    let mut camera = cropped(fixtures::camera("cmos-rolling"), 96);
    camera.shutter = Shutter::Global;
    camera.radiation = None;
    let optics = &mut camera.optics;

    optics.vignetting = Vignetting::None;
    optics.psf = Psf::new(Shape::Gaussian(0.7), Variation::default());
    // A fifth more at the edge, 46 px from the middle at 2200 px: Sirius moves 9 px outwards.
    optics.projection = Projection::new(Model::BrownConrady {
        k: [450.0, 0.0, 0.0],
        p: [0.0, 0.0],
    });
    camera
}

/// The attitude that images Sirius at `at` (px) through an ideal lens.
pub fn towards_sirius(camera: &Camera, at: [f64; 2]) -> [f64; 4] {
    let [ra, dec] = SIRIUS_DEG.map(f64::to_radians);
    let star = unit(ra, dec);
    let optics = &camera.optics;
    let [x, y] = [0, 1].map(|k| (at[k] - optics.principal_px[k]) / optics.focal_px);
    let seen = Vector3::new(x, y, 1.0);
    let turn = Rotation3::rotation_between(&star, &seen).unwrap();
    let q = UnitQuaternion::from_rotation_matrix(&turn);
    [q.i, q.j, q.k, q.w]
}

#[test]
fn a_star_moved_out_by_distortion_is_within_the_bound() {
    let camera = Arc::new(camera());
    let attitude = towards_sirius(&camera, [92.0, 47.5]);
    let vehicle = VehicleState::new(7, epoch(), attitude, [0.0; 3], None).unwrap();
    let emulator = emulator(Selection::Bsc);
    let bench = Bench {
        emulator: &emulator,
        camera,
        vehicle,
    };
    let choice = Choice::default();
    let scene = emulator.scene(&bench.camera, &bench.vehicle, 0, &choice);
    let sources = scene.unwrap().sources;
    let brightest = sources.iter().map(|s| s.electrons).fold(0.0, f64::max);
    let (effect, verdict) = verdicts(&bench, &choice).swap_remove(0);
    let measured = bench.error_e(effect, &choice).unwrap();
    assert_eq!(effect.name, "distortion");
    // All other light of the frame is faint compared with the star, which saturates a pixel.
    assert!(measured > 10.0 * brightest, "{measured} {brightest}");
    let declared = verdict.error_e.unwrap();
    let bounds = measured..=10.0 * measured;
    assert!(bounds.contains(&declared), "{declared} {measured}");
}
