//! Rendering: the plan's passes over bands of rows, in parallel. It cannot fail.

use crate::effect::{Stage, Verdict};
use crate::frame::{Frame, Tile};
use crate::plan::Plan;
use crate::scene::Scene;
use rayon::prelude::*;

/// Rows of a tile: a tile of 1024 columns then keeps its charge in a core's second-level cache.
const TILE_ROWS: usize = 32;

/// Renders `scene`. Pixels depend neither on the number of threads nor on the tiles. `keep_expected` keeps the
/// expected electrons too.
pub fn render(plan: &Plan<'_>, scene: &Scene, keep_expected: bool) -> Frame {
    let (width, height) = (scene.camera.detector.width, scene.camera.detector.height);
    let mut digits = vec![0; width * height];
    let mut electrons = vec![0.0f32; width * height];
    let mut expected = vec![0.0f32; if keep_expected { width * height } else { 0 }];
    let in_tile = width * TILE_ROWS;

    let tiles = electrons
        .par_chunks_mut(in_tile)
        .zip(digits.par_chunks_mut(in_tile));
    let work = |(index, (electrons, digits)): (usize, (&mut [f32], &mut [u16])),
                kept: &mut [f32]| {
        let rows = digits.len() / width;
        let mut tile = Tile {
            row: index * TILE_ROWS,
            rows,
            width,
            electrons,
            digits,
            key: scene.key,
        };
        run(plan, |stage| stage == Stage::Light, &mut tile);
        kept.copy_from_slice(&tile.electrons[..kept.len()]);
        run(plan, |stage| stage > Stage::Light, &mut tile);
    };
    if keep_expected {
        let kept = expected.par_chunks_mut(in_tile);
        tiles
            .enumerate()
            .zip(kept)
            .for_each(|(tile, kept)| work(tile, kept));
    } else {
        tiles.enumerate().for_each(|tile| work(tile, &mut []));
    }
    Frame {
        width,
        height,
        digits,
        expected_e: keep_expected.then_some(expected),
    }
}

fn run(plan: &Plan<'_>, wanted: impl Fn(Stage) -> bool, tile: &mut Tile<'_>) {
    for step in plan.steps.iter().filter(|step| wanted(step.effect.stage)) {
        if let Verdict::Run { pass, .. } = &step.verdict {
            pass(tile);
        }
    }
}
