//! The sky: positions and brightness of the Earth, the Sun, the stars and the objects in orbit, and
//! their apparent directions.

pub mod apparent;
pub mod atmosphere;
mod bicubic;
pub mod bodies;
pub mod body_attitude;
pub mod catalog;
mod constants;
pub mod earth_light;
pub mod ecliptic;
pub mod field;
pub mod look;
pub mod moon;
mod objects;
pub mod photometry;
pub mod planets;
pub mod population;
mod population_orbits;
mod propagate;
pub mod radiation;
pub mod shadow;
pub mod shape;
pub mod star_field;
pub mod starlight;
pub mod zodiacal;

pub use apparent::{Corrections, Observer};
pub use atmosphere::{Atmosphere, Limb};
pub use earth_light::EarthDisc;
pub use population::Population;
pub use star_field::StarField;
