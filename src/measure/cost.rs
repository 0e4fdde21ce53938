//! The cost of accuracy: frames of a scene at each setting of [`Fidelity`], with their errors
//! against `reference` and their times.
//!
//! The settings are the presets, and `realtime` with one tolerance changed to its value in `fast`
//! or in `reference`. Errors are those of frames without noise, weighted by the noise of faint
//! sources. Times are those of whole frames with noise; the settings alternate in each round, so
//! that other load affects all alike.

mod choice;
mod errors;
mod row;
mod setting;
mod table;

pub use choice::{Chosen, best};
pub use errors::{Errors, Sums};
pub use row::Row;
pub use setting::{Setting, settings};

use super::clock::thread_ms;
use super::ratio::{Machine, with_threads};
use serde::Serialize;
use skyloop_base::rng::{NoiseKey, word};
use skyloop_render::attitude::VehicleState;
use skyloop_render::engine::Emulator;
use skyloop_render::fidelity::Fidelity;
use skyloop_render::scene::Unobservable;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Default and minimum number of rounds.
pub const ROUNDS: usize = 101;
const MIN_ROUNDS: usize = 5;

/// Measurements of a scene.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// The camera's name.
    pub camera: String,
    /// Number of frames for errors.
    pub frames: usize,
    /// Number of rounds for times.
    pub rounds: usize,
    /// The machine.
    #[serde(flatten)]
    pub machine: Machine,
    /// One row per setting.
    pub rows: Vec<Row>,
}

/// Limits of a measurement.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Maximum number of rounds.
    pub rounds: usize,
    /// No further rounds, except a minimum, after this time.
    pub limit: Duration,
    /// Whether one thread renders, and times are its processor times, without other programs.
    pub one_core: bool,
}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum Unmeasured {
    /// A frame of a vehicle cannot be made.
    #[error(transparent)]
    Unobservable(#[from] Unobservable),
    /// The caller stopped the measurement.
    #[error("the measurement was stopped")]
    Stopped,
}

/// Ends a measurement that the caller stops.
fn check_stop(flow: ControlFlow<()>) -> Result<(), Unmeasured> {
    match flow {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Unmeasured::Stopped),
    }
}

impl Report {
    /// Measures the frames of `vehicles`. `on_progress` gets the number of finished parts and of
    /// all parts, and may stop the measurement. The emulator keeps its state, except the number of
    /// the next frame.
    ///
    /// Errors: those of [`skyloop_render::scene::build_view`], or a stop by `on_progress`.
    pub fn measure(
        emulator: &mut Emulator,
        vehicles: &[VehicleState],
        effort: Effort,
        mut on_progress: impl FnMut(usize, usize) -> ControlFlow<()> + Send,
    ) -> Result<Report, Unmeasured> {
        let settings = settings();
        let before = *emulator.fidelity();
        let mut measure = || {
            let machine = Machine::this();
            let measured = measured(emulator, vehicles, &settings, effort, &mut on_progress);
            (measured, machine)
        };
        let (measured, machine) = if effort.one_core {
            with_threads(1, measure)
        } else {
            measure()
        };
        emulator.set_fidelity(before);
        let (sums, times) = measured?;
        Ok(Report {
            camera: emulator.camera().name.clone(),
            frames: vehicles.len(),
            rounds: times.first().map_or(0, Vec::len),
            machine,
            rows: row::rows(settings, &sums, &times),
        })
    }

    /// The setting for a budget of time per frame, ms.
    pub fn chosen(&self, budget_ms: f64) -> Option<Chosen<'_>> {
        best(&self.rows, budget_ms)
    }
}

fn measured(
    emulator: &mut Emulator,
    vehicles: &[VehicleState],
    settings: &[Setting],
    effort: Effort,
    on_progress: &mut impl FnMut(usize, usize) -> ControlFlow<()>,
) -> Result<(Vec<Sums>, Vec<Vec<f64>>), Unmeasured> {
    let all = vehicles.len() + effort.rounds;
    let mut sums = vec![Sums::default(); settings.len()];
    for (i, vehicle) in vehicles.iter().enumerate() {
        errors::add(emulator, vehicle, settings, &mut sums)?;
        check_stop(on_progress(i + 1, all))?;
    }
    let times = times(emulator, vehicles, settings, effort, |round| {
        on_progress(vehicles.len() + round, all)
    })?;
    Ok((sums, times))
}

/// Frame times of each setting, ms, one per round. Each round starts with an untimed frame: it
/// computes results shared by all settings, such as the orbits.
fn times(
    emulator: &mut Emulator,
    vehicles: &[VehicleState],
    settings: &[Setting],
    effort: Effort,
    mut on_round: impl FnMut(usize) -> ControlFlow<()>,
) -> Result<Vec<Vec<f64>>, Unmeasured> {
    let started = Instant::now();
    let mut times = vec![Vec::new(); settings.len()];
    let each = vehicles.iter().cycle().take(effort.rounds).enumerate();
    for (round, vehicle) in each {
        if round >= MIN_ROUNDS && started.elapsed() > effort.limit {
            break;
        }
        emulator.set_fidelity(Fidelity::REALTIME);
        emulator.expose(vehicle, 0)?;
        for i in order(round, settings.len()) {
            emulator.set_fidelity(settings[i].fidelity);
            let before_ms = thread_ms();
            let exposed = emulator.expose(vehicle, 0)?;
            times[i].push(if effort.one_core {
                thread_ms() - before_ms
            } else {
                exposed.render_time.as_secs_f64() * 1e3
            });
        }
        check_stop(on_round(round + 1))?;
    }
    Ok(times)
}

/// The random order of a round. A frame is slower after one that has emptied the caches, so no
/// setting may follow the same one every time.
fn order(round: usize, count: usize) -> Vec<usize> {
    let key = NoiseKey {
        seed: 0,
        sequence: round as u32,
        repeat: 0,
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by_cached_key(|i| word(key, 0, *i));
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_contain_all_settings_in_varying_order() {
        let count = settings().len();
        let mut followed = vec![vec![0; count]; count];
        for round in 0..ROUNDS {
            let order = order(round, count);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..count));
            for pair in order.windows(2) {
                followed[pair[0]][pair[1]] += 1;
            }
        }
        // X-Val: each of 101 rounds has a given pair with a probability of 1 in 27, on average 3.7
        // in all; 15 occur for one of a hundred thousand pairs.
        let max = followed.into_iter().flatten().max().unwrap();
        assert!(max < 15, "{max}");
    }
}
