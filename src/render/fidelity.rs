//! Accuracy, as error bounds in field units; never a "quality" from 1 to 10.

mod choice;
mod coarser;
mod orbits;
mod tolerances;
mod value;

pub use choice::Choice;
pub use coarser::Coarser;
pub use orbits::Orbits;
pub use tolerances::{Fidelity, PRESETS, TOLERANCES, Tolerance};
pub use value::{Allowed, Setting, Value};
