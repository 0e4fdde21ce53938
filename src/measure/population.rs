//! A synthetic catalogue for the built-in scene's camera.

use skyloop_base::load::ConfigError;
use skyloop_config::Config;
use skyloop_config::flight::{self, FlightError};
use skyloop_orbit::synth::population;
use skyloop_render::attitude::VehicleState;
use skyloop_render::sky::photometry::Sphere;
use skyloop_render::sky::population::Appearance;

/// The built-in scene with synthetic spheres instead of its objects, and its first vehicle.
pub(crate) fn scene_with_population(objects: usize) -> Result<(Config, VehicleState), ConfigError> {
    let mut config = Config::builtin()?;
    let no_start = |error: FlightError| ConfigError::Orbit(error.to_string());
    let mission = flight::mission(&config).map_err(no_start)?;
    let vehicle = flight::vehicle(&mission, 0).map_err(no_start)?;
    config.objects.clear();
    config.looks.clear();
    for one in population(objects, 1, vehicle.epoch) {
        let sphere = Sphere {
            diameter_m: one.diameter_m,
            ..Sphere::default()
        };
        let object = one.object();
        config
            .looks
            .insert(object.id.clone(), Appearance::Sphere(sphere));
        config.objects.push(object);
    }
    Ok((config, vehicle))
}
