//! Veils: light of the Sun, the Moon (moonglow) and the day side of the Earth (earthshine) that the optics scatter over the field.
//!
//! ```text
//! N_xy = E PST(angle) A_pixel QE t_int
//! ```
//!
//! with the irradiance E on the aperture and the point-source transmittance at the angle from the boresight (`camera::stray`); of the Earth the sum over
//! patches of its lit disc. The Sun is never in the image: inside of its exclusion angle it fills all pixels. Reference: Breault 1995 (Handbook of Optics, ch. 38). Validity: the same
//! on all pixels, which is what a point-source transmittance speaks of; no ghosts, no glare around bright stars; at mid-exposure's attitude; the air's light
//! counts as that of the ground below it. Price: the passes over the pixels.

use super::area::{judge, up_to};
use super::cause::digits;
use super::{Effect, Judge, Stage};
use crate::scene::{AreaLight, Scene};

/// ns of a look at light that is the same everywhere.
const LOOK_NS: f64 = 45.0;

/// Sunlight.
pub const SUNLIGHT: Effect = Effect {
    name: "sunlight",
    stage: Stage::Light,
    random: false,
    judge: Judge::Pixels(|scene, _| {
        judge(
            scene,
            "sunlight",
            |area| sun(scene, area),
            LOOK_NS,
            |parts| parts.sunlight = false,
        )
    }),
    mark: |simulated| simulated.sunlight = true,
};
/// Moonglow.
pub const MOONGLOW: Effect = Effect {
    name: "moonglow",
    stage: Stage::Light,
    random: false,
    judge: Judge::Pixels(|scene, _| {
        judge(scene, "moonglow", scattered, LOOK_NS, |parts| {
            parts.moonglow = false
        })
    }),
    mark: |simulated| simulated.moonglow = true,
};
/// Earthshine.
pub const EARTHSHINE: Effect = Effect {
    name: "earthshine",
    stage: Stage::Light,
    random: false,
    judge: Judge::Pixels(|scene, _| {
        judge(scene, "earthshine", scattered, LOOK_NS, |parts| {
            parts.earthshine = false
        })
    }),
    mark: |simulated| simulated.earthshine = true,
};

fn scattered(area: &AreaLight) -> String {
    format!("the optics scatter {}", up_to(area))
}

fn sun(scene: &Scene, area: &AreaLight) -> String {
    let sun = &scene.view.sun;
    let [angle, exclusion] = [sun.angle, scene.view.camera.optics.stray.sun_exclusion];
    let [angle, exclusion] = [angle, exclusion].map(|rad| digits(rad.to_degrees()));
    if sun.excluded {
        format!(
            "the Sun is {angle} deg from the boresight, within the exclusion angle of {exclusion}: the frame saturates"
        )
    } else {
        format!(
            "the Sun is {angle} deg from the boresight, {}",
            scattered(area)
        )
    }
}
