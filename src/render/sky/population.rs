//! The resident space objects of a scene, and which of them a camera sees.

pub use super::field::OWN_VEHICLE_M;
pub use super::objects::{Look, Looks, SeenObject, Shutter};
pub use super::population_orbits::Seen;

use super::apparent::Corrections;
use super::field::Field;
use super::objects::Objects;
use super::photometry::Sphere;
use super::population_orbits::PopulationOrbits;
use super::shadow::Earth;
use crate::fidelity::Orbits;
use skyloop_orbit::{Object, OrbitError};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// Objects, and their orbits from frame to frame.
#[derive(Debug, Default)]
pub struct Population {
    objects: Objects,
    /// Computed on first use.
    population_orbits: OnceLock<Mutex<PopulationOrbits>>,
}

impl Population {
    /// Objects; `looks` of some, by their ids; and what stands for all others.
    pub fn new(objects: Vec<Object>, sphere: Sphere, looks: Looks) -> Population {
        Population {
            objects: Objects::new(objects, sphere, looks),
            population_orbits: OnceLock::new(),
        }
    }

    /// The objects.
    pub fn objects(&self) -> &[Object] {
        self.objects.all()
    }

    /// Bytes of memory that the objects take, names and looks included, with 16 for each
    /// allocation.
    pub fn bytes(&self) -> usize {
        let fleet = self
            .population_orbits
            .get()
            .and_then(|population_orbits| population_orbits.lock().ok());
        self.objects.bytes() + fleet.map_or(0, |population_orbits| population_orbits.bytes())
    }

    /// Indices of the objects that may be in the field at some time of the exposure, in no order;
    /// and why others have no position, each object once.
    pub fn before(&self, field: &Field<'_>) -> (Vec<usize>, Vec<OrbitError>) {
        self.population_orbits().before(&self.objects, field)
    }

    /// The orbits, for one caller at a time.
    fn population_orbits(&self) -> MutexGuard<'_, PopulationOrbits> {
        let population_orbits = (self.population_orbits)
            .get_or_init(|| Mutex::new(PopulationOrbits::new(&self.objects)));
        // A thread that panicked has left nothing half done: all state is computed anew from the
        // time of the call.
        population_orbits
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Computes the orbits' tracks before their first use.
    pub fn get_ready(&self) {
        drop(self.population_orbits());
    }

    /// The objects that may be in the field, and what is seen of them.
    pub fn in_field(&self, field: &Field<'_>, corrections: &Corrections, orbits: Orbits) -> Seen {
        (self.population_orbits()).look(&self.objects, field, corrections, orbits)
    }

    /// The object of an index as it is seen during an exposure, wherever it stands, by the scalar
    /// SGP4; `earth` is that of mid-exposure. Fails if its orbit has no position then.
    pub fn see(
        &self,
        index: usize,
        earth: &Earth,
        shutter: &Shutter,
        corrections: &Corrections,
    ) -> Result<SeenObject, OrbitError> {
        self.objects.see(index, earth, shutter, corrections)
    }
}
