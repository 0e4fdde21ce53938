//! The closer look at those who may be in the field: where they are exactly, and the light of who is there.
//!
//! Orbits are asked for some dozens of objects at a time, which takes a fraction of what one by one does.

use super::apparent::{Corrections, apparent_object};
use super::field::{Field, Test, Unseen};
use super::population::{Population, SeenObject};
use super::shadow::Earth;
use hifitime::Epoch;
use nalgebra::Matrix3;
use skyloop_orbit::tracks::Tracks;
use skyloop_orbit::{Object, OrbitError, StateVector, frames};
use std::borrow::Cow;
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

/// One of those who are looked at.
struct Whom<'a> {
    index: u32,
    object: Cow<'a, Object>,
    track: Option<u32>,
}

impl Closer<'_> {
    /// What is found of these.
    pub fn look(&self, near: &[Near]) -> Vec<Close> {
        let shutter = self.field.shutter;
        let mut found = Vec::new();
        let tested: Vec<Whom<'_>> = near
            .iter()
            .filter_map(|one| self.tested(one, &mut found))
            .collect();
        let now = self.states(tested.iter(), |_| shutter.each_ref().map(|at| at.epoch));
        let mut here: Vec<(&Whom<'_>, [StateVector; 3])> = Vec::new();
        for (whom, states) in tested.iter().zip(now) {
            match states {
                Ok(states) if self.field.may_hold(&states[1]) => here.push((whom, states)),
                Ok(_) => {}
                Err(error) => found.push(Close::Failed(whom.index, error)),
            }
        }

        let left = |i: usize| [0, 1, 2].map(|k| shutter[k].when_light_left(&here[i].1[k]));
        let then = match self.corrections.light_time {
            true => self.states(here.iter().map(|(whom, _)| *whom), left),
            false => Vec::new(),
        };
        let mut then = then.into_iter();
        for (whom, now) in here {
            found.push(match then.next().transpose() {
                Ok(then) => {
                    let seen = [0, 1, 2].map(|k| {
                        let then = then.map(|then| then[k]);
                        apparent_object(now[k], then, &shutter[k], self.corrections)
                    });
                    let index = whom.index as usize;
                    let (earth, corrections) = (&self.earth, self.corrections);
                    let population = self.population;
                    let seen = population.lit(index, earth, shutter, corrections, seen);
                    Close::Seen(Arc::new(seen))
                }
                Err(error) => Close::Failed(whom.index, error),
            });
        }
        found
    }

    /// One of those who are near, if he may be in the field: who has no track has not been tested yet.
    fn tested(&self, &(index, track): &Near, found: &mut Vec<Close>) -> Option<Whom<'_>> {
        let mid = self.field.shutter[1].epoch;
        let object = self.population.objects()[index as usize].settled(mid);
        let track = track.filter(|_| self.tracks.is_some());
        if track.is_none() {
            let state = match object.state_with(mid, &self.at.rotations[1]) {
                Ok(state) => state,
                Err(error) => {
                    found.push(Close::Failed(index, error));
                    return None;
                }
            };
            let teme = state.rotated(&self.at.rotations[1].transpose());
            let bright = self.population.brightest(index as usize);
            if let Err(why) = self.test.judge(&teme, bright)? {
                found.push(Close::Unseen(index as usize, why));
                return None;
            }
        }
        Some(Whom {
            index,
            object,
            track,
        })
    }

    /// The states of these (GCRF) at the times that `t` gives of each by its number, those of an exposure's start, mid and end: by their
    /// tracks, where they have one.
    fn states<'a>(
        &self,
        whom: impl Iterator<Item = &'a Whom<'a>>,
        t: impl Fn(usize) -> [Epoch; 3],
    ) -> Vec<Result<[StateVector; 3], OrbitError>> {
        let whom: Vec<&Whom<'_>> = whom.collect();
        let mut states = vec![[Err(0); 3]; whom.len()];
        if let Some(tracks) = self.tracks {
            let nobody = u32::MAX;
            let of = |(i, whom): (usize, &&Whom<'_>)| (whom.track.unwrap_or(nobody) as usize, t(i));
            let asked: Vec<(usize, [Epoch; 3])> = whom.iter().enumerate().map(of).collect();
            tracks.states_at(&asked, &mut states);
        }
        let rotations = &self.at.rotations;
        type Answer<'a> = (usize, (&'a Whom<'a>, [Result<StateVector, u8>; 3]));
        let gcrf = |(i, (whom, states)): Answer<'_>| match states {
            [Ok(start), Ok(mid), Ok(end)] => Ok([
                start.rotated(&rotations[0]),
                mid.rotated(&rotations[1]),
                end.rotated(&rotations[2]),
            ]),
            states => {
                let t = t(i);
                let at = |k: usize| match states[k] {
                    Ok(state) => Ok(state.rotated(&rotations[k])),
                    Err(code) if whom.track.is_some() => Err(whom.object.failure(t[k], code)),
                    Err(_) => whom.object.state_with(t[k], &rotations[k]),
                };
                Ok([at(0)?, at(1)?, at(2)?])
            }
        };
        whom.into_iter().zip(states).enumerate().map(gcrf).collect()
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
