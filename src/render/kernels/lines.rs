//! What pixels in a line collect of a point's light, by the place of the point.

use super::real::Real;

/// Pixels of a tile's side: the most that is computed at a time.
pub const SIDE: usize = 16;
/// Powers of the series of a share in the place of the source, from 0 on.
const POWERS: usize = 4;
/// Shares below are none: products of two stay far from what is too small for single precision.
const MIN: f64 = 1e-15;

/// The shares of pixels in a line, by where in a pixel the source is: around each of the nodes a
/// series.
#[derive(Debug, Clone, PartialEq)]
pub struct Lines<T> {
    /// Nodes a pixel.
    nodes: T,
    /// How far they are apart, px.
    node_px: T,
    /// Pixels on each side of the source's own.
    reach: i32,
    /// Terms of a power, one a pixel; so many that a tile may be taken anywhere.
    stride: usize,
    /// By node, by power.
    terms: Vec<T>,
}

impl<T: Real> Lines<T> {
    /// With so many `nodes` a pixel, for sources up to `reach` pixels away. `terms` gives, for a
    /// pixel so many pixels from the source's own and a source so far (0..1, px) above that one's
    /// lower edge, Taylor's series of its share in that place.
    pub fn new(nodes: usize, reach: usize, terms: impl Fn(i64, f64) -> [f64; POWERS]) -> Lines<T> {
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

    /// How far (px) they reach around any source.
    pub fn reach_px(&self) -> f64 {
        f64::from(self.reach) - 1.0
    }

    /// The shares of `L` pixels from `first` on of the light of a source that is `off` (px) from
    /// the middle of pixel 0.
    #[inline(always)]
    pub fn shares<const L: usize>(&self, off: f64, first: i32) -> [T; L] {
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
