//! The footprint of a streak whose light a Gaussian spreads that is the same everywhere: points of it are laid on pixels by a kernel.

use super::{Footprint, Light, Wings, spans_of};
use crate::camera::Camera;
use crate::camera::psf::square;
use crate::fidelity::Fidelity;
use crate::kernels::{self, Dot, SIDE, Sheet};
use crate::track::{Lit, Sample, Track};
use skyloop_orbit::sgp4_batch::Level;
use std::ops::Range;

impl Footprint {
    /// That of a track of several points whose light all rows collect; none of other tracks and spreads.
    pub(super) fn streak(
        track: &Track,
        camera: &Camera,
        fidelity: &Fidelity,
        light: &Light,
        level: Option<Level>,
    ) -> Option<Footprint> {
        let is_lit = |sample: &Sample| sample.lit == Lit::ALL && sample.parts.is_empty();
        let lines = camera.optics.psf.lines()?;
        let reach = camera.optics.psf.drawn_px(fidelity, light.electrons);
        // (No number is none.)
        let is_told = reach <= lines.reach_px();
        if track.samples.len() < 2 || !is_told || !track.samples.iter().all(is_lit) {
            return None;
        }
        let sides = [camera.detector.width as i64, camera.detector.height as i64];
        let inside = |range: Range<i64>, side: i64| range.start.max(0)..range.end.min(side);
        let mut dots = Vec::with_capacity(track.samples.len());
        for sample in track.samples.iter().filter(|sample| sample.is_somewhere()) {
            let [columns, rows] = square(sample.at, reach);
            let pixels = [inside(columns, sides[0]), inside(rows, sides[1])];
            if pixels.iter().all(|range| !range.is_empty()) {
                dots.push(Dot {
                    at: sample.at,
                    light: sample.weight,
                    pixels,
                });
            }
        }
        let rows = || dots.iter().map(|dot| &dot.pixels[1]);
        let Some(first_row) = rows().map(|rows| rows.start).min() else {
            return Some(Footprint::default());
        };
        let past_row = rows().map(|rows| rows.end).max().unwrap_or(first_row);

        let mut reached = vec![(i64::MAX, 0); (past_row - first_row) as usize];
        let mut evaluated = 0;
        for Dot {
            pixels: [columns, rows],
            ..
        } in &dots
        {
            let rows = (rows.start - first_row) as usize..(rows.end - first_row) as usize;
            evaluated += (columns.end - columns.start) as u64 * rows.len() as u64;
            for row in &mut reached[rows] {
                *row = (row.0.min(columns.start), row.1.max(columns.end));
            }
        }
        let (spans, total) = spans_of(&reached, sides[0]);
        let origins = spans
            .iter()
            .map(|span| i64::from(span.offset) - i64::from(span.column));
        let origins: Vec<i64> = origins.collect();
        let mut light = vec![0.0; total as usize + SIDE];
        let mut sheet = Sheet {
            first_row,
            origins: &origins,
            light: &mut light,
        };
        kernels::lay_dots(level, lines, &dots, &mut sheet);
        // What rounding leaves of no light may be below 0.
        let shares = light[..total as usize]
            .iter()
            .map(|share| if *share > 0.0 { *share as f32 } else { 0.0 });
        Some(Footprint {
            first_row: first_row as usize,
            spans,
            shares: shares.collect(),
            evaluated,
            wings: Wings {
                drawn_px: reach,
                undrawn: 0.0,
            },
        })
    }
}
