//! The vector instructions of the processor, detected at run time.

use pulp::{Scalar, WithSimd};
use std::fmt;

/// A set of vector instructions. All give the same bits, since all fuse the same products and sums.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Level {
    /// One object at a time, with Rust's `mul_add`. Exact on every processor, but slow where that
    /// is a function call.
    #[default]
    Portable,
    /// Two at a time (AArch64).
    Neon,
    /// Four at a time (x86-64-v3: AVX2 and FMA).
    Avx2,
    /// Eight at a time (x86-64-v4: AVX-512 F, BW, CD, DQ, VL).
    Avx512,
}

impl Level {
    /// From the slowest to the fastest.
    pub(crate) const ALL: [Level; 4] = [Level::Portable, Level::Neon, Level::Avx2, Level::Avx512];

    /// The levels of this processor, from the slowest to the fastest.
    pub fn available() -> Vec<Level> {
        Level::ALL
            .into_iter()
            .filter(|level| level.is_available())
            .collect()
    }

    /// The fastest level of this processor.
    pub fn best() -> Level {
        let mut fastest_first = Level::ALL.into_iter().rev();
        fastest_first
            .find(|level| level.is_available())
            .unwrap_or_default()
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Level::Portable => true,
            #[cfg(target_arch = "aarch64")]
            Level::Neon => pulp::aarch64::Neon::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[allow(unreachable_patterns)]
            _ => false,
        }
    }

    /// Runs `work` with these instructions; portable ones where the processor lacks them.
    pub(crate) fn run<W: WithSimd>(self, work: W) -> W::Output {
        match self {
            #[cfg(target_arch = "aarch64")]
            Level::Neon => {
                if let Some(simd) = pulp::aarch64::Neon::try_new() {
                    return pulp::Simd::vectorize(simd, work);
                }
            }
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => {
                if let Some(simd) = pulp::x86::V3::try_new() {
                    return pulp::Simd::vectorize(simd, work);
                }
            }
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => {
                if let Some(simd) = pulp::x86::V4::try_new() {
                    return pulp::Simd::vectorize(simd, work);
                }
            }
            _ => {}
        }
        pulp::Simd::vectorize(Scalar, work)
    }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Level::Portable => "portable",
            Level::Neon => "NEON",
            Level::Avx2 => "AVX2",
            Level::Avx512 => "AVX-512",
        })
    }
}
