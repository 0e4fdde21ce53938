//! State sent by the client: attitudes, times, and settings of the camera.

use super::clock;
use super::clock::due::{Due, MAX_WAITING, Sync, TimeCheck};
use super::clock::exposure_clock::ExposureClock;
use super::history::{History, Latched, Pointing};
use super::refusal::Refusal;
use hifitime::Epoch;
use skyloop_config::{Clock as Kind, OutOfOrder, Run, Staleness};
use skyloop_firmware_sim::time::{to_epoch, to_wire};
use skyloop_orbit::time::{seconds, utc_text};
use skyloop_protocols::{Attitude, Header, Reason, SyncState, WireTime};
use skyloop_render::attitude::{AttitudeError, VehicleState};
use skyloop_render::camera::Camera;
use skyloop_render::engine::Emulator;
use skyloop_render::scene::{Exposure, shutter, turn_at};
use std::sync::Arc;
use std::time::Instant;

/// State of the client on the link that carries the truth.
pub(super) struct Client {
    pub kind: Kind,
    pub clock: Box<dyn ExposureClock>,
    pub history: History,
    staleness: Staleness,
    out_of_order: OutOfOrder,
    configured: Arc<Camera>,
    /// The camera as commanded.
    camera: Arc<Camera>,
    has_objects: bool,
    /// The attitude of the last frame, and the number of earlier frames of it.
    rendered: Option<(u64, u32)>,
    /// The attitude that was refused after it had been accepted.
    refused: Option<u64>,
    /// Number of accepted attitudes.
    accepted: u64,
}

impl Client {
    pub fn new(emulator: &Emulator, kind: Kind) -> Client {
        let (run, camera) = (Run::default(), emulator.camera());
        Client {
            kind,
            clock: clock::of(kind, &run, camera.rate_hz),
            history: History::default(),
            staleness: run.staleness,
            out_of_order: run.out_of_order,
            configured: camera.clone(),
            camera,
            has_objects: emulator.has_objects(),
            rendered: None,
            refused: None,
            accepted: 0,
        }
    }

    pub fn set_run(&mut self, run: &Run) {
        self.clock = clock::of(self.kind, run, self.camera.rate_hz);
        (self.staleness, self.out_of_order) = (run.staleness, run.out_of_order);
    }

    /// The camera as commanded.
    pub fn camera(&self) -> &Arc<Camera> {
        &self.camera
    }

    /// The camera for changes. Frames in progress are not affected.
    pub fn camera_mut(&mut self) -> &mut Camera {
        Arc::make_mut(&mut self.camera)
    }

    pub fn is_stepped(&self) -> bool {
        self.kind == Kind::Stepped
    }

    /// Whether an attitude has been accepted.
    pub fn has_attitude(&self) -> bool {
        self.history.latest().is_some()
    }

    /// Whether every `packet` (Attitude or Trigger) requests a frame. At a cadence none does.
    pub fn is_requested_by(&mut self, packet: &str) -> bool {
        self.clock.cadence().is_none() && self.clock.requested_by() == packet
    }

    /// The camera's rate, if frames follow it.
    pub fn cadence_hz(&mut self) -> Option<f64> {
        let rate_hz = self.camera.rate_hz;
        self.clock.cadence().map(|_| rate_hz)
    }

    /// Whether a single shot is exposed or waits for its frame.
    pub fn is_exposing_single_shot(&mut self) -> bool {
        let cadence = self.clock.cadence();
        cadence.is_some_and(|cadence| cadence.single_shot_is_open())
    }

    /// Restarts for another client or after a Reset. Returns the number of waiting exposures, which
    /// get no frame.
    pub fn restart(&mut self, now: Instant) -> u32 {
        self.history = History::default();
        (self.rendered, self.refused) = (None, None);
        self.camera = self.configured.clone();
        self.clock.restart(self.camera.rate_hz, now)
    }

    /// The vehicle state of an Attitude.
    pub fn vehicle(&self, header: &Header, attitude: &Attitude) -> Result<VehicleState, Refusal> {
        let sequence = attitude.sequence;
        if self.clock.is_full() {
            return Err(Refusal::busy(format!(
                "{MAX_WAITING} attitudes already wait for their frames; wait for a frame"
            )));
        }
        if attitude.state.is_none() && self.has_objects {
            return Err(Refusal::value(format!(
                "attitude {sequence} carries no position, and objects are configured: send the orbit state"
            )));
        }
        let orbit = attitude
            .state
            .map(|state| (state.position_m, state.velocity_m_s));
        let vehicle = VehicleState::new(
            sequence,
            to_epoch(header.time),
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
            detail: format!("attitude {sequence}: {error}"),
        })?;
        let span_s = self.camera.exposure_s + self.camera.readout_s();
        check_exposable(&vehicle, span_s)
            .map_err(|why| Refusal::value(format!("attitude {sequence}: {why}")))?;
        Ok(vehicle)
    }

    /// Evaluates a time stamp. Also returns the number of exposures that were dropped because the
    /// client's clock was stepped.
    pub fn observe_time(&mut self, time: Epoch, arrived: Instant) -> (TimeCheck, u32) {
        let check = self.clock.observe_time(time, arrived);
        if check != TimeCheck::Jumped {
            return (check, 0);
        }
        tracing::warn!(
            "the client's clock has jumped to {}: it is followed, and earlier attitudes and triggers are dropped",
            utc_text(time)
        );
        self.history.clear();
        (check, self.clock.drop_requests())
    }

    /// Accepts an attitude; returns whether one with a later time was accepted before.
    pub fn accept_attitude(
        &mut self,
        vehicle: VehicleState,
        header: Header,
        arrived: Instant,
    ) -> Result<bool, Refusal> {
        let out_of_order = self.is_out_of_order(vehicle.epoch, vehicle.sequence, arrived)?;
        self.accepted += 1;
        let latched = Latched {
            vehicle,
            header,
            arrived,
            number: self.accepted,
            out_of_order,
        };
        self.clock.latched(&latched, &self.camera);
        self.history.add(latched, self.camera.exposure_s);
        Ok(out_of_order)
    }

    /// Whether an attitude is earlier than one accepted before; refuses it if the run requires
    /// order. Accepted attitudes too far in the future are ignored, so that a wrong one does not
    /// block the others.
    fn is_out_of_order(
        &mut self,
        epoch: Epoch,
        sequence: u32,
        arrived: Instant,
    ) -> Result<bool, Refusal> {
        let cadence = self.clock.cadence();
        let now = cadence.and_then(|cadence| cadence.scene_at(arrived));
        let limit = now.map(|now| now + seconds(self.staleness.limit_s));
        let last = match limit {
            Some(limit) => self.history.latest_by(limit),
            None => self.history.latest(),
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
        if let Some(limit) = limit.filter(|limit| epoch <= *limit) {
            // An attitude beyond the limit was wrong, or the client's clock was set back.
            self.history.drop_after(limit);
        }
        Ok(is_earlier)
    }

    /// The vehicle state of a due exposure; none before the first attitude.
    pub fn pointing(&self, due: &Due, exposure: &Exposure) -> Option<Pointing> {
        match &due.latched {
            Some(latched) => Some(Pointing::exact(latched)),
            None => self.history.over(exposure, &self.staleness),
        }
    }

    /// Notes the attitude of a frame; returns the number of earlier frames of it. An attitude that
    /// requests its own frame (`is_requested`) has none.
    pub fn count_repeat(&mut self, number: u64, is_requested: bool) -> u32 {
        let repeat = match self.rendered {
            Some((rendered, frames)) if rendered == number && !is_requested => {
                frames.wrapping_add(1)
            }
            _ => 0,
        };
        self.rendered = Some((number, repeat));
        repeat
    }

    /// Notes that an accepted attitude is refused; false if it already was.
    pub fn refuse_once(&mut self, number: u64) -> bool {
        self.refused.replace(number) != Some(number)
    }

    /// How the clock follows the client's time, or that exposures are paused.
    pub fn sync(&self, now: Instant) -> Sync {
        let sync = self.clock.sync(now);
        let state = if self.clock.is_paused() {
            SyncState::Paused
        } else {
            sync.state
        };
        Sync { state, ..sync }
    }

    /// The present time of the emulator: that of the last attitude.
    pub fn now(&self) -> WireTime {
        let latest = self.history.latest();
        let time = latest.and_then(|latched| to_wire(latched.vehicle.epoch));
        time.unwrap_or_default()
    }
}

/// Errors: the time code cannot represent the exposure.
pub(super) fn check_representable(exposure: &Exposure) -> Result<(), String> {
    if to_wire(exposure.start).is_none() || to_wire(exposure.end).is_none() {
        return Err("its exposure reaches beyond the time code, 1958 to 2094".to_string());
    }
    Ok(())
}

/// Errors: an exposure at the epoch of `vehicle` cannot be rendered. It lasts for `span_s` from the
/// opening of the first row to the closing of the last.
fn check_exposable(vehicle: &VehicleState, span_s: f64) -> Result<(), String> {
    let exposure = Exposure::around(vehicle.epoch, span_s);
    check_representable(&exposure)?;
    turn_at(vehicle.rates, span_s)
        .and_then(|_| shutter(vehicle, &exposure))
        .map(|_| ())
        .map_err(|error| error.to_string())
}
