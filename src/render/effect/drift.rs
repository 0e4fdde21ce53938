//! Aberration drift: stars move because the observer's velocity changes while the shutter is open.
//!
//! ```text
//! du = (dv - (dv . u) u) / c
//! ```
//!
//! Reference: first order of aberration (Explanatory Supplement to the Astronomical Almanac, 3rd
//! ed., 2013, Eq. 7.40) in the change of velocity dv since mid-exposure. In a low orbit dv grows by
//! some 8 m/s each second: 0.005 arcsec. Objects in orbit have it in their own tracks.
//! Validity: dv is a parabola through start, mid and end; the Earth's own acceleration, 0.006
//! m/s^2, is left out.
//!
//! Without it a star is displaced by d at the ends of the exposure, but hardly on average. Let a be
//! half the length of its track without drift, and b the mean of the parabola. The second moment or
//! the slope of the streak bounds the change:
//!
//! ```text
//! dN <= min(N_0 (0.61 b / s + (a d + d^2 / 2) / (3 s^2)), 0.86 N d / s)
//! b = |d_start + d_end| / 6
//! ```
//!
//! Price: some ten products for each evaluation of a star.

use super::cause::STILL_IN_FLOOD;
use super::{Assessment, Effect, ErrorBound};
use crate::fidelity::Fidelity;
use crate::scene::bounds::{BoundChange, STEEPEST, STEEPEST_STREAK, changed_e};
use crate::scene::{Body, Candidate, EffectId, EffectSet, Scene, Source, View, work};
use crate::sky::bodies::LIGHT_M_S;
use hifitime::Unit;
use nalgebra::Vector3;

/// The change of the stars' aberration during the exposure.
pub(crate) const ABERRATION_DRIFT: Effect = Effect::images(
    EffectId::AberrationDrift,
    "aberration drift",
    assess,
    change,
);

fn assess(view: &View, simulated: &EffectSet, fidelity: &Fidelity) -> Assessment<'static> {
    if view.still_in_flood {
        return Assessment::none(STILL_IN_FLOOD);
    }
    let [start, end] = view.velocity_change_m_s.map(|dv| dv.norm());
    if start.max(end) == 0.0 {
        return Assessment::none(why_none(view));
    }
    let is_star = |candidate: &Candidate| matches!(candidate.body, Body::Star(_));
    if !view.candidates.iter().any(is_star) {
        return Assessment::none(if simulated.has(EffectId::Stars) {
            "no star is in the field"
        } else {
            "stars are switched off"
        });
    }
    // |du| = |dv| sin(angle between them) / c, for the star furthest from the axis of dv.
    let axis = view.pointing(0.0).matrix().transpose() * Vector3::z();
    let field = view.camera.cone_rad(0.0) + view.turn;
    let bound = |dv: &Vector3<f64>| {
        let from = dv.angle(&axis);
        let from = from.min(std::f64::consts::PI - from);
        dv.norm() / LIGHT_M_S * libm::sin((from + field).min(std::f64::consts::FRAC_PI_2))
    };
    let changes = view.velocity_change_m_s.iter();
    let furthest = changes.map(bound).fold(0.0, f64::max);
    let px = furthest * view.scale_and_corner_px.0;
    let because = format!("stars move by up to {px:.2e} px from mid-exposure to its ends");
    // Images that would stand still become tracks of two panels.
    let estimated_ms = work(view, 0.0, fidelity).moving_ms;
    Assessment::new(because, ErrorBound { e: 0.0, px }, estimated_ms)
}

/// Why no star drifts.
fn why_none(view: &View) -> &'static str {
    let velocity = |dt_s: f64| {
        let then = view.exposure.mid + Unit::Second * dt_s;
        view.vehicle.at(then).orbit.map(|state| state.velocity_m_s)
    };
    match velocity(0.0) {
        None => "the observer has no orbit (observer.orbit), and no velocity that changes",
        mid if velocity(view.open_s / 2.0) == mid => {
            "the observer's velocity does not change in so short a time"
        }
        _ => "aberration is switched off (sky.aberration)",
    }
}

fn change(scene: &Scene, bound: &ErrorBound) -> ErrorBound {
    let (view, d) = (&scene.view, bound.px);
    let [start, end] = &view.velocity_change_m_s;
    let scale = view.scale_and_corner_px.0;
    // With a rolling shutter each row sees another part of the path.
    let rolled = d * view.camera.readout_s() / view.open_s.max(f64::MIN_POSITIVE);
    let b = (start + end).norm() / 6.0 / LIGHT_M_S * scale + rolled;
    let other = scene.simulated.toggled(EffectId::AberrationDrift);
    // Every image without drift also touches the detector with drift.
    let margin_px = |_: &Source| Some(d + 1.0);
    let e = changed_e(scene, &other, false, margin_px, |image| {
        let Body::Star(_) = image.source.body else {
            return BoundChange::default();
        };
        let a = image.length_px / 2.0;
        // The length of a straight track of the same second moment.
        let length_px = (8.0 * (a * d + d * d / 2.0)).sqrt();
        let off =
            image.moved_e(image.still_e, STEEPEST, b) + image.spread_e(image.still_e, length_px);
        let streak = image.moved_e(image.height_e(), STEEPEST_STREAK, d);
        BoundChange {
            e: off.min(streak),
            reach_px: d + 1.0,
        }
    });
    ErrorBound { e, ..*bound }
}
