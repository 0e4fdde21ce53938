//! Area light on the pixels.
//!
//! Where it is even, its value is worked out on a grid that is as fine as it asks for, and runs in straight lines between (`lines`): where it is so
//! all over the field, no pixel is touched before it is drawn. Where there is an edge, or detail as small as a few pixels, each pixel is the mean over
//! its area and its time (`sampled`), and the point spread function blurs them (`blur`): what they have more than lines say is kept beside those (`runs`).

use super::blur::Blur;
use super::full::Full;
use super::known::Known;
use super::lines::{Lines, Square};
use super::plane::Plane;
use super::runs::Runs;
use super::sampled::Sampled;
use super::{Asked, Light, Radiance};
use crate::fidelity::Fidelity;
use nalgebra::Vector3;
use rayon::prelude::*;

/// Side of the grid's largest squares, px: of light whose detail is no larger, and of any.
const SQUARE: usize = 32;
const LARGEST: usize = 256;
/// Squares of this side that straight lines do not fill are sampled.
pub const SMALLEST: usize = 4;
/// Where lines miss no more than this many times what they may, the middle of a pixel stands for all of it: at a kink of s (e-/px) lines across
/// [`SMALLEST`] miss s / 2, and the middle s / 8; where light bends evenly, the middle misses far less.
const MIDDLE: f64 = 4.0;
/// Of an even bend lines across a quarter of a square miss a quarter of what they miss across it. Where they seem to miss less than that, a kink or a thin layer lies between
/// the places at which it is looked: what they miss is believed where it was no more than so many times what it may be before.
const QUARTERED: f64 = 4.0;
const LUCK: f64 = 1.5 * QUARTERED;
/// Places of a square (0..1) at which lines are looked at too, and how many times what they may they miss there at kinks.
const BETWEEN: [[f64; 2]; 2] = [[0.31, 0.69], [0.69, 0.31]];
const KINK: f64 = 2.0;
/// Longest part (px) of the way of what moves that three places are looked at on, and how much its middle may be off the line between its
/// ends, in units of what lines may miss: what Simpson's rule then errs by is far less.
const PANEL_PX: f64 = 4.0;
const BEND: f64 = 12.0;
/// ns of a look: the pointing then, and the radiance.
pub const AREA_LOOK_NS: f64 = 130.0;
/// How often a part is halved at most.
const HALVINGS: u32 = 5;

/// Squares of the grid: those that straight lines fill, and those whose pixels are worked out each for itself.
#[derive(Default)]
struct Pieces {
    even: Vec<Square>,
    sampled: Vec<(Square, Sampled)>,
    asked: Asked,
}

/// A square of the grid at a place of the plane, with the light at its nine places.
struct Part {
    x: i64,
    y: i64,
    side: usize,
    nodes: [Option<f64>; 9],
    /// How often lines across the square that it is a quarter of missed what they may; 0 of the largest.
    missed: f64,
}

/// What lays light on a grid.
pub struct Grid<'a, 'v> {
    pub radiance: &'a dyn Radiance,
    pub plane: &'a Plane<'v>,
    fidelity: &'a Fidelity,
    pub scale_e: f64,
    /// Where pixels are full of this light and others' together.
    full: &'a Full,
    /// How far (rad) the pattern moves while a pixel is open.
    pub motion: f64,
    /// Whether light without an edge is the same at all of that time as in its middle.
    pub is_still: bool,
    /// Columns and rows of the detector.
    pub detector: [usize; 2],
    /// Pixels that are needed around the detector.
    pub margin: usize,
    /// Columns and rows of the grid before the detector's first: those of whole squares, so that squares on the detector lie alike with any margin.
    pub rim: usize,
}

/// Lays `radiance`, of which a pixel takes `scale_e` electrons a steradian; and what was asked for it. No light once the work is over.
pub fn lay(
    radiance: &dyn Radiance,
    plane: &Plane<'_>,
    blur: &Blur<'_>,
    scale_e: f64,
    full: &Full,
    fidelity: &Fidelity,
) -> (Light, Asked) {
    let margin = blur.margin();
    let detector = blur.size();
    let grid = Grid {
        radiance,
        plane,
        fidelity,
        scale_e,
        full,
        motion: plane.motion(),
        is_still: panels(radiance, plane.motion() * plane.scale_px()) == 0,
        detector,
        margin,
        rim: margin.next_multiple_of(LARGEST),
    };
    let size = detector.map(|pixels| pixels + 2 * grid.rim);
    let side = largest(radiance, plane, detector);
    let known = Known::of(&grid, side);
    let [across, down] = size.map(|pixels| pixels.div_ceil(LARGEST));
    let squares = (0..across * down).into_par_iter().map(|i| {
        let mut pieces = Pieces::default();
        let from = [i % across, i / across].map(|i| i * LARGEST);
        grid.lay(from, LARGEST, &known, &mut pieces);
        pieces
    });
    let squares: Vec<Pieces> = squares.collect();
    if plane.limit().is_over() {
        return (Light::default(), known.asked);
    }
    let (mut even, mut sampled, mut asked) = (Vec::new(), Vec::new(), known.asked);
    for pieces in squares {
        even.extend(pieces.even);
        sampled.extend(pieces.sampled);
        asked += pieces.asked;
    }
    let lines = Lines::new(size, LARGEST, even);
    let sampled = grid.sampled(sampled, &mut asked);
    let runs = blur.runs(plane.limit(), &lines, grid.rim, &sampled, &mut asked);
    if plane.limit().is_over() {
        return (Light::default(), asked);
    }
    let light = Light::new(lines.within(grid.rim, detector), Runs::new(detector, runs));
    (light, asked)
}

/// The side (px) of the grid's largest squares: no more than the detail of its light, nor a quarter of the detector, over which optics bend it.
fn largest(radiance: &dyn Radiance, plane: &Plane<'_>, [columns, rows]: [usize; 2]) -> usize {
    let detail_px = radiance.detail() * plane.scale_px();
    let most = detail_px.min(columns.min(rows) as f64 / 4.0);
    let mut side = LARGEST;
    while side > SQUARE && side as f64 > most {
        side /= 2;
    }
    side
}

impl Grid<'_, '_> {
    /// The square of the grid from a column and row on: whole, if lines across it meet all that is known there, or its quarters.
    fn lay(&self, [x, y]: [usize; 2], side: usize, known: &Known, pieces: &mut Pieces) {
        if !self.is_needed([x, y], side) {
            return;
        }
        if side > known.side {
            if let Some(square) = known.whole([x, y], side, self) {
                pieces.even.push(square);
                return;
            }
            let half = side / 2;
            for [dx, dy] in [[0, 0], [half, 0], [0, half], [half, half]] {
                self.lay([x + dx, y + dy], half, known, pieces);
            }
            return;
        }
        let nodes = known.nine([x, y], side);
        let [x, y] = [x, y].map(|i| i as i64 - self.rim as i64);
        let part = Part {
            x,
            y,
            side,
            nodes,
            missed: 0.0,
        };
        self.refine(part, pieces);
    }

    /// Whether any pixel is needed of a square from a column and row of the grid on.
    pub fn is_needed(&self, from: [usize; 2], side: usize) -> bool {
        from.iter().zip(self.detector).all(|(from, pixels)| {
            let needed = self.rim - self.margin..self.rim + pixels + self.margin;
            from + side > needed.start && *from < needed.end
        })
    }

    /// The light (e-) that lines may miss where so much is.
    pub fn may_miss(&self, e: f64) -> f64 {
        self.fidelity.area_e + self.fidelity.area_part * e.abs()
    }

    /// The light (e-) of a pixel around a place: the mean over its time, or where the pattern moves by little, that in its
    /// middle; none where the plane has no direction, or the work is over.
    pub fn at(&self, x: f64, y: f64, asked: &mut Asked) -> Option<f64> {
        if self.plane.limit().is_over() {
            return None;
        }
        let (seen, taken) = self.plane.taken([x, y])?;
        let [middle_s, duration_s] = self.plane.open_s(y);
        let moved_px = self.motion * self.plane.scale_px();
        let light = |part: f64| {
            let sky = self.plane.to_sky(middle_s + (part - 0.5) * duration_s);
            self.light(&(sky * seen), taken)
        };
        let Fidelity {
            area_e, area_part, ..
        } = *self.fidelity;
        let bent = |value: f64| BEND * (area_e + area_part * value.abs());
        let (mean, looks) = match panels(self.radiance, moved_px) {
            0 => (light(0.5), 1),
            panels => mean(light, panels, bent),
        };
        asked.lights += 1;
        asked.smeared += looks - 1;
        let ns = self.plane.place_ns() + looks as f64 * AREA_LOOK_NS;
        self.plane.limit().spend(ns);
        Some(mean)
    }

    pub fn light(&self, direction: &Vector3<f64>, taken: f64) -> f64 {
        light(self.radiance, direction, taken) * self.scale_e
    }

    /// Whether an edge may run through a square, while it moves.
    fn has_edge(&self, square: &Part, asked: &mut Asked) -> bool {
        let Some(edge) = self.radiance.edge() else {
            return false;
        };
        let half = square.side as f64 / 2.0;
        let middle = [square.x as f64 + half, square.y as f64 + half];
        let Some((seen, _)) = self.plane.taken(middle) else {
            return true;
        };
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        let radius = corners.iter().map(|[x, y]| {
            let corner = self
                .plane
                .taken([middle[0] + x * (half + 1.0), middle[1] + y * (half + 1.0)]);
            corner.map_or(f64::INFINITY, |(corner, _)| (corner - seen).norm())
        });
        let radius = radius.fold(0.0, f64::max) + self.motion / 2.0;
        let sky = self.plane.to_sky(self.plane.open_s(middle[1])[0]);
        asked.edges += 1;
        let nearest = edge.angle(&(sky * seen)).abs();
        nearest <= radius || nearest.is_nan()
    }

    /// The light at the nine places of a square with those corners.
    fn between(
        &self,
        [x, y]: [i64; 2],
        side: usize,
        [a, b, c, d]: [Option<f64>; 4],
        asked: &mut Asked,
    ) -> [Option<f64>; 9] {
        let (x, y, h) = (x as f64, y as f64, side as f64 / 2.0);
        let between = [[h, 0.0], [0.0, h], [h, h], [2.0 * h, h], [h, 2.0 * h]];
        let [top, left, middle, right, bottom] =
            between.map(|[dx, dy]| self.at(x + dx, y + dy, asked));
        [a, top, b, left, middle, right, c, bottom, d]
    }

    /// How often lines miss what they may, at kinks, where no other square has its places.
    fn missed_between(&self, part: &Part, asked: &mut Asked) -> f64 {
        let missed = BETWEEN.map(|at| {
            let [u, v] = at.map(|at| 2.0 * at);
            let [left, above] = [u, v].map(|at| usize::from(at >= 1.0));
            let node = |i: usize| part.nodes[3 * above + left + i].unwrap_or(0.0);
            let across = |i: usize| node(i) + (node(i + 1) - node(i)) * (u - left as f64);
            let line = across(0) + (across(3) - across(0)) * (v - above as f64);
            let side = part.side as f64;
            let light = self.at(
                part.x as f64 + at[0] * side,
                part.y as f64 + at[1] * side,
                asked,
            );
            light.map_or(f64::INFINITY, |light| {
                (light - line).abs() / (KINK * self.may_miss(light))
            })
        });
        missed[0].max(missed[1])
    }

    fn refine(&self, part: Part, pieces: &mut Pieces) {
        let Part {
            x,
            y,
            side,
            nodes,
            missed: before,
        } = part;
        let [dx, dy] = [x, y].map(|i| (i + self.rim as i64) as usize);
        // Once the limit of work is over no place is known, and squares would be halved to the smallest.
        if self.plane.limit().is_over() || !self.is_needed([dx, dy], side) {
            return;
        }
        let half = side / 2;
        let [a, top, b, left, middle, right, c, bottom, d] = nodes;
        let value = |node: Option<f64>| node.unwrap_or(0.0);
        let square = Square {
            x: dx,
            y: dy,
            side,
            nodes: nodes.map(|node| value(node) as f32),
        };
        // Beyond the projection's end there is no light; on it there is an edge. Of full pixels nobody sees how full.
        if nodes.iter().all(Option::is_none) || self.full.has([x, y], side) {
            pieces.even.push(square);
            return;
        }
        let ends = [value(a), value(b), value(c), value(d)];
        let lines = [
            (ends[0] + ends[1]) / 2.0,
            (ends[0] + ends[2]) / 2.0,
            ends.iter().sum::<f64>() / 4.0,
            (ends[1] + ends[3]) / 2.0,
            (ends[2] + ends[3]) / 2.0,
        ];
        let between = [top, left, middle, right, bottom];
        let missed = between.iter().zip(lines).map(|(node, line)| {
            // Between nine nodes lines miss a quarter of what they miss between four, across and down together up to half.
            node.map_or(f64::INFINITY, |node| {
                (node - line).abs() / (2.0 * self.may_miss(node))
            })
        });
        let missed = missed.fold(0.0, f64::max);
        let is_whole =
            nodes.iter().all(Option::is_some) && !self.has_edge(&part, &mut pieces.asked);
        let may_be_even = is_whole && missed <= 1.0 && before <= LUCK;
        // Of unknown detail, thin layers may lie between all places of a grid, however fine.
        let missed = if may_be_even && self.radiance.detail() == 0.0 {
            missed.max(self.missed_between(&part, &mut pieces.asked))
        } else {
            missed
        };
        if may_be_even && missed <= 1.0 {
            pieces.even.push(square);
        } else if side <= SMALLEST {
            let bent = !is_whole || missed.max(before / QUARTERED) > MIDDLE;
            let how = if bent { Sampled::All } else { Sampled::Middle };
            pieces.sampled.push((square, how));
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
                    nodes: self.between([x, y], half, corners, &mut pieces.asked),
                    missed,
                };
                self.refine(quarter, pieces);
            }
        }
    }
}

/// The light that a pixel which takes so much (sr) gets from a direction, of a scale of 1.
pub fn light(radiance: &dyn Radiance, direction: &Vector3<f64>, taken: f64) -> f64 {
    let taken = if radiance.is_of_pixels() { 1.0 } else { taken };
    radiance.seen(direction) * taken
}

/// Into how many parts a way of so many px is divided at first: none where all of it is as good as straight, as it is where the way is no longer
/// than squares which tell that light is.
pub fn panels(radiance: &dyn Radiance, moved_px: f64) -> usize {
    let (still_px, panel_px) = if radiance.is_of_pixels() {
        return 0;
    } else if radiance.is_hidden_inside() {
        (SQUARE as f64, SQUARE as f64)
    } else {
        (1.0, PANEL_PX)
    };
    if moved_px <= still_px {
        0
    } else {
        (moved_px / panel_px).ceil() as usize
    }
}

/// The mean of `value` from 0 to 1 by Simpson's rule on `panels` even panels, each halved until its middle is no further off the line between its
/// ends than `bent` tells of its value; and how often it was asked for.
fn mean(value: impl Fn(f64) -> f64, panels: usize, bent: impl Fn(f64) -> f64) -> (f64, usize) {
    let side = 1.0 / panels as f64;
    let (mut sum, mut looks) = (0.0, 1);
    let mut open: Vec<([f64; 3], f64, f64, u32)> = Vec::new();
    let mut before = value(0.0);
    for panel in 0..panels {
        let from = panel as f64 * side;
        let after = value(from + side);
        open.push(([before, value(from + side / 2.0), after], from, side, 0));
        before = after;
        looks += 2;
        while let Some(([a, b, c], from, side, halved)) = open.pop() {
            let off = (a + c) / 2.0 - b;
            if halved == HALVINGS || off.abs() <= bent(b) {
                sum += side * (a + 4.0 * b + c) / 6.0;
                continue;
            }
            let [left, right] = [0.25, 0.75].map(|part| value(from + part * side));
            looks += 2;
            let half = side / 2.0;
            open.push(([b, right, c], from + half, half, halved + 1));
            open.push(([a, left, b], from, half, halved + 1));
        }
    }
    (sum, looks)
}
