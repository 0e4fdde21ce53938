//! The resident space objects of a scene, and which of them a camera sees.

pub use super::field::OWN_VEHICLE_M;
pub use super::objects::{Appearance, Appearances, SeenObject, Shutter};
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
    /// Objects; the known `looks` by object id; and the sphere for all others.
    pub fn new(objects: Vec<Object>, sphere: Sphere, looks: Appearances) -> Population {
        Population {
            objects: Objects::new(objects, sphere, looks),
            population_orbits: OnceLock::new(),
        }
    }

    /// The objects.
    pub fn objects(&self) -> &[Object] {
        self.objects.all()
    }

    /// Memory of objects and orbits, bytes, with names and appearances, and 16 for each allocation.
    pub fn bytes(&self) -> usize {
        let orbits = self.population_orbits.get();
        let orbits = orbits.and_then(|orbits| orbits.lock().ok());
        self.objects.bytes() + orbits.map_or(0, |orbits| orbits.bytes())
    }

    /// Indices of the objects that may be in the field during the exposure, in no order; and the
    /// reasons for missing positions, each object once.
    pub fn candidates(&self, field: &Field<'_>) -> (Vec<usize>, Vec<OrbitError>) {
        self.population_orbits().candidates(&self.objects, field)
    }

    /// The orbits, for one caller at a time.
    fn population_orbits(&self) -> MutexGuard<'_, PopulationOrbits> {
        let population_orbits = (self.population_orbits)
            .get_or_init(|| Mutex::new(PopulationOrbits::new(&self.objects)));
        // A panic leaves no inconsistent state: each call computes all state anew for its own time.
        population_orbits
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Computes the tracks before their first use.
    pub(crate) fn compute_tracks(&self) {
        drop(self.population_orbits());
    }

    /// The objects that may be in the field, and their appearance.
    pub fn in_field(&self, field: &Field<'_>, corrections: &Corrections, orbits: Orbits) -> Seen {
        (self.population_orbits()).in_field(&self.objects, field, corrections, orbits)
    }

    /// An object during an exposure, in or outside the field, by the scalar SGP4; `earth` is that
    /// of mid-exposure. Fails if its orbit has no position at that time.
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
