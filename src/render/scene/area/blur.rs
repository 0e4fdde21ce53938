//! The point spread function on area light, at edges and fine detail.
//!
//! ```text
//! N_xy <- sum_ij K_ij N_(x-i)(y-j),   sum K = 1
//! ```
//!
//! K is the spread of a point in the middle of a pixel over the pixels around it: without the
//! pixel's own width, in the Sun's colour, in the middle of a patch of the detector. Uniform light
//! does not change. Wings reach at most [`FURTHEST`] pixels; the light further out is distributed
//! evenly over these.

use crate::camera::{Camera, Stamp};
use crate::fidelity::Fidelity;

/// Furthest that light is spread, px.
const FURTHEST: usize = 24;
/// Side of the patches with a common spread, px: the bits of a word.
pub(crate) const PATCH: usize = u64::BITS as usize;

/// Core width below which less of the pixel's width is removed from a spread, px.
const NARROW_PX: f64 = 0.5;
/// Pixels of a row added up together; the buffer has as many more at its end.
pub(crate) const LANES: usize = 8;

/// Time of a blurred pixel, ns.
pub const BLURRED_NS: f64 = 50.0;
/// Time of each neighbour's contribution, ns.
pub const SPREAD_NS: f64 = 0.07;

/// How a camera spreads area light.
pub(crate) struct Blur<'a> {
    camera: &'a Camera,
    reach: usize,
    margin: usize,
}

impl<'a> Blur<'a> {
    /// For light up to `max_e` in a pixel. Without edges light is not blurred.
    pub fn new(camera: &'a Camera, max_e: f64, has_edges: bool, fidelity: &Fidelity) -> Blur<'a> {
        let loss = (fidelity.area_e / max_e.max(f64::MIN_POSITIVE)).clamp(fidelity.psf_loss, 1e-3);
        let reach = (camera.optics.psf.reach_px(loss).ceil() as usize).clamp(1, FURTHEST);
        Blur {
            camera,
            reach,
            margin: if has_edges { reach } else { 0 },
        }
    }

    /// Columns and rows of the detector.
    pub fn size(&self) -> [usize; 2] {
        [self.camera.detector.width, self.camera.detector.height]
    }

    /// How far light is spread, px.
    pub fn reach(&self) -> usize {
        self.reach
    }

    /// Number of pixels around the detector that give light to it.
    pub fn margin(&self) -> usize {
        self.margin
    }

    /// The light of a pixel of `e` (row by row) after spreading by a `kernel`.
    pub fn spread(&self, e: &[f32], pixel: usize, columns: usize, kernel: &[[f32; LANES]]) -> f32 {
        let side = 2 * self.reach + 1;
        let first = pixel - self.reach * columns - self.reach;
        let mut lanes = [0.0f32; LANES];
        let lines = kernel.chunks_exact(side.div_ceil(LANES));
        for (line, kernel) in lines.enumerate() {
            let (light, _) = e[first + line * columns..].as_chunks::<LANES>();
            for (light, kernel) in light.iter().zip(kernel) {
                for (lane, (e, k)) in lanes.iter_mut().zip(light.iter().zip(kernel)) {
                    *lane += e * k;
                }
            }
        }
        // A narrow spread without the pixel's width may have negative terms.
        lanes.iter().sum::<f32>().max(0.0)
    }

    /// The kernel of the patch that begins at a column and a row, row by row. It is mirrored,
    /// because it is applied where light arrives.
    ///
    /// A point's share S of each pixel contains the pixel's width, and so does the light that it is
    /// applied to. The kernel removes it to second order, `K = S - S'' / 24` along columns and
    /// rows: its variance is smaller by that of a pixel, 1/12 px^2. Each row is padded with zeros.
    pub fn kernel(&self, at: [usize; 2]) -> Vec<[f32; LANES]> {
        let middle = at.map(|from| from as f64 + PATCH as f64 / 2.0);
        let psf = self.camera.optics.psf_at(middle, 1.0);
        let (reach, mut stamp) = (self.reach as i64 + 1, Stamp::default());
        psf.spread(
            1.0,
            [0.0; 2],
            -reach..reach + 1,
            -reach..reach + 1,
            &mut stamp,
        );
        let wide = (2 * reach + 1) as usize;
        // The second order does not hold for spreads far narrower than a pixel.
        let narrow = (psf.core_px() / NARROW_PX).powi(2).min(1.0);
        let narrower = |i: usize| {
            let share = |i: usize| stamp.light[i];
            let bend = share(i - 1) + share(i + 1) + share(i - wide) + share(i + wide);
            share(i) - narrow * (bend - 4.0 * share(i)) / 24.0
        };
        let inside = 1..wide - 1;
        let kernel = inside
            .clone()
            .flat_map(|row| inside.clone().map(move |column| row * wide + column));
        let kernel: Vec<f64> = kernel.map(narrower).collect();
        let even = (1.0 - kernel.iter().sum::<f64>()) / kernel.len() as f64;
        let kernel: Vec<f32> = kernel.iter().rev().map(|k| (k + even) as f32).collect();
        let lines = kernel.chunks_exact(wide - 2);
        let lanes = lines.flat_map(|line| {
            line.chunks(LANES).map(|of| {
                let mut lanes = [0.0; LANES];
                lanes[..of.len()].copy_from_slice(of);
                lanes
            })
        });
        lanes.collect()
    }
}
