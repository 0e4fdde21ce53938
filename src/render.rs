//! Rendering: the plan's passes, over bands of rows in parallel or over the whole frame. It cannot fail.

use crate::effect::{Pass, Stage, Verdict};
use crate::frame::{Charge, Frame, Tile};
use crate::plan::{Plan, Step};
use crate::scene::Scene;
use rayon::prelude::*;

/// Rows of a tile: a tile of 1024 columns then keeps its charge in a core's second-level cache.
const TILE_ROWS: usize = 32;

/// Renders `scene`. Pixels depend neither on the number of threads nor on the tiles. `keep` keeps the expected
/// electrons and the charge too.
pub fn render(plan: &Plan<'_>, scene: &Scene, keep: bool) -> Frame {
    let detector = &scene.view.camera.detector;
    let (width, height) = (detector.width, detector.height);
    let mut digits = vec![0; width * height];
    let mut electrons = vec![0.0f32; width * height];

    let mut rest = &plan.steps[..];
    let expected_e = keep.then(|| {
        let light = rest.partition_point(|step| step.effect.stage <= Stage::Light);
        let (light, later) = rest.split_at(light);
        run(light, scene, &mut electrons, &mut digits);
        rest = later;
        electrons.clone()
    });
    run(rest, scene, &mut electrons, &mut digits);
    Frame {
        width,
        height,
        digits,
        expected_e,
        charge_e: keep.then_some(electrons),
    }
}

/// Passes over bands go together, band by band, up to a pass that needs the whole frame.
fn run(steps: &[Step<'_>], scene: &Scene, electrons: &mut [f32], digits: &mut [u16]) {
    let width = scene.view.camera.detector.width;
    let passes = steps.iter().filter_map(|step| match &step.verdict {
        Verdict::Run { pass, .. } => Some(pass),
        Verdict::Off { .. } | Verdict::Skip { .. } => None,
    });
    let passes: Vec<&Pass<'_>> = passes.collect();
    for group in passes.chunk_by(|a, b| !is_whole(a) && !is_whole(b)) {
        if let [Pass::Frame(pass)] = group {
            pass(&mut Charge { width, electrons });
            continue;
        }
        tiles(scene, electrons, digits).for_each(|mut tile| {
            for pass in group {
                if let Pass::Tile(pass) = pass {
                    pass(&mut tile);
                }
            }
        });
    }
}

/// A frame's bands of rows.
pub fn tiles<'a>(
    scene: &Scene,
    electrons: &'a mut [f32],
    digits: &'a mut [u16],
) -> impl ParallelIterator<Item = Tile<'a>> {
    let (width, key) = (scene.view.camera.detector.width, scene.view.key);
    let bands = electrons
        .par_chunks_mut(width * TILE_ROWS)
        .zip(digits.par_chunks_mut(width * TILE_ROWS));
    bands
        .enumerate()
        .map(move |(index, (electrons, digits))| Tile {
            row: index * TILE_ROWS,
            rows: digits.len() / width,
            width,
            electrons,
            digits,
            key,
        })
}

fn is_whole(pass: &Pass<'_>) -> bool {
    matches!(pass, Pass::Frame(_))
}
