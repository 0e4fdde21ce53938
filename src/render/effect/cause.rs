//! Texts that several effects share: why a scene needs an effect, or why not.

use crate::scene::{EffectId, Hidden, MOON, Scene, Source};
use crate::sky::field::Excluded;

/// Why images stand still in a frame that exceeds its work limit.
pub(super) const STILL_IN_FLOOD: &str =
    "all pixels are full of other light, and motion would cost more than the limit of work";

/// A number with three significant digits.
pub fn three_digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_string(),
        1e-3..1e5 => {
            let decimals = (2 - libm::log10(value.abs()).floor() as i32).max(0) as usize;
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.2e}"),
    }
}

/// `1 star`, `3 stars`.
pub fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Why no star and no object lights a pixel.
pub(super) fn no_light(scene: &Scene) -> String {
    let part = |effect: EffectId, what: &str| {
        if scene.simulated.has(effect) {
            none_lit(scene, what, effect)
        } else {
            format!("{what}s are switched off")
        }
    };
    let stars = part(EffectId::Stars, "star");
    format!("no light: {stars}; {}", part(EffectId::Rsos, "object"))
}

/// Why no source of a kind lights a pixel; `what` is the noun for one.
pub(super) fn none_lit(scene: &Scene, what: &str, kind: EffectId) -> String {
    let is = |source: &&Source| source.body.effect() == kind;
    let sources: Vec<&Source> = scene.sources.iter().filter(is).collect();
    let all = counted(sources.len(), what);
    if sources.is_empty() {
        return match (what, scene.view.objects) {
            ("object", 0) => "the scene has no objects".to_string(),
            ("object", 1) => format!("the scene's object is not in the field{}", unknown(scene)),
            ("object", n) => {
                let unknown = unknown(scene);
                format!("none of the scene's {n} objects is in the field{unknown}")
            }
            (MOON, _) => "the Moon is not in the field".to_string(),
            _ => format!("no {what} is in the field"),
        };
    }
    let hidden = |by: Hidden| sources.iter().filter(|s| s.hidden == Some(by)).count();
    let (earth, shadow) = (hidden(Hidden::ByEarth), hidden(Hidden::InShadow));
    let moon = hidden(Hidden::ByMoon);
    if earth + shadow + moon == sources.len() {
        return match (earth, shadow, moon) {
            (_, 0, 0) => format!("{all} in the field, behind the Earth"),
            (0, _, 0) => format!("{all} in the field, in the Earth's shadow"),
            (0, 0, _) => format!("{all} in the field, behind the Moon"),
            _ => format!(
                "{all} in the field: {earth} behind the Earth, {shadow} in its shadow, {moon} behind the Moon"
            ),
        };
    }
    let reason = if sources.iter().all(|s| s.arriving_e == 0.0) {
        "the camera turns no light into charge (optics.transmission, detector.quantum_efficiency)"
    } else if sources.iter().all(|s| s.electrons == 0.0) {
        "no light passes the optics there (optics.vignetting)"
    } else {
        "their light falls outside the frame"
    };
    format!("{all} in the field: {reason}")
}

/// The objects without an image that may be in the field.
fn unknown(scene: &Scene) -> String {
    let unseen = |why: Excluded| scene.view.unseen.iter().filter(|one| one.1 == why).count();
    let parts = [
        (unseen(Excluded::BehindEarth), "behind the Earth"),
        (unseen(Excluded::TooFaint), "too faint"),
        (scene.view.unknown.count, "without a position at this time"),
    ];
    let parts = parts.iter().filter(|(n, _)| *n > 0);
    let parts: Vec<String> = parts.map(|(n, what)| format!("{n} {what}")).collect();
    if parts.is_empty() {
        return String::new();
    }
    format!(" ({})", parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_nouns_a_plural() {
        for (value, text) in [
            (0.0, "0"),
            (0.001234, "0.00123"),
            (1.8, "1.80"),
            (30_000.0, "30000"),
            (123_456.0, "1.23e5"),
            (0.000_05, "5.00e-5"),
        ] {
            assert_eq!(three_digits(value), text);
        }
        assert_eq!(counted(1, "star"), "1 star");
        assert_eq!(counted(0, "star"), "0 stars");
        assert_eq!(counted(2, "particle"), "2 particles");
    }
}
