//! The accepted attitudes, and the vehicle state of an exposure derived from them.

use hifitime::Epoch;
use nalgebra::Vector3;
use skyloop_config::{OnStale, Staleness};
use skyloop_orbit::time::seconds;
use skyloop_protocols::{AttitudeSource, Header};
use skyloop_render::attitude::{VehicleState, between, rates_between};
use skyloop_render::scene::{Exposure, shutter};
use std::collections::VecDeque;
use std::time::Instant;

/// Maximum number of stored messages. They span several exposures at any client rate, because
/// [`MIN_SPACING`] thins them out.
const CAPACITY: usize = 512;
/// Spacing of stored messages, as a share of the exposure: of denser ones the newest is stored.
const MIN_SPACING: f64 = 1.0 / 64.0;

/// An attitude that has been accepted.
#[derive(Debug, Clone)]
pub(super) struct Latched {
    pub vehicle: VehicleState,
    pub header: Header,
    pub arrived: Instant,
    /// Its number among all accepted attitudes.
    pub number: u64,
    /// Whether an attitude with a later time came before it.
    pub out_of_order: bool,
}

/// The attitudes of one exchange, sorted by time.
#[derive(Debug)]
pub(super) struct History {
    messages: VecDeque<Latched>,
}

impl Default for History {
    /// Empty, with all memory reserved.
    fn default() -> Self {
        let messages = VecDeque::with_capacity(CAPACITY + 1);
        Self { messages }
    }
}

/// The vehicle state of an exposure.
#[derive(Debug, Clone)]
pub(super) struct Pointing {
    /// Attitude at mid-exposure, mean rates over the exposure, and the orbit.
    pub vehicle: VehicleState,
    /// The message that it is derived from: the last one before mid-exposure, else the first.
    pub message: Latched,
    /// Method of derivation.
    pub source: AttitudeSource,
    /// Mid-exposure minus the time of that message, s.
    pub age_s: f64,
}

impl Pointing {
    /// The vehicle state of an exposure at the time of an attitude.
    pub fn exact(latched: &Latched) -> Pointing {
        Pointing {
            vehicle: latched.vehicle.clone(),
            message: latched.clone(),
            source: AttitudeSource::Exact,
            age_s: 0.0,
        }
    }
}

impl History {
    /// Inserts a message by its time.
    pub fn add(&mut self, latched: Latched, exposure_s: f64) {
        let epoch = latched.vehicle.epoch;
        let at = self.after(epoch);
        let is_last = at == self.messages.len();
        self.messages.insert(at, latched);
        let spacing = seconds(exposure_s * MIN_SPACING);
        // The previous message lies between two messages that are less than the spacing apart.
        if is_last
            && let Some(before) = self.messages.iter().rev().nth(2)
            && epoch - before.vehicle.epoch < spacing
        {
            self.messages.remove(at - 1);
        }
        if self.messages.len() > CAPACITY {
            self.messages.pop_front();
        }
    }

    pub fn drop_after(&mut self, epoch: Epoch) {
        let at = self.after(epoch);
        self.messages.truncate(at);
    }

    pub fn clear(&mut self) {
        self.messages.clear();
    }

    pub fn latest(&self) -> Option<&Latched> {
        self.messages.back()
    }

    /// Index of the first message with a later time.
    fn after(&self, epoch: Epoch) -> usize {
        self.messages
            .partition_point(|message| message.vehicle.epoch <= epoch)
    }

    /// The newest message whose time is not later.
    pub fn latest_by(&self, epoch: Epoch) -> Option<&Latched> {
        self.messages.range(..self.after(epoch)).next_back()
    }

    /// The vehicle state of an exposure; none before the first message. A message too far in the
    /// future is used only if no message shortly before the exposure exists.
    pub fn over(&self, exposure: &Exposure, staleness: &Staleness) -> Option<Pointing> {
        let (first, last) = (self.messages.front()?, self.messages.back()?);
        let limit = seconds(staleness.limit_s);
        let after = self.after(exposure.mid);
        let before = self.latest_by(exposure.mid);
        let near_before = before.is_some_and(|one| one.vehicle.epoch + limit >= exposure.mid);
        let next = self.messages.get(after);
        let near_after = next.filter(|one| one.vehicle.epoch <= exposure.mid + limit);
        let is_far = last.vehicle.epoch > exposure.end + limit;
        if is_far && !near_before {
            return Some(from_outdated(last, exposure, staleness, true));
        }
        // A message too far in the future is not used to interpolate.
        let ends_before = is_far && near_after.is_none();
        // After a silence the next message may be nearer. The motion in the gap is unknown.
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
                return Some(from_outdated(last, exposure, staleness, false));
            }
            Some(_) if next.is_some() && !ends_before => AttitudeSource::Interpolated,
            Some(_) => AttitudeSource::Extrapolated,
        };
        let is_known = before.is_none() || near_before;
        let vehicle = if is_known && exposure.start < last.vehicle.epoch && !ends_before {
            self.with_mean_rates(exposure, message)?
        } else {
            message.vehicle.at(exposure.mid)
        };
        Some(Pointing {
            vehicle,
            message: message.clone(),
            source,
            age_s,
        })
    }

    /// The attitude at mid-exposure, with the constant rates that connect those at start and end.
    fn with_mean_rates(&self, exposure: &Exposure, message: &Latched) -> Option<VehicleState> {
        let [start, mid, end] =
            [exposure.start, exposure.mid, exposure.end].map(|epoch| self.at(epoch));
        let (start, mid, end) = (start?, mid?, end?);
        let open_s = (exposure.end - exposure.start).to_seconds();
        let rates = if open_s > 0.0 {
            rates_between(&start.attitude, &end.attitude, open_s)
        } else {
            mid.rates
        };
        Some(VehicleState {
            sequence: message.vehicle.sequence,
            rates,
            ..mid
        })
    }

    /// The vehicle at one instant.
    fn at(&self, epoch: Epoch) -> Option<VehicleState> {
        match (self.latest_by(epoch), self.messages.get(self.after(epoch))) {
            (Some(a), Some(b)) => Some(between(&a.vehicle, &b.vehicle, epoch)),
            (Some(one), None) | (None, Some(one)) => Some(one.vehicle.at(epoch)),
            (None, None) => None,
        }
    }
}

/// The vehicle state from an attitude that is too old, or too far in the future.
fn from_outdated(
    message: &Latched,
    exposure: &Exposure,
    staleness: &Staleness,
    is_future: bool,
) -> Pointing {
    let carried = message.vehicle.at(exposure.mid);
    let received = &message.vehicle;
    let limit_s = if is_future {
        -staleness.limit_s
    } else {
        staleness.limit_s
    };
    let held = || {
        let held = received.at(received.epoch + seconds(limit_s));
        // The orbit continues, unless the position would become unobservable.
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
        age_s: (exposure.mid - received.epoch).to_seconds(),
    }
}
