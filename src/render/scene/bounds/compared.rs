//! Changes of images with other effects: bounds for all, true differences where the bounds are
//! largest.
//!
//! The change of every source is bounded first (`image`). In the cell with the largest sum, the
//! greatest bounds are replaced: the other image is formed, and both are compared pixel by pixel.
//! `points` chooses the cells, until the bounds are no more than the known changes. The number of
//! compared pixels is limited (`Compared::spare`), because forming images is expensive.

use super::cells::{CELL, cells};
use super::image::{BoundChange, Image, changes, lines_of_sight};
use crate::camera::Detector;
use crate::fidelity::Fidelity;
use crate::scene::content::Scene;
use crate::scene::effect_set::{EffectId, EffectSet};
use crate::scene::imaging::Imaging;
use crate::scene::source::{Candidate, Source};
use std::ops::Range;

/// Limit of recomputed pixels for a skipped effect, in each frame.
const SKIPPED: u64 = 1_000;
/// The same for an effect that runs (only for printed plans): `1 / PART` of the pixels of all
/// images, and `MORE`.
const PART: u64 = 4;
const MORE: u64 = 1_000_000;
/// Number of the greatest bounds that may be replaced.
const GREATEST: usize = 128;

/// The bound of the change of one source's light.
struct Light<'a> {
    source: &'a Source,
    e: f64,
    /// How far from the image the change reaches, px.
    margin: usize,
    /// Whether the true change has replaced the bound.
    settled: bool,
}

/// An image with the scene's effects, and with the other effects.
struct Pair<'a> {
    current: Option<&'a Source>,
    other: Option<Source>,
}

/// The images of a scene, and their changes with other effects.
pub(crate) struct Compared<'a> {
    scene: &'a Scene,
    other: EffectSet,
    fidelity: Fidelity,
    /// The greatest first.
    lights: Vec<Light<'a>>,
    pairs: Vec<Pair<'a>>,
    /// Sum of the bounds in each cell (`cells`), e-.
    bounds: Vec<f64>,
    /// Sum of the known changes in each cell, with pixel response, e-.
    known: Vec<f64>,
    /// Columns of cells.
    columns: usize,
    /// Remaining number of pixels that may be computed.
    spare: u64,
}

/// The changes of the pixels of a column of cells, e-.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Peak {
    /// The known change of the cell with the greatest sum of known change and bound.
    pub known: f64,
    /// The bound of that cell's other sources.
    pub bound: f64,
    /// That cell's row.
    pub row: usize,
    /// The greatest bound in any cell of the column, and its row.
    pub max_bound: (f64, usize),
    /// Bounds of the change of a column of pixels: by known changes, and by other sources.
    pub all: [f64; 2],
}

/// Compares the images with those of the effects `other`; `faint` and `change` bound the change of
/// each ([`changes`]). With `enters`, further sources may come onto the detector.
pub(crate) fn compare<'a>(
    scene: &'a Scene,
    other: &EffectSet,
    enters: bool,
    faint: impl Fn(&Source) -> Option<f64> + Sync,
    change: impl Fn(&Image<'_>) -> BoundChange + Sync,
) -> Compared<'a> {
    let (detector, now) = (&scene.view.camera.detector, &scene.simulated);
    let columns = detector.width.div_ceil(CELL);
    let cells = columns * detector.height.div_ceil(CELL);
    let pixels: u64 = scene.sources.iter().map(|s| s.footprint.evaluated()).sum();
    let skipped = now.and_shapes(other) != *now;
    let mut fidelity = scene.fidelity;
    if skipped {
        // Short tracks are sampled too, not replaced by still images.
        fidelity.skip_px = 0.0;
    }
    let lights = changes(scene, faint, change).into_iter();
    let lights = lights.map(|(source, e, margin)| Light {
        source,
        e,
        margin,
        settled: false,
    });
    let mut compared = Compared {
        scene,
        other: *other,
        fidelity,
        lights: lights.collect(),
        pairs: Vec::new(),
        bounds: vec![0.0; cells],
        known: vec![0.0; cells],
        columns,
        spare: if skipped {
            SKIPPED
        } else {
            pixels / PART + MORE
        },
    };
    let lights = compared.lights.iter();
    for light in lights.take_while(|_| !scene.is_cancelled()) {
        each_cell(detector, light, |cell| compared.bounds[cell] += light.e);
    }
    let lights = &mut compared.lights;
    let falling = |a: &Light<'_>, b: &Light<'_>| b.e.total_cmp(&a.e);
    if lights.len() > GREATEST {
        lights.select_nth_unstable_by(GREATEST, falling);
        lights.truncate(GREATEST);
    }
    lights.sort_by(falling);
    if enters {
        for source in entering(scene, other) {
            compared.add_pair(Pair {
                current: None,
                other: Some(source),
            });
        }
    }
    compared
}

impl<'a> Compared<'a> {
    /// The changes of each column of cells.
    pub fn peaks(&self) -> Vec<Peak> {
        let mut peaks = vec![Peak::default(); self.columns];
        let rows = self.known.chunks_exact(self.columns);
        let rows = rows.zip(self.bounds.chunks_exact(self.columns));
        for (row, (known, bounds)) in rows.enumerate() {
            for (peak, (known, bound)) in peaks.iter_mut().zip(known.iter().zip(bounds)) {
                let bound = bound.max(0.0);
                if known + bound > peak.known + peak.bound {
                    (peak.known, peak.bound, peak.row) = (*known, bound, row);
                }
                if bound > peak.max_bound.0 {
                    peak.max_bound = (bound, row);
                }
                let pixels = CELL as f64;
                peak.all = [peak.all[0] + known * pixels, peak.all[1] + bound * pixels];
            }
        }
        peaks
    }

    /// Replaces the greatest bounds in a cell by true changes, until the remaining bounds are no
    /// greater than these. Returns the changed columns of cells; none if no bound can be replaced.
    pub fn replace_bounds(&mut self, column: usize, row: usize) -> Vec<usize> {
        let scene = self.scene;
        let detector = &scene.view.camera.detector;
        let wanted = row * self.columns + column;
        let mut replaced = Vec::new();
        for i in (0..self.lights.len()).take_while(|_| !scene.is_cancelled()) {
            let light = &mut self.lights[i];
            let mut reaches = false;
            if !light.settled {
                each_cell(detector, light, |cell| reaches |= cell == wanted);
            }
            if !reaches {
                continue;
            }
            let (source, e) = (light.source, light.e);
            let pixels = pixels(scene, source, &self.other, &self.fidelity);
            if pixels > self.spare {
                break;
            }
            self.spare -= pixels;
            light.settled = true;
            each_cell(detector, light, |cell| {
                self.bounds[cell] -= e;
                replaced.push(cell % self.columns);
            });
            self.add_pair(Pair {
                current: Some(source),
                other: other_image(scene, source, &self.other, &self.fidelity),
            });
            if self.bounds[wanted] <= self.known[wanted] {
                break;
            }
        }
        replaced
    }

    /// Adds the difference of a pair of images to the known changes.
    fn add_pair(&mut self, pair: Pair<'a>) {
        let (detector, columns) = (&self.scene.view.camera.detector, self.columns);
        let response = self.scene.simulated.has(EffectId::PixelResponse);
        let mut greatest = vec![0.0f64; columns];
        let mut row_of_cells = 0;
        let known = &mut self.known;
        let mut add = |row: usize, greatest: &mut [f64]| {
            for (known, e) in known[row * columns..].iter_mut().zip(greatest) {
                *known += std::mem::take(e);
            }
        };
        pair.each(detector, |row, column, e| {
            if row / CELL != row_of_cells {
                add(row_of_cells, &mut greatest);
                row_of_cells = row / CELL;
            }
            let e = if response {
                e * detector.pattern.response_of(row * detector.width + column)
            } else {
                e
            };
            let cell = &mut greatest[column / CELL];
            *cell = cell.max(e.abs());
        });
        add(row_of_cells, &mut greatest);
        self.pairs.push(pair);
    }

    /// The known change of the light of each pixel of `columns`, one column after the other, e-.
    pub fn change_e(&self, columns: &Range<usize>) -> Vec<f64> {
        let detector = &self.scene.view.camera.detector;
        let mut change = vec![0.0; columns.len() * detector.height];
        let pairs = self.pairs.iter();
        for pair in pairs.take_while(|_| !self.scene.is_cancelled()) {
            pair.each(detector, |row, column, e| {
                if columns.contains(&column) {
                    change[(column - columns.start) * detector.height + row] += e;
                }
            });
        }
        change
    }
}

impl Pair<'_> {
    /// Calls `each` with row, column and change (e-) of every pixel of either image, row by row.
    fn each(&self, detector: &Detector, mut each: impl FnMut(usize, usize, f64)) {
        for row in 0..detector.height {
            let (a, was, was_e) = line(self.current, row);
            let (b, is, is_e) = line(self.other.as_ref(), row);
            for (column, share) in (a..).zip(was) {
                let other = column.checked_sub(b).and_then(|i| is.get(i));
                let other = other.map_or(0.0, |share| f64::from(*share) * is_e);
                each(row, column, other - f64::from(*share) * was_e);
            }
            for (column, share) in (b..).zip(is) {
                if !(a..a + was.len()).contains(&column) {
                    each(row, column, f64::from(*share) * is_e);
                }
            }
        }
    }
}

/// The images that touch the detector with the effects `without`, but not in the scene.
pub(crate) fn entering(scene: &Scene, without: &EffectSet) -> Vec<Source> {
    if *without == scene.simulated {
        return Vec::new();
    }
    let (view, fidelity) = (&scene.view, &scene.fidelity);
    let (optics, detector) = (&view.camera.optics, &view.camera.detector);
    let projection = optics.projection_if(without.has(EffectId::Distortion));
    let seen = lines_of_sight(scene);
    let readout_px = view.longest_track_px(view.camera.readout_s()) / 2.0;
    let margin = optics.psf.reach_px(fidelity.psf_loss) + readout_px + 1.0;
    let comes_near = |candidate: &Candidate| {
        let positions = seen(&candidate.body).map(|seen| optics.project_by(&projection, &seen));
        let positions: Vec<[f64; 2]> = positions.into_iter().flatten().collect();
        [detector.width, detector.height]
            .iter()
            .enumerate()
            .all(|(k, pixels)| {
                let along = || positions.iter().map(|at| at[k]);
                let (low, high) = (
                    along().fold(f64::MAX, f64::min),
                    along().fold(f64::MIN, f64::max),
                );
                // The path may bend between the three positions.
                let margin = margin + (high - low) / 2.0;
                low <= *pixels as f64 + margin && high >= -margin
            })
    };
    let mut imaged = scene
        .sources
        .iter()
        .map(|source| source.body.identity())
        .peekable();
    let missing = view.candidates.iter().filter(|candidate| {
        let has_image = imaged.next_if_eq(&candidate.body.identity()).is_some();
        let shines = scene.simulated.has(candidate.body.effect());
        !has_image && shines && candidate.electrons() > 0.0 && comes_near(candidate)
    });
    let imaging = Imaging {
        view,
        simulated: without,
        fidelity,
    };
    missing
        .filter_map(|candidate| imaging.image(candidate))
        .collect()
}

/// The image of a source with other effects; none if it then does not touch the detector.
fn other_image(
    scene: &Scene,
    source: &Source,
    other: &EffectSet,
    fidelity: &Fidelity,
) -> Option<Source> {
    let wanted = source.body.identity();
    let candidates = &mut scene.view.candidates.iter();
    let candidate = candidates.find(|candidate| candidate.body.identity() == wanted)?;
    let imaging = Imaging {
        view: &scene.view,
        simulated: other,
        fidelity,
    };
    imaging.image(candidate)
}

/// Estimated number of pixels that [`other_image`] evaluates.
fn pixels(scene: &Scene, source: &Source, other: &EffectSet, fidelity: &Fidelity) -> u64 {
    let evaluated = source.footprint.evaluated();
    let moves = |of: &EffectSet| of.moves_images();
    if moves(other) {
        // A short track has two pieces of two points.
        return if moves(&scene.simulated) {
            evaluated
        } else {
            4 * evaluated
        };
    }
    let drawn_px = (scene.view.camera.optics.psf).drawn_px(fidelity, source.clear_e);
    evaluated.min((2.0 * drawn_px + 1.0).powi(2) as u64)
}

/// A row of a source's image: its first column, its shares, and the electrons of the source.
fn line(source: Option<&Source>, row: usize) -> (usize, &[f32], f64) {
    let of = source.and_then(|source| {
        let (_, first, shares) = source.footprint.rows(row..row + 1).next()?;
        Some((first, shares, source.electrons))
    });
    of.unwrap_or((0, &[], 0.0))
}

/// Calls `each` once with every cell that a light's change reaches.
fn each_cell(detector: &Detector, light: &Light<'_>, each: impl FnMut(usize)) {
    cells(detector, light.source, light.margin, each);
}
