//! The attitudes that have come, and what they make of an exposure.

use super::Latched;
use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_config::{OnStale, Staleness};
use skyloop_orbit::time::seconds;
use skyloop_protocols::AttitudeSource;
use skyloop_render::attitude::{VehicleState, between, rates_between};
use skyloop_render::scene::{Exposure, shutter};
use std::collections::VecDeque;

/// Messages that are kept: some exposures of any client's rate, since of those that follow each other closely not all are.
const KEPT: usize = 512;
/// Of messages that are nearer to each other than this share of an exposure only the newest is kept.
const GRAIN: f64 = 1.0 / 64.0;

/// The attitudes of one exchange, in the order of their times.
#[derive(Debug)]
pub(super) struct History {
    messages: VecDeque<Latched>,
}

impl Default for History {
    /// None yet, and room for all that are kept.
    fn default() -> Self {
        let messages = VecDeque::with_capacity(KEPT + 1);
        Self { messages }
    }
}

/// What an exposure is made with.
#[derive(Debug, Clone)]
pub(super) struct Pointing {
    /// Attitude in the middle of the exposure, rates that take it from its start to its end, and the orbit.
    pub vehicle: VehicleState,
    /// The message that it goes by: the last one before the middle, else the first.
    pub message: Latched,
    /// How it was got.
    pub source: AttitudeSource,
    /// Middle of the exposure minus the time of that message, s.
    pub age_s: f64,
}

impl History {
    /// Takes a message in its place by time.
    pub fn add(&mut self, latched: Latched, exposure_s: f64) {
        let epoch = latched.vehicle.epoch;
        let at = self.after(epoch);
        let is_last = at == self.messages.len();
        self.messages.insert(at, latched);
        let grain = seconds(exposure_s * GRAIN);
        // The one before it is between two that are nearer to each other than the grain.
        if is_last
            && let Some(before) = at
                .checked_sub(2)
                .and_then(|before| self.messages.get(before))
            && epoch - before.vehicle.epoch < grain
        {
            self.messages.remove(at - 1);
        }
        if self.messages.len() > KEPT {
            self.messages.pop_front();
        }
    }

    /// Forgets those of a later time.
    pub fn forget_after(&mut self, epoch: Epoch) {
        let at = self.after(epoch);
        self.messages.truncate(at);
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.messages.clear();
    }

    /// The newest message.
    pub fn latest(&self) -> Option<&Latched> {
        self.messages.back()
    }

    /// The place of the first message of a later time.
    fn after(&self, epoch: Epoch) -> usize {
        self.messages
            .partition_point(|message| message.vehicle.epoch <= epoch)
    }

    /// The newest message that is not of a later time.
    pub fn latest_by(&self, epoch: Epoch) -> Option<&Latched> {
        let after = self.after(epoch);
        after.checked_sub(1).and_then(|at| self.messages.get(at))
    }

    /// What an exposure is made with; none before the first message. One of a future too far counts only where none is near before the exposure.
    pub fn over(&self, exposure: &Exposure, staleness: &Staleness) -> Option<Pointing> {
        let (first, last) = (self.messages.front()?, self.messages.back()?);
        let limit = seconds(staleness.limit_s);
        let after = self.after(exposure.mid);
        let before = after.checked_sub(1).and_then(|at| self.messages.get(at));
        let near_before = before.is_some_and(|one| one.vehicle.epoch + limit >= exposure.mid);
        let next = self.messages.get(after);
        let near_after = next.filter(|one| one.vehicle.epoch <= exposure.mid + limit);
        let is_far = last.vehicle.epoch > exposure.end + limit;
        if is_far && !near_before {
            return Some(out_of_reach(last, exposure, staleness, true));
        }
        // What it says of the way there is not believed.
        let ends_before = is_far && near_after.is_none();
        // After a silence the next message may be the nearer one; between it and the last before nobody knows the way.
        let message = match (before, near_after) {
            (Some(_), Some(next)) if !near_before => next,
            _ => before.unwrap_or(first),
        };
        let age_s = (exposure.mid - message.vehicle.epoch).to_seconds();
        let source = match before {
            None => AttitudeSource::Future,
            Some(_) if age_s < 0.0 => AttitudeSource::Future,
            Some(_) if age_s == 0.0 => AttitudeSource::Exact,
            Some(last) if !near_before => {
                return Some(out_of_reach(last, exposure, staleness, false));
            }
            Some(_) if next.is_some() && !ends_before => AttitudeSource::Interpolated,
            Some(_) => AttitudeSource::Extrapolated,
        };
        let is_known = before.is_none() || near_before;
        let vehicle = match is_known && exposure.start < last.vehicle.epoch && !ends_before {
            true => self.turning(exposure, message)?,
            false => message.vehicle.at(exposure.mid),
        };
        Some(Pointing {
            vehicle,
            message: message.clone(),
            source,
            age_s,
        })
    }

    /// The attitude in the middle, with the constant rates that take it from that at the start to that at the end.
    fn turning(&self, exposure: &Exposure, message: &Latched) -> Option<VehicleState> {
        let [start, mid, end] =
            [exposure.start, exposure.mid, exposure.end].map(|epoch| self.at(epoch));
        let (start, mid, end) = (start?, mid?, end?);
        let open_s = (exposure.end - exposure.start).to_seconds();
        let rates = match open_s > 0.0 {
            true => rates_between(&start.attitude, &end.attitude, open_s),
            false => mid.rates,
        };
        Some(VehicleState {
            sequence: message.vehicle.sequence,
            rates,
            ..mid
        })
    }

    /// The vehicle at one instant.
    fn at(&self, epoch: Epoch) -> Option<VehicleState> {
        let after = self.after(epoch);
        let before = after.checked_sub(1).and_then(|at| self.messages.get(at));
        match (before, self.messages.get(after)) {
            (Some(a), Some(b)) => Some(between(&a.vehicle, &b.vehicle, epoch)),
            (Some(one), None) | (None, Some(one)) => Some(one.vehicle.at(epoch)),
            (None, None) => None,
        }
    }
}

/// What is made of an attitude that is too old, or of a future too far.
fn out_of_reach(
    message: &Latched,
    exposure: &Exposure,
    staleness: &Staleness,
    is_future: bool,
) -> Pointing {
    let carried = message.vehicle.at(exposure.mid);
    let told = &message.vehicle;
    let limit_s = if is_future {
        -staleness.limit_s
    } else {
        staleness.limit_s
    };
    let held = || {
        let held = told.at(told.epoch + seconds(limit_s));
        // Its orbit goes on; but one that leads to where nothing can be shown is held, too.
        let orbit = match shutter(&carried, exposure) {
            Ok(_) => carried.clone(),
            Err(_) => VehicleState {
                epoch: carried.epoch,
                ..held.clone()
            },
        };
        VehicleState {
            attitude: held.attitude,
            rates: Vector3::zeros(),
            ..orbit
        }
    };
    let (vehicle, source) = match staleness.then {
        OnStale::Extrapolate if is_future => (carried, AttitudeSource::Future),
        OnStale::Extrapolate => (carried, AttitudeSource::Stale),
        OnStale::Hold => (held(), AttitudeSource::Held),
        OnStale::Invalid => (held(), AttitudeSource::Invalid),
    };
    Pointing {
        vehicle,
        message: message.clone(),
        source,
        age_s: (exposure.mid - told.epoch).to_seconds(),
    }
}
