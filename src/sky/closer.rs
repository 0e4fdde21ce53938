//! The closer look at those who may be in the field: where they are exactly, and the light of who is there.
//!
//! Orbits are asked for some dozens of objects at a time, which takes a fraction of what one by one does.

use super::apparent::{ApparentObject, Corrections, apparent_object};
use super::field::{Field, Test, Unseen};
use super::population::{Population, SeenObject};
use super::shadow::Earth;
use hifitime::{Epoch, Unit};
use nalgebra::Matrix3;
use skyloop_orbit::tracks::Tracks;
use skyloop_orbit::{OrbitError, StateVector, frames};
use std::sync::Arc;

/// Objects that are looked at together.
pub const TASK: usize = 64;

/// Exposures up to this (s) are short enough for one rotation from TEME to GCRF: what it turns by in half of that is 4e-11 rad.
const SHORT_S: f64 = 10.0;

/// All that such a look needs.
pub struct Closer<'a> {
    pub population: &'a Population,
    pub field: &'a Field<'a>,
    pub test: Test<'a>,
    pub at: &'a Instants,
    /// None where the scalar model is to say it all.
    pub tracks: Option<&'a Tracks>,
    pub earth: Earth,
    pub corrections: &'a Corrections,
}

/// What it finds.
pub enum Close {
    Seen(Arc<SeenObject>),
    /// The object's index, and why.
    Unseen(usize, Unseen),
    /// It has no position.
    Failed(u32, OrbitError),
}

/// An object, by its index, and the number of its track, if it has one.
pub type Near = (u32, Option<u32>);

/// What light takes over 3000 km, s.
const EARLIER_S: f64 = 0.01;

impl Closer<'_> {
    /// What is found of these.
    pub fn look(&self, near: &[Near]) -> Vec<Close> {
        let mut found = Vec::with_capacity(near.len());
        let (mut tracked, mut tracks_of) = (Vec::new(), Vec::new());
        for &(index, track) in near {
            match (track, self.tracks) {
                (Some(track), Some(_)) => {
                    tracked.push(index);
                    tracks_of.push(track as usize);
                }
                _ => found.extend(self.alone(index)),
            }
        }
        let Some(tracks) = self.tracks else {
            return found;
        };
        let [start, mid, end] = self.field.shutter.each_ref().map(|at| at.epoch);
        let indices = &mut tracked.into_iter();
        let mut add = |when: &[Epoch], states: &[Result<StateVector, u8>]| {
            found.extend(indices.next().and_then(|i| self.placed(i, when, states)));
        };
        if self.corrections.light_time {
            let earlier = |t: Epoch| t - Unit::Second * EARLIER_S;
            let when = [start, mid, end, earlier(start), earlier(mid), earlier(end)];
            tracks.states_at(&tracks_of, &when, |states| add(&when, &states));
        } else {
            let when = [start, mid, end];
            tracks.states_at(&tracks_of, &when, |states| add(&when, &states));
        }
        found
    }

    /// What is found of the object of that index, if he is in the field, by his states (TEME) at the exposure's start, mid and end, and, where light
    /// takes time, by [`EARLIER_S`] earlier.
    fn placed(
        &self,
        index: u32,
        when: &[Epoch],
        states: &[Result<StateVector, u8>],
    ) -> Option<Close> {
        let (shutter, rotations) = (self.field.shutter, &self.at.rotations);
        let failed = |(t, state): (&Epoch, &Result<StateVector, u8>)| Some((*t, state.err()?));
        if let Some((t, code)) = when.iter().zip(states).find_map(failed) {
            let object = self.population.objects()[index as usize].settled(shutter[1].epoch);
            return Some(Close::Failed(index, object.failure(t, code)));
        }
        let gcrf = |k: usize| Some((*states.get(k)?).ok()?.rotated(&rotations[k % 3]));
        if !self.field.may_hold(&gcrf(1)?) {
            return None;
        }
        let seen = |k: usize| -> Option<ApparentObject> {
            let then = gcrf(k + 3).map(|then| (EARLIER_S, then));
            let object = apparent_object(gcrf(k)?, then, &shutter[k], self.corrections);
            Some(object)
        };
        let seen = [seen(0)?, seen(1)?, seen(2)?];
        let index = index as usize;
        let seen = (self.population).lit(index, &self.earth, shutter, self.corrections, seen);
        Some(Close::Seen(Arc::new(seen)))
    }

    /// The same of one without a track, who has not been tested yet.
    fn alone(&self, index: u32) -> Option<Close> {
        let (population, shutter) = (self.population, self.field.shutter);
        let mid = shutter[1].epoch;
        let object = population.objects()[index as usize].settled(mid);
        let state = match object.state_with(mid, &self.at.rotations[1]) {
            Ok(state) => state,
            Err(error) => return Some(Close::Failed(index, error)),
        };
        let teme = state.rotated(&self.at.rotations[1].transpose());
        let bright = population.brightest(index as usize);
        if let Err(why) = self.test.judge(&teme, bright)? {
            return Some(Close::Unseen(index as usize, why));
        }
        if !self.field.may_hold(&state) {
            return None;
        }
        let seen = population.see(index as usize, &self.earth, shutter, self.corrections);
        Some(match seen {
            Ok(seen) => Close::Seen(Arc::new(seen)),
            Err(error) => Close::Failed(index, error),
        })
    }
}

/// The rotations from TEME to GCRF at an exposure's start, mid and end.
pub struct Instants {
    pub rotations: [Matrix3<f64>; 3],
}

impl Instants {
    pub fn of(field: &Field<'_>) -> Instants {
        let [start, mid, end] = field.shutter.each_ref().map(|observer| observer.epoch);
        let rotation = frames::teme_to_gcrf(mid);
        let rotations = if (end - start).to_seconds() <= SHORT_S {
            [rotation; 3]
        } else {
            [
                frames::teme_to_gcrf(start),
                rotation,
                frames::teme_to_gcrf(end),
            ]
        };
        Instants { rotations }
    }
}
