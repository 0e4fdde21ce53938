//! The shares of a point's light on pixels in a line, by the position of the point.

use super::real::Real;

/// Greatest side of a tile, px.
pub(crate) const SIDE: usize = 16;
/// Terms of the power series of a share in the position of the source.
const POWERS: usize = 4;
/// Smaller shares are 0: products of two stay far above subnormal numbers.
const MIN: f64 = 1e-15;

/// The shares of pixels in a line, as a power series around nodes of the source's position in its
/// pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines<T> {
    /// Nodes per pixel.
    nodes: T,
    /// Distance of the nodes, px.
    node_px: T,
    /// Pixels on each side of the source's own.
    reach: i32,
    /// Number of terms of a power: one for each pixel, with room for a tile at any position.
    stride: usize,
    /// The series' coefficients, by node, power and pixel.
    terms: Vec<T>,
}

impl<T: Real> Lines<T> {
    /// With `nodes` in each pixel, for pixels up to `reach` from the source's own. `terms` gives
    /// the Taylor series of a pixel's share, from the pixel's offset and the source's position
    /// (0..1, px) above the lower edge of its own pixel.
    pub(crate) fn new(
        nodes: usize,
        reach: usize,
        terms: impl Fn(i64, f64) -> [f64; POWERS],
    ) -> Lines<T> {
        let pixels = 2 * reach + 1;
        let stride = pixels + SIDE;
        let mut all = vec![T::default(); (nodes + 1) * POWERS * stride];
        for (node, lines) in all.chunks_exact_mut(POWERS * stride).enumerate() {
            let above = node as f64 / nodes as f64;
            for i in 0..pixels {
                let terms = terms(i as i64 - reach as i64, above);
                if terms[0] < MIN {
                    continue;
                }
                for (power, term) in terms.into_iter().enumerate() {
                    lines[power * stride + i] = T::of(term);
                }
            }
        }
        Lines {
            nodes: T::of(nodes as f64),
            node_px: T::of(1.0 / nodes as f64),
            reach: reach as i32,
            stride,
            terms: all,
        }
    }

    /// Reach around any source, px.
    pub(crate) fn reach_px(&self) -> f64 {
        f64::from(self.reach) - 1.0
    }

    /// The shares of `L` pixels from `first` on, for a source `off` (px) from the middle of pixel
    /// 0.
    #[inline(always)]
    pub(crate) fn shares<const L: usize>(&self, off: f64, first: i32) -> [T; L] {
        let off = T::of(off);
        let (pixel, own) = off.nearest();
        let above = off - own + T::of(0.5);
        let (node, at) = (above * self.nodes).nearest();
        let off = (-at).fused(self.node_px, above);
        let from = node as u32 as usize * (POWERS * self.stride)
            + (self.reach - pixel + first) as u32 as usize;
        let terms = &self.terms[from..from + (POWERS - 1) * self.stride + L];
        let mut sum = [T::default(); L];
        for power in (0..POWERS).rev() {
            let terms = &terms[power * self.stride..][..L];
            for i in 0..L {
                sum[i] = sum[i].fused(off, terms[i]);
            }
        }
        sum
    }
}
