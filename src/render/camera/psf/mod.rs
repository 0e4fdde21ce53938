//! The point spread function, integrated over each pixel, and its variation over the field and with
//! colour.
//!
//! The integrals are exact for Gaussians and images, and within 1e-4 of the brightest pixel for
//! tables of circular profiles if their width (see [`Airy`] and [`Moffat`]) is at most
//! [`WIDEST_PX`]; small widths have no limit. Cost: a stamp of 15 x 15 pixels takes 1.7 us as a
//! Gaussian, 2 us from a table, some 10 us from four images; a table takes 20 to 200 ms when the
//! camera is loaded.
//!
//! No profile is truncated and renormalised. Light of wide wings outside the drawn pixels,
//! [`LocalPsf::undrawn`], is spread evenly over the drawn pixels (see `footprint`).
//! [`Fidelity::loss`] limits the loss of narrow profiles.

mod airy;
mod circular;
mod gaussian;
mod images;
mod moffat;
mod stamp;

pub use airy::Airy;
pub use images::{Flaw, Gradient, Image, Images, SUM_TOLERANCE};
pub use moffat::Moffat;
pub use stamp::Stamp;

use crate::fidelity::Fidelity;
use crate::kernels::Lines;
use circular::Quadrant;
use gaussian::Gaussian;
use skyloop_base::range::nearest;
use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

/// Greatest width (px) of circular profiles from tables, before variation over the field.
pub const WIDEST_PX: f64 = 20.0;
/// Greatest distance (px) of drawn light from a source: wide wings end there, except for a
/// Gaussian, which has none. Beyond it lie 2 % of a diffraction pattern whose `lambda N` is 25 px,
/// and a thousandth of one of 1 px.
pub const FURTHEST_PX: f64 = 256.0;

/// Limits of a shape's width (px), and of its factors from field and colour.
const WIDTHS_PX: RangeInclusive<f64> = 1e-6..=1e3;
const SCALES: RangeInclusive<f64> = 1e-3..=1e3;

/// The columns and rows of the unbounded plane whose pixels lie within `reach_px` of `at` (px).
pub(crate) fn square(at: [f64; 2], reach_px: f64) -> [Range<i64>; 2] {
    // Pixel i covers i - 0.5 to i + 0.5.
    // Avoids `floor`, which is a function call on old processors.
    let pixel = |x: f64| {
        let towards_zero = (x + 0.5) as i64;
        towards_zero.saturating_sub(i64::from(x + 0.5 < towards_zero as f64))
    };
    at.map(|x| pixel(x - reach_px)..pixel(x + reach_px).saturating_add(1))
}

/// Spread of a point's light over the detector.
#[derive(Debug, Clone, PartialEq)]
pub struct Psf {
    shape: Shape,
    variation: Variation,
    /// The shares of lines of pixels, for a Gaussian that is the same everywhere and for all
    /// colours.
    lines: Option<Arc<(Lines<f32>, Lines<f64>)>>,
}

/// A shape and its width (px) at the principal point for a source of the band's reference
/// wavelength.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A circular Gaussian of this standard deviation.
    Gaussian(f64),
    /// Diffraction, with `lambda N`.
    Airy(Arc<Airy>, f64),
    /// Moffat's profile, with its full width at half maximum.
    Moffat(Arc<Moffat>, f64),
    /// Images.
    Images(Arc<Images>),
}

/// Variation of the width.
#[derive(Debug, Clone, PartialEq)]
pub struct Variation {
    /// Distance from the principal point (px, rising) and the factor of the width there; linear
    /// between.
    pub by_field: Vec<[f64; 2]>,
    /// Exponent of the width with the wavelength.
    pub wavelength_exponent: f64,
    /// Minimum and maximum ratio of a source's mean wavelength to the band's reference.
    pub wavelength_ratios: [f64; 2],
}

impl Default for Variation {
    /// No variation.
    fn default() -> Self {
        Variation {
            by_field: Vec::new(),
            wavelength_exponent: 0.0,
            wavelength_ratios: [1.0, 1.0],
        }
    }
}

/// The spread at one position of the field for one colour.
#[derive(Debug, Clone, Copy)]
pub struct LocalPsf<'a> {
    shape: &'a Shape,
    /// Its width, in units of the shape's own.
    scale: f64,
    mix: images::Mix,
}

impl Shape {
    /// With its width limited to [`WIDTHS_PX`].
    fn bounded(self) -> Shape {
        let bounded = |width_px: f64| nearest(width_px, WIDTHS_PX);
        match self {
            Shape::Gaussian(sigma_px) => Shape::Gaussian(bounded(sigma_px)),
            Shape::Airy(airy, width_px) => Shape::Airy(airy, bounded(width_px)),
            Shape::Moffat(moffat, width_px) => Shape::Moffat(moffat, bounded(width_px)),
            Shape::Images(images) => Shape::Images(images),
        }
    }
}

impl Psf {
    /// A shape whose width varies. Widths are limited to 1e-6 to 1e3 px, and factors from field and
    /// colour to 1e-3 to 1e3; NaN becomes the minimum.
    pub fn new(shape: Shape, variation: Variation) -> Psf {
        let shape = shape.bounded();
        let is_even = variation.by_field.is_empty() && variation.wavelength_exponent == 0.0;
        let lines = match shape {
            Shape::Gaussian(sigma_px) if is_even => {
                let gaussian = Gaussian { sigma_px };
                gaussian.lines().zip(gaussian.lines())
            }
            _ => None,
        };
        Psf {
            shape,
            variation,
            lines: lines.map(Arc::new),
        }
    }

    /// The shares of lines of pixels for a Gaussian that is the same everywhere and for all
    /// colours, in single and in double precision; none for other spreads.
    pub(crate) fn lines(&self) -> Option<&(Lines<f32>, Lines<f64>)> {
        self.lines.as_deref()
    }

    /// The spread at `field_px` from the principal point for a source whose mean wavelength is
    /// `wavelength_ratio` times the band's reference.
    pub fn at(&self, field_px: [f64; 2], wavelength_ratio: f64) -> LocalPsf<'_> {
        let mut scale = self.by_wavelength(wavelength_ratio);
        if !self.variation.by_field.is_empty() {
            let distance = libm::hypot(field_px[0], field_px[1]);
            scale *= super::vignetting::linear(&self.variation.by_field, distance);
        }
        let mix = match &self.shape {
            Shape::Images(images) => images.mix(field_px),
            _ => images::Mix::default(),
        };
        self.local(scale, mix)
    }

    /// Whether the centroid of the light equals the position of the source.
    #[inline]
    pub(crate) fn is_symmetric(&self) -> bool {
        !matches!(self.shape, Shape::Images(_))
    }

    /// From a source at `field_px` from the principal point to the centroid of its light, px.
    /// Images may be off centre, other profiles are symmetric.
    #[inline]
    pub(crate) fn offset_px(&self, field_px: [f64; 2]) -> [f64; 2] {
        match &self.shape {
            Shape::Images(images) => images.offset_px(&images.mix(field_px)),
            _ => [0.0; 2],
        }
    }

    fn local(&self, scale: f64, mix: images::Mix) -> LocalPsf<'_> {
        LocalPsf {
            shape: &self.shape,
            scale: nearest(scale, SCALES),
            mix,
        }
    }

    fn by_wavelength(&self, ratio: f64) -> f64 {
        match self.variation.wavelength_exponent {
            0.0 => 1.0,
            1.0 => ratio,
            exponent => libm::pow(ratio, exponent),
        }
    }

    /// Minimum and maximum scale over the field and all colours.
    fn scales(&self) -> [f64; 2] {
        let factors = self.variation.by_field.iter().map(|[_, factor]| *factor);
        let field = factors.fold(None, |range: Option<[f64; 2]>, f| {
            let [min, max] = range.unwrap_or([f, f]);
            Some([min.min(f), max.max(f)])
        });
        let [min, max] = field.unwrap_or([1.0, 1.0]);
        let [a, b] = self
            .variation
            .wavelength_ratios
            .map(|ratio| self.by_wavelength(ratio));
        [min * a.min(b), max * a.max(b)]
    }

    /// Time to spread a point over a square of `rows` rows, ns on one core.
    pub(crate) fn stamp_ns(&self, rows: f64) -> f64 {
        match self.shape {
            // Error functions at the edges of rows and columns, one product per pixel.
            Shape::Gaussian(_) => 200.0 + 47.0 * rows + 0.34 * rows * rows,
            // Table interpolation: one position per edge, one sum per corner.
            Shape::Airy(..) => 250.0 + 65.0 * rows + 3.5 * rows * rows,
            // Its reach needs powers.
            Shape::Moffat(..) => 500.0 + 65.0 * rows + 3.5 * rows * rows,
            Shape::Images(ref images) => 100.0 + 11.0 * images.mixed() as f64 * rows * rows,
        }
    }

    /// The greatest [`LocalPsf::reach_px`] over the field and all colours.
    pub fn reach_px(&self, loss: f64) -> f64 {
        self.local(self.scales()[1], images::Mix::default())
            .reach_px(loss)
    }

    /// The greatest [`LocalPsf::drawn_px`] over the field and all colours.
    pub fn drawn_px(&self, fidelity: &Fidelity, electrons: f64) -> f64 {
        self.local(self.scales()[1], images::Mix::default())
            .drawn_px(fidelity, electrons)
    }

    /// The radius (px) of the circle to draw around each point of a streak, for a source of
    /// `electrons`: it contains all light except [`Fidelity::loss`]. Only for a Gaussian that is
    /// the same everywhere and for all colours.
    pub fn circle_px(&self, fidelity: &Fidelity, electrons: f64) -> Option<f64> {
        match self.shape {
            Shape::Gaussian(sigma_px) if self.lines.is_some() => {
                Some(Gaussian { sigma_px }.circle_px(fidelity.loss(electrons)))
            }
            _ => None,
        }
    }

    /// A bound of the sum of the squares of a point's shares, over the field and all colours (1).
    pub fn sharpness(&self) -> f64 {
        // For shares that sum to 1, the sum of squares is at most the greatest share.
        if let Shape::Images(images) = &self.shape {
            return images.gradient().peak.min(1.0);
        }
        // Symmetric profiles are sharpest at the middle of a pixel. Squares of shares further out
        // are negligible.
        let narrowest = self.narrowest();
        let mut stamp = Stamp::default();
        let reach_px = 4.0 * narrowest.core_px();
        if reach_px > FURTHEST_PX {
            return self.peak();
        }
        let reach = reach_px.ceil() as i64 + 1;
        let around = -reach..reach + 1;
        narrowest.spread(1.0, [0.0; 2], around.clone(), around, &mut stamp);
        let squares: f64 = stamp.light.iter().map(|share| share * share).sum();
        (1.01 * squares).min(1.0)
    }

    /// A bound of a point's share on any pixel, over the field and all colours (1).
    pub fn peak(&self) -> f64 {
        if let Shape::Images(images) = &self.shape {
            return images.gradient().peak.min(1.0);
        }
        let middle = self.narrowest().on_pixel([0.0; 2], &mut Stamp::default());
        (1.01 * middle).min(1.0)
    }

    /// The smallest [`LocalPsf::core_px`] over the field and all colours.
    pub fn core_px(&self) -> f64 {
        self.narrowest().core_px()
    }

    /// The narrowest spread, except for images.
    fn narrowest(&self) -> LocalPsf<'_> {
        self.local(self.scales()[0], images::Mix::default())
    }
}

impl LocalPsf<'_> {
    /// Half the side (px) of the square outside of which less than `loss` of the light falls; at
    /// most [`FURTHEST_PX`] except for a Gaussian.
    pub fn reach_px(&self, loss: f64) -> f64 {
        let reach = match self.shape {
            Shape::Gaussian(sigma_px) => return self.gaussian(*sigma_px).reach_px(loss),
            Shape::Airy(airy, width_px) => self.scale * width_px * airy.reach(loss),
            Shape::Moffat(moffat, width_px) => self.scale * width_px * moffat.reach(loss),
            Shape::Images(images) => images.reach_px(),
        };
        nearest(reach, 0.0..=FURTHEST_PX)
    }

    /// Half the side (px) of the square to draw for a source of `electrons`: it contains all light
    /// except [`Fidelity::loss`]; for wide wings, all that is not too faint, with the rest in
    /// [`LocalPsf::undrawn`].
    pub fn drawn_px(&self, fidelity: &Fidelity, electrons: f64) -> f64 {
        let share = fidelity.wing_e / electrons;
        let faint_px = match self.shape {
            Shape::Airy(airy, width_px) => {
                let width_px = self.scale * width_px;
                width_px * airy.faint(share * width_px * width_px)
            }
            Shape::Moffat(moffat, width_px) => {
                let width_px = self.scale * width_px;
                width_px * moffat.faint(share * width_px * width_px)
            }
            Shape::Gaussian(_) => return self.reach_px(fidelity.loss(electrons)),
            Shape::Images(_) => return self.reach_px(fidelity.psf_loss),
        };
        self.reach_px(fidelity.psf_loss)
            .min(faint_px.max(0.0) + 1.0)
    }

    /// The table of its light and its width (px), if it has one.
    fn table(&self) -> Option<(&Quadrant, f64)> {
        match self.shape {
            Shape::Airy(airy, width_px) => Some((airy.table(), self.scale * width_px)),
            Shape::Moffat(moffat, width_px) => Some((moffat.table(), self.scale * width_px)),
            Shape::Gaussian(_) | Shape::Images(_) => None,
        }
    }

    /// The share of a point's light on a pixel whose middle is `off` (px) away.
    pub fn on_pixel(&self, off: [f64; 2], stamp: &mut Stamp) -> f64 {
        if let Some((table, width_px)) = self.table() {
            let [across, down] = off.map(|off| [-0.5, 0.5].map(|edge| (edge - off) / width_px));
            return table.inside(across, down).max(0.0);
        }
        self.spread(1.0, off, 0..1, 0..1, stamp);
        stamp.light.iter().sum()
    }

    /// The light of a point at `at` (px) outside of `square` (columns, rows); 0 if at most
    /// `psf_loss`.
    pub fn undrawn(&self, at: [f64; 2], square: &[Range<i64>; 2], fidelity: &Fidelity) -> f64 {
        let Some((table, width_px)) = self.table() else {
            return 0.0;
        };
        let [across, down] = [0, 1].map(|axis: usize| {
            let Range { start, end } = square[axis];
            [start, end].map(|i| (i as f64 - 0.5 - at[axis]) / width_px)
        });
        let outside = 1.0 - table.inside(across, down);
        if outside > fidelity.psf_loss {
            outside
        } else {
            0.0
        }
    }

    /// The width (px) of its core, as the standard deviation of a Gaussian: the scale for sampling
    /// tracks.
    pub fn core_px(&self) -> f64 {
        // The full width at half maximum of a Gaussian is 2.3548 standard deviations.
        const FULL_WIDTH: f64 = 2.354_820_045;
        match self.shape {
            Shape::Gaussian(sigma_px) => self.gaussian(*sigma_px).sigma_px,
            Shape::Airy(airy, width_px) => {
                self.scale * width_px * 2.0 * airy.half_width() / FULL_WIDTH
            }
            Shape::Moffat(_, width_px) => self.scale * width_px / FULL_WIDTH,
            Shape::Images(images) => images.core_px(),
        }
    }

    /// Change of the shares with the position of the source, for images; other profiles behave like
    /// a Gaussian of the core's width.
    pub(crate) fn gradient(&self) -> Option<Gradient> {
        match self.shape {
            Shape::Images(images) => Some(images.gradient()),
            Shape::Gaussian(_) | Shape::Airy(..) | Shape::Moffat(..) => None,
        }
    }

    /// Greatest difference to another spread of the same camera, relative to its peak (1); valid
    /// for small differences.
    pub(crate) fn differs(&self, other: &LocalPsf<'_>) -> f64 {
        // The peak is proportional to the inverse square of the width.
        let wider = (self.scale / other.scale).max(other.scale / self.scale);
        wider * wider - 1.0 + images::apart(&self.mix, &other.mix)
    }

    fn gaussian(&self, sigma_px: f64) -> Gaussian {
        Gaussian {
            sigma_px: self.scale * sigma_px,
        }
    }

    /// Spreads `light` around `at` (px) over a rectangle of pixels.
    pub fn spread(
        &self,
        light: f64,
        at: [f64; 2],
        columns: Range<i64>,
        rows: Range<i64>,
        stamp: &mut Stamp,
    ) {
        let edges = 0..(columns.end + 1 - columns.start).max(1) as usize;
        self.spread_between(
            light,
            at,
            edges.map(|i| columns.start + i as i64),
            rows,
            stamp,
        );
    }

    /// The light of a point at `at` (px) on each of `rows`, summed over `columns`.
    pub(crate) fn spread_on_rows(
        &self,
        at: [f64; 2],
        columns: Range<i64>,
        rows: Range<i64>,
        stamp: &mut Stamp,
    ) {
        let edges = [columns.start, columns.end].into_iter();
        self.spread_between(1.0, at, edges, rows, stamp);
    }

    fn spread_between(
        &self,
        light: f64,
        at: [f64; 2],
        edges: impl ExactSizeIterator<Item = i64> + Clone,
        rows: Range<i64>,
        stamp: &mut Stamp,
    ) {
        let pixels = edges.len() * rows.end.abs_diff(rows.start) as usize;
        stamp.light.clear();
        stamp.light.reserve(pixels);
        match self.shape {
            Shape::Gaussian(sigma_px) => {
                let gaussian = self.gaussian(*sigma_px);
                gaussian.shares(at[0], edges, &mut stamp.across);
                gaussian.shares(at[1], rows.start..=rows.end, &mut stamp.down);
                let wide = stamp.across.len().max(1);
                stamp.light.resize(stamp.down.len() * wide, 0.0);
                let lines = stamp.light.chunks_exact_mut(wide);
                for (out, down) in lines.zip(&stamp.down) {
                    let down = light * down;
                    let pixels = out.iter_mut().zip(&stamp.across);
                    pixels.for_each(|(out, across)| *out = down * across);
                }
            }
            Shape::Images(images) => {
                images.spread(&self.mix, light, at, edges, rows, &mut stamp.light);
            }
            Shape::Airy(..) | Shape::Moffat(..) => {
                if let Some((table, width_px)) = self.table() {
                    table.spread(width_px, light, at, edges, rows, stamp);
                }
            }
        }
    }
}
