//! Commands change the camera's settings and the exchange, or are refused.

use super::receive::Refusal;
use super::{Exchange, Server};
use crate::camera::{EXPOSURE_S, GAIN_E_PER_DN, RATE_HZ};
use crate::config::Clock;
use crate::scene::turn_at;
use skyloop_protocols::{Command, Header, Reason};
use std::ops::RangeInclusive;
use std::time::Instant;

impl Server {
    /// Does what a command says.
    pub(super) fn obey(
        &mut self,
        header: Header,
        command: Command,
        arrived: Instant,
    ) -> Result<(), Refusal> {
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
                self.wall.clear(self.emulator.camera().rate_hz, arrived);
                self.exchange = Exchange {
                    number: self.exchange.number,
                    resets: self.exchange.resets.wrapping_add(1),
                    answers: std::mem::take(&mut self.exchange.answers),
                    overrun: self.exchange.overrun,
                    release: Some(arrived),
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
            Command::Output(_)
            | Command::Positions(_)
            | Command::Resend { .. }
            | Command::Fault(_) => {
                return Err(Refusal {
                    reason: Reason::NotSupported,
                    detail: "not yet".to_string(),
                });
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
