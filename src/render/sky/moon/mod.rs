//! The Moon: its disc, its brightness, and the distribution of its light.
//!
//! [`Bodies`](super::bodies::Bodies) has its position.
//!
//! **Total light**: the disc reflectance `A` of Kieffer & Stone 2005 (AJ 129, 2887; model 311g),
//! Eq. (10), at 549.1 nm, which represents V (551 nm): with the phase angle `g` and the Sun's
//! selenographic longitude `P`
//!
//! ```text
//! ln A = sum a_i g^i + sum b_j P^(2j-1) + d1 e^(-g/p1) + d2 e^(-g/p2) + d3 cos((g - p3) / p4)
//! V    = V_sun - 2.5 log10(A (R / d)^2) + 5 log10(d_sun / au)
//! ```
//!
//! The terms of `d` are the opposition surge. Omitted are libration (below 2 %) and the cosine,
//! since d3 is 0 at this wavelength. The fit is valid from 1.55 to 97 degrees of phase to 1 %, with
//! 5 % in absolute scale; beyond, it stays within 0.2 mag of Allen's law up to 150 degrees.
//!
//! **On the disc**: Lommel and Seeliger's law, radiance `mu0 / (mu0 + mu)` by the cosines of
//! incidence and emission. Its integral over the disc of a sphere is closed (a test integrates it):
//!
//! ```text
//! S = integral of mu0 mu / (mu0 + mu) = (pi / 2) (1 - sin(g/2) tan(g/2) ln cot(g/4))
//! ```
//!
//! so the share of light from each direction has an integral of 1 at any phase. Maria, limb profile
//! and earthshine are not modelled. The disc is drawn as from a great distance: the terminator is
//! up to 0.26 degrees of selenographic arc off.

mod cells;
mod disc;
pub(super) mod series;

pub use cells::Cell;
pub use disc::{MoonDisc, RADIUS_M};
