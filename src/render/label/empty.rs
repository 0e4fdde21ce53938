//! The reason for a label without objects.

use crate::scene::{Scene, full_part};

/// The reason. `label_snr` is the lowest signal-to-noise ratio of listed objects; `flooded_by` is
/// as in the label.
pub(crate) fn why_no_objects(scene: &Scene, label_snr: f64, flooded_by: Option<&str>) -> String {
    if let Some(light) = flooded_by {
        return format!("every pixel is full: {light}");
    }
    let faint = format!("has a signal-to-noise ratio of {label_snr} or more");
    match full_part(scene) {
        0.0 => format!("no object in the field {faint}"),
        part => {
            // Rounded down, so that it never reads as 100 %.
            let percent = (part * 1000.0).floor() / 10.0;
            format!("{percent} % of the pixels are full, and no object {faint} on the others")
        }
    }
}
