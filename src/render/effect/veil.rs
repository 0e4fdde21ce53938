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

use super::Effect;
use super::area::{judge, up_to};
use super::cause::digits;
use crate::scene::{AreaLight, EffectId, Scene};

/// ns of a look at light that is the same everywhere.
const LOOK_NS: f64 = 45.0;

/// Sunlight.
pub const SUNLIGHT: Effect = Effect::light(EffectId::Sunlight, "sunlight", |scene, _| {
    judge(scene, EffectId::Sunlight, |area| sun(scene, area), LOOK_NS)
});
/// Moonglow.
pub const MOONGLOW: Effect = Effect::light(EffectId::Moonglow, "moonglow", |scene, _| {
    judge(scene, EffectId::Moonglow, scattered, LOOK_NS)
});
/// Earthshine.
pub const EARTHSHINE: Effect = Effect::light(EffectId::Earthshine, "earthshine", |scene, _| {
    judge(scene, EffectId::Earthshine, scattered, LOOK_NS)
});

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
        let scattered = scattered(area);
        format!("the Sun is {angle} deg from the boresight, {scattered}")
    }
}
