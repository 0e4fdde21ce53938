//! Where an object is: position and velocity in the Geocentric Celestial
//! Reference Frame (GCRF), in metres and metres per second.
//!
//! ```text
//! bytes -> load/parse -> Object -> state(t) -> StateVector (GCRF)
//! ```
//!
//! Three sources of motion, one answer:
//!
//! | module | source | model | frame it comes in |
//! |---|---|---|---|
//! | [`elements`] | TLE, 3LE, OMM | SGP4/SDP4 | TEME, turned by [`frames`] |
//! | [`ephemeris`] | CCSDS OEM (KVN, XML) | Hermite or Lagrange interpolation | turned at loading |
//! | [`two_body`] | one state | two bodies and J2 | GCRF |
//!
//! [`synth`] makes populations for scale tests, with the mix of the real one.
//!
//! Nothing here panics on what a file says: a record that cannot be read is
//! [`Rejected`] with its line and reason, and the rest of the file loads.

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
mod designator;
mod format;
mod identity;
mod lines;
mod load;
mod meta;
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

pub use age::{Ages, FRESH_DAYS};
pub use designator::Designator;
pub use format::Format;
pub use identity::{Identity, catalogue_number, is_same, places};
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
pub use unite::{Refused, Source, United, unite};
pub use unread::{found as unread_format, not_attitudes};
pub use write::{Written, write};

use elements::{Elements, PropagationError};
use ephemeris::Ephemeris;
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
        self.position_m
            .iter()
            .chain(self.velocity_m_s.iter())
            .all(|x| x.is_finite())
    }

    /// The same state in axes turned by `rotation` (3 x 3, new = rotation * old).
    ///
    /// The velocity is turned alike: the slow turning of the axes themselves
    /// (precession and nutation, about 1e-11 rad/s) is left out, which is
    /// below 1 mm/s out to the geostationary belt.
    pub fn rotated(&self, rotation: &Matrix3<f64>) -> Self {
        Self {
            position_m: rotation * self.position_m,
            velocity_m_s: rotation * self.velocity_m_s,
        }
    }
}

/// A thing in orbit: what it is called and how it moves.
#[derive(Clone, Debug)]
pub struct Object {
    /// `NORAD 44322` from an element set, the OBJECT_ID of an OEM. Where that is a placeholder, with the name behind it:
    /// `NORAD 0 CUBE`, `UNKNOWN CUBE`.
    pub id: String,
    /// Names: the name line of a 3LE, the OBJECT_NAME of an OEM.
    pub names: Vec<String>,
    /// What tells it from all others.
    pub identity: Identity,
    /// Its motion.
    pub orbit: Orbit,
}

/// How an object's motion is given.
#[derive(Clone, Debug)]
pub enum Orbit {
    /// Mean elements, propagated by SGP4/SDP4: a set, and further ones. The one nearest in time counts.
    Elements(Elements, Vec<Elements>),
    /// Tabulated states, interpolated.
    Ephemeris(Ephemeris),
}

impl Object {
    /// The state at `t`, GCRF, m and m/s.
    ///
    /// Errors: [`OrbitError`], which names the object and the epoch.
    pub fn state(&self, t: Epoch) -> Result<StateVector, OrbitError> {
        match &self.orbit {
            Orbit::Elements(..) => self.state_with(t, &frames::teme_to_gcrf(t)),
            Orbit::Ephemeris(_) => self.state_with(t, &Matrix3::identity()),
        }
    }

    /// [`Object::state`] with the rotation of [`frames::teme_to_gcrf`] at `t`
    /// given by the caller: many objects at one instant pay for it once.
    pub fn state_with(
        &self,
        t: Epoch,
        teme_to_gcrf: &Matrix3<f64>,
    ) -> Result<StateVector, OrbitError> {
        let state = match &self.orbit {
            Orbit::Elements(set, others) => nearest(set, others, t)
                .state_teme(t)
                .map(|state| state.rotated(teme_to_gcrf))
                .map_err(|reason| OrbitError::Propagation {
                    object: self.label(),
                    epoch: t,
                    reason,
                })?,
            Orbit::Ephemeris(ephemeris) => {
                ephemeris
                    .state(t)
                    .map_err(|gap| OrbitError::OutsideInterval {
                        object: self.label(),
                        epoch: t,
                        start: gap.start,
                        stop: gap.stop,
                    })?
            }
        };
        Ok(state)
    }

    /// Why it has no state at `t`, where the batch gives that code of a failure.
    pub fn failure(&self, t: Epoch, code: u8) -> OrbitError {
        let reason = match self.state_with(t, &Matrix3::identity()) {
            Err(error) => return error,
            // Of a negative radius the scalar model gives the point beyond the Earth's centre.
            Ok(state) if code == sgp4_batch::DECAYED => PropagationError::Decayed {
                depth_km: (elements::EARTH_RADIUS_M + state.position_m.norm()) * 1e-3,
            },
            Ok(_) => PropagationError::NotFinite,
        };
        OrbitError::Propagation {
            object: self.label(),
            epoch: t,
            reason,
        }
    }

    /// The first and the last instant at which it may have a state.
    pub fn span(&self) -> Option<(Epoch, Epoch)> {
        let reach = Unit::Day * elements::MAX_ELAPSED_DAYS;
        let sets = self
            .sets()
            .map(|set| (set.epoch - reach, set.epoch + reach));
        let covered = match &self.orbit {
            Orbit::Ephemeris(ephemeris) => ephemeris.interval(),
            Orbit::Elements(..) => None,
        };
        let all = sets.chain(covered);
        all.reduce(|(first, last), (start, end)| (first.min(start), last.max(end)))
    }

    /// Instants, in order, between which its states begin and end, however shortly: the middle of each time that an ephemeris covers, and of each gap
    /// between two; of element sets the changes from one to the next, of which one may have no state.
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
        let neighbours = epochs.windows(2);
        let changes = neighbours.map(|pair| middle([pair[0], pair[1]]));
        let beside = |change: Epoch| [-1, 1].map(|ns| change + Unit::Nanosecond * ns);
        changes.flat_map(beside).collect()
    }

    /// Its element sets, in their order; none of an ephemeris.
    pub fn sets(&self) -> impl Iterator<Item = &Elements> {
        let (first, others) = match &self.orbit {
            Orbit::Elements(set, others) => (Some(set), others.as_slice()),
            Orbit::Ephemeris(_) => (None, &[][..]),
        };
        first.into_iter().chain(others)
    }

    /// What was assumed where its ephemeris leaves it open: lines of its file, and a text each. None of element sets.
    pub fn remarks(&self) -> Vec<(usize, &str)> {
        match &self.orbit {
            Orbit::Elements(..) => Vec::new(),
            Orbit::Ephemeris(ephemeris) => ephemeris.remarks(),
        }
    }

    /// Which of its element sets counts at `t`, in their order; 0 where there is no choice.
    pub fn number_at(&self, t: Epoch) -> usize {
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

    /// The object with the one element set that counts at `t`: within an exposure it must not change.
    pub fn settled(&self, t: Epoch) -> Cow<'_, Object> {
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

    /// Identifier and first name, for messages: `NORAD 39265 (CASSIOPE)`; the identifier alone where it has the name.
    pub fn label(&self) -> String {
        let is_part = |name: &&String| self.id.split(' ').any(|part| part == name.as_str());
        match self
            .names
            .first()
            .filter(|name| !is_part(name) && **name != self.id)
        {
            Some(name) => format!("{} ({name})", self.id),
            None => self.id.clone(),
        }
    }
}

/// A name as it goes into every label: its first 100 printable characters, a blank for a line break.
fn bounded_name(name: &str) -> String {
    let broken = |c: char| if c == '\n' { ' ' } else { c };
    let letters = name.chars().map(broken).filter(|c| !c.is_control());
    letters.take(100).collect()
}

/// The set whose epoch is nearest to `t`.
fn nearest<'a>(set: &'a Elements, others: &'a [Elements], t: Epoch) -> &'a Elements {
    others.iter().fold(set, |best, other| {
        if (other.epoch - t).abs() < (best.epoch - t).abs() {
            other
        } else {
            best
        }
    })
}

/// Why an object has no state at an epoch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OrbitError {
    /// The epoch lies outside what an ephemeris covers.
    #[error(
        "{object}: {} is outside its ephemeris, which covers {} to {}; \
         ask inside it or load an ephemeris that covers the epoch",
        utc_text(*epoch), utc_text(*start), utc_text(*stop)
    )]
    OutsideInterval {
        /// The object's label.
        object: String,
        /// The epoch asked for.
        epoch: Epoch,
        /// Start of the covered interval nearest to the epoch.
        start: Epoch,
        /// End of that interval.
        stop: Epoch,
    },
    /// The orbit model has no answer at the epoch.
    #[error("{object}: no state at {}: {reason}; use elements nearer to the epoch", utc_text(*epoch))]
    Propagation {
        /// The object's label.
        object: String,
        /// The epoch asked for.
        epoch: Epoch,
        /// What went wrong.
        reason: PropagationError,
    },
}

impl OrbitError {
    /// The label of the object that has no state.
    pub fn object(&self) -> &str {
        match self {
            OrbitError::OutsideInterval { object, .. } | OrbitError::Propagation { object, .. } => {
                object
            }
        }
    }
}
