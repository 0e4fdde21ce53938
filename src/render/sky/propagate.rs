//! Exact propagation and photometry of the candidates in the field.
//!
//! Objects are propagated in groups, which is several times faster than one by one.

use super::apparent::{Corrections, apparent_object};
use super::field::{Excluded, Field, Test};
use super::objects::{Objects, SeenObject};
use super::shadow::Earth;
use hifitime::{Epoch, Unit};
use nalgebra::Matrix3;
use skyloop_orbit::tracks::Tracks;
use skyloop_orbit::{OrbitError, StateVector, frames};
use std::sync::Arc;

/// Objects that are propagated together.
pub(crate) const TASK: usize = 64;

/// Longest exposure with a single rotation from TEME to GCRF, s: in half of that the rotation
/// changes by 4e-11 rad.
const SHORT_S: f64 = 10.0;

/// The inputs of a propagation.
pub(crate) struct Propagation<'a> {
    pub population: &'a Objects,
    pub field: &'a Field<'a>,
    pub test: Test<'a>,
    pub at: &'a Instants,
    /// None for the scalar model.
    pub tracks: Option<&'a Tracks>,
    pub earth: Earth,
    pub corrections: &'a Corrections,
}

/// The result for an object.
pub(crate) enum Outcome {
    Seen(Arc<SeenObject>),
    /// The object's index, and the reason.
    Excluded(usize, Excluded),
    /// The object has no position.
    Failed(u32, OrbitError),
}

/// An object's index, and the number of its track, if it has one.
pub(crate) type Near = (u32, Option<u32>);

/// For light time, states are also computed this much earlier, s. It is the light time of 3000 km.
const EARLIER_S: f64 = 0.01;
/// Residuals (see [`smooth`]) that differ by more than this within an exposure are a jump, m.
const JUMP_M: f64 = 0.01;

impl Propagation<'_> {
    /// The results for these objects.
    pub fn run(&self, near: &[Near]) -> Vec<Outcome> {
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
        let mut indices = tracked.into_iter();
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
        debug_assert!(indices.next().is_none(), "each has its states");
        found
    }

    /// The result for an object, if it is in the field, from its states (TEME) at the exposure's
    /// start, mid and end; for light time also [`EARLIER_S`] earlier.
    fn placed(
        &self,
        index: u32,
        when: &[Epoch],
        states: &[Result<StateVector, u8>],
    ) -> Option<Outcome> {
        let (shutter, rotations) = (self.field.shutter, &self.at.rotations);
        let failed = |(t, state): (&Epoch, &Result<StateVector, u8>)| Some((*t, state.err()?));
        if let Some((t, code)) = when.iter().zip(states).find_map(failed) {
            let object = self.population.all()[index as usize].with_set_at(shutter[1].epoch);
            return Some(Outcome::Failed(index, object.failure(t, code)));
        }
        let gcrf = |k: usize| Some((*states.get(k)?).ok()?.rotated(&rotations[k % 3]));
        let now = [gcrf(0)?, gcrf(1)?, gcrf(2)?];
        if !self.field.may_hold(&now[1]) {
            return None;
        }
        let before = match (gcrf(3), gcrf(4), gcrf(5)) {
            (Some(a), Some(b), Some(c)) => {
                smooth(&now, [a, b, c]).map(|then| Some((EARLIER_S, then)))
            }
            _ => [None; 3],
        };
        let seen = |k: usize| apparent_object(now[k], before[k], &shutter[k], self.corrections);
        let seen = [seen(0), seen(1), seen(2)];
        let index = index as usize;
        let seen = self
            .population
            .seen_object(index, &self.earth, shutter, self.corrections, seen);
        Some(Outcome::Seen(Arc::new(seen)))
    }

    /// The same for an object without a track, which the field's test has not covered.
    fn alone(&self, index: u32) -> Option<Outcome> {
        let (population, shutter) = (self.population, self.field.shutter);
        let mid = shutter[1].epoch;
        let object = population.all()[index as usize].with_set_at(mid);
        let state = match object.state_with(mid, &self.at.rotations[1]) {
            Ok(state) => state,
            Err(error) => return Some(Outcome::Failed(index, error)),
        };
        let teme = state.rotated(&self.at.rotations[1].transpose());
        let bright = population.brightest(index as usize);
        if let Err(why) = self.test.assess(&teme, bright)? {
            return Some(Outcome::Excluded(index as usize, why));
        }
        if !self.field.may_hold(&state) {
            return None;
        }
        let seen = population.see(index as usize, &self.earth, shutter, self.corrections);
        Some(match seen {
            Ok(seen) => Outcome::Seen(Arc::new(seen)),
            Err(error) => Outcome::Failed(index, error),
        })
    }
}

/// The states `then`, [`EARLIER_S`] before `now`, corrected for jumps of the model in that time:
/// extrapolation to a longer light time would multiply a jump.
fn smooth(now: &[StateVector; 3], then: [StateVector; 3]) -> [StateVector; 3] {
    // Residual: the path between both instants minus that by the mean velocity. SGP4's velocities
    // are not the derivative of its positions, but the residual is constant over an exposure.
    let off = [0, 1, 2].map(|k: usize| {
        let mean_m_s = (now[k].velocity_m_s + then[k].velocity_m_s) / 2.0;
        now[k].position_m - then[k].position_m - mean_m_s * EARLIER_S
    });
    let apart = |k: usize, other: usize| (off[k] - off[other]).norm() > JUMP_M;
    [0, 1, 2].map(|k| {
        let [one, other] = [(k + 1) % 3, (k + 2) % 3];
        if !(apart(k, one) && apart(k, other)) {
            return then[k];
        }
        let StateVector {
            position_m,
            velocity_m_s,
        } = now[k];
        StateVector {
            position_m: position_m - velocity_m_s * EARLIER_S - off[one],
            velocity_m_s,
        }
    })
}

/// The rotations from TEME to GCRF at an exposure's start, mid and end.
pub(crate) struct Instants {
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

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// States on a parabola 0.1 s apart, and [`EARLIER_S`] before each; velocities have the error
    /// `off_m_s`.
    fn states(off_m_s: Vector3<f64>) -> [[StateVector; 3]; 2] {
        let (r, v, a) = (
            Vector3::new(4.2e7, 1e6, 0.0),
            Vector3::new(0.0, 3e3, 100.0),
            Vector3::new(-0.22, 0.0, 0.0),
        );
        [0.0, -EARLIER_S].map(|earlier| {
            [0.0, 0.1, 0.2].map(|s| {
                let t = s + earlier;
                StateVector {
                    position_m: r + v * t + a * (t * t / 2.0),
                    velocity_m_s: v + a * t + off_m_s,
                }
            })
        })
    }

    #[test]
    fn jumps_of_the_model_do_not_change_the_path() {
        let apart = |a: &StateVector, b: &StateVector| (a.position_m - b.position_m).norm();
        for off_m_s in [Vector3::zeros(), Vector3::new(300.0, 0.0, 20.0)] {
            let [now, then] = states(off_m_s);
            // A constant error of the velocities is not a jump.
            assert_eq!(smooth(&now, then), then);
            for k in 0..3 {
                for jump_m in [0.02, 60.0, 1e6] {
                    let mut jumped = then;
                    jumped[k].position_m += Vector3::new(0.0, 0.6, 0.8) * jump_m;
                    let found = smooth(&now, jumped);
                    for (found, then) in found.iter().zip(&then) {
                        // X-Val: by hand: half of 0.22 m/s^2 times 0.01 s squared.
                        assert!(apart(found, then) < 1.2e-5, "{}", apart(found, then));
                    }
                }
            }
        }
    }
}
