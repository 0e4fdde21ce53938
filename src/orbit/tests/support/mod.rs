//! Shared by the tests of the batch: results of scalar SGP4, and the tolerances against it.

pub mod samples;
pub mod texts;

use nalgebra::Vector3;
use skyloop_orbit::StateVector;
use skyloop_orbit::elements::{Elements, PropagationError};
use skyloop_orbit::sgp4_batch::{Batch, States, TOO_FAR, UNKNOWN};
use std::collections::BTreeMap;
use std::fmt::Display;

/// Position, km, and velocity, km/s, TEME; or an error code of the reference implementation.
pub type Answer = Result<([f64; 3], [f64; 3]), u8>;

/// The reference's code for a radius below the Earth's, or below 0.
pub const DECAYED: u8 = 6;

/// Largest difference from scalar SGP4, km and km/s.
pub const TOLERANCE: (f64, f64) = (1e-6, 1e-9);

/// The other bound: this many times the effect of one unit in the last place of an element.
const SHIFTS: f64 = 10.0;

/// The result of the `sgp4` crate, one object at a time.
pub fn scalar(set: &Elements, minutes: f64) -> Answer {
    match set.state_teme_after(minutes) {
        Ok(state) => Ok(km(&state)),
        Err(PropagationError::TooFar { .. }) => Err(TOO_FAR),
        Err(PropagationError::NotFinite) => Err(UNKNOWN),
        Err(error) => Err(error.code()),
    }
}

/// The results of the batch, in the order of the sets.
pub fn batch(sets: &[Elements], minutes: f64) -> Vec<Answer> {
    let mut states = States::default();
    let mut batch = Batch::new(sets).unwrap();
    batch.propagate_after(minutes, &mut states);
    answers(&batch, &states)
}

/// All results, in the order of the sets.
pub fn answers(batch: &Batch, states: &States) -> Vec<Answer> {
    let all = 0..batch.len();
    all.map(|i| states.get(i).map(|state| km(&state))).collect()
}

fn km(state: &StateVector) -> ([f64; 3], [f64; 3]) {
    (
        (state.position_m / 1e3).into(),
        (state.velocity_m_s / 1e3).into(),
    )
}

/// Distances of position and velocity.
pub fn distance(a: &([f64; 3], [f64; 3]), b: &([f64; 3], [f64; 3])) -> (f64, f64) {
    let norm = |a: [f64; 3], b: [f64; 3]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b));
        squares.sum::<f64>().sqrt()
    };
    (norm(a.0, b.0), norm(a.1, b.1))
}

/// Valid sets that differ by one unit in the last place of B*, eccentricity or mean motion.
pub fn neighbours(set: &Elements) -> impl Iterator<Item = Elements> {
    let set = *set;
    let steps: [fn(f64) -> f64; 2] = [f64::next_up, f64::next_down];
    let sets = steps.into_iter().flat_map(move |step| {
        let [mut drag, mut eccentricity, mut mean_motion] = [set; 3];
        drag.drag = step(set.drag);
        eccentricity.eccentricity = step(set.eccentricity);
        mean_motion.mean_motion = step(set.mean_motion);
        [drag, eccentricity, mean_motion]
    });
    sets.filter(|set| set.eccentricity >= 0.0 && set.constants().is_ok())
}

/// Statistics of many comparisons.
#[derive(Default)]
pub struct Tally {
    pub states: usize,
    pub codes: BTreeMap<u8, usize>,
    /// Largest differences within [`TOLERANCE`], km and km/s.
    pub worst: (f64, f64),
    /// Results that only the other bound allows: label, and difference over shift (velocities where
    /// positions are within the tolerance).
    pub sensitive: Vec<(String, f64)>,
    /// Results with different failures: near a failure the last digit decides.
    pub brinks: Vec<String>,
}

impl Tally {
    /// Compares a result of the batch with scalar SGP4, and panics where neither bound holds.
    pub fn hold(&mut self, label: impl Display, set: &Elements, minutes: f64, batch: &Answer) {
        let exact = scalar(set, minutes);
        if let Ok((position, velocity)) = batch {
            let finite = position.iter().chain(velocity).all(|x| x.is_finite());
            assert!(finite, "{label} at {minutes} min: {batch:?}");
        }
        match (&exact, batch) {
            (Ok(exact), Ok(batch)) => {
                self.states += 1;
                let (km, km_s) = distance(exact, batch);
                if km <= TOLERANCE.0 && km_s <= TOLERANCE.1 {
                    self.worst = (self.worst.0.max(km), self.worst.1.max(km_s));
                    return;
                }
                let shift = shift(set, minutes, exact);
                let within = |off: f64, tolerance: f64, shift: f64| {
                    off <= tolerance || off <= SHIFTS * shift
                };
                assert!(
                    within(km, TOLERANCE.0, shift.0) && within(km_s, TOLERANCE.1, shift.1),
                    "{label} at {minutes} min: {km:e} km and {km_s:e} km/s off, the effect of one unit in the last place \
                     is {shift:?}: {set:?}"
                );
                let ratio = if km > TOLERANCE.0 {
                    km / shift.0
                } else {
                    km_s / shift.1
                };
                self.sensitive
                    .push((format!("{label} at {minutes} min: {km:.1e} km"), ratio));
            }
            (Err(code), Err(found)) if code == found => *self.codes.entry(*code).or_default() += 1,
            _ => {
                let allowed = neighbours(set).any(|set| is_alike(&scalar(&set, minutes), batch))
                    || (*batch == Err(DECAYED)
                        && exact.is_ok_and(|state| is_inside_out(set, minutes, &state)));
                let label = format!("{label} at {minutes} min: {exact:?}, in the batch {batch:?}");
                assert!(allowed, "{label}: {set:?}");
                self.brinks.push(label);
            }
        }
    }

    /// Prints the statistics, and the sensitive results.
    pub fn print(&self, title: impl Display) {
        println!(
            "{title}: {} states, at most {:.1e} km and {:.1e} km/s off; error codes {:?}; {} more are sensitive to a unit in the \
             last place, at most by {:.1} of its effect",
            self.states,
            self.worst.0,
            self.worst.1,
            self.codes,
            self.sensitive.len(),
            self.sensitive
                .iter()
                .fold(0.0, |worst: f64, (_, ratio)| worst.max(*ratio)),
        );
        println!("{} near a failure", self.brinks.len());
        for label in &self.brinks {
            println!("  {label}");
        }
        for (label, ratio) in &self.sensitive {
            println!("  {label}, {ratio:.2} of the effect of a unit in the last place");
        }
    }
}

/// Effect of one unit in the last place of an element on scalar SGP4, km and km/s; infinite where
/// it fails.
fn shift(set: &Elements, minutes: f64, exact: &([f64; 3], [f64; 3])) -> (f64, f64) {
    let shifts = neighbours(set).map(|set| match scalar(&set, minutes) {
        Ok(moved) => distance(exact, &moved),
        Err(_) => (f64::INFINITY, f64::INFINITY),
    });
    shifts.fold((0.0, 0.0), |worst, (km, km_s)| {
        (worst.0.max(km), worst.1.max(km_s))
    })
}

/// Whether a result equals that of a neighbour: the same code, or a state within a thousandth.
fn is_alike(neighbour: &Answer, answer: &Answer) -> bool {
    match (neighbour, answer) {
        (Ok(a), Ok(b)) => {
            let (km, km_s) = distance(a, b);
            let (radius, speed) = distance(a, &([0.0; 3], [0.0; 3]));
            km <= 1e-3 * radius && km_s <= 1e-3 * speed
        }
        (Err(a), Err(b)) => a == b,
        _ => false,
    }
}

/// Whether a velocity is not the derivative of the position. This happens where J2's short-period
/// term makes the radius negative. The reference then reports a decayed object, and the crate gives
/// the point beyond the Earth's centre.
fn is_inside_out(set: &Elements, minutes: f64, state: &([f64; 3], [f64; 3])) -> bool {
    const STEP_MIN: f64 = 0.01;
    let (Ok(before), Ok(after)) = (
        set.state_teme_after(minutes - STEP_MIN),
        set.state_teme_after(minutes + STEP_MIN),
    ) else {
        return true;
    };
    let moved_km = (after.position_m - before.position_m) / 1e3;
    let velocity = Vector3::from(state.1);
    (moved_km / (2.0 * STEP_MIN * 60.0) - velocity).norm() > 0.1 * velocity.norm()
}
