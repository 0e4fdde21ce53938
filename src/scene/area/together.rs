//! The light of all area sources of a scene together: what is even stays a list of squares, and is drawn where it is asked for.

use super::AreaLight;
use super::lines::{Lines, Places};
use crate::camera::Detector;
use crate::footprint::Footprint;
use crate::kernels;
use crate::lanes;
use crate::scene::View;
use rayon::prelude::*;
use skyloop_orbit::sgp4_batch::Level;
use std::sync::OnceLock;

/// Pixels that are worked out together.
const FEW: usize = 32 * 1024;
/// Images lie close if they have more than the detector's pixels over this: then all pixels' light is asked for anyway.
const CLOSE: usize = 4;

/// The light of several area sources.
#[derive(Debug, Default)]
pub struct Together {
    /// Columns and rows of the detector.
    size: [usize; 2],
    /// What is even all over it, and is not drawn yet.
    even: Option<(Lines, Places)>,
    /// The other light on each pixel, as if of one electron each had so many shares; nothing where there is none.
    others: Footprint,
    /// All of it likewise, once it is asked for.
    all: OnceLock<Footprint>,
}

impl Together {
    /// That of `areas`, before which images have so many `pixels`.
    pub fn of(areas: &[AreaLight], view: &View, pixels: usize) -> Together {
        let Detector { width, height, .. } = view.camera.detector;
        let is_close = pixels >= width * height / CLOSE;
        let (even, drawn): (Vec<&AreaLight>, _) = areas
            .iter()
            .filter(|area| area.electrons > 0.0)
            .partition(|area| !is_close && area.even.is_some());
        let even: Vec<&Lines> = even.iter().filter_map(|area| area.even.as_ref()).collect();
        let e = drawn_by(
            if drawn.is_empty() { 0 } else { width * height },
            |first, e| {
                for area in &drawn {
                    area.add_to(view.level, first, e);
                }
            },
        );
        Together {
            others: Footprint::whole(width, e),
            even: Lines::of_all(&even).map(|lines| {
                let places = lines.places();
                (lines, places)
            }),
            ..Together::none([width, height])
        }
    }

    fn none(size: [usize; 2]) -> Together {
        Together {
            size,
            ..Together::default()
        }
    }

    /// Light that is given pixel by pixel, row by row, e-.
    #[cfg(test)]
    pub fn each(size: [usize; 2], e: Vec<f32>) -> Together {
        Together {
            others: Footprint::whole(size[0], e),
            ..Together::none(size)
        }
    }

    /// Whether there is no light.
    pub fn is_none(&self) -> bool {
        self.even.is_none() && self.others.shares().is_empty()
    }

    /// Adds the light on the pixels from `first` on, by row-major index, to `electrons`.
    pub fn add_to(&self, level: Option<Level>, first: usize, electrons: &mut [f32]) {
        if let Some((lines, _)) = &self.even {
            lines.add_to(level, first, electrons);
        }
        kernels::add(level, self.others_from(first), electrons);
    }

    /// [`Together::add_to`] for a part of a row.
    pub fn add_to_row(&self, first: usize, electrons: &mut [f32]) {
        if let Some((lines, places)) = &self.even {
            lines.add_to_row(places, first, electrons);
        }
        for (e, other) in electrons.iter_mut().zip(self.others_from(first)) {
            *e += other;
        }
    }

    /// The light on one, e-.
    pub fn of_pixel(&self, pixel: usize) -> f64 {
        let mut e = [0.0];
        self.add_to_row(pixel, &mut e);
        e[0].into()
    }

    /// The light on each pixel, row by row, e-; empty where there is none.
    pub fn e(&self) -> &[f32] {
        self.footprint().shares()
    }

    /// The same, as if of one electron each pixel had so many shares.
    pub fn footprint(&self) -> &Footprint {
        if self.even.is_none() {
            return &self.others;
        }
        self.all.get_or_init(|| {
            let [width, height] = self.size;
            let all = drawn_by(width * height, |first, e| {
                self.add_to(Some(Level::best()), first, e);
            });
            Footprint::whole(width, all)
        })
    }

    fn others_from(&self, first: usize) -> &[f32] {
        self.others.shares().get(first..).unwrap_or_default()
    }

    /// No pixel of a cell of `side` columns and rows, a power of two, gets more light than this, e-, row by row of cells; empty where there is none.
    pub fn most_of_cells(&self, side: usize) -> Vec<f64> {
        if self.is_none() {
            return Vec::new();
        }
        let [width, height] = self.size;
        let [across, down] = [width, height].map(|pixels| pixels.div_ceil(side));
        let mut cells = vec![0.0f32; across * down];
        if let Some((lines, _)) = &self.even {
            lines.most_of_cells(side, across, &mut cells);
        }
        let mut cells: Vec<f64> = cells.into_iter().map(f64::from).collect();
        let rows = self.others.shares().par_chunks(width * side);
        let rows = rows.zip(cells.par_chunks_mut(across));
        rows.for_each(|(pixels, cells)| {
            let mut most = vec![0.0f32; width];
            for row in pixels.chunks(width) {
                for (most, e) in most.iter_mut().zip(row) {
                    *most = if e > most { *e } else { *most };
                }
            }
            for (cell, most) in cells.iter_mut().zip(most.chunks(side)) {
                *cell += f64::from(lanes::greatest(most));
            }
        });
        cells
    }
}

/// So many pixels, to which `add` adds light from one of them on.
fn drawn_by(pixels: usize, add: impl Fn(usize, &mut [f32]) + Sync) -> Vec<f32> {
    let mut e = lanes::blank(pixels);
    let parts = e.par_chunks_mut(FEW).enumerate();
    parts.for_each(|(part, e)| add(part * FEW, e));
    e
}
