//! Orbits: position and velocity of objects in the Geocentric Celestial Reference Frame (GCRF), m
//! and m/s.
//!
//! ```text
//! bytes -> load/parse -> Object -> state(t) -> StateVector (GCRF)
//! ```
//!
//! | module | source | model | frame of the source |
//! |---|---|---|---|
//! | [`elements`] | TLE, 3LE, OMM | SGP4/SDP4 | TEME, turned by [`frames`] |
//! | [`ephemeris`] | CCSDS OEM (KVN, XML) | Hermite or Lagrange interpolation | turned at loading |
//! | [`two_body`] | one state | two bodies and J2 | GCRF |
//!
//! [`synth`] makes synthetic populations for scale tests. An unreadable record becomes
//! [`Rejected`] with its line and reason, and the rest of the file loads. No file causes a panic.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod aem;
pub mod cone;
pub mod elements;
pub mod ephemeris;
pub mod frames;
pub mod sgp4_batch;
pub mod synth;
pub mod tracks;
pub mod two_body;

mod age;
mod catalogue_number;
mod designator;
mod format;
mod identity;
mod lines;
mod load;
mod meta;
mod missing;
mod oem;
mod omm;
mod output_file;
mod parts;
mod pick;
mod placeholder;
mod printable;
mod read;
mod record;
mod regime;
mod segments;
mod server;
mod text;
mod theory;
pub mod time;
mod tle;
mod two_line;
mod unite;
mod units;
mod unread;
mod write;
mod xml;

#[cfg(test)]
#[path = "tests/support/texts.rs"]
mod texts;

pub use age::{Ages, FRESH_DAYS};
pub use catalogue_number::catalogue_number;
pub use designator::Designator;
pub use format::Format;
pub use identity::{Identity, is_same, places};
pub use load::{Contents, LoadError, Loaded, Rejected, load, load_contents, parse, parse_contents};
pub use meta::set_ut1_utc;
pub use output_file::{Mark, NO_MARK, OutputFile, foreign, may_replace, write_file};
pub use pick::file_and_name;
pub use placeholder::is_placeholder;
pub use printable::{path_text, printable, printable_line, steers};
pub use read::{
    Input, LARGEST_CONFIG, LARGEST_FILE, LARGEST_PIPE, LARGEST_TABLE, inputs, is_input,
    is_same_file, not_input, read_bytes,
};
pub use record::Record;
pub use regime::Regime;
pub use sgp4;
pub use text::{Listing, files, read_text, read_text_within, remedy};
pub use theory::Theory;
pub use two_line::{Checksum, ElementsError};
pub use unite::{Source, United, unite};
pub use unread::{found as unread_format, not_attitudes};
pub use write::{Written, write};

use elements::{Elements, PropagationError};
use ephemeris::{Ephemeris, NotCovered};
use hifitime::{Epoch, Unit};
use nalgebra::{Matrix3, Vector3};
use std::borrow::Cow;
use time::utc_text;

/// Position and velocity of a point, geocentric, GCRF axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StateVector {
    /// Position, m, GCRF.
    pub position_m: Vector3<f64>,
    /// Velocity, m/s, GCRF.
    pub velocity_m_s: Vector3<f64>,
}

impl StateVector {
    /// Whether all six numbers are finite.
    pub fn is_finite(&self) -> bool {
        let numbers = self.position_m.iter().chain(self.velocity_m_s.iter());
        numbers.into_iter().all(|x| x.is_finite())
    }

    /// The state in axes rotated by `rotation` (3 x 3, new = rotation * old).
    ///
    /// The rotation of the axes with time (precession and nutation, about 1e-11 rad/s) is left out
    /// of the velocity: an error below 1 mm/s out to the geostationary belt.
    pub fn rotated(&self, rotation: &Matrix3<f64>) -> Self {
        Self {
            position_m: rotation * self.position_m,
            velocity_m_s: rotation * self.velocity_m_s,
        }
    }
}

/// An object in orbit.
#[derive(Clone, Debug)]
pub struct Object {
    /// `NORAD 44322` from an element set, the OBJECT_ID of an OEM. A placeholder id is followed by
    /// the name: `NORAD 0 CUBE`, `UNKNOWN CUBE`.
    pub id: String,
    /// Names: the name line of a 3LE, the OBJECT_NAME of an OEM.
    pub names: Vec<String>,
    /// Fields that distinguish it from other objects.
    pub identity: Identity,
    /// Source of its states.
    pub orbit: Orbit,
}

/// Source of the states of an object.
#[derive(Clone, Debug)]
pub enum Orbit {
    /// Mean elements for SGP4/SDP4; the set with the nearest epoch is used.
    Elements(Elements, Vec<Elements>),
    /// Tabulated states, interpolated.
    Ephemeris(Ephemeris),
}

impl Object {
    /// The state at `t`, GCRF, m and m/s.
    ///
    /// # Errors
    ///
    /// [`OrbitError`], which names the object and the epoch.
    pub fn state(&self, t: Epoch) -> Result<StateVector, OrbitError> {
        match &self.orbit {
            Orbit::Elements(..) => self.state_with(t, &frames::teme_to_gcrf(t)),
            Orbit::Ephemeris(_) => self.state_with(t, &Matrix3::identity()),
        }
    }

    /// [`Object::state`] with a precomputed rotation [`frames::teme_to_gcrf`] at `t`.
    pub fn state_with(
        &self,
        t: Epoch,
        teme_to_gcrf: &Matrix3<f64>,
    ) -> Result<StateVector, OrbitError> {
        match &self.orbit {
            Orbit::Elements(set, others) => match nearest(set, others, t).state_teme(t) {
                Ok(state) => Ok(state.rotated(teme_to_gcrf)),
                Err(reason) => Err(self.no_state(t, reason)),
            },
            Orbit::Ephemeris(ephemeris) => {
                let outside = |NotCovered { start, stop }| OrbitError::OutsideInterval {
                    object: self.label(),
                    epoch: t,
                    start,
                    stop,
                };
                ephemeris.state(t).map_err(outside)
            }
        }
    }

    fn no_state(&self, epoch: Epoch, reason: PropagationError) -> OrbitError {
        OrbitError::Propagation {
            object: self.label(),
            epoch,
            reason,
        }
    }

    /// The error at `t` for a failure code of the batch.
    pub fn failure(&self, t: Epoch, code: u8) -> OrbitError {
        let reason = match self.state_with(t, &Matrix3::identity()) {
            Err(error) => return error,
            // For a negative radius the scalar model gives a point on the other side of the centre.
            Ok(state) if code == sgp4_batch::DECAYED => PropagationError::Decayed {
                depth_km: (elements::EARTH_RADIUS_M + state.position_m.norm()) * 1e-3,
            },
            Ok(_) => PropagationError::NotFinite,
        };
        self.no_state(t, reason)
    }

    /// The first and the last instant with a possible state.
    pub fn span(&self) -> Option<(Epoch, Epoch)> {
        if let Orbit::Ephemeris(ephemeris) = &self.orbit {
            return ephemeris.interval();
        }
        let reach = Unit::Day * elements::MAX_ELAPSED_DAYS;
        let epochs = self.sets().map(|set| set.epoch);
        let (first, last) = epochs.clone().min().zip(epochs.max())?;
        Some((first - reach, last + reach))
    }

    /// Instants, in order, between the starts and ends of its states. For an ephemeris: the middle
    /// of each covered interval and of each gap. For element sets: 1 ns before and after each
    /// change of the nearest set, since either set may have no state there.
    pub fn span_middles(&self) -> Vec<Epoch> {
        let middle = |[start, end]: [Epoch; 2]| start + (end - start) * 0.5;
        if let Orbit::Ephemeris(ephemeris) = &self.orbit {
            let covered = ephemeris.covered();
            let gaps = covered.windows(2).map(|pair| [pair[0][1], pair[1][0]]);
            let mut middles: Vec<Epoch> = covered.iter().copied().chain(gaps).map(middle).collect();
            middles.sort_unstable();
            return middles;
        }
        let mut epochs: Vec<Epoch> = self.sets().map(|set| set.epoch).collect();
        epochs.sort_unstable();
        let changes = epochs.windows(2).map(|pair| middle([pair[0], pair[1]]));
        let both_sides = |change: Epoch| [-1, 1].map(|ns| change + Unit::Nanosecond * ns);
        changes.flat_map(both_sides).collect()
    }

    /// Its element sets, in order; empty for an ephemeris.
    pub fn sets(&self) -> impl Iterator<Item = &Elements> + Clone {
        let (first, others) = match &self.orbit {
            Orbit::Elements(set, others) => (Some(set), others.as_slice()),
            Orbit::Ephemeris(_) => (None, &[][..]),
        };
        first.into_iter().chain(others)
    }

    /// Remarks on assumptions of its ephemeris: lines of the file and texts.
    pub fn remarks(&self) -> Vec<(usize, &str)> {
        match &self.orbit {
            Orbit::Elements(..) => Vec::new(),
            Orbit::Ephemeris(ephemeris) => ephemeris.remarks(),
        }
    }

    /// Index of the element set that is used at `t`.
    pub fn set_index_at(&self, t: Epoch) -> usize {
        match &self.orbit {
            Orbit::Elements(set, others) if !others.is_empty() => {
                let nearest = nearest(set, others, t);
                self.sets()
                    .position(|one| std::ptr::eq(one, nearest))
                    .unwrap_or(0)
            }
            _ => 0,
        }
    }

    /// The object with the element set of `t` alone, so that it cannot change during an exposure.
    pub fn with_set_at(&self, t: Epoch) -> Cow<'_, Object> {
        match &self.orbit {
            Orbit::Elements(set, others) if !others.is_empty() => Cow::Owned(Object {
                id: self.id.clone(),
                names: self.names.clone(),
                identity: self.identity,
                orbit: Orbit::Elements(*nearest(set, others, t), Vec::new()),
            }),
            _ => Cow::Borrowed(self),
        }
    }

    /// Identifier and first name, for messages: `NORAD 39265 (CASSIOPE)`. The name is left out
    /// where the identifier has it.
    pub fn label(&self) -> String {
        let is_part = |name: &&String| self.id.split(' ').any(|part| part == name.as_str());
        let name = self.names.first().filter(|name| !is_part(name));
        match name.filter(|name| **name != self.id) {
            Some(name) => format!("{} ({name})", self.id),
            None => self.id.clone(),
        }
    }
}

/// A name for labels: its first 100 printable characters, with blanks for line breaks.
fn bounded_name(name: &str) -> String {
    let broken = |c: char| if c == '\n' { ' ' } else { c };
    let letters = name.chars().map(broken).filter(|c| !c.is_control());
    letters.take(100).collect()
}

/// The set with the epoch nearest to `t`; the first of equally near ones.
fn nearest<'a>(set: &'a Elements, others: &'a [Elements], t: Epoch) -> &'a Elements {
    let all = std::iter::once(set).chain(others);
    all.min_by_key(|one| (one.epoch - t).abs()).unwrap_or(set)
}

/// Why an object has no state at an epoch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// The epoch lies outside the covered intervals of an ephemeris.
    #[error(
        "{object}: {} is outside its ephemeris, which covers {} to {}; \
         ask inside it or load an ephemeris that covers the epoch",
        utc_text(*epoch), utc_text(*start), utc_text(*stop)
    )]
    OutsideInterval {
        /// The object's label.
        object: String,
        /// The requested epoch.
        epoch: Epoch,
        /// Start of the covered interval nearest to the epoch.
        start: Epoch,
        /// End of that interval.
        stop: Epoch,
    },
    /// The orbit model has no state at the epoch.
    #[error("{object}: no state at {}: {reason}; use elements nearer to the epoch", utc_text(*epoch))]
    Propagation {
        /// The object's label.
        object: String,
        /// The requested epoch.
        epoch: Epoch,
        /// The failure of the model.
        reason: PropagationError,
    },
}

impl OrbitError {
    /// The label of the object that has no state.
    pub fn object(&self) -> &str {
        let (OrbitError::OutsideInterval { object, .. } | OrbitError::Propagation { object, .. }) =
            self;
        object
    }
}
