//! What the tests of the batch share: the scalar twin's answers, and how far the batch may be from them.

pub mod samples;
pub mod texts;

use nalgebra::Vector3;
use skyloop_orbit::StateVector;
use skyloop_orbit::elements::{Elements, PropagationError};
use skyloop_orbit::sgp4_batch::{Batch, States, TOO_FAR, UNKNOWN};
use std::collections::BTreeMap;
use std::fmt::Display;

/// Position, km, and velocity, km/s, TEME; or the reference implementation's error code.
pub type Answer = Result<([f64; 3], [f64; 3]), u8>;

/// The reference's code of a radius below the Earth's, or below 0.
pub const DECAYED: u8 = 6;

/// How far from the scalar twin every answer may be, km and km/s.
pub const TOLERANCE: (f64, f64) = (1e-6, 1e-9);

/// The other bound: so many times what one unit in the last place of an element does to the scalar answer.
const SHIFTS: f64 = 10.0;

/// The answer of the `sgp4` crate, one object at a time.
pub fn scalar(set: &Elements, minutes: f64) -> Answer {
    match set.state_teme_after(minutes) {
        Ok(state) => Ok(km(&state)),
        Err(PropagationError::TooFar { .. }) => Err(TOO_FAR),
        Err(PropagationError::NotFinite) => Err(UNKNOWN),
        Err(error) => Err(error.code()),
    }
}

/// The answers of the batch, in the order of the sets.
pub fn batch(sets: &[Elements], minutes: f64) -> Vec<Answer> {
    let mut states = States::default();
    let mut batch = Batch::new(sets).unwrap();
    batch.propagate_after(minutes, &mut states);
    answers(&batch, &states)
}

/// All answers, in the order of the sets.
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

/// The sets one unit in the last place of B*, eccentricity or mean motion away, as far as they are sets.
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

/// What became of many comparisons.
#[derive(Default)]
pub struct Tally {
    pub states: usize,
    pub codes: BTreeMap<u8, usize>,
    /// Of those within [`TOLERANCE`], km and km/s.
    pub worst: (f64, f64),
    /// Those that only the other bound allows: what, and distance over shift (of velocities where positions are within).
    pub sensitive: Vec<(String, f64)>,
    /// Those of which one fails and the other does not, or in another way: on the brink of failure the last digit decides.
    pub brinks: Vec<String>,
}

impl Tally {
    /// Compares the batch's answer with the scalar one, and panics where neither bound holds.
    pub fn hold(&mut self, what: impl Display, set: &Elements, minutes: f64, batch: &Answer) {
        let exact = scalar(set, minutes);
        if let Ok((position, velocity)) = batch {
            let finite = position.iter().chain(velocity).all(|x| x.is_finite());
            assert!(finite, "{what} at {minutes} min: {batch:?}");
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
                    "{what} at {minutes} min: {km:e} km and {km_s:e} km/s off, one unit in the last place \
                     does {shift:?}: {set:?}"
                );
                let ratio = if km > TOLERANCE.0 {
                    km / shift.0
                } else {
                    km_s / shift.1
                };
                self.sensitive
                    .push((format!("{what} at {minutes} min: {km:.1e} km"), ratio));
            }
            (Err(code), Err(found)) if code == found => *self.codes.entry(*code).or_default() += 1,
            _ => {
                let allowed = neighbours(set).any(|set| is_alike(&scalar(&set, minutes), batch))
                    || (*batch == Err(DECAYED)
                        && exact.is_ok_and(|state| is_inside_out(set, minutes, &state)));
                let what = format!("{what} at {minutes} min: {exact:?}, in the batch {batch:?}");
                assert!(allowed, "{what}: {set:?}");
                self.brinks.push(what);
            }
        }
    }

    /// Prints what was found, and the objects that the last digit moves.
    pub fn print(&self, of: impl Display) {
        println!(
            "{of}: {} states, at most {:.1e} km and {:.1e} km/s off; error codes {:?}; {} more that a unit in the last place \
             moves, at most by {:.1} of what it does",
            self.states,
            self.worst.0,
            self.worst.1,
            self.codes,
            self.sensitive.len(),
            self.sensitive
                .iter()
                .fold(0.0, |worst: f64, (_, ratio)| worst.max(*ratio)),
        );
        println!("{} brinks of failure", self.brinks.len());
        for what in &self.brinks {
            println!("  {what}");
        }
        for (what, ratio) in &self.sensitive {
            println!("  {what}, {ratio:.2} of what a unit in the last place does");
        }
    }
}

/// How far one unit in the last place of an element moves the scalar answer, km and km/s; no bound where it makes it fail.
fn shift(set: &Elements, minutes: f64, exact: &([f64; 3], [f64; 3])) -> (f64, f64) {
    let shifts = neighbours(set).map(|set| match scalar(&set, minutes) {
        Ok(moved) => distance(exact, &moved),
        Err(_) => (f64::INFINITY, f64::INFINITY),
    });
    shifts.fold((0.0, 0.0), |worst, (km, km_s)| {
        (worst.0.max(km), worst.1.max(km_s))
    })
}

/// Whether an answer is as a neighbour's: of the same code, or with a state where that one is, to a thousandth of its size.
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

/// Whether a state is none of a body in motion: its velocity is not how its position changes. So it is where J2's short-period
/// term has made the radius negative: the reference says that such an object has decayed, the crate gives the point beyond the
/// Earth's centre.
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
