//! An attitude from the wire becomes the latched vehicle state, or is refused.

use super::clock::{Due, Heard, MAX_WAITING, SURE_S};
use super::receive::Refusal;
use super::withheld::{CLOCK_SET, name};
use super::{Latched, Server, add};
use crate::stats::Request;
use hifitime::Epoch;
use skyloop_config::OutOfOrder;
use skyloop_firmware_sim::time::{to_epoch, to_wire};
use skyloop_link::{Inbound, LinkError};
use skyloop_orbit::time::{seconds, utc_text};
use skyloop_protocols::{Attitude, Header, Reason, Withheld};
use skyloop_render::attitude::{AttitudeError, VehicleState};
use skyloop_render::scene::{Exposure, shutter, turn_at};
use std::time::Instant;

impl Server {
    /// Latches a vehicle state.
    pub(super) fn latch(
        &mut self,
        header: Header,
        attitude: &Attitude,
        inbound: &Inbound,
    ) -> Result<(), Refusal> {
        let epoch = to_epoch(header.time);
        if self.clock.is_full() {
            return Err(Refusal::busy(format!(
                "{MAX_WAITING} attitudes already wait for their frames; wait for a frame"
            )));
        }
        if attitude.state.is_none() && self.has_objects {
            return Err(Refusal::value(format!(
                "attitude {} carries no position, and objects are configured: send the state it sees them from",
                attitude.sequence
            )));
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
        let camera = self.settings.camera.clone();
        exposable(&vehicle, camera.exposure_s + camera.readout_s())
            .map_err(|why| Refusal::value(format!("attitude {}: {why}", attitude.sequence)))?;
        if self.clock.awaits_time() {
            // After a pause another time may have begun.
            self.truth.history.forget_after(epoch);
        }
        if let Heard::Doubted(ahead_s) = self.hear(epoch, inbound.arrived)
            && ahead_s > 0.0
        {
            return Err(Refusal::value(format!(
                "time of attitude {} lies {ahead_s:.3} s ahead of the client's clock; that is followed when it goes on so for {SURE_S} s",
                attitude.sequence
            )));
        }
        let out_of_order = self.is_out_of_order(epoch, attitude.sequence, inbound.arrived)?;
        add(&mut self.counters.time_backwards, u32::from(out_of_order));
        self.accepted += 1;
        let latched = Latched {
            vehicle,
            header,
            arrived: inbound.arrived,
            number: self.accepted,
            out_of_order,
        };
        self.clock.latched(&latched, &camera);
        self.truth.history.add(latched, camera.exposure_s);
        Ok(())
    }

    /// A time that the client told. Where its clock has jumped, what came before has no meaning any more.
    pub(super) fn hear(&mut self, told: Epoch, arrived: Instant) -> Heard {
        let heard = self.clock.hear(told, arrived);
        if heard == Heard::Jumped {
            tracing::warn!(
                "the client's clock has jumped to {}: it is followed, and attitudes and triggers that came before are forgotten",
                utc_text(told)
            );
            self.truth.history.clear();
            let asked_for = self.clock.forget();
            add(&mut self.missed, asked_for);
            add(&mut self.counters.triggers_missed, asked_for);
            (0..asked_for).for_each(|_| self.fail(Request::default(), CLOCK_SET));
        }
        heard
    }

    /// Whether an attitude is earlier than one before it; refuses it then, unless such ones are used. One of a future too far to be shown does not count:
    /// a single one that is wrong would keep out all that are right.
    fn is_out_of_order(
        &mut self,
        epoch: Epoch,
        sequence: u32,
        arrived: Instant,
    ) -> Result<bool, Refusal> {
        let cadence = self.clock.cadence();
        let now = cadence.and_then(|cadence| cadence.scene_at(arrived));
        let reach = now.map(|now| now + seconds(self.staleness.limit_s));
        let history = &mut self.truth.history;
        let last = match reach {
            Some(reach) => history.latest_by(reach),
            None => history.latest(),
        };
        let later = last.filter(|last| epoch < last.vehicle.epoch);
        let is_earlier = later.is_some();
        if let Some(last) = later
            && self.out_of_order == OutOfOrder::Refuse
        {
            let back_s = (last.vehicle.epoch - epoch).to_seconds();
            return Err(Refusal {
                reason: Reason::TimeBackwards,
                detail: format!(
                    "time of attitude {sequence} lies {back_s:.6} s before the last one; send them in order, or Reset"
                ),
            });
        }
        if let Some(reach) = reach.filter(|reach| epoch <= *reach) {
            // One of a future too far was wrong, or of a clock that has been set back: it is not waited for.
            history.forget_after(reach);
        }
        Ok(is_earlier)
    }

    /// An attitude that had been accepted may be carried to where nothing can be shown: it is refused once, and each exposure of it is
    /// missed. `request` is none where the frame is on its way: there it ends link by link.
    pub(super) fn refuse_later(
        &mut self,
        request: Option<Request>,
        (number, header): (u64, Header),
        due: &Due,
        why: &str,
    ) -> Result<(), LinkError> {
        self.miss(due);
        if let Some(request) = request {
            self.fail(request, name(Withheld::Refused));
        }
        if self.truth.refused == Some(number) {
            return Ok(());
        }
        self.truth.refused = Some(number);
        self.counters.refuse(Reason::ValueOutOfRange);
        for at in 0..self.channels.len() {
            if self.channels[at].roles.bring_frames() {
                self.report(at, Withheld::Refused, why);
            }
        }
        let at = self.truth_channel();
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
