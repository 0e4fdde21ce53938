//! Point sources: stars and resident space objects.
//!
//! Clark et al. 2021, Eqs. (2), (11) without the division by the gain (see `readout`):
//! `N_xy = E_obj QE tau A_app t_int PSF(x, y, x_obj, y_obj)`. The PSF is integrated over each pixel, along the
//! true track of the exposure.

use super::{Effect, Stage, Verdict};
use crate::fidelity::Fidelity;
use crate::scene::{Body, Scene, Source};

/// The stars.
pub const STARS: Effect = Effect {
    name: "stars",
    stage: Stage::Light,
    judge: judge_stars,
};
/// The resident space objects.
pub const RSOS: Effect = Effect {
    name: "rsos",
    stage: Stage::Light,
    judge: judge_rsos,
};

fn judge_stars<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    judge(
        scene,
        "no star's light falls on the detector",
        "stars in the field",
        |body| matches!(body, Body::Star(_)),
    )
}

fn judge_rsos<'s>(scene: &'s Scene, _: &Fidelity) -> Verdict<'s> {
    judge(
        scene,
        "no object's light falls on the detector",
        "objects in the field",
        |body| matches!(body, Body::Rso(_)),
    )
}

fn judge<'s>(
    scene: &'s Scene,
    why: &'static str,
    because: &'static str,
    kind: impl Fn(&Body) -> bool,
) -> Verdict<'s> {
    let lit = |s: &&Source| kind(&s.body) && s.electrons > 0.0;
    let drawn: Vec<&Source> = scene.sources.iter().filter(lit).collect();
    let pixels: usize = drawn.iter().map(|s| s.footprint.shares().len()).sum();
    if pixels == 0 {
        return Verdict::Skip { why, error_e: 0.0 };
    }
    Verdict::Run {
        because,
        price_ms: pixels as f64 * 1e-6,
        pass: Box::new(move |tile| {
            let (first, width) = (tile.row, tile.width);
            for source in &drawn {
                let electrons = source.electrons;
                for (row, column, shares) in source.footprint.rows(first..first + tile.rows) {
                    let from = (row - first) * width + column;
                    for (pixel, share) in tile.electrons[from..].iter_mut().zip(shares) {
                        *pixel += (electrons * f64::from(*share)) as f32;
                    }
                }
            }
        }),
    }
}
