//! The star detector: threshold, connected pixels, moment centroid. Its input is pixels, gain,
//! offset and full scale.
//!
//! 1. Background and noise by tiles (`background.rs`).
//! 2. The signal is smoothed by the binomial kernel [1 2 1]/4 along both axes (close to the PSF, so
//!    faint stars gain most) and compared with `threshold` times its noise. 8-connected pixels
//!    above it form one blob, unless they have distinct peaks (`blobs.rs`).
//! 3. A plain moment over the pixels above the threshold is biased towards pixel centres. Over more
//!    pixels it is noisy. So the moment is weighted by a Gaussian window of the blob's size, which
//!    moves with the centroid until it converges.

use crate::blobs::{Blob, Blobs};
use crate::image::Image;
use crate::signal::Signal;

/// Detector settings.
#[derive(Clone, Copy, Debug)]
pub struct DetectorSettings {
    /// Threshold of the smoothed image in units of its noise.
    pub threshold: f32,
    /// Maximum number of detections; the brightest are used.
    pub max_detections: usize,
}

impl Default for DetectorSettings {
    fn default() -> Self {
        Self {
            threshold: 5.0,
            max_detections: 10_000,
        }
    }
}

/// One blob of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection {
    /// Centroid along columns, px; 0 is the centre of the first.
    pub x_px: f64,
    /// Centroid along rows, px; 0 is the centre of the first.
    pub y_px: f64,
    /// Light above the background in the blob grown by two pixels, e-.
    pub flux_e: f64,
    /// Signal to noise under the Gaussian window.
    pub snr: f64,
    /// Pixels above the threshold.
    pub pixels: usize,
    /// The blob, grown by two pixels, leaves the frame.
    pub edge: bool,
    /// A pixel reached 95 % of full scale, where the full well may have clipped the signal.
    pub saturated: bool,
}

/// The detections of one frame. They come only from [`detect`] and [`detect_windows`] and do not
/// change: their existence proves that labels had no influence.
#[derive(Debug)]
pub struct Detections {
    frame: u32,
    list: Vec<Detection>,
}

impl Detections {
    fn new(frame: u32, mut list: Vec<Detection>, settings: &DetectorSettings) -> Self {
        list.sort_by(|a, b| b.flux_e.total_cmp(&a.flux_e));
        list.truncate(settings.max_detections);
        Self { frame, list }
    }

    /// No detections, for a frame that is not analysed.
    #[must_use]
    pub fn none(frame: u32) -> Self {
        let list = Vec::new();
        Self { frame, list }
    }

    /// Number of the frame.
    #[must_use]
    pub(crate) fn frame(&self) -> u32 {
        self.frame
    }

    /// The detections, brightest first.
    #[must_use]
    pub fn list(&self) -> &[Detection] {
        &self.list
    }
}

/// Finds the blobs of light in an image. An image with a wrong number of pixels has none.
#[must_use]
pub fn detect(image: &Image<'_>, settings: &DetectorSettings) -> Detections {
    let mut list = Vec::new();
    if image.width > 0 && image.pixels.len() == image.width * image.height {
        let signal = Signal::new(image);
        let blobs = Blobs::find(&signal, settings.threshold);
        let measured = |blob| signal.measure(image, blob, &blobs);
        list.extend(blobs.list.iter().filter_map(measured));
    }
    Detections::new(image.frame, list, settings)
}

/// Finds the blobs of light in windows of a frame; each window has column and row of its first
/// pixel. Window edges count as frame edges. A blob in several windows is listed once.
#[must_use]
pub fn detect_windows<'a>(
    frame: u32,
    windows: impl Iterator<Item = ([u16; 2], Image<'a>)>,
    settings: &DetectorSettings,
) -> Detections {
    /// Detections closer than this are the same blob, px.
    const SAME_PX: f64 = 1.0;
    let mut list: Vec<Detection> = Vec::new();
    for ([column, row], image) in windows {
        for mut found in detect(&image, settings).list {
            found.x_px += f64::from(column);
            found.y_px += f64::from(row);
            let same = |other: &&mut Detection| {
                libm::hypot(other.x_px - found.x_px, other.y_px - found.y_px) < SAME_PX
            };
            match list.iter_mut().find(same) {
                Some(other) if other.edge && !found.edge => *other = found,
                Some(_) => {}
                None => list.push(found),
            }
        }
    }
    Detections::new(frame, list, settings)
}

impl Signal {
    /// The pixels of a blob grown by two, without pixels of other blobs, and whether the frame cuts
    /// it.
    fn grown(&self, blob: &Blob, blobs: &Blobs) -> (Vec<usize>, bool) {
        const GROWTH: usize = 2;
        let around = blob.pixels.iter();
        let around = around.flat_map(|index| self.around(*index, GROWTH));
        let is_free = |index: &usize| blobs.is_free_for(*index, blob);
        let mut grown: Vec<usize> = around.filter(is_free).collect();
        grown.sort_unstable();
        grown.dedup();
        let edge = blob.pixels.iter().any(|&index| {
            let (x, y) = (index % self.width, index / self.width);
            x < GROWTH || y < GROWTH || x + GROWTH >= self.width || y + GROWTH >= self.height
        });
        (grown, edge)
    }

    fn measure(&self, image: &Image<'_>, blob: &Blob, blobs: &Blobs) -> Option<Detection> {
        let (grown, edge) = self.grown(blob, blobs);
        let start = Moments::of(blob.pixels.iter().map(|&index| self.sample(index)))?;
        let pixels = blob.pixels.iter().copied();
        let by_light = |a: &usize, b: &usize| self.electrons[*a].total_cmp(&self.electrons[*b]);
        let brightest = pixels.clone().max_by(by_light)?;
        let peak = self.electrons[brightest].max(0.0);
        let variance = self.sigma[brightest].powi(2);
        let window = Window::of_blob(&start, f64::from(peak / (peak + variance)));
        let (x_px, y_px, snr) = self.windowed_centroid(&start, &window, blob, blobs);
        let limit = u32::from(image.full_scale_dn) * 95 / 100;
        let light = grown.iter().map(|index| f64::from(self.electrons[*index]));
        let is_full = |index: usize| u32::from(image.pixels[index]) >= limit;
        Some(Detection {
            x_px,
            y_px,
            flux_e: light.sum(),
            snr,
            pixels: blob.pixels.len(),
            edge,
            saturated: pixels.clone().any(is_full),
        })
    }

    /// The point where the window-weighted first moment of the light vanishes, and the signal to
    /// noise there.
    ///
    /// `c <- c + 2 sum(w s (r - c)) / sum(w s)`. With a window of the star's size, the product of
    /// both has half the variance of each, so the factor 2 converges in one step (the "windowed"
    /// centroid of Bertin's `SExtractor`).
    fn windowed_centroid(
        &self,
        start: &Moments,
        window: &Window,
        blob: &Blob,
        blobs: &Blobs,
    ) -> (f64, f64, f64) {
        const STEPS: usize = 20;
        const CONVERGED_PX: f64 = 1e-4;
        /// Maximum distance from the blob's moment; a larger one means another source.
        const MAX_SHIFT_PX: f64 = 1.5;
        let (mut x, mut y, mut snr) = (start.x, start.y, 0.0);
        for _ in 0..STEPS {
            let (mut sum, mut sum_x, mut sum_y, mut variance) = (0.0, 0.0, 0.0, 0.0);
            for index in self.block(x.round() as isize, y.round() as isize, window.reach) {
                if !blobs.is_free_for(index, blob) {
                    continue;
                }
                let (column, row, electrons) = self.sample(index);
                let (dx, dy) = (column - x, row - y);
                let weight = window.weight(dx, dy);
                sum += weight * electrons;
                sum_x += weight * electrons * dx;
                sum_y += weight * electrons * dy;
                variance +=
                    weight * weight * (f64::from(self.sigma[index]).powi(2) + electrons.max(0.0));
            }
            if sum <= 0.0 || variance <= 0.0 {
                break;
            }
            snr = sum / variance.sqrt();
            let (step_x, step_y) = (2.0 * sum_x / sum, 2.0 * sum_y / sum);
            if libm::hypot(x + step_x - start.x, y + step_y - start.y) > MAX_SHIFT_PX {
                return (start.x, start.y, snr);
            }
            x += step_x;
            y += step_y;
            if libm::hypot(step_x, step_y) < CONVERGED_PX {
                break;
            }
        }
        (x, y, snr)
    }
}

/// Centre and covariance of the positive signal of some pixels, px and px^2.
struct Moments {
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn of(samples: impl Iterator<Item = (f64, f64, f64)> + Clone) -> Option<Self> {
        let positive = samples.filter(|(_, _, e)| *e > 0.0);
        let sum: f64 = positive.clone().map(|(_, _, e)| e).sum();
        if sum <= 0.0 {
            return None;
        }
        let mean = |f: &dyn Fn(f64, f64) -> f64| {
            positive.clone().map(|(x, y, e)| e * f(x, y)).sum::<f64>() / sum
        };
        let (x, y) = (mean(&|x, _| x), mean(&|_, y| y));
        Some(Self {
            x,
            y,
            xx: mean(&|u, _| (u - x).powi(2)),
            xy: mean(&|u, v| (u - x) * (v - y)),
            yy: mean(&|_, v| (v - y).powi(2)),
        })
    }
}

/// A Gaussian window, `exp(-d' C^-1 d / 2)`.
struct Window {
    inverse: [f64; 3],
    /// Half side of the evaluated square, px.
    reach: isize,
}

impl Window {
    /// A window somewhat larger than the blob: the pixels above the threshold lack the wings.
    ///
    /// Against background noise the best window is as wide as the star. A star dominated by shot
    /// noise (`shot`: its fraction of the variance in the brightest pixel) is best weighted evenly.
    /// The wider window is also less sensitive to pixel sampling.
    fn of_blob(blob: &Moments, shot: f64) -> Self {
        /// Variance added, px^2: for the wings, and for bright stars.
        const WINGS: f64 = 0.3;
        const BRIGHT: f64 = 0.9;
        /// Limit of the half side, which is four sigma otherwise: it bounds the time for streaks.
        const MAX_REACH: f64 = 60.0;
        let wider = WINGS + BRIGHT * shot;
        let (xx, xy, yy) = (blob.xx + wider, blob.xy, blob.yy + wider);
        let determinant = xx * yy - xy * xy;
        let reach = (4.0 * xx.max(yy).sqrt()).ceil().min(MAX_REACH) as isize;
        Self {
            inverse: [yy / determinant, -xy / determinant, xx / determinant],
            reach,
        }
    }

    fn weight(&self, dx: f64, dy: f64) -> f64 {
        let [a, b, c] = self.inverse;
        libm::exp(-0.5 * (a * dx * dx + 2.0 * b * dx * dy + c * dy * dy))
    }
}
