//! Commands change the camera's settings and the exchange, or are refused.

use super::budget;
use super::clock::Asked;
use super::receive::Refusal;
use super::{Server, add};
use skyloop_config::Clock as Kind;
use skyloop_firmware_sim::time::to_epoch;
use skyloop_link::FAULT_REFUSED;
use skyloop_protocols::{Command, Header, Output, WireTime, Withheld};
use skyloop_render::camera::{EXPOSURE_S, GAIN_E_PER_DN, RATE_HZ};
use skyloop_render::scene::turn_at;
use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::time::Instant;

impl Server {
    /// Does what a command says.
    pub(super) fn obey(
        &mut self,
        at: usize,
        header: Header,
        command: Command,
        arrived: Instant,
    ) -> Result<(), Refusal> {
        match command {
            Command::Exposure { seconds } => {
                within("Exposure.seconds", seconds, EXPOSURE_S)?;
                let camera = self.settings.camera.clone();
                // What reading the frame out takes of its period is not for the exposure.
                let most = 1.0 / camera.rate_hz - (camera.period_s(seconds) - seconds);
                self.do_not_overlap("Exposure.seconds", seconds, most, "lower FrameRate")?;
                self.must_rest("Exposure")?;
                if let Some(latest) = self.truth.history.latest()
                    && self.kind != Kind::Stepped
                {
                    let open_s = seconds + camera.readout_s();
                    turn_at(latest.vehicle.rates, open_s).map_err(|error| {
                        Refusal::value(format!("Exposure.seconds = {seconds}: {error}"))
                    })?;
                }
                self.settings.change().exposure_s = seconds;
            }
            Command::Gain { e_per_dn } => {
                within("Gain.e_per_dn", e_per_dn, GAIN_E_PER_DN)?;
                self.settings.change().detector.gain_e_per_dn = e_per_dn;
            }
            Command::FrameRate { hz } => {
                self.by_cadence_only("FrameRate")?;
                within("FrameRate.hz", hz, RATE_HZ)?;
                let camera = self.settings.camera.clone();
                let most = 1.0 / camera.period_s(camera.exposure_s);
                self.do_not_overlap("FrameRate.hz", hz, most, "shorten Exposure")?;
                self.may_hold_back(hz)
                    .map_err(|why| Refusal::value(format!("FrameRate: {why}, or ask for fewer")))?;
                for at in 0..self.channels.len() {
                    let output = self.channels[at].exchange.output;
                    self.must_fit(at, &output, hz, "FrameRate")?;
                }
                self.may_be_in_time(hz)?;
                self.settings.change().rate_hz = hz;
                if let Some(cadence) = self.clock.cadence() {
                    cadence.set_rate(hz, arrived);
                }
            }
            Command::SingleShot => {
                self.by_cadence_only("SingleShot")?;
                if self.truth.history.latest().is_none() {
                    return Err(Refusal::busy("SingleShot: no attitude yet; send one first"));
                }
                if self.clock.is_paused() {
                    return Err(Refusal::busy(
                        "SingleShot: exposures are paused; send Resume first",
                    ));
                }
                self.must_rest("SingleShot")?;
                let exposure_s = self.settings.camera.exposure_s;
                if let Some(cadence) = self.clock.cadence() {
                    cadence.single_shot(exposure_s, arrived);
                }
            }
            Command::Pause => {
                // Who pauses all cameras knows nothing of a further one's single shot: that is given up.
                if !self.is_led {
                    self.must_rest("Pause")?;
                }
                if !self.clock.is_paused() {
                    self.clock.pause(arrived);
                }
            }
            Command::Resume => {
                if self.clock.is_paused() {
                    self.clock.resume(arrived);
                }
            }
            Command::Reset => {
                if self.channels[at].roles.truth {
                    self.clear_truth(true, arrived);
                }
                let channel = &mut self.channels[at];
                channel.reset(self.output, arrived);
                let gaps = &mut channel.exchange.gaps;
                gaps.missing(header.apid, header.sequence_count);
                self.cancel_unwanted();
            }
            Command::Credit { packets } => {
                let credit = &mut self.channels[at].exchange.credit;
                let sent = credit.sent();
                let before = credit.granted();
                if !credit.grant(packets) {
                    return Err(Refusal::value(format!(
                        "Credit.packets = {packets}: it lies behind the {sent} packets sent, or 2^31 or more ahead; grant `received + window`"
                    )));
                }
                let step = credit.granted().wrapping_sub(before);
                let exchange = &mut self.channels[at].exchange;
                match exchange.window {
                    Some(_) => exchange.step = exchange.step.max(step),
                    None => exchange.window = Some(packets.wrapping_sub(sent)),
                }
            }
            Command::Output(output) => {
                let detector = &self.settings.camera.detector;
                let most = detector.width.min(detector.height);
                if usize::from(output.window_size) > most {
                    return Err(Refusal::value(format!(
                        "Output.window_size = {}: the frame has {most} pixels across; ask for no more",
                        output.window_size
                    )));
                }
                self.must_fit(at, &output, self.settings.camera.rate_hz, "Output")?;
                self.channels[at].exchange.output = output;
            }
            Command::Positions(positions) => {
                let detector = &self.settings.camera.detector;
                let outside = positions.centres().iter().find(|[column, row]| {
                    usize::from(*column) >= detector.width || usize::from(*row) >= detector.height
                });
                if let Some([column, row]) = outside {
                    return Err(Refusal::value(format!(
                        "Positions: ({column}, {row}) is outside the frame of {} x {} pixels; give centres inside it",
                        detector.width, detector.height
                    )));
                }
                let listed = (!positions.centres().is_empty()).then_some(positions);
                let before = std::mem::replace(&mut self.channels[at].exchange.positions, listed);
                let output = self.channels[at].exchange.output;
                let rate_hz = self.settings.camera.rate_hz;
                self.must_fit(at, &output, rate_hz, "Positions")
                    .inspect_err(|_| self.channels[at].exchange.positions = before)?;
            }
            Command::Resend {
                frame,
                first,
                count,
            } => {
                if self.channels[at].wire.tally.awaits_proof() {
                    return Err(Refusal::busy(
                        "Resend: this address is not proved; return the Challenge first",
                    ));
                }
                let sent = self.resend(at, frame, first, count);
                // A link that has gone is noticed at its next packet.
                let Some(sent) = sent.unwrap_or(Some(0)) else {
                    return Err(Refusal::value(format!(
                        "Resend.frame = {frame}: only the packets of the last two frames are kept"
                    )));
                };
                // One that paces shows by its Credit what it has received.
                if sent > 0 && self.channels[at].exchange.window.is_none() {
                    let detail = format!(
                        "{sent} packets of frame {frame} are requested again, and the client sends no Credit"
                    );
                    self.report(at, Withheld::Lost, &detail);
                }
            }
            Command::Trigger { number, start } => {
                let start = to_epoch(start);
                if header.time != WireTime::default() {
                    self.hear(to_epoch(header.time), arrived);
                }
                self.clock.triggered(Asked {
                    number,
                    start,
                    camera: self.settings.camera.clone(),
                    arrived,
                })?;
                add(&mut self.counters.triggers, 1);
                self.channels[at].exchange.triggered = true;
            }
            // The link has done it as the packet passed.
            Command::Fault(fault) => {
                let refused =
                    |why: Cow<'_, str>| Refusal::not_supported(format!("{FAULT_REFUSED}{why}"));
                let outbox = &self.channels[at].wire.outbox;
                outbox.injects(fault.kind).map_err(refused)?;
            }
            Command::Ping | Command::Attitude(_) => {}
        }
        Ok(())
    }

    /// By the wall clock, a frame must leave before the next comes: refuses what a link cannot carry.
    fn must_fit(
        &self,
        at: usize,
        output: &Output,
        rate_hz: f64,
        command: &str,
    ) -> Result<(), Refusal> {
        if self.kind == Kind::Stepped {
            return Ok(());
        }
        let channel = &self.channels[at];
        let camera = self.settings.camera.clone();
        let listed = channel.exchange.positions.as_ref();
        let output = &Output {
            windows: listed.map_or(output.windows, |listed| listed.centres().len() as u8),
            ..*output
        };
        let fits = budget::fits(&channel.wire, channel.roles, &camera, output, rate_hz);
        fits.map_err(|why| Refusal::value(format!("{command}: {why}")))
    }

    /// Refuses a rate at which the device holds all frames back beyond their deadlines, where such frames are left out.
    fn may_be_in_time(&mut self, hz: f64) -> Result<(), Refusal> {
        let latency = self.clock.cadence().map(|cadence| cadence.latency_at(hz));
        let why = latency.and_then(|latency| self.never_in_time(latency.as_secs_f64()));
        match why.filter(|_| self.overrun.leaves_out()) {
            None => Ok(()),
            Some(why) => Err(Refusal::value(format!(
                "FrameRate.hz = {hz}: {why}; set run.latency_s, or ask for less"
            ))),
        }
    }

    /// Refuses `command` while a single shot is exposed.
    fn must_rest(&mut self, command: &str) -> Result<(), Refusal> {
        let cadence = self.clock.cadence();
        if cadence.is_none_or(|cadence| !cadence.single_shot_is_open()) {
            return Ok(());
        }
        Err(Refusal::busy(format!(
            "{command}: a single shot is being exposed; wait for its frame"
        )))
    }

    /// At a cadence, one exposure ends before the next begins.
    fn do_not_overlap(
        &mut self,
        field: &str,
        value: f64,
        most: f64,
        remedy: &str,
    ) -> Result<(), Refusal> {
        if self.clock.cadence().is_none() || value <= most {
            return Ok(());
        }
        Err(Refusal::value(format!(
            "{field} = {value}: exposures would overlap; at most {most}, or {remedy} first"
        )))
    }

    /// Refuses `command` where frames do not come at the camera's cadence.
    fn by_cadence_only(&mut self, command: &str) -> Result<(), Refusal> {
        if self.clock.cadence().is_some() {
            return Ok(());
        }
        let asks = self.clock.asks();
        Err(Refusal::not_supported(format!(
            "{command} has no meaning where each {asks} gives its frame: send one when a frame is wanted"
        )))
    }
}

fn within(field: &str, value: f64, range: RangeInclusive<f64>) -> Result<(), Refusal> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(Refusal::value(format!(
        "{field} = {value}: must be {} to {}",
        range.start(),
        range.end()
    )))
}
