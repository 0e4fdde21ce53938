//! SGP4 and SDP4 for a whole catalogue at once.
//!
//! ```text
//! Elements -> sgp4 crate: constants -> rows of blocks of 8 -> lanes of 1, 2, 4 or 8
//!          -> position, velocity, code
//! ```
//!
//! Blocks are sorted by kind of orbit: near-Earth, deep-space, and deep-space in resonance with a
//! day or half a day. Masks handle all other cases within a block. The constants come from the
//! `sgp4` crate. Its scalar propagation ([`Elements::state_teme`](crate::Elements::state_teme)) is
//! the reference in tests.
//!
//! | module | content |
//! |---|---|
//! | `level` | vector instructions of the processor |
//! | `lanes`, `trig` | arithmetic on several objects at a time |
//! | `constants` | constants of one object |
//! | `site` | kind of orbit |
//! | `secular`, `near`, `deep`, `resonance` | perturbed mean elements |
//! | `short_period` | from these to positions and velocities |
//! | `model`, `block` | interface of all blocks; their states |
//! | `propagate` | steps over many blocks at a time |
//! | `batch` | the whole catalogue |
//!
//! A state depends on elements and time alone: not on threads, processor, other objects or earlier
//! calls.

mod batch;
mod block;
mod constants;
mod deep;
mod lanes;
mod level;
mod model;
mod near;
mod orbit_kind;
mod propagate;
mod resonance;
mod secular;
mod short_period;
mod trig;

pub use batch::{Batch, States};
pub use block::{BlockStates, DECAYED, NO_OBJECT, TOO_FAR, UNKNOWN};
pub use lanes::{BLOCK, Row};
pub use level::Level;
pub(crate) use propagate::Requested;
