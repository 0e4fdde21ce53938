//! The mean light of a pixel over its exposure, while the pattern moves across it.

use super::radiance::Radiance;

/// Motion (px) below which a pattern hidden inside its edge counts as still.
pub(crate) const MIN_SQUARE_PX: usize = 32;
/// Longest initial panel of Simpson's rule along a path, px.
const PANEL_PX: f64 = 4.0;
/// Greatest number of halvings of a panel.
const HALVINGS: u32 = 5;
/// Time of an evaluation of pointing and radiance, ns.
pub(crate) const AREA_EVALUATION_NS: f64 = 130.0;

/// Initial number of panels of a path of `moved_px`; 0 if light along it is nearly linear.
pub(crate) fn panels(radiance: &dyn Radiance, moved_px: f64) -> usize {
    let (still_px, panel_px) = if radiance.is_of_pixels() {
        return 0;
    } else if radiance.is_hidden_inside() {
        (MIN_SQUARE_PX as f64, MIN_SQUARE_PX as f64)
    } else {
        (1.0, PANEL_PX)
    };
    if moved_px <= still_px {
        0
    } else {
        (moved_px / panel_px).ceil() as usize
    }
}

/// The mean of `value` from 0 to 1 by Simpson's rule on `panels` equal panels, and the number of
/// evaluations. A panel is halved until its middle `b` is off the line between its ends by at most
/// `bent(b)`.
pub(crate) fn mean(
    value: impl Fn(f64) -> f64,
    panels: usize,
    bent: impl Fn(f64) -> f64,
) -> (f64, usize) {
    let side = 1.0 / panels as f64;
    let (mut sum, mut evaluations) = (0.0, 1);
    let mut open: Vec<([f64; 3], f64, f64, u32)> = Vec::new();
    let mut before = value(0.0);
    for panel in 0..panels {
        let from = panel as f64 * side;
        let after = value(from + side);
        open.push(([before, value(from + side / 2.0), after], from, side, 0));
        before = after;
        evaluations += 2;
        while let Some(([a, b, c], from, side, halved)) = open.pop() {
            let off = (a + c) / 2.0 - b;
            if halved == HALVINGS || off.abs() <= bent(b) {
                sum += side * (a + 4.0 * b + c) / 6.0;
                continue;
            }
            let [left, right] = [0.25, 0.75].map(|part| value(from + part * side));
            evaluations += 2;
            let half = side / 2.0;
            open.push(([b, right, c], from + half, half, halved + 1));
            open.push(([a, left, b], from, half, halved + 1));
        }
    }
    (sum, evaluations)
}
