//! Area light on the pixels.
//!
//! Smooth light is evaluated on an adaptive grid and interpolated between its nodes (`lines`);
//! pixels are computed only when drawn. At an edge, or with detail of a few pixels, each pixel is
//! the mean over its area and its time (`sampled`), blurred by the point spread function (`blur`).
//! Its difference from the interpolation is stored separately (`runs`).

use super::blur::Blur;
use super::full::Full;
use super::grid::{Grid, LARGEST, SMALLEST};
use super::known::Known;
use super::light::Light;
use super::lines::{Lines, Square};
use super::motion::MIN_SQUARE_PX;
use super::near;
use super::plane::Plane;
use super::radiance::Radiance;
use super::raster_work::RasterWork;
use super::runs::Runs;
use super::sampled::{Sampled, sampled};
use crate::fidelity::Fidelity;
use rayon::prelude::*;

/// Greatest interpolation error, in tolerances, at which the middle of a pixel represents the
/// whole. At a kink of s e-/px, lines across [`SMALLEST`] err by s / 2 and the middle by s / 8; for
/// smooth bends the middle errs by far less.
const MIDDLE: f64 = 4.0;
/// For a smooth bend, a quarter of a square has a quarter of the error. A smaller error indicates a
/// kink or a thin layer between the nodes. A small error is accepted only if that of the larger
/// square was at most `MAX_PARENT_ERROR` tolerances.
const QUARTERED: f64 = 4.0;
const MAX_PARENT_ERROR: f64 = 1.5 * QUARTERED;
/// Further positions of a square (0..1) at which the interpolation is checked; and the error that
/// is permitted there because of kinks, in tolerances.
const BETWEEN: [[f64; 2]; 2] = [[0.31, 0.69], [0.69, 0.31]];
const KINK: f64 = 2.0;

/// Squares of the grid: those that are interpolated, and those whose pixels are sampled.
#[derive(Default)]
struct Pieces {
    even: Vec<Square>,
    sampled: Vec<(Square, Sampled)>,
    work: RasterWork,
}

/// A square of the plane, with the light at its nine nodes.
struct Part {
    x: i64,
    y: i64,
    side: usize,
    nodes: [Option<f64>; 9],
    /// The interpolation error of its parent square, in tolerances; 0 for the largest.
    missed: f64,
}

/// Rasterizes `radiance` and counts the work. No light once the work limit is over.
pub(crate) fn rasterize(
    radiance: &dyn Radiance,
    plane: &Plane<'_>,
    blur: &Blur<'_>,
    full: &Full,
    fidelity: &Fidelity,
) -> (Light, RasterWork) {
    let grid = Grid::new(radiance, plane, blur.margin(), full, fidelity);
    let size = grid.detector.map(|pixels| pixels + 2 * grid.rim);
    let side = largest(radiance, plane, grid.detector);
    let known = Known::of(&grid, side);
    let [across, down] = size.map(|pixels| pixels.div_ceil(LARGEST));
    let squares = (0..across * down).into_par_iter().map(|i| {
        let mut refinement = Refinement {
            grid: &grid,
            known: &known,
            pieces: Pieces::default(),
        };
        let from = [i % across, i / across].map(|i| i * LARGEST);
        refinement.divide(from, LARGEST);
        refinement.pieces
    });
    let squares: Vec<Pieces> = squares.collect();
    if plane.limit().is_over() {
        return (Light::default(), known.work);
    }
    let (mut even, mut marked, mut work) = (Vec::new(), Vec::new(), known.work);
    for pieces in squares {
        even.extend(pieces.even);
        marked.extend(pieces.sampled);
        work += pieces.work;
    }
    let lines = Lines::new(size, LARGEST, even);
    let blocks = sampled(&grid, marked, &mut work);
    let runs = near::runs(blur, plane.limit(), &lines, grid.rim, &blocks, &mut work);
    if plane.limit().is_over() {
        return (Light::default(), work);
    }
    let lines = lines.within(grid.rim, grid.detector);
    (Light::new(lines, Runs::new(grid.detector, runs)), work)
}

/// Side of the squares that are evaluated first, px: at most the detail of the light, and a quarter
/// of the detector, because the optics vary the light over the field.
fn largest(radiance: &dyn Radiance, plane: &Plane<'_>, [columns, rows]: [usize; 2]) -> usize {
    let detail_px = radiance.detail() * plane.scale_px();
    let max_px = detail_px.min(columns.min(rows) as f64 / 4.0);
    let mut side = LARGEST;
    while side > MIN_SQUARE_PX && side as f64 > max_px {
        side /= 2;
    }
    side
}

/// The adaptive refinement of one of the grid's largest squares.
struct Refinement<'g, 'a, 'v> {
    grid: &'g Grid<'a, 'v>,
    known: &'g Known,
    pieces: Pieces,
}

impl Refinement<'_, '_, '_> {
    /// Interpolates a square, given by its first column and row, if that agrees with all known
    /// nodes; else divides it.
    fn divide(&mut self, [x, y]: [usize; 2], side: usize) {
        let (grid, known) = (self.grid, self.known);
        if !grid.is_needed([x, y], side) {
            return;
        }
        if side > known.side {
            if let Some(square) = known.whole([x, y], side, grid) {
                self.pieces.even.push(square);
                return;
            }
            let half = side / 2;
            for [dx, dy] in [[0, 0], [half, 0], [0, half], [half, half]] {
                self.divide([x + dx, y + dy], half);
            }
            return;
        }
        let nodes = known.nine([x, y], side);
        let [x, y] = [x, y].map(|i| i as i64 - grid.rim as i64);
        let part = Part {
            x,
            y,
            side,
            nodes,
            missed: 0.0,
        };
        self.refine(part);
    }

    /// Whether a moving edge may cross a square.
    fn has_edge(&mut self, square: &Part) -> bool {
        let plane = self.grid.plane;
        let Some(edge) = self.grid.radiance.edge() else {
            return false;
        };
        let half = square.side as f64 / 2.0;
        let middle = [square.x as f64 + half, square.y as f64 + half];
        let Some((seen, _)) = plane.solid_angle_sr(middle) else {
            return true;
        };
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        let radius = corners.iter().map(|[x, y]| {
            let corner =
                plane.solid_angle_sr([middle[0] + x * (half + 1.0), middle[1] + y * (half + 1.0)]);
            corner.map_or(f64::INFINITY, |(corner, _)| (corner - seen).norm())
        });
        let radius = radius.fold(0.0, f64::max) + self.grid.motion / 2.0;
        let sky = plane.to_sky(plane.open_s(middle[1])[0]);
        self.pieces.work.edges += 1;
        let nearest = edge.angle(&(sky * seen)).abs();
        nearest <= radius || nearest.is_nan()
    }

    /// The light at a position, e-.
    fn at(&mut self, x: f64, y: f64) -> Option<f64> {
        self.grid.at(x, y, &mut self.pieces.work)
    }

    /// The light at the nine nodes of a square with those corners.
    fn between(
        &mut self,
        [x, y]: [i64; 2],
        side: usize,
        [a, b, c, d]: [Option<f64>; 4],
    ) -> [Option<f64>; 9] {
        let (x, y, h) = (x as f64, y as f64, side as f64 / 2.0);
        let between = [[h, 0.0], [0.0, h], [h, h], [2.0 * h, h], [h, 2.0 * h]];
        let [top, left, middle, right, bottom] = between.map(|[dx, dy]| self.at(x + dx, y + dy));
        [a, top, b, left, middle, right, c, bottom, d]
    }

    /// The interpolation error at positions that are no node of any square, in tolerances.
    fn missed_between(&mut self, part: &Part) -> f64 {
        let missed = BETWEEN.map(|at| {
            let [u, v] = at.map(|at| 2.0 * at);
            let [left, above] = [u, v].map(|at| usize::from(at >= 1.0));
            let node = |i: usize| part.nodes[3 * above + left + i].unwrap_or(0.0);
            let across = |i: usize| node(i) + (node(i + 1) - node(i)) * (u - left as f64);
            let line = across(0) + (across(3) - across(0)) * (v - above as f64);
            let side = part.side as f64;
            let light = self.at(part.x as f64 + at[0] * side, part.y as f64 + at[1] * side);
            light.map_or(f64::INFINITY, |light| {
                (light - line).abs() / (KINK * self.grid.may_miss(light))
            })
        });
        missed[0].max(missed[1])
    }

    /// Interpolates, samples or quarters a square.
    fn refine(&mut self, part: Part) {
        let grid = self.grid;
        let Part {
            x,
            y,
            side,
            nodes,
            missed: before,
        } = part;
        let [dx, dy] = [x, y].map(|i| (i + grid.rim as i64) as usize);
        // Once the work limit is over, all nodes are unknown and squares would be halved to the
        // smallest.
        if grid.plane.limit().is_over() || !grid.is_needed([dx, dy], side) {
            return;
        }
        let half = side / 2;
        let [a, top, b, left, middle, right, c, bottom, d] = nodes;
        let square = Square {
            x: dx,
            y: dy,
            side,
            nodes: nodes.map(|node| node.unwrap_or(0.0) as f32),
        };
        // Beyond the domain of the projection there is no light; its boundary is an edge. The
        // excess of a full pixel is invisible.
        if nodes.iter().all(Option::is_none) || grid.full.has([x, y], side) {
            self.pieces.even.push(square);
            return;
        }
        let missed = missed_at_nodes(grid, &nodes);
        let is_whole = nodes.iter().all(Option::is_some) && !self.has_edge(&part);
        let may_be_even = is_whole && missed <= 1.0 && before <= MAX_PARENT_ERROR;
        // Thin layers of unknown size may lie between all nodes of any grid.
        let missed = if may_be_even && grid.radiance.detail() == 0.0 {
            missed.max(self.missed_between(&part))
        } else {
            missed
        };
        if may_be_even && missed <= 1.0 {
            self.pieces.even.push(square);
        } else if side <= SMALLEST {
            let bent = !is_whole || missed.max(before / QUARTERED) > MIDDLE;
            let how = if bent { Sampled::All } else { Sampled::Middle };
            self.pieces.sampled.push((square, how));
        } else {
            let quarters = [
                (0, 0, [a, top, left, middle]),
                (half, 0, [top, b, middle, right]),
                (0, half, [left, middle, c, bottom]),
                (half, half, [middle, right, bottom, d]),
            ];
            for (dx, dy, corners) in quarters {
                let [x, y] = [x + dx as i64, y + dy as i64];
                let quarter = Part {
                    x,
                    y,
                    side: half,
                    nodes: self.between([x, y], half, corners),
                    missed,
                };
                self.refine(quarter);
            }
        }
    }
}

/// The greatest error of lines between the corners of a square, at its other nodes, in tolerances.
fn missed_at_nodes(grid: &Grid<'_, '_>, nodes: &[Option<f64>; 9]) -> f64 {
    let [a, top, b, left, middle, right, c, bottom, d] = *nodes;
    let ends = [a, b, c, d].map(|node| node.unwrap_or(0.0));
    let lines = [
        (ends[0] + ends[1]) / 2.0,
        (ends[0] + ends[2]) / 2.0,
        ends.iter().sum::<f64>() / 4.0,
        (ends[1] + ends[3]) / 2.0,
        (ends[2] + ends[3]) / 2.0,
    ];
    let between = [top, left, middle, right, bottom];
    let missed = between.iter().zip(lines).map(|(node, line)| {
        // Lines between nine nodes have a quarter of the error of lines between four; in both
        // directions together up to half.
        node.map_or(f64::INFINITY, |node| {
            (node - line).abs() / (2.0 * grid.may_miss(node))
        })
    });
    missed.fold(0.0, f64::max)
}
