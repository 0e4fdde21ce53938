//! Rendering: applies the plan's passes to bands of rows in parallel, or to the whole frame. It
//! cannot fail.
//!
//! A band's charge stays in a core's second-level cache from the first light to the pixel values.
//! Consecutive passes on single pixels process it run by run in the first-level cache. A charge
//! image exists only for a pass on the whole frame, or on request. Frames of equal shape reuse
//! memory.

use crate::effect::{Decision, EFFECTS, Pass, Stage};
use crate::frame::{Charge, Frame, Memory, Tile};
use crate::plan::{Plan, Step};
use crate::scene::Scene;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;
use std::cell::Cell;
use std::mem;
use std::sync::{Mutex, PoisonError};

/// Rows of a band.
pub const BAND_ROWS: usize = 32;
/// Pixels of a run.
const RUN: usize = 2048;

thread_local! {
    /// A thread's buffer for a band's charge, e-.
    static CHARGE: Cell<Vec<f32>> = const { Cell::new(Vec::new()) };
}

/// Renders `scene` with the vector instructions of `level`; without a level pixel by pixel, pass by
/// pass over the whole frame, on one thread. Pixels do not depend on level, bands, runs or threads.
/// With `keep` the frame has the expected electrons and the charge too. It takes its buffers from
/// `memory`. `done` gets the first pixel and the values of each complete band, on the band's
/// thread, roughly from top to bottom; it is not called if all bands complete together.
pub fn render(
    plan: &Plan<'_>,
    scene: &Scene,
    level: Option<Level>,
    keep: bool,
    memory: &mut Memory,
    done: &(dyn Fn(usize, &[u16]) + Sync),
) -> Frame {
    let detector = &scene.view.camera.detector;
    let (width, height) = (detector.width, detector.height);
    let mut dn = mem::take(&mut memory.dn);
    let together = &plan.together;
    let mut slots = [together; EFFECTS.len()];
    let passes = running(&plan.steps, scene, together, &mut slots);
    let mut frame = Frame {
        width,
        height,
        ..Frame::default()
    };
    if level.is_some() && !keep && !passes.iter().any(|pass| is_whole(pass)) {
        grow(&mut dn, scene);
        bands(scene, &mut dn, level, passes, done);
    } else {
        let mut electrons = mem::take(&mut memory.electrons);
        dn.clear();
        electrons.clear();
        grow(&mut dn, scene);
        grow(&mut electrons, scene);
        if scene.is_cancelled() {
            (memory.dn, memory.electrons) = (dn, electrons);
            return frame;
        }
        let light = plan
            .steps
            .partition_point(|step| step.effect.stage <= Stage::Light);
        let (light, later) = plan.steps.split_at(light);
        let light = running(light, scene, together, &mut slots);
        run(light, scene, level, &mut electrons, &mut dn);
        frame.expected_e = keep.then(|| electrons.clone());
        let later = running(later, scene, together, &mut slots);
        run(later, scene, level, &mut electrons, &mut dn);
        if keep {
            frame.charge_e = Some(electrons);
        } else {
            memory.electrons = electrons;
        }
    }
    frame.dn = dn;
    frame
}

/// Resizes a buffer to the frame's pixels, piece by piece until the frame is cancelled: new memory
/// takes 1 us per page, 100 ms for a large frame.
fn grow<T: Copy + Default>(memory: &mut Vec<T>, scene: &Scene) {
    const PIECE: usize = 1 << 20;
    let pixels = scene.view.camera.detector.pixels();
    memory.truncate(pixels);
    memory.reserve_exact(pixels - memory.len());
    while memory.len() < pixels && !scene.is_cancelled() {
        memory.resize(pixels.min(memory.len() + PIECE), T::default());
    }
}

/// The passes of `steps` that run, in `slots`. If all area sources run, `together` replaces their
/// passes.
fn running<'r, 'a, 's>(
    steps: &'a [Step<'s>],
    scene: &Scene,
    together: &'a Pass<'s>,
    slots: &'r mut [&'a Pass<'s>],
) -> &'r [&'a Pass<'s>] {
    let lit = || scene.areas.iter().filter(|area| area.electrons > 0.0);
    let is_area = |step: &Step<'_>| lit().any(|area| area.effect == step.effect.id);
    let running = steps.iter().filter_map(|step| match &step.decision {
        Decision::Run { pass, .. } => Some((pass, is_area(step))),
        Decision::Off { .. } | Decision::Skip { .. } => None,
    });
    let areas = running.clone().filter(|(_, is_area)| *is_area).count();
    let is_sum = areas >= 2 && areas >= lit().count();
    let mut first = Some(together);
    let passes = running.filter_map(|(pass, is_area)| {
        if is_sum && is_area {
            first.take()
        } else {
            Some(pass)
        }
    });
    let count = slots.iter_mut().zip(passes).fold(0, |count, (slot, pass)| {
        *slot = pass;
        count + 1
    });
    &slots[..count]
}

/// All passes, band by band, each band in its own buffer.
fn bands(
    scene: &Scene,
    dn: &mut [u16],
    level: Option<Level>,
    passes: &[&Pass<'_>],
    done: &(dyn Fn(usize, &[u16]) + Sync),
) {
    let band = scene.view.camera.detector.width * BAND_ROWS;
    // Each thread takes the next band from the top: the upper part of the frame completes first and
    // can be sent.
    let left = Mutex::new(dn.chunks_mut(band).enumerate());
    let next = || {
        let mut left = left.lock().unwrap_or_else(PoisonError::into_inner);
        left.next().filter(|_| !scene.is_cancelled())
    };
    (0..rayon::current_num_threads())
        .into_par_iter()
        .for_each(|_| {
            while let Some((index, dn)) = next() {
                let mut electrons = CHARGE.take();
                electrons.clear();
                electrons.resize(dn.len(), 0.0);
                dn.fill(0);
                let mut tile = tile_of(scene, level, index * band, &mut electrons, dn);
                apply(&mut tile, passes);
                CHARGE.set(electrons);
                done(index * band, dn);
            }
        });
}

/// Runs passes in order. Those between two passes on the whole frame run together, band by band.
fn run(
    passes: &[&Pass<'_>],
    scene: &Scene,
    level: Option<Level>,
    electrons: &mut [f32],
    dn: &mut [u16],
) {
    let width = scene.view.camera.detector.width;
    for group in passes.chunk_by(|a, b| !is_whole(a) && !is_whole(b)) {
        if scene.is_cancelled() {
            return;
        }
        if let [Pass::Frame(pass)] = group {
            pass(&mut Charge { width, electrons });
            continue;
        }
        if level.is_some() {
            let tiles = tiles(scene, level, electrons, dn);
            let tiles = tiles.filter(|_| !scene.is_cancelled());
            tiles.for_each(|mut tile| apply(&mut tile, group));
            continue;
        }
        let mut whole = tile_of(scene, level, 0, electrons, dn);
        for pass in group {
            if let Pass::Tile(pass) | Pass::Pixels(pass) = pass {
                pass(&mut whole);
            }
        }
    }
}

/// Applies `passes` to a band.
fn apply(band: &mut Tile<'_>, passes: &[&Pass<'_>]) {
    for group in passes.chunk_by(|a, b| is_of_pixels(a) && is_of_pixels(b)) {
        match group {
            [Pass::Tile(pass)] => pass(band),
            group => {
                for mut run in band.runs(RUN) {
                    for pass in group {
                        if let Pass::Pixels(pass) = pass {
                            pass(&mut run);
                        }
                    }
                }
            }
        }
    }
}

/// A frame's bands of rows.
pub fn tiles<'a>(
    scene: &Scene,
    level: Option<Level>,
    electrons: &'a mut [f32],
    dn: &'a mut [u16],
) -> impl ParallelIterator<Item = Tile<'a>> {
    let band = scene.view.camera.detector.width * BAND_ROWS;
    let bands = electrons.par_chunks_mut(band).zip(dn.par_chunks_mut(band));
    bands
        .enumerate()
        .map(move |(index, (electrons, dn))| tile_of(scene, level, index * band, electrons, dn))
}

/// The part of a frame from pixel `first` on.
fn tile_of<'a>(
    scene: &Scene,
    level: Option<Level>,
    first: usize,
    electrons: &'a mut [f32],
    dn: &'a mut [u16],
) -> Tile<'a> {
    Tile {
        first,
        width: scene.view.camera.detector.width,
        electrons,
        dn,
        key: scene.view.key,
        level,
    }
}

fn is_whole(pass: &Pass<'_>) -> bool {
    matches!(pass, Pass::Frame(_))
}

fn is_of_pixels(pass: &Pass<'_>) -> bool {
    matches!(pass, Pass::Pixels(_))
}
