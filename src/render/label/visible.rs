//! Reasons why objects and artifacts are not visible.

use crate::scene::{Body, Hidden, Scene, Source};

/// Objects with a lower signal-to-noise ratio are not visible.
pub const VISIBLE_SNR: f64 = 3.0;

/// Whether labels list a source as an object.
pub(crate) fn is_listed(source: &Source, scene: &Scene, label_snr: f64) -> bool {
    source.clear_snr >= label_snr || scene.fills_all(source)
}

/// The reason why an object is not visible, as text of the label; none if it is visible.
pub(crate) fn why_not_visible(source: &Source, scene: &Scene, in_frame: bool) -> Option<String> {
    if !in_frame {
        return Some("its centroid is outside the frame".to_string());
    }
    match source.hidden {
        Some(hidden) => Some(why_hidden(hidden).to_string()),
        None if scene.fills_all(source) => Some("every pixel that it lights is full".to_string()),
        None if source.snr < VISIBLE_SNR => {
            let dimmed = match &source.body {
                Body::Rso(seen) if seen.illumination < 1.0 => ", in the Earth's penumbra",
                _ => "",
            };
            Some(too_faint(dimmed, source.snr))
        }
        None => None,
    }
}

/// The reason why no light of an object arrives, as text of the label.
pub fn why_hidden(hidden: Hidden) -> &'static str {
    match hidden {
        Hidden::ByEarth => "behind the Earth",
        Hidden::ByMoon => "behind the Moon",
        Hidden::InShadow => "in the Earth's shadow",
    }
}

/// The reason for a signal-to-noise ratio below [`VISIBLE_SNR`].
pub(crate) fn too_faint(dimmed: &str, snr: f64) -> String {
    // Rounded down, so that it never reads as the limit itself.
    let snr = (snr * 100.0).floor() / 100.0;
    format!("too faint{dimmed}: snr {snr} is below {VISIBLE_SNR}")
}
