//! The sky: where the Earth, the Sun and the stars are, and in which direction a camera sees them.

pub mod apparent;
pub mod bodies;
pub mod shadow;
