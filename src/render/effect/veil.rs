//! Veils: light of the Sun, the Moon (moonglow) and the day side of the Earth (earthshine) that the
//! optics scatter over the field.
//!
//! ```text
//! N_xy = E PST(angle) A_pixel QE t_int
//! ```
//!
//! with the irradiance E on the aperture and the point-source transmittance at the angle from the
//! boresight (`camera::stray`); of the Earth the sum over patches of its lit disc. The Sun is never
//! in the image: inside its exclusion angle all pixels are full.
//! Reference: Breault 1995 (Handbook of Optics, ch. 38).
//! Validity: uniform over the detector, as a point-source transmittance implies; no ghosts, no
//! glare around bright stars; attitude of mid-exposure; the air's light is counted as that of the
//! ground below.
//! Price: the passes over the pixels.

use super::Effect;
use super::area::{assess, up_to};
use super::cause::three_digits;
use crate::scene::{
    AreaLight, EffectId, Found, NO_ORBIT, Radiance, Scene, Surroundings, View, World, moons_light,
};
use crate::sky::earth_light::EarthDisc;
use crate::sky::moon::MoonDisc;
use crate::sky::photometry::photon_irradiance;
use crate::sky::shadow::Earth;
use nalgebra::Vector3;
use std::sync::Arc;

/// Time of an evaluation of uniform light, ns.
const EVALUATION_NS: f64 = 45.0;

/// Sunlight.
pub(crate) const SUNLIGHT: Effect = Effect::light(EffectId::Sunlight, "sunlight", |scene, _| {
    assess(
        scene,
        EffectId::Sunlight,
        |area| sun(scene, area),
        EVALUATION_NS,
    )
})
.area_source(sunlight, NOTHING);
/// Moonglow.
pub(crate) const MOONGLOW: Effect = Effect::light(EffectId::Moonglow, "moonglow", |scene, _| {
    assess(scene, EffectId::Moonglow, scatters, EVALUATION_NS)
})
.area_source(moonglow, NOTHING);
/// Earthshine.
pub(crate) const EARTHSHINE: Effect =
    Effect::light(EffectId::Earthshine, "earthshine", |scene, _| {
        assess(scene, EffectId::Earthshine, scatters, EVALUATION_NS)
    })
    .area_source(earthshine, NOTHING);

fn scatters(area: &AreaLight) -> String {
    format!("the optics scatter {}", up_to(area))
}

fn sun(scene: &Scene, area: &AreaLight) -> String {
    let sun = &scene.view.sun;
    let [angle, exclusion] = [sun.angle, scene.view.camera.optics.stray.sun_exclusion];
    let [angle, exclusion] = [angle, exclusion].map(|rad| three_digits(rad.to_degrees()));
    if sun.excluded {
        format!(
            "the Sun is {angle} deg from the boresight, within the exclusion angle of {exclusion}: \
             the frame saturates"
        )
    } else {
        let scatters = scatters(area);
        format!("the Sun is {angle} deg from the boresight, {scatters}")
    }
}

const NOTHING: &str = "nothing of it is scattered onto the detector";
const NO_TABLE: &str = "the optics scatter no light (optics.stray.pst)";

/// Number of patches of the Earth's disc, for an error of 1 %.
const PATCHES: usize = 100;
/// Charge of a pixel with the Sun inside the exclusion angle, in full wells.
const OVERFILL: f64 = 4.0;

/// The same light on every pixel.
#[derive(Debug)]
struct Veil {
    e_s: f64,
}

impl Radiance for Veil {
    fn toward(&self, _: &Vector3<f64>) -> f64 {
        self.e_s
    }

    fn detail(&self) -> f64 {
        f64::INFINITY
    }

    fn is_of_pixels(&self) -> bool {
        true
    }
}

/// The veil of a source of `irradiance` (ph/s/m^2) on the aperture, `angle` (rad) from the
/// boresight, e-/s.
fn scattered(view: &View, irradiance: f64, angle: f64) -> f64 {
    let (stray, detector) = (&view.camera.optics.stray, &view.camera.detector);
    if view.camera.optics.transmission == 0.0 {
        // The point-source transmittance includes the transmission, except if nothing passes.
        return 0.0;
    }
    stray.veil_e_s(
        irradiance,
        angle,
        detector.pitch_m,
        detector.quantum_efficiency,
    )
}

fn from_boresight(view: &View, direction: &Vector3<f64>) -> f64 {
    let seen = view.pointing(0.0).rotate(direction);
    libm::atan2(libm::hypot(seen.x, seen.y), seen.z)
}

fn sunlight(_: &World, view: &View, _: &Surroundings) -> Found {
    let sun = &view.sun;
    if sun.lit == 0.0 {
        return Err("the Earth hides the Sun".into());
    }
    if sun.excluded {
        let detector = &view.camera.detector;
        let full_e = detector.full_well_e.max(detector.converter_reach_e());
        let e_s = OVERFILL * full_e / view.exposure.duration_s;
        return Ok(Arc::new(Veil { e_s }));
    }
    if !view.camera.optics.stray.scatters() {
        return Err(NO_TABLE.into());
    }
    let e_s = scattered(view, sun.irradiance * sun.lit, sun.angle);
    Ok(Arc::new(Veil { e_s }))
}

fn moonglow(world: &World, view: &View, _: &Surroundings) -> Found {
    if !view.camera.optics.stray.scatters() {
        return Err(NO_TABLE.into());
    }
    let moon = MoonDisc::seen_by(&view.observer, &world.corrections);
    let earth = Earth::at(view.exposure.mid);
    let light = moons_light(&moon, &earth, &view.observer);
    if light == 0.0 {
        return Err("the Earth, or its shadow, hides the Moon".into());
    }
    let zero_point = view.camera.optics.band.zero_point();
    let irradiance = light * photon_irradiance(zero_point, moon.magnitude());
    let e_s = scattered(view, irradiance, from_boresight(view, &moon.direction));
    Ok(Arc::new(Veil { e_s }))
}

fn earthshine(_: &World, view: &View, around: &Surroundings) -> Found {
    if !view.camera.optics.stray.scatters() {
        return Err(NO_TABLE.into());
    }
    let bodies = &view.observer.bodies;
    let earth = Earth::at(view.exposure.mid);
    let disc = EarthDisc::new(view.observer.position_m, bodies.sun_apparent_m(), earth);
    let (Some(disc), Some(_)) = (disc, around.horizon) else {
        return Err(NO_ORBIT.into());
    };
    let sun = view.camera.optics.band.sun_irradiance();
    let patches = disc.patches(PATCHES);
    if patches.is_empty() {
        return Err("no part of the Earth's day side is seen".into());
    }
    let part = |(direction, irradiance): (Vector3<f64>, f64)| {
        scattered(view, irradiance * sun, from_boresight(view, &direction))
    };
    let patches = patches.into_iter();
    let e_s = patches.map(|patch| part((patch.direction, patch.irradiance)));
    Ok(Arc::new(Veil { e_s: e_s.sum() }))
}
