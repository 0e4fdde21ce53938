//! Full well: the most charge that a pixel holds. The excess is lost, as to an anti-blooming drain,
//! or blooms along the column (`kernels::bloom`).
//!
//! ```text
//! N_xy <- min(N_xy, full well)
//! ```
//!
//! Reference: Janesick 2001, Scientific Charge-Coupled Devices.
//! Validity: a hard limit, the same for all pixels, of 1 to 1e9 e-. Real wells differ by some per
//! cent and bend below the limit (`nonlinearity` has its own bend). No charge remains for the next
//! frame.
//! Price: a comparison a pixel; with blooming also a pass over each column that has an overfull
//! pixel.

use super::cause::three_digits;
use super::{Assessment, Effect, LazyBound, Pass};
use crate::camera::Blooming;
use crate::fidelity::Fidelity;
use crate::kernels::Bloom;
use crate::scene::bounds::{full_pixel_error_e, greatest, held_e, max_difference};
use crate::scene::{EffectId, Scene, columns_e, drawn_e, in_groups};
use skyloop_base::abort::WorkLimit;
use std::cell::Cell;

thread_local! {
    /// Blooming buffers, reused from frame to frame.
    static BUFFERS: Cell<Buffers> = Cell::default();
}

/// Buffers for blooming columns.
#[derive(Default)]
struct Buffers {
    /// Of each column, whether it has an overfull pixel.
    overfull: Vec<bool>,
    /// One column, e-.
    column: Vec<f32>,
    bloom: Bloom,
}

/// Full well.
pub(crate) const FULL_WELL: Effect = Effect::charge(EffectId::FullWell, "full well", assess);

fn assess<'s>(scene: &'s Scene, _: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    let detector = &scene.view.camera.detector;
    let full = detector.full_well_e;
    let brightest = scene.brightest_e();
    let max_e = drawn_e(brightest) + scene.struck.max_e();
    let spills = detector.blooming == Blooming::Column;
    let assessment = if scene.blooming.columns.is_empty() {
        let [max_e, full] = [max_e, full].map(three_digits);
        Assessment::none(format!(
            "no pixel gets more than {max_e} of the {full} e- that it holds"
        ))
    } else {
        let (spilling, ns) = if spills {
            (", and bloom along its column", 0.3)
        } else {
            ("", 0.2)
        };
        let because = format!(
            "a pixel may collect {} e-, above the full well of {} e-{spilling}",
            three_digits(max_e),
            three_digits(full)
        );
        let error_e = move || {
            let without = scene.simulated.without(EffectId::FullWell);
            let spilling = greatest(scene, &scene.blooming.columns, |columns| {
                let [a, b] = [&scene.simulated, &without].map(|of| held_e(scene, columns, of));
                max_difference(&a, &b)
            });
            spilling + full_pixel_error_e(scene, &without)
        };
        let assessment = Assessment::of_pixels(scene, because, 0.0, ns);
        let columns = if spills { overfull_columns(scene) } else { 0 };
        Assessment {
            error: LazyBound::of(error_e),
            drawn_e: max_e - brightest,
            estimated_ms: assessment.estimated_ms + (columns * detector.height) as f64 * 8e-6,
            ..assessment
        }
    };
    let pass = if spills {
        Pass::Frame(Box::new(move |charge| {
            blooming(charge.electrons, charge.width, full, &scene.view.limit);
        }))
    } else {
        Pass::Pixels(Box::new(move |tile| {
            let pixels = tile.electrons.iter_mut();
            pixels.for_each(|e| *e = e.min(full as f32));
        }))
    };
    (assessment, pass)
}

/// Number of columns in which noise is likely to overfill a pixel.
fn overfull_columns(scene: &Scene) -> usize {
    let detector = &scene.view.camera.detector;
    let over = |e: &f64| e + 3.0 * e.sqrt() > detector.full_well_e;
    let groups = in_groups(scene, &scene.blooming.columns, |columns| {
        let charge = columns_e(scene, columns, &scene.simulated);
        let columns = charge.chunks_exact(detector.height);
        columns.filter(|column| column.iter().any(over)).count()
    });
    groups.into_iter().sum()
}

/// Blooms every column with an overfull pixel, until the frame is cancelled. Returns the charge
/// lost at the ends of columns, e-.
fn blooming(electrons: &mut [f32], width: usize, full: f64, limit: &WorkLimit) -> f64 {
    let mut buffers = BUFFERS.take();
    let Buffers {
        overfull,
        column,
        bloom,
    } = &mut buffers;
    overfull.clear();
    overfull.resize(width, false);
    for row in electrons.chunks(width) {
        for (over, e) in overfull.iter_mut().zip(row) {
            *over |= f64::from(*e) > full;
        }
    }
    let mut left = 0.0;
    let over = (0..width).filter(|x| overfull[*x]);
    for x in over.take_while(|_| !limit.is_cancelled()) {
        column.clear();
        column.extend(electrons[x..].iter().step_by(width));
        left += bloom.blooming(column, full).iter().sum::<f64>();
        for (to, e) in electrons[x..].iter_mut().step_by(width).zip(&*column) {
            *to = *e;
        }
    }
    BUFFERS.set(buffers);
    left
}

#[cfg(test)]
mod tests {
    use super::{WorkLimit, blooming};

    #[test]
    fn blooming_conserves_charge_within_each_column() {
        let (width, height, full) = (7, 30, 1000.0);
        let mut frame = vec![0.0f32; width * height];
        let mut state = 1u32;
        for e in &mut frame {
            // Numerical Recipes' generator; any will do.
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *e = (state >> 21) as f32;
        }
        frame[3 * width + 2] = 15_000.0;
        let before = frame.clone();
        let left = blooming(&mut frame, width, full, &WorkLimit::default());
        let column = |frame: &[f32], x: usize| -> f64 {
            frame[x..]
                .iter()
                .step_by(width)
                .map(|e| f64::from(*e))
                .sum()
        };
        let lost: f64 = (0..width)
            .map(|x| column(&before, x) - column(&frame, x))
            .sum();
        assert!(left > 0.0 && (lost - left).abs() < 1e-6, "{lost} {left}");
        for x in 0..width {
            assert!(column(&frame, x) <= column(&before, x));
        }
        assert!(frame.iter().all(|e| f64::from(*e) <= full + 1.0));
        // No overfull pixel: no change.
        let mut below_full = before.iter().map(|e| e.min(900.0)).collect::<Vec<_>>();
        let unchanged = below_full.clone();
        assert_eq!(
            blooming(&mut below_full, width, full, &WorkLimit::default()),
            0.0
        );
        assert_eq!(below_full, unchanged);
    }
}
