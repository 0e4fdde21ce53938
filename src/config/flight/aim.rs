//! The directions of `look_at`: the apparent target, and the direction up.

use crate::{LookAt, Target, Up};
use hifitime::Epoch;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::profile::{
    Aim, Direction, LimbStare, OrbitSourceError, Profile, ProfileError,
};
use skyloop_orbit::StateVector;
use skyloop_orbit::time::utc_text;
use skyloop_render::camera::Camera;
use skyloop_render::sky::Corrections;
use skyloop_render::sky::apparent::{Observer, object_direction};
use skyloop_render::sky::bodies::Bodies;
use skyloop_render::sky::planets;
use skyloop_render::sky::shadow::Earth;
use std::sync::Arc;

/// The boresight of `camera` at a target, with the corrections of the sky.
pub(super) fn aim(look: &LookAt, camera: &Camera, corrections: Corrections) -> Aim {
    let [x, y, z, w] = camera.mounting.xyzw();
    let up = match look.up {
        Up::North => of_state(|_| Vector3::z()),
        Up::Velocity => of_state(|state| state.velocity_m_s),
        Up::Zenith => of_state(|state| state.position_m),
        Up::Sun => of_observer(move |observer| observer.sun_m(&corrections)),
    };
    Aim {
        target: target(&look.target, corrections),
        up,
        roll_rad: look.roll_rad,
        body_to_camera: UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    }
}

/// The apparent direction of a target, as in the scene.
fn target(target: &Target, corrections: Corrections) -> Direction {
    match target {
        Target::Direction([ra, dec]) => {
            let [(sin_ra, cos_ra), (sin_dec, cos_dec)] = [*ra, *dec].map(libm::sincos);
            of_state(move |_| Vector3::new(cos_dec * cos_ra, cos_dec * sin_ra, sin_dec))
        }
        Target::Velocity => of_state(|state| state.velocity_m_s),
        Target::Limb([height_m, azimuth_rad]) => {
            let limb = LimbStare {
                height_m: *height_m,
                azimuth_rad: *azimuth_rad,
            };
            Arc::new(move |epoch, state| Ok(limb.direction(epoch, state)?))
        }
        Target::Sun => of_observer(move |observer| observer.sun_m(&corrections)),
        Target::Moon => of_observer(move |observer| observer.moon_m(&corrections)),
        Target::Planet(name) => {
            let name = *name;
            of_observer(move |observer| {
                let planets = planets::seen_by(observer, &corrections);
                let planet = planets.into_iter().find(|planet| planet.name == name);
                planet.map_or(Vector3::zeros(), |planet| planet.direction)
            })
        }
        Target::Object(object) => {
            let object = object.clone();
            Arc::new(move |epoch, state| {
                let observer = observer(epoch, state)?;
                let seen = object_direction(|at| object.state(at), &observer, &corrections)?;
                Ok(seen.direction)
            })
        }
    }
}

fn of_state(direction: impl Fn(&StateVector) -> Vector3<f64> + Send + Sync + 'static) -> Direction {
    Arc::new(move |_, state| Ok(direction(state)))
}

fn of_observer(direction: impl Fn(&Observer) -> Vector3<f64> + Send + Sync + 'static) -> Direction {
    Arc::new(move |epoch, state| Ok(direction(&observer(epoch, state)?)))
}

fn observer(epoch: Epoch, state: &StateVector) -> Result<Observer, OrbitSourceError> {
    Ok(Observer {
        epoch,
        position_m: state.position_m,
        velocity_m_s: state.velocity_m_s,
        bodies: Bodies::at(epoch)?,
    })
}

/// Notices for a mission with a target: one where the Earth hides it, one where the rule for the
/// roll does not apply.
pub(super) fn notices(look: &LookAt, mission: &Mission) -> Result<Vec<String>, ProfileError> {
    let Profile::Aim(aim) = &mission.profile else {
        return Ok(Vec::new());
    };
    let orbit = mission.orbit.as_ref();
    let (mut hidden, mut parallel) = (Vec::new(), Vec::new());
    for epoch in (0..mission.frames).map(|number| mission.epoch(number)) {
        if aim.is_degenerate(epoch, orbit)? {
            parallel.push(epoch);
        }
        let Some(orbit) = orbit else { continue };
        let state = orbit(epoch).map_err(|source| ProfileError::Orbit { epoch, source })?;
        let (earth, observer_m) = (Earth::at(epoch), state.position_m);
        let is_hidden = match &look.target {
            Target::Limb(_) | Target::Velocity => false,
            Target::Object(object) => object
                .state(epoch)
                .is_ok_and(|target| earth.occults(observer_m, target.position_m)),
            _ => {
                let direction = (aim.target)(epoch, &state)
                    .map_err(|source| ProfileError::Target { epoch, source })?;
                earth.occults_direction(observer_m, direction)
            }
        };
        if is_hidden {
            hidden.push(epoch);
        }
    }
    let of = mission.frames;
    let line = |what: &str, epochs: &[Epoch]| {
        let first = epochs.first()?;
        let count = epochs.len();
        let first = utc_text(*first);
        Some(format!(
            "look_at: {what}, in {count} of {of} exposures, the first at {first}"
        ))
    };
    let rule = format!(
        "the line of sight is parallel to up = {:?}, and {} is up instead",
        look.up.name(),
        match look.up {
            Up::North => "ICRF +X",
            _ => "north",
        }
    );
    let lines = [
        line("the target is behind the Earth", &hidden),
        line(&rule, &parallel),
    ];
    Ok(lines.into_iter().flatten().collect())
}
