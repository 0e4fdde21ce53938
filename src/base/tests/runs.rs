//! All 2^32 words in runs, vectorized by `pulp`: seconds instead of minutes.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;
use skyloop_base::rng::normal::normal;
use skyloop_base::rng::poisson::expanded;

pub const ALL: f64 = 4_294_967_296.0;
/// Words per run, and per thread at a time.
pub const RUN: usize = 1 << 10;
const PART: usize = 1 << 20;

struct Normals<'a> {
    first: u32,
    z: &'a mut [f32; RUN],
}

impl WithSimd for Normals<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        for i in 0..RUN {
            self.z[i] = normal(self.first.wrapping_add(i as u32));
        }
    }
}

/// The Poisson draws of a mean from normal draws; returns whether all are the same.
pub struct Poissons<'a> {
    pub mean: f32,
    pub z: &'a [f32; RUN],
    pub draws: &'a mut [f32; RUN],
}

impl WithSimd for Poissons<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        for i in 0..RUN {
            self.draws[i] = expanded(self.mean, self.z[i]);
        }
        let mut differ = 0;
        for i in 0..RUN {
            differ |= self.draws[i].to_bits() ^ self.draws[0].to_bits();
        }
        differ == 0
    }
}

/// Calls `each` for every run with its first word and its normal draws.
pub fn runs(each: impl Fn(Arch, u32, &[f32; RUN]) + Sync) {
    let arch = Arch::new();
    let parts = (0..u32::MAX).into_par_iter().step_by(PART);
    parts.for_each(|part| {
        let mut z = [0.0; RUN];
        for first in (part..=part + (PART as u32 - 1)).step_by(RUN) {
            arch.dispatch(Normals { first, z: &mut z });
            each(arch, first, &z);
        }
    });
}
