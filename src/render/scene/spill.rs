//! Where pixels fill up, and where charge spills.
//!
//! Of charge q >= 0 that is added to a column, a pixel shows its own, and what full pixels beside it pass on. A full run of pixels
//! passes on no more than was added to it, for it held no more than it holds now. So with n full pixels, each holding the full well W,
//!
//! ```text
//! change <= min(W + 1, q own + sum of q over n pixels),   n <= charge of the column / W
//! ```
//!
//! It is monotonic, so the same bounds what is taken away, and what is added here and taken there by the greater of both.

use super::brightest::CELL;
use super::{AreaLight, EffectId, Kind, Lit, Scene, View};
use crate::camera::{Blooming, Detector};
use rayon::prelude::*;

/// Pixels of columns that are computed together: a core's cache holds them, and a cancelled frame ends before the next.
const TOGETHER: usize = 1 << 18;
/// Few columns are computed in so many groups.
const GROUPS: usize = 8;

/// What fills up and spills.
#[derive(Debug, Default)]
pub struct Spill {
    /// Most that a pixel holds, e-.
    pub most_e: f64,
    /// The columns in which a pixel may fill up, whatever noise and particles add, and those that share a cell with them
    /// (`brightest`); sorted.
    pub columns: Vec<usize>,
    /// Whether their charge spills, rather than being lost.
    pub along: bool,
    /// The brightest area source that alone fills every pixel, if any does.
    pub flood: Option<&'static Kind>,
}

impl Spill {
    /// That of a scene whose images are made.
    pub(super) fn of(scene: &Scene) -> Spill {
        let (detector, simulated) = (&scene.view.camera.detector, &scene.simulated);
        let full_e = detector.full_well_e;
        let mut events = vec![0.0; detector.width];
        let struck = scene.struck.hits();
        for (pixel, e) in struck.take_while(|_| !scene.is_cancelled()) {
            events[pixel as usize % detector.width] += f64::from(e);
        }
        let fills =
            |column: &usize| drawn_e(scene.brightest_of(*column)) + events[*column] >= full_e;
        let may = drawn_e(scene.brightest_e()) + scene.struck.most_e() >= full_e;
        // By whole cells, so that what bounds say of other cells holds for all other columns.
        let cells = |column: &usize| {
            let past = (column + CELL).min(detector.width);
            !scene.is_cancelled() && (*column..past).any(|column| fills(&column))
        };
        let filling = (0..if may { detector.width } else { 0 }).step_by(CELL);
        let filling = filling
            .filter(cells)
            .flat_map(|column| column..(column + CELL).min(detector.width));
        Spill {
            // Whole electrons spill: there may be one more.
            most_e: if simulated.has(EffectId::FullWell) {
                full_e + 1.0
            } else {
                f64::INFINITY
            },
            columns: filling.collect(),
            along: simulated.has(EffectId::FullWell) && detector.blooming == Blooming::Column,
            flood: flood(scene),
        }
    }

    /// Whether a column is among them.
    pub fn has(&self, column: usize) -> bool {
        self.columns.binary_search(&column).is_ok()
    }

    /// Whether charge may spill along a column.
    pub fn spills(&self) -> bool {
        self.along && !self.columns.is_empty()
    }
}

/// Light (e-) so far over the full well that shot noise brings no pixel back below it.
pub fn flooding_e(detector: &Detector) -> f64 {
    2.0 * detector.full_well_e + 100.0
}

fn flood(scene: &Scene) -> Option<&'static Kind> {
    let full_e = flooding_e(&scene.view.camera.detector);
    let floods = |area: &&AreaLight| area.most_e >= full_e && scene.least_e(area) >= full_e;
    let areas = scene
        .areas
        .iter()
        .filter(|_| scene.simulated.has(EffectId::FullWell));
    let floods = areas.filter(floods);
    let most = floods.max_by(|a, b| a.electrons.total_cmp(&b.electrons))?;
    Some(most.kind)
}

/// The most (e-) that is drawn where so much is expected: ten sigma and ten electrons above nothing is.
pub fn drawn_e(expected_e: f64) -> f64 {
    expected_e + 10.0 * expected_e.sqrt() + 10.0
}

impl Scene {
    /// What `work` makes of groups of `columns`, side by side; once the frame is cancelled, of some of them.
    pub fn in_groups<T: Send>(
        &self,
        columns: &[usize],
        work: impl Fn(&[usize]) -> T + Send + Sync,
    ) -> Vec<T> {
        let most = (TOGETHER / self.view.camera.detector.height.max(1)).max(1);
        let groups = columns.par_chunks(columns.len().div_ceil(GROUPS).clamp(1, most));
        let groups = groups.filter(|_| !self.is_cancelled());
        groups.map(work).collect()
    }
}

/// The light on each column, e-.
pub(super) fn columns_e<'a>(view: &View, lights: impl Iterator<Item = Lit<'a>>) -> Vec<f64> {
    let detector = &view.camera.detector;
    let mut columns = vec![0.0; detector.width];
    for light in lights.filter(|light| light.electrons > 0.0) {
        let rows = light.footprint.rows(0..detector.height);
        for (_, first, shares) in rows.take_while(|_| !view.limit.is_cancelled()) {
            for (column, share) in columns[first..].iter_mut().zip(shares) {
                *column += light.electrons * f64::from(*share);
            }
        }
    }
    columns
}
