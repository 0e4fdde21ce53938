//! An attitude from the wire becomes the latched vehicle state, or is refused.

use super::receive::Refusal;
use super::{Latched, MAX_WAITING, Server};
use crate::attitude::{AttitudeError, VehicleState};
use crate::config::Clock;
use crate::link::{Inbound, LinkError};
use crate::scene::{Exposure, shutter, turn_at};
use skyloop_firmware_sim::time::{to_epoch, to_wire};
use skyloop_protocols::{Attitude, Header, Reason};

impl Server {
    /// Latches a vehicle state.
    pub(super) fn latch(
        &mut self,
        header: Header,
        attitude: &Attitude,
        inbound: &Inbound,
    ) -> Result<(), Refusal> {
        let epoch = to_epoch(header.time);
        if let Some(last) = &self.truth.latest
            && epoch < last.vehicle.epoch
        {
            let back_s = (last.vehicle.epoch - epoch).to_seconds();
            return Err(Refusal {
                reason: Reason::TimeBackwards,
                detail: format!(
                    "time of attitude {} lies {back_s:.6} s before the last one; send them in order, or Reset",
                    attitude.sequence
                ),
            });
        }
        if self.clock == Clock::Stepped && self.truth.waiting.len() >= MAX_WAITING {
            return Err(Refusal {
                reason: Reason::Busy,
                detail: format!(
                    "{MAX_WAITING} attitudes already wait for their frames; wait for a frame"
                ),
            });
        }
        if attitude.state.is_none() && self.emulator.has_objects() {
            return Err(Refusal {
                reason: Reason::ValueOutOfRange,
                detail: format!(
                    "attitude {} carries no position, and objects are configured: send the state it sees them from",
                    attitude.sequence
                ),
            });
        }
        let orbit = attitude
            .state
            .map(|state| (state.position_m, state.velocity_m_s));
        let vehicle = VehicleState::new(
            attitude.sequence,
            epoch,
            attitude.q_icrf_to_body,
            attitude.rates_rad_s,
            orbit,
        )
        .map_err(|error| Refusal {
            reason: match error {
                AttitudeError::NotUnit { .. } => Reason::QuaternionNotUnit,
                AttitudeError::NotFinite { .. } => Reason::NotFinite,
                AttitudeError::OutOfRange { .. } => Reason::ValueOutOfRange,
            },
            detail: format!("attitude {}: {error}", attitude.sequence),
        })?;
        let camera = self.emulator.camera();
        exposable(&vehicle, camera.exposure_s + camera.readout_s()).map_err(|why| Refusal {
            reason: Reason::ValueOutOfRange,
            detail: format!("attitude {}: {why}", attitude.sequence),
        })?;
        let latched = Latched {
            vehicle,
            camera,
            header,
            arrived: inbound.arrived,
        };
        match self.clock {
            Clock::Stepped => self.truth.waiting.push_back(latched.clone()),
            Clock::Wall => self.wall.set(epoch, inbound.arrived),
        }
        self.truth.latest = Some(latched);
        self.truth.repeat = 0;
        self.truth.refused = false;
        Ok(())
    }

    /// By the wall clock an accepted attitude may be carried to where nothing can be shown: it is refused once,
    /// and each later exposure of it is missed.
    pub(super) fn refuse_later(
        &mut self,
        at: usize,
        header: &Header,
        why: &str,
    ) -> Result<(), LinkError> {
        if std::mem::replace(&mut self.truth.refused, true) {
            self.wall.missed = self.wall.missed.wrapping_add(1);
            return Ok(());
        }
        self.counters.refuse(Reason::ValueOutOfRange);
        self.nack(
            at,
            header.apid,
            header.sequence_count,
            Reason::ValueOutOfRange,
            why,
        )
    }
}

/// Whether the wire has words for the times of an exposure.
pub(super) fn tellable(exposure: &Exposure) -> Result<(), String> {
    if to_wire(exposure.start).is_none() || to_wire(exposure.end).is_none() {
        return Err("its exposure reaches beyond the time code, 1958 to 2094".to_string());
    }
    Ok(())
}

/// Whether an exposure around `vehicle`'s epoch that lasts for `open_s` from the first row's opening to the last row's
/// closing can be shown and its times be told; else why not.
fn exposable(vehicle: &VehicleState, open_s: f64) -> Result<(), String> {
    let exposure = Exposure::around(vehicle.epoch, open_s);
    tellable(&exposure)?;
    turn_at(vehicle.rates, open_s)
        .and_then(|_| shutter(vehicle, &exposure))
        .map(|_| ())
        .map_err(|error| error.to_string())
}
