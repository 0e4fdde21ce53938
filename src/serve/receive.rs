//! From the wire: packets to commands to the emulator's settings and the latched vehicle state.

use super::deliver::LISTEN;
use super::{Exchange, Latched, MAX_WAITING, Server};
use crate::attitude::{AttitudeError, VehicleState};
use crate::camera::{EXPOSURE_S, GAIN_E_PER_DN, RATE_HZ};
use crate::config::Clock;
use crate::link::{Inbound, LinkError, Outbound, QUEUE};
use crate::scene::{Exposure, turn_at};
use skyloop_firmware_sim::time::{to_epoch, to_wire};
use skyloop_protocols::{Attitude, Command, Header, Reason, Reply, packet};
use std::ops::RangeInclusive;
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

/// Why a valid packet is refused.
struct Refusal {
    reason: Reason,
    detail: String,
}

impl Server {
    /// Waits up to `timeout` for a packet and acts on it; false when the link has ended.
    pub(super) fn receive(&mut self, timeout: Duration) -> Result<bool, LinkError> {
        let timeout = if self.flush()? {
            timeout
        } else {
            timeout.min(LISTEN)
        };
        match self.wire.inbox.recv_timeout(timeout) {
            Ok(inbound) => self.handle(inbound).map(|()| true),
            Err(RecvTimeoutError::Timeout) => Ok(true),
            Err(RecvTimeoutError::Disconnected) => Ok(false),
        }
    }

    /// Acts on the packets that have come; false when the link has ended. As many as a full queue holds: a
    /// flood does not stop the frames.
    pub(super) fn receive_waiting(&mut self) -> Result<bool, LinkError> {
        self.flush()?;
        for _ in 0..QUEUE {
            match self.wire.inbox.try_recv() {
                Ok(inbound) => self.handle(inbound)?,
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return Ok(false),
            }
        }
        Ok(true)
    }

    fn handle(&mut self, inbound: Inbound) -> Result<(), LinkError> {
        if inbound.exchange != self.exchange.number {
            self.open_exchange(inbound.exchange);
        }
        let (header, command) = match (self.personality.decode_command)(&inbound.packet) {
            Ok(decoded) => decoded,
            Err(error) => {
                self.counters.refuse(error.reason());
                let (apid, count) = packet::identify(&inbound.packet).unwrap_or((0, 0));
                self.see_refused(apid, count);
                return self.nack(apid, count, error.reason(), &error.to_string());
            }
        };
        let missing = self
            .exchange
            .gaps
            .missing(header.apid, header.sequence_count);
        self.counters.sequence_gaps = self.counters.sequence_gaps.wrapping_add(u32::from(missing));
        let done = match command {
            Command::Attitude(attitude) => self.latch(header, &attitude, &inbound),
            command => self.obey(header, command, inbound.arrived),
        };
        if let Err(Refusal { reason, detail }) = done {
            self.counters.refuse(reason);
            return self.nack(header.apid, header.sequence_count, reason, &detail);
        }
        match command {
            Command::Attitude(_) => {
                self.counters.attitudes = self.counters.attitudes.wrapping_add(1)
            }
            _ => self.counters.commands = self.counters.commands.wrapping_add(1),
        }
        match command {
            Command::Attitude(_) | Command::Credit { .. } => Ok(()),
            Command::Ping => {
                self.ack(&header)?;
                self.send(&Reply::Status(self.status()), self.now())
            }
            Command::Reset => {
                self.ack(&header)?;
                self.offer(Outbound::Release {
                    exchange: inbound.exchange,
                    asked: inbound.arrived,
                })
            }
            _ => self.ack(&header),
        }
    }

    /// A refused packet that states the expected count is not missing; what else a damaged header states is
    /// not believed.
    fn see_refused(&mut self, apid: u16, count: u16) {
        let mut gaps = self.exchange.gaps.clone();
        if gaps.missing(apid, count) == 0 {
            self.exchange.gaps = gaps;
        }
    }

    /// Another client: nothing of the last one's is left.
    fn open_exchange(&mut self, number: u32) {
        self.abandon_waiting();
        let unsent = self.exchange.answers.len() as u32;
        self.counters.lost_outbound = self.counters.lost_outbound.wrapping_add(unsent);
        self.exchange = Exchange {
            number,
            ..Exchange::default()
        };
        self.emulator.reset_camera();
        self.wall.clear(self.emulator.camera().rate_hz);
    }

    /// Counts the attitudes that will have no frame.
    pub(super) fn abandon_waiting(&mut self) {
        let waiting = self.exchange.waiting.drain(..).count() as u32;
        self.counters.frames_abandoned = self.counters.frames_abandoned.wrapping_add(waiting);
    }

    /// Latches a vehicle state.
    fn latch(
        &mut self,
        header: Header,
        attitude: &Attitude,
        inbound: &Inbound,
    ) -> Result<(), Refusal> {
        let epoch = to_epoch(header.time);
        if let Some(last) = &self.exchange.latest
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
        if self.clock == Clock::Stepped && self.exchange.waiting.len() >= MAX_WAITING {
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
        turn_at(vehicle.rates, camera.exposure_s).map_err(|error| Refusal {
            reason: Reason::ValueOutOfRange,
            detail: format!("attitude {}: {error}", attitude.sequence),
        })?;
        let exposure = Exposure::around(epoch, camera.exposure_s);
        if to_wire(exposure.start).is_none() || to_wire(exposure.end).is_none() {
            return Err(Refusal {
                reason: Reason::ValueOutOfRange,
                detail: format!(
                    "attitude {}: its exposure reaches beyond the time code, 1958 to 2094",
                    attitude.sequence
                ),
            });
        }
        let latched = Latched {
            vehicle,
            camera,
            header,
            arrived: inbound.arrived,
        };
        match self.clock {
            Clock::Stepped => self.exchange.waiting.push_back(latched.clone()),
            Clock::Wall => self.wall.set(epoch, inbound.arrived),
        }
        self.exchange.latest = Some(latched);
        self.exchange.repeat = 0;
        Ok(())
    }

    fn obey(&mut self, header: Header, command: Command, arrived: Instant) -> Result<(), Refusal> {
        match command {
            Command::Exposure { seconds } => {
                within("Exposure.seconds", seconds, EXPOSURE_S)?;
                let (_, rate_hz) = self.timing();
                self.do_not_overlap(
                    "Exposure.seconds",
                    seconds,
                    1.0 / rate_hz,
                    "lower FrameRate",
                )?;
                self.must_rest("Exposure")?;
                if let (Clock::Wall, Some(latest)) = (self.clock, &self.exchange.latest) {
                    turn_at(latest.vehicle.rates, seconds).map_err(|error| Refusal {
                        reason: Reason::ValueOutOfRange,
                        detail: format!("Exposure.seconds = {seconds}: {error}"),
                    })?;
                }
                self.emulator.camera_mut().exposure_s = seconds;
            }
            Command::Gain { e_per_dn } => {
                within("Gain.e_per_dn", e_per_dn, GAIN_E_PER_DN)?;
                self.emulator.camera_mut().detector.gain_e_per_dn = e_per_dn;
            }
            Command::FrameRate { hz } => {
                self.on_the_wall_only("FrameRate", "each attitude gives its frame")?;
                within("FrameRate.hz", hz, RATE_HZ)?;
                let (exposure_s, _) = self.timing();
                self.do_not_overlap("FrameRate.hz", hz, 1.0 / exposure_s, "shorten Exposure")?;
                self.emulator.camera_mut().rate_hz = hz;
                self.wall.set_rate(hz, arrived);
            }
            Command::SingleShot => {
                self.on_the_wall_only("SingleShot", "send an Attitude for each frame")?;
                if self.exchange.latest.is_none() {
                    return Err(Refusal {
                        reason: Reason::Busy,
                        detail: "SingleShot: no attitude yet; send one first".to_string(),
                    });
                }
                self.must_rest("SingleShot")?;
                let exposure_s = self.emulator.camera().exposure_s;
                self.wall.single_shot(exposure_s, arrived);
            }
            Command::Reset => {
                self.abandon_waiting();
                self.emulator.reset_camera();
                self.wall.clear(self.emulator.camera().rate_hz);
                self.exchange = Exchange {
                    number: self.exchange.number,
                    resets: self.exchange.resets.wrapping_add(1),
                    answers: std::mem::take(&mut self.exchange.answers),
                    overrun: self.exchange.overrun,
                    ..Exchange::default()
                };
                self.exchange
                    .gaps
                    .missing(header.apid, header.sequence_count);
            }
            Command::Credit { packets } => {
                let sent = self.exchange.credit.sent();
                if !self.exchange.credit.grant(packets) {
                    return Err(Refusal {
                        reason: Reason::ValueOutOfRange,
                        detail: format!(
                            "Credit.packets = {packets}: the first lies behind the {sent} packets sent, or 2^31 ahead"
                        ),
                    });
                }
            }
            Command::Ping | Command::Attitude(_) => {}
        }
        Ok(())
    }

    /// Refuses `command` while a single shot is exposed.
    fn must_rest(&self, command: &str) -> Result<(), Refusal> {
        if !self.wall.single_shot_is_open() {
            return Ok(());
        }
        Err(Refusal {
            reason: Reason::Busy,
            detail: format!("{command}: a single shot is being exposed; wait for its frame"),
        })
    }

    /// Exposure time (s) and rate (Hz) in force.
    fn timing(&self) -> (f64, f64) {
        let camera = self.emulator.camera();
        (camera.exposure_s, camera.rate_hz)
    }

    /// By the wall clock, one exposure ends before the next begins.
    fn do_not_overlap(
        &self,
        field: &str,
        value: f64,
        most: f64,
        remedy: &str,
    ) -> Result<(), Refusal> {
        if self.clock == Clock::Stepped || value <= most {
            return Ok(());
        }
        Err(Refusal {
            reason: Reason::ValueOutOfRange,
            detail: format!(
                "{field} = {value}: exposures would overlap; at most {most}, or {remedy} first"
            ),
        })
    }

    fn on_the_wall_only(&self, command: &str, instead: &str) -> Result<(), Refusal> {
        if self.clock == Clock::Wall {
            return Ok(());
        }
        Err(Refusal {
            reason: Reason::NotSupported,
            detail: format!("{command} has no meaning on the stepped clock: {instead}"),
        })
    }

    /// Refuses an attitude that gives no scene: an epoch beyond the ephemerides, a turn too far.
    pub(super) fn refuse_exposure(&mut self, header: &Header, detail: &str) {
        self.counters.refuse(Reason::ValueOutOfRange);
        if let Err(error) = self.nack(
            header.apid,
            header.sequence_count,
            Reason::ValueOutOfRange,
            detail,
        ) {
            tracing::error!(%error, "could not refuse an attitude");
        }
    }
}

fn within(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Refusal> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Refusal {
        reason: Reason::ValueOutOfRange,
        detail: format!(
            "{field} = {value}: must be {} to {}",
            range.start(),
            range.end()
        ),
    })
}
