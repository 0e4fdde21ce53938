//! The footprint of a streak with one Gaussian spread: a kernel adds its samples to pixels.

use super::{DOT_NS, DOT_PIXEL_NS, Footprint, HELD_NS, Light, Wings};
use crate::camera::Camera;
use crate::fidelity::Fidelity;
use crate::kernels::{self, Circle, Dot, Ends, MAX_TILE_OFFSET, ROWS, Real, Sheet, Span};
use crate::track::{Lit, Sample, Track};
use skyloop_base::abort::WorkLimit;
use skyloop_orbit::sgp4_batch::Level;
use std::cell::RefCell;

thread_local! {
    /// Buffers for streaks, reused: a frame has a thousand short ones, for which the allocator took
    /// a thirtieth of its time.
    static BUFFERS: RefCell<StreakBuffers> = RefCell::default();
}

/// Pixels copied together.
const LANES: usize = 8;
/// Below this tolerated loss of light, sums are in double precision: single precision errs by up to
/// 3e-8.
const SINGLE_PRECISION_LOSS: f64 = 3e-7;

/// Buffers for a streak.
#[derive(Default)]
struct StreakBuffers {
    dots: Vec<Dot>,
    rows: Rows,
    /// The pixels of the sheet in single precision, which suffices for most streaks.
    light: Vec<f32>,
}

/// Rows of a sheet; `first` is a row of the detector plane.
#[derive(Default)]
struct Rows {
    first: i32,
    /// First lit column of each row, and the one past the last, from the row before `first` on. A
    /// row is empty if `low` is the greater.
    low: Vec<i32>,
    past: Vec<i32>,
    /// Index of each row's pixel of column 0, which may lie outside the sheet.
    origins: Vec<i32>,
    /// Pixels of the sheet.
    pixels: usize,
}

impl Footprint {
    /// The footprint of a track of several samples with all rows open; none for other tracks and
    /// spreads.
    pub(super) fn streak(
        limit: &WorkLimit,
        track: &Track,
        camera: &Camera,
        fidelity: &Fidelity,
        light: &Light,
        level: Option<Level>,
    ) -> Option<Footprint> {
        let (single, double) = camera.optics.psf.lines()?;
        let radius = camera.optics.psf.circle_px(fidelity, light.electrons)?;
        // False for NaN.
        let is_in_range = radius <= single.reach_px();
        if track.samples.len() < 2 || !is_in_range {
            return None;
        }
        BUFFERS.with_borrow_mut(|buffers| {
            buffers.take_samples(track, camera, radius)?;
            let StreakBuffers {
                dots,
                rows,
                light: single_light,
            } = buffers;
            let circle = Circle::new(radius);
            let side = circle.side as f64;
            limit.spend(dots.len() as f64 * (DOT_NS + side * side * DOT_PIXEL_NS));
            if limit.is_over() || rows.reach(dots, &circle, level).is_none() {
                return Some(Footprint::default());
            }
            let sides = [camera.detector.width as i32, camera.detector.height as i32];
            let footprint = if fidelity.loss(light.electrons) < SINGLE_PRECISION_LOSS {
                let mut light = Vec::new();
                let mut sheet = rows.sheet(&mut light);
                kernels::add_dots_f64(level, double, &circle, dots, &mut sheet);
                rows.cut(&light, sides)
            } else {
                let mut sheet = rows.sheet(single_light);
                kernels::add_dots(level, single, &circle, dots, &mut sheet);
                rows.cut(single_light, sides)
            };
            limit.spend(footprint.shares.len() as f64 * HELD_NS);
            Some(Footprint {
                evaluated: (dots.len() * circle.side * circle.side) as u64,
                wings: Wings {
                    drawn_px: radius,
                    undrawn: 0.0,
                },
                ..footprint
            })
        })
    }
}

impl StreakBuffers {
    /// Takes the samples whose circles of `radius` pixels touch the detector; none if a sample has
    /// closed or partly open rows.
    fn take_samples(&mut self, track: &Track, camera: &Camera, radius: f64) -> Option<()> {
        // Circles with centres between these limits touch the detector.
        let [low, high] = [[0.0; 2], camera.detector.sides()];
        let [low, high] = [
            low.map(|x| x - 0.5 - radius),
            high.map(|x| x - 0.5 + radius),
        ];
        self.dots.clear();
        for Sample {
            at,
            weight,
            lit,
            parts,
        } in &track.samples
        {
            if *lit != Lit::ALL || !parts.is_empty() {
                return None;
            }
            // False for NaN.
            let touches = |k: usize| at[k] >= low[k] && at[k] <= high[k];
            if touches(0) && touches(1) && weight.is_finite() {
                self.dots.push(Dot::new(*at, *weight, radius));
            }
        }
        Some(())
    }
}

impl Rows {
    /// Takes the rows that the dots' circles touch, with room for each dot's tiles; none without
    /// dots.
    fn reach(&mut self, dots: &[Dot], circle: &Circle, level: Option<Level>) -> Option<()> {
        let tops = dots.iter().map(|dot| dot.first[1]);
        let (first, last) = (tops.clone().min()?, tops.max()?);
        let span = first.abs_diff(last) as usize;
        let count = span + circle.side.next_multiple_of(ROWS);
        // One more row on each side, so that every row has neighbours.
        let Rows {
            low, past, origins, ..
        } = self;
        low.clear();
        low.resize(count + 2, i32::MAX);
        past.clear();
        past.resize(count + 2, i32::MIN);
        let mut ends = Ends {
            first_row: first,
            low: &mut low[1..=count],
            past: &mut past[1..=count],
        };
        kernels::reach_dots(level, circle, dots, &mut ends);
        // How far a tile may begin before the columns that circles touch in its row or in a
        // neighbouring row. The common tile of two dots may begin before the tile of one of them.
        let before = circle.radius.ceil() as i32 + 1 + MAX_TILE_OFFSET as i32;
        let wide = circle.wide() as i32 + 1;
        let mut pixels = 0;
        // Unreached rows have no tile.
        let near = low.windows(3).zip(past.windows(3)).take(span + circle.side);
        origins.clear();
        origins.extend(near.map(|(low, past)| {
            let from = low[0].min(low[1]).min(low[2]).saturating_sub(before);
            let to = past[0].max(past[1]).max(past[2]).saturating_add(wide);
            let origin = pixels - from;
            pixels += to.saturating_sub(from).max(0);
            origin
        }));
        self.first = first;
        self.pixels = pixels as usize + LANES;
        Some(())
    }

    /// An empty sheet of these rows; `light` is the buffer of its pixels.
    fn sheet<'a, T: Real>(&'a self, light: &'a mut Vec<T>) -> Sheet<'a, T> {
        light.clear();
        light.resize(self.pixels, T::default());
        Sheet {
            first_row: self.first,
            origins: &self.origins,
            light,
        }
    }

    /// The lit pixels of a sheet that lie on a detector of `width` columns and `height` rows.
    fn cut<T: Real>(&self, light: &[T], [width, height]: [i32; 2]) -> Footprint {
        // The rows on the detector, and the range of each.
        let [from, to] = [0, height].map(|row| row.saturating_sub(self.first).max(0) as usize);
        let to = to.min(self.origins.len());
        let from = from.min(to);
        let ends = self.low[1..][from..to]
            .iter()
            .zip(&self.past[1..][from..to]);
        let mut total = 0;
        let mut spans: Vec<Span> = Vec::with_capacity(to - from);
        spans.extend(ends.map(|(low, past)| {
            let column = (*low).clamp(0, width);
            // Rows that no circle touches are empty.
            let length = (*past).min(width).saturating_sub(column).max(0) as u32;
            let offset = total;
            total += length;
            Span {
                column: if length > 0 { column as u32 } else { 0 },
                offset,
                length,
            }
        }));
        let is_lit = |span: &Span| span.length > 0;
        let Some(dark) = spans.iter().position(is_lit) else {
            return Footprint::default();
        };
        spans.truncate(spans.iter().rposition(is_lit).map_or(0, |last| last + 1));
        spans.drain(..dark);
        let from = from + dark;
        let first_row = self.first + from as i32;
        // Copies whole chunks: the next row overwrites the pixels beyond a row's last.
        let mut shares: Vec<f32> = Vec::with_capacity(total as usize + LANES);
        // The sheet has no pixels for empty ranges.
        let lit_spans = spans.iter().zip(&self.origins[from..]);
        for (span, origin) in lit_spans.filter(|(span, _)| is_lit(span)) {
            let from = (origin + span.column as i32) as u32 as usize;
            let whole = (span.length as usize).next_multiple_of(LANES);
            let light = light[from..from + whole].as_chunks::<LANES>().0;
            for light in light {
                // An array's `map` would compile to a function call.
                let mut lit = [0.0; LANES];
                for (to, share) in lit.iter_mut().zip(light) {
                    let share = share.single();
                    // Rounding may give negative shares.
                    *to = if share > 0.0 { share } else { 0.0 };
                }
                shares.extend_from_slice(&lit);
            }
            shares.truncate((span.offset + span.length) as usize);
        }
        Footprint {
            first_row: first_row as usize,
            spans,
            shares,
            ..Footprint::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_base::load::Folder;

    /// The pixels of some points, each with light 1.
    fn image(points: &[[f64; 2]]) -> Vec<f32> {
        let camera = Camera::load("fai-nir", &Folder::current()).unwrap();
        let samples = points.iter().map(|at| Sample {
            at: *at,
            weight: 1.0,
            lit: Lit::ALL,
            parts: Vec::new(),
        });
        let track = Track {
            start: points[0],
            end: points[points.len() - 1],
            samples: samples.collect(),
        };
        let fidelity = Fidelity::REALTIME;
        let streak = Footprint::streak(
            &WorkLimit::default(),
            &track,
            &camera,
            &fidelity,
            &Light::default(),
            None,
        );
        let mut pixels = vec![0.0; 256 * 256];
        streak.unwrap().light(None, 1.0, 0..256, 256, &mut pixels);
        pixels
    }

    #[test]
    fn streaks_leave_the_detector_and_return() {
        // X-Val: the detector ends at 255.5, so only a part of the middle point's circle is on it,
        // and some rows between the points are empty.
        for column in [254.0, 256.0, 257.0, 258.5, 259.4] {
            let points = [[128.0, 10.0], [column, 40.0], [60.2, 70.0]];
            let pixels = image(&points);
            // (A track of one sample is no streak: each point is given twice, at half the light.)
            let apart = points.map(|point| image(&[point, point]));
            for (i, pixel) in pixels.iter().enumerate() {
                let sum: f32 = apart.iter().map(|one| one[i] / 2.0).sum();
                assert!((pixel - sum).abs() < 1e-6, "{column}: {pixel} {sum}");
            }
            let all: f32 = pixels.iter().sum();
            assert!((1.99..3.001).contains(&all), "{column}: {all}");
        }
    }
}
