//! Point sources: stars and resident space objects.
//!
//! Clark et al. 2021, Eqs. (2), (11) without the division by the gain (see `readout`):
//! `N_xy = E_obj QE tau A_app t_int PSF(x, y, x_obj, y_obj)`. The PSF is integrated over each
//! pixel, along the true track of the exposure.
//!
//! Reference: Clark et al. 2021.
//! Validity: sources smaller than the PSF; their light adds up.
//! Price: the pixels of each image, once for each sample of its track (`scene::work`), and a sum a
//! pixel.

use super::cause::{counted, none_lit, three_digits};
use super::{Assessment, Effect, LazyBound, Pass};
use crate::fidelity::Fidelity;
use crate::scene::bounds::{
    ALL_FULL, final_change_e, is_flooded_without, lit_e, with_transfer_smear,
};
use crate::scene::{EffectId, Lit, Scene, Source, still_ms};

/// The stars.
pub(crate) const STARS: Effect = Effect::light(EffectId::Stars, "stars", assess_stars);
/// The resident space objects.
pub(crate) const RSOS: Effect = Effect::light(EffectId::Rsos, "rsos", assess_rsos);

fn assess_stars<'s>(scene: &'s Scene, fidelity: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    // Computed with the light of all sources.
    let own_e = |_: &[&Source]| scene.stars_e.clone();
    assess(scene, fidelity, (EffectId::Stars, "star"), own_e)
}

fn assess_rsos<'s>(scene: &'s Scene, fidelity: &Fidelity) -> (Assessment<'s>, Pass<'s>) {
    assess_kind(scene, fidelity, (EffectId::Rsos, "object"))
}

/// [`assess`] for sources whose own light has to be computed.
pub(super) fn assess_kind<'s>(
    scene: &'s Scene,
    fidelity: &Fidelity,
    kind: (EffectId, &'static str),
) -> (Assessment<'s>, Pass<'s>) {
    let own_e = |drawn: &[&Source]| lit_e(scene, drawn.iter().copied().map(Lit::from));
    assess(scene, fidelity, kind, own_e)
}

/// The assessment of sources of a kind; `own_e` bounds their light alone, `what` is the noun for
/// one.
fn assess<'s>(
    scene: &'s Scene,
    fidelity: &Fidelity,
    (effect, what): (EffectId, &'static str),
    own_e: impl Fn(&[&Source]) -> Vec<f64> + Send + 's,
) -> (Assessment<'s>, Pass<'s>) {
    let lit = |s: &&Source| s.body.effect() == effect && s.electrons > 0.0;
    let drawn: Vec<&Source> = scene.sources.iter().filter(lit).collect();
    let pixels: usize = drawn.iter().map(|s| s.footprint.shares().len()).sum();
    let assessment = if pixels == 0 {
        Assessment::none(none_lit(scene, what, effect))
    } else {
        let brightest = drawn.iter().map(|s| s.electrons).fold(0.0, f64::max);
        let (all, max_e) = (counted(drawn.len(), what), three_digits(brightest));
        let because = format!("{all} in the field, up to {max_e} e-");
        if is_flooded_without(scene, effect) {
            Assessment::none(format!("{because}: {ALL_FULL}"))
        } else {
            // Their own light, and their part of the frame-transfer smear.
            let all = drawn.clone();
            let cells_e =
                move || with_transfer_smear(scene, own_e(&all), || scene.transfer_smear_e.clone());
            // Hidden sources have images too: labels give their signal in full light.
            let made = scene.sources.iter().filter(|s| s.body.effect() == effect);
            let error = LazyBound::of(move || final_change_e(scene, cells_e, effect));
            Assessment {
                // Faint light is drawn in whole electrons too.
                drawn_e: drawn.iter().map(|source| source.electrons).sum(),
                ..Assessment::new(because, error, still_ms(scene, made, fidelity))
            }
        }
    };
    let pass = Pass::Tile(Box::new(move |tile| {
        let (rows, width) = (tile.rows(), tile.width);
        for source in &drawn {
            let (footprint, e) = (&source.footprint, source.electrons);
            footprint.light(tile.level, e, rows.clone(), width, tile.electrons);
        }
    }));
    (assessment, pass)
}
