//! Footprints: the share of a point source's light on each pixel of the detector.

mod drawn;
mod streak;

pub use drawn::Light;

use crate::camera::{Camera, Stamp};
use crate::fidelity::Fidelity;
use crate::kernels::{self, Span};
use crate::track::{Sample, Track, Window};
use drawn::Drawn;
use skyloop_base::abort::WorkLimit;
use skyloop_orbit::sgp4_batch::Level;
use std::ops::Range;

/// The share of a source's light on each pixel of the detector that it touches.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Footprint {
    first_row: usize,
    spans: Vec<Span>,
    shares: Vec<f32>,
    evaluated: u64,
    /// The drawing radius and the undrawn light of its samples.
    pub wings: Wings,
}

/// Drawing radius around the samples of a track, and the light further out.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wings {
    /// Half the side of the drawn square, px.
    pub drawn_px: f64,
    /// The share of light from outside the square, distributed evenly over it (1).
    pub undrawn: f64,
}

impl Wings {
    /// The greater value of each.
    fn and(&self, other: &Wings) -> Wings {
        Wings {
            drawn_px: self.drawn_px.max(other.drawn_px),
            undrawn: self.undrawn.max(other.undrawn),
        }
    }
}

/// Fainter light is ignored, e-: its shares are close to subnormal numbers, which are slow.
const MIN_E: f64 = 1e-20;

/// Time of a pixel of a footprint, ns: its terms of two signal-to-noise ratios, its bounds, and
/// newly allocated memory.
pub(crate) const PIXEL_NS: f64 = 9.0;
/// The same for large footprints that exceed the caches, with drawing.
pub(crate) const HELD_NS: f64 = 10.0;
/// Time of a sample of a Gaussian streak, ns.
pub(crate) const DOT_NS: f64 = 25.0;
/// Time of each pixel around it, ns.
pub(crate) const DOT_PIXEL_NS: f64 = 0.3;

/// The spans of rows, each `reached` from a first column to the one past the last, on a detector of
/// that `width`; and their total number of pixels.
fn spans_of(reached: &[(i64, i64)], width: i64) -> (Vec<Span>, u32) {
    let mut total = 0;
    let spans = reached.iter().map(|&(from, past)| {
        let length = (past - from).max(0) as u32;
        let span = Span {
            column: from.min(width) as u32,
            offset: total,
            length,
        };
        total += length;
        span
    });
    (spans.collect(), total)
}

/// The square around a sample in which its light is drawn, and its part on the detector.
struct SampleSquare<'a> {
    sample: &'a Sample,
    drawn: Drawn<'a>,
    columns: Range<i64>,
    rows: Range<i64>,
}

impl<'a> SampleSquare<'a> {
    /// The squares of a track's samples that have pixels on the detector.
    fn of(
        track: &'a Track,
        camera: &'a Camera,
        fidelity: &Fidelity,
        light: &Light,
    ) -> Vec<SampleSquare<'a>> {
        let inside = |range: &Range<i64>, size: usize| {
            let first = range.start.max(0);
            first..range.end.min(size as i64).max(first)
        };
        let samples = track.samples.iter().filter(|sample| sample.is_finite());
        let squares = samples.map(|sample| {
            let drawn = Drawn::around(sample.at, camera, fidelity, light);
            let columns = inside(&drawn.square[0], camera.detector.width);
            let rows = sample.rows(&inside(&drawn.square[1], camera.detector.height));
            SampleSquare {
                sample,
                drawn,
                columns,
                rows,
            }
        });
        squares
            .filter(|square| !square.columns.is_empty() && !square.rows.is_empty())
            .collect()
    }
}

/// Length of a range that is not reversed.
fn length(range: &Range<i64>) -> usize {
    (range.end - range.start) as usize
}

/// The first row that the squares touch, and for each row from there the first column and the one
/// past the last. None without squares.
fn reached_rows(squares: &[SampleSquare<'_>]) -> Option<(usize, Vec<(i64, i64)>)> {
    let first_row = squares.iter().map(|square| square.rows.start).min()?;
    let past_row = squares.iter().map(|square| square.rows.end).max()?;
    let mut reached = vec![(i64::MAX, 0); (past_row - first_row) as usize];
    for SampleSquare { columns, rows, .. } in squares {
        for row in &mut reached[(rows.start - first_row) as usize..(rows.end - first_row) as usize]
        {
            *row = (row.0.min(columns.start), row.1.max(columns.end));
        }
    }
    Some((first_row as usize, reached))
}

impl Footprint {
    /// The part of the detector plane from which light reaches the detector.
    pub fn window(camera: &Camera, fidelity: &Fidelity) -> Window {
        let reach = camera.optics.psf.reach_px(fidelity.psf_loss) + 0.5;
        let (width, height) = (camera.detector.width as f64, camera.detector.height as f64);
        Window {
            low: [-reach; 2],
            high: [width - 1.0 + reach, height - 1.0 + reach],
        }
    }

    /// Spreads a track with the camera's PSF over the detector; empty once the work limit is over.
    /// All vector instruction levels give the same result.
    pub fn of(
        limit: &WorkLimit,
        track: &Track,
        camera: &Camera,
        fidelity: &Fidelity,
        light: &Light,
        level: Option<Level>,
    ) -> Footprint {
        if let Some(streak) = Footprint::streak(limit, track, camera, fidelity, light, level) {
            return streak;
        }
        let squares = SampleSquare::of(track, camera, fidelity, light);
        let Some((first_row, reached)) = reached_rows(&squares) else {
            return Footprint::default();
        };
        let stamps_ns = squares.iter().map(|square| {
            let [wide, high] = [&square.columns, &square.rows].map(length);
            camera
                .optics
                .psf
                .stamp_ns((wide as f64 * high as f64).sqrt())
        });
        limit.spend(stamps_ns.sum());
        let (spans, total) = spans_of(&reached, camera.detector.width as i64);
        limit.spend(f64::from(total) * HELD_NS);
        if limit.is_over() {
            return Footprint::default();
        }
        let mut footprint = Footprint {
            first_row,
            spans,
            shares: vec![0.0; total as usize],
            ..Footprint::default()
        };
        let (mut stamp, mut collected) = (Stamp::of(level), Vec::new());
        for square in squares {
            if limit.is_over() {
                return Footprint::default();
            }
            footprint.add(&square, fidelity, &mut stamp, &mut collected);
        }
        // Shares of rows that open or close are sums of both signs, which may round below 0.
        let shares = footprint.shares.iter_mut();
        shares.for_each(|share| *share = share.max(0.0));
        footprint
    }

    /// Adds the light of a sample; `stamp` and `collected` are buffers.
    fn add(
        &mut self,
        square: &SampleSquare<'_>,
        fidelity: &Fidelity,
        stamp: &mut Stamp,
        collected: &mut Vec<f64>,
    ) {
        let SampleSquare {
            sample,
            drawn,
            columns,
            rows,
        } = square;
        let Sample { at, weight, .. } = *sample;
        let wide = length(columns);
        self.evaluated += (wide * length(rows)) as u64;
        let psf = &drawn.psf;
        psf.spread(*weight, *at, columns.clone(), rows.clone(), stamp);
        let undrawn = psf.undrawn(*at, &drawn.square, fidelity);
        self.wings = self.wings.and(&Wings {
            drawn_px: drawn.reach,
            undrawn,
        });
        let rest = weight * undrawn;
        let whole = drawn.square == [columns.clone(), rows.clone()];
        // Pixels shift the centroid of a narrower core; the rest must not compensate for that.
        let centre = if rest > 0.0 && whole && psf.core_px() > 0.4 {
            drawn.rest_around(*at, rest, &stamp.light)
        } else {
            *at
        };
        let [across, down] = [0, 1].map(|axis| drawn.even(axis, centre));
        sample.shares(rows, collected);
        let lines = stamp.light.chunks_exact(wide).zip(&*collected);
        for (row, (light, collected)) in rows.clone().zip(lines).filter(|(_, (_, c))| **c != 0.0) {
            let span = self.spans[row as usize - self.first_row];
            let from = span.offset as usize + (columns.start as usize - span.column as usize);
            let out = &mut self.shares[from..from + wide];
            for (out, light) in out.iter_mut().zip(light) {
                *out += (*light * collected) as f32;
            }
            if rest > 0.0 {
                let rest = rest * down(row) * collected;
                for (out, column) in out.iter_mut().zip(columns.clone()) {
                    *out += (rest * across(column)) as f32;
                }
            }
        }
    }

    /// The footprint of a source that covers the whole detector, from the share of each pixel, row
    /// by row.
    pub fn whole(width: usize, shares: Vec<f32>) -> Footprint {
        let spans = (0..shares.len() / width.max(1)).map(|row| Span {
            column: 0,
            offset: (row * width) as u32,
            length: width as u32,
        });
        let spans = spans.collect();
        Footprint {
            first_row: 0,
            spans,
            shares,
            ..Footprint::default()
        }
    }

    /// The sum of footprints, each times its part of the light; incomplete once `limit` is over.
    pub(crate) fn sum(parts: &[(f64, Footprint)], limit: &WorkLimit) -> Footprint {
        let lit = || parts.iter().filter(|(_, part)| !part.shares.is_empty());
        let first_row = lit().map(|(_, part)| part.first_row).min().unwrap_or(0);
        let past_row = lit().map(|(_, part)| part.first_row + part.spans.len());
        let mut reached = vec![(u32::MAX, 0u32); past_row.max().unwrap_or(0) - first_row];
        for (_, part) in lit() {
            let rows = reached[part.first_row - first_row..].iter_mut();
            for (row, span) in rows.zip(&part.spans).filter(|(_, span)| span.length > 0) {
                *row = (row.0.min(span.column), row.1.max(span.column + span.length));
            }
        }
        let mut offset = 0;
        let spans = reached.iter().map(|&(from, past)| {
            let length = past.saturating_sub(from);
            let span = Span {
                column: if length > 0 { from } else { 0 },
                offset,
                length,
            };
            offset += length;
            span
        });
        let spans: Vec<Span> = spans.collect();
        let mut shares = vec![0.0f32; offset as usize];
        for (light, part) in lit() {
            let rows = spans[part.first_row - first_row..].iter();
            let rows = rows.zip(&part.spans).take_while(|_| !limit.is_over());
            for (to, from) in rows.filter(|(_, from)| from.length > 0) {
                let at = (to.offset + from.column - to.column) as usize;
                let from = &part.shares[from.offset as usize..(from.offset + from.length) as usize];
                for (to, share) in shares[at..at + from.len()].iter_mut().zip(from) {
                    *to += (light * f64::from(*share)) as f32;
                }
            }
        }
        Footprint {
            first_row,
            spans,
            shares,
            evaluated: parts.iter().map(|(_, part)| part.evaluated).sum(),
            wings: parts
                .iter()
                .fold(Wings::default(), |wings, (_, part)| wings.and(&part.wings)),
        }
    }

    /// Multiplies all shares.
    pub(crate) fn scale(&mut self, by: f64) {
        let shares = self.shares.iter_mut();
        shares.for_each(|share| *share = (by * f64::from(*share)) as f32);
    }

    /// Number of evaluations of a point's light on a pixel.
    pub(crate) fn evaluated(&self) -> u64 {
        self.evaluated
    }

    /// The shares of the pixels, in no particular order.
    pub fn shares(&self) -> &[f32] {
        &self.shares
    }

    /// The first row that it touches.
    pub(crate) fn first_row(&self) -> usize {
        self.first_row
    }

    /// Adds light of `electrons` e- to the pixels of `rows` of a detector of that width.
    pub fn light(
        &self,
        level: Option<Level>,
        electrons: f64,
        rows: Range<usize>,
        width: usize,
        pixels: &mut [f32],
    ) {
        let spans = self.within(&rows);
        let first = (self.first_row + spans.start).saturating_sub(rows.start);
        let spans = &self.spans[spans];
        if !spans.is_empty() && electrons.abs() >= MIN_E {
            // Finite, because the kernel multiplies it by 0 too.
            let electrons = (electrons as f32).min(f32::MAX);
            kernels::add_light(level, electrons, spans, &self.shares, first, width, pixels);
        }
    }

    /// The indices of its spans in `rows`.
    fn within(&self, rows: &Range<usize>) -> Range<usize> {
        let [from, to] = [rows.start, rows.end]
            .map(|row| row.saturating_sub(self.first_row).min(self.spans.len()));
        from..to.max(from)
    }

    /// `(row, first column, shares)` of every row in `rows` that the footprint touches.
    pub fn rows(
        &self,
        rows: std::ops::Range<usize>,
    ) -> impl Iterator<Item = (usize, usize, &[f32])> {
        let spans = self.within(&rows);
        let from = spans.start;
        self.spans[spans].iter().enumerate().map(move |(i, span)| {
            let shares = &self.shares[span.offset as usize..(span.offset + span.length) as usize];
            (self.first_row + from + i, span.column as usize, shares)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::track::{Place, Rows, TrackSpec};
    use skyloop_base::load::Folder;

    fn line(from: [f64; 2], to: [f64; 2], fidelity: &Fidelity) -> Track {
        let position = |t: f64| {
            let at = [0, 1].map(|k| from[k] + (to[k] - from[k]) * t);
            Some(Place { at, light: 1.0 })
        };
        let track_spec = TrackSpec {
            pieces: 2,
            even: None,
            step_px: fidelity.track_step_sigma * 0.7,
            panel_px: 0.0,
            point_px: 0.0,
            reach_px: 6.0,
            window: Window {
                low: [-10.0; 2],
                high: [266.0; 2],
            },
            rows: Rows::together(256),
        };
        Track::sample(position, &track_spec, fidelity).unwrap()
    }

    fn spread(track: &Track, camera: &Camera, fidelity: &Fidelity) -> Footprint {
        let (limit, light) = (WorkLimit::default(), Light::default());
        let level = Some(Level::best());
        Footprint::of(&limit, track, camera, fidelity, &light, level)
    }

    fn centre(track: &Track) -> [f64; 2] {
        let light: f64 = track.samples.iter().map(|s| s.weight).sum();
        [0, 1].map(|k| {
            track
                .samples
                .iter()
                .map(|s| s.weight * s.at[k])
                .sum::<f64>()
                / light
        })
    }

    fn moments(footprint: &Footprint) -> (f64, f64, f64) {
        let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
        for (row, column, shares) in footprint.rows(0..256) {
            for (i, share) in shares.iter().enumerate() {
                let share = f64::from(*share);
                sum += share;
                x += share * (column + i) as f64;
                y += share * row as f64;
            }
        }
        (sum, x / sum, y / sum)
    }

    #[test]
    fn footprints_conserve_light_and_centroid() {
        let camera = Camera::load("fai-nir", &Folder::current()).unwrap();
        for fidelity in [Fidelity::REALTIME, Fidelity::REFERENCE] {
            for (from, to) in [
                ([100.3, 80.7], [100.3, 80.7]),
                ([100.3, 80.7], [100.31, 80.7]),
                ([20.2, 30.9], [190.0, 201.3]),
                ([200.0, 50.0], [20.5, 50.5]),
            ] {
                let track = line(from, to, &fidelity);
                let (sum, x, y) = moments(&spread(&track, &camera, &fidelity));
                let centroid = centre(&track);
                assert!((sum - 1.0).abs() < 1e-5, "{sum}");
                assert!((x - centroid[0]).hypot(y - centroid[1]) < 1e-4);
                assert!((centroid[0] - (from[0] + to[0]) / 2.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn realtime_streaks_agree_with_the_reference() {
        let camera = Camera::load("fai-nir", &Folder::current()).unwrap();
        let image = |fidelity: &Fidelity| {
            let footprint = spread(
                &line([50.2, 60.4], [81.9, 73.3], fidelity),
                &camera,
                fidelity,
            );
            let mut image = vec![0.0; 256 * 256];
            for (row, column, shares) in footprint.rows(0..256) {
                for (i, share) in shares.iter().enumerate() {
                    image[row * 256 + column + i] = f64::from(*share);
                }
            }
            image
        };
        let (fast, truth) = (image(&Fidelity::REALTIME), image(&Fidelity::REFERENCE));
        let height = truth.iter().copied().fold(0.0, f64::max);
        let worst = fast
            .iter()
            .zip(&truth)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f64::max);
        assert!(worst < 2e-5 * height, "{}", worst / height);
    }

    #[test]
    fn light_outside_the_detector_is_clipped() {
        let camera = Camera::load("fai-nir", &Folder::current()).unwrap();
        let fidelity = Fidelity::REALTIME;
        for at in [[-50.0, 10.0], [10.0, 1e9], [1e300, 1e300], [300.0, 300.0]] {
            let footprint = spread(&line(at, at, &fidelity), &camera, &fidelity);
            assert!(footprint.shares().is_empty());
        }
        let corner = spread(
            &line([-0.5, -0.5], [-0.5, -0.5], &fidelity),
            &camera,
            &fidelity,
        );
        assert!((moments(&corner).0 - 0.25).abs() < 1e-6);
    }
}
