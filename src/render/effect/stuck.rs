//! Stuck pixels: a constant digital number, whatever their charge.
//!
//! ```text
//! DN_xy <- stuck_dn   at the stuck pixels of the camera's pattern
//! ```
//!
//! Reference: none but the definition; the pixels are drawn by the camera's serial number, or
//! listed.
//! Validity: single pixels, up to a tenth of the detector, all with the same constant value; no
//! blinking pixels, no stuck columns.
//! Price: proportional to their number.

use super::cause::counted;
use super::{Assessment, Effect, ErrorBound, Pass};
use crate::fidelity::Fidelity;
use crate::scene::bounds::held_of;
use crate::scene::{EffectId, Scene};

/// Stuck pixels.
pub(crate) const STUCK_PIXELS: Effect =
    Effect::of_dn(EffectId::StuckPixels, "stuck pixels", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let (stuck, dn) = (detector.pattern.stuck(), detector.stuck_dn);
    let assessment = if stuck.is_empty() {
        Assessment::none("the detector has no stuck pixels")
    } else {
        let gain = detector.gain_e_per_dn;
        let instead_e = (f64::from(dn) - detector.offset_dn) * gain;
        let off = held_of(scene, stuck)
            .into_iter()
            .zip(stuck)
            .take_while(|_| !scene.is_cancelled())
            .map(|(e, pixel)| {
                let dead = scene.simulated.has(EffectId::DeadPixels)
                    && detector.pattern.dead().binary_search(pixel).is_ok();
                let e = if dead { 0.0 } else { e };
                let read = if scene.simulated.has(EffectId::NonLinearity) {
                    detector.response_e(e)
                } else {
                    e
                };
                (instead_e - read.min(detector.converter_reach_e())).abs()
            });
        let because = format!("{} at {dn} DN", counted(stuck.len(), "stuck pixel"));
        // Digital numbers are rounded.
        let error = ErrorBound::of_pixel(off.fold(0.0, f64::max) + gain);
        Assessment::new(because, error, stuck.len() as f64 * 2e-6)
    };
    let pass = Pass::Pixels(Box::new(move |tile| {
        let (first, pixels) = (tile.first, tile.dn.len());
        let from = stuck.partition_point(|pixel| (*pixel as usize) < first);
        let in_tile = stuck[from..].iter().map(|pixel| *pixel as usize);
        in_tile
            .take_while(|pixel| *pixel < first + pixels)
            .for_each(|pixel| tile.dn[pixel - first] = dn);
    }));
    (assessment, pass)
}
