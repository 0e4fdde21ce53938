//! SGP4 and SDP4 of a whole catalogue at once.
//!
//! ```text
//! Elements -> sgp4 crate: constants -> rows of blocks of 8 -> lanes of 1, 2, 4 or 8 -> position, velocity, code
//! ```
//!
//! Blocks are sorted by kind of orbit: near the Earth, deep space, and there resonant with a day or
//! half a day. All other cases are masks. The constants are those of the `sgp4` crate, whose scalar
//! propagation ([`Elements::state_teme`](crate::Elements::state_teme)) is the reference in tests:
//!
//! | module | what |
//! |---|---|
//! | `level` | vector instructions of the processor |
//! | `lanes`, `trig` | arithmetic on several objects side by side |
//! | `constants` | constants of one object |
//! | `site` | kind of orbit |
//! | `secular`, `near`, `deep`, `resonance` | perturbed mean elements |
//! | `short_period` | from these to positions and velocities |
//! | `model`, `block` | what blocks have in common; their states |
//! | `propagate` | many blocks at a time, step by step |
//! | `batch` | the whole catalogue |
//!
//! A state depends on elements and time alone: not on threads, processor, neighbours or earlier
//! calls.

mod batch;
mod block;
mod constants;
mod deep;
mod lanes;
mod level;
mod model;
mod near;
mod propagate;
mod resonance;
mod secular;
mod short_period;
mod site;
mod trig;

pub use batch::{Batch, States};
pub use block::{BlockStates, DECAYED, NOBODY, TOO_FAR, UNKNOWN};
pub use lanes::{BLOCK, Row};
pub use level::Level;
pub(crate) use propagate::Requested;
