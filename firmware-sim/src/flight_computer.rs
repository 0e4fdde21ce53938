//! The run: attitudes out, frames in, each frame detected, scored and reported.
//!
//! A frame that does not come, comes damaged or is refused is counted, and the run goes on.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_orbit::time::utc_text;
use skyloop_protocols::{Command, apid};
use thiserror::Error;

use crate::detector::{DetectorSettings, detect};
use crate::event::{Event, Loss};
use crate::exchange::{Exchange, Incoming, TICK};
use crate::mission::{Mission, Pace};
use crate::port::{Port, PortError};
use crate::profile::ProfileError;
use crate::reassembly::AssemblyError;
use crate::received::ReceivedFrame;
use crate::report::{NackRecord, Report};
use crate::score::score;
use crate::time;

/// How long to listen before a grant is sent again: it may have been lost.
const GRANT_AGAIN: Duration = TICK;
/// How long to wait for the emulator's last Status.
const STATUS_TIMEOUT: Duration = Duration::from_secs(1);

/// Why a run cannot go on.
#[derive(Debug, Error)]
pub enum RunError {
    /// The link is gone.
    #[error(transparent)]
    Port(#[from] PortError),
    /// Nobody answered a Reset.
    #[error(
        "no answer within {} s: is an emulator (skyloop run) listening on this link, and at this baud rate? \
         One that another client has left without a Reset is free when that one has been silent for its idle_s (5 s)",
        waited.as_secs_f64()
    )]
    NoAnswer {
        /// How long it was waited for.
        waited: Duration,
    },
    /// The mission had begun; what came of it is in the report.
    #[error("{source}")]
    CutShort {
        /// The report until then.
        report: Box<Report>,
        /// What went wrong.
        source: Box<RunError>,
    },
    /// There is no attitude or no state for a frame.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// An epoch that the wire's time field does not hold.
    #[error("{} is outside the wire's time, 1958 to 2094: choose another epoch", utc_text(*epoch))]
    Time {
        /// The epoch.
        epoch: Epoch,
    },
    /// A setting out of its range.
    #[error("{what} is {value}; it must be finite and above 0")]
    Setting {
        /// The setting.
        what: &'static str,
        /// Its value.
        value: f64,
    },
}

/// The flight computer on one end of a link.
pub struct FlightComputer<P> {
    mission: Mission,
    detector: DetectorSettings,
    exchange: Exchange<P>,
    report: Report,
    /// When the latest attitudes left.
    sent: VecDeque<(u32, Instant)>,
}

impl<P: Port> FlightComputer<P> {
    /// A flight computer that has not said anything yet.
    #[must_use]
    pub fn new(port: P, mission: Mission) -> Self {
        Self {
            report: Report {
                requested: mission.frames,
                ..Report::default()
            },
            mission,
            detector: DetectorSettings::default(),
            exchange: Exchange::new(port),
            sent: VecDeque::new(),
        }
    }

    /// Opens the exchange by a Reset and flies the mission. `watch` sees all that happens and may break the run off.
    ///
    /// # Errors
    /// [`RunError`]: settings out of range, no attitude or state for a frame, no answer, or a link that is gone.
    /// [`RunError::CutShort`] once the emulator had answered. Lost and refused frames are no errors; the report
    /// counts them.
    pub fn run(
        mut self,
        mut watch: impl FnMut(Event<'_>) -> ControlFlow<()>,
    ) -> Result<Report, RunError> {
        self.check()?;
        let waited = self.mission.timeout;
        match self.exchange.open(waited, || watch(Event::Tick))? {
            ControlFlow::Break(()) => return Ok(self.report),
            ControlFlow::Continue(false) => return Err(RunError::NoAnswer { waited }),
            ControlFlow::Continue(true) => {}
        }
        // A run that is broken off has a report like any other, and an emulator may leave when the frames are in.
        let flown = match self.mission.pace {
            Pace::Stepped { most_hz } => self.run_stepped(most_hz, &mut watch),
            Pace::Wall { rate_hz } => self.run_wall(rate_hz, &mut watch),
        };
        let _ = self.ask_status();
        // Frees the emulator: the next client need not wait until this one counts as silent.
        let _ = self.exchange.command(&Command::Reset);
        self.exchange.account(&mut self.report);
        match flown {
            Ok(_) => Ok(self.report),
            Err(source) => Err(RunError::CutShort {
                report: Box::new(self.report),
                source: Box::new(source),
            }),
        }
    }

    /// What can be known before anything is sent: settings, and the attitude at both ends of a stepped run.
    fn check(&self) -> Result<(), RunError> {
        let positive = |what, value: f64| {
            if value.is_finite() && value > 0.0 {
                Ok(())
            } else {
                Err(RunError::Setting { what, value })
            }
        };
        match self.mission.pace {
            Pace::Stepped { most_hz } => {
                positive("the period", self.mission.period_s)?;
                positive("the rate", most_hz.unwrap_or(1.0))?;
                self.mission.attitude(0, self.mission.epoch(0))?;
                let last = self.mission.frames.saturating_sub(1);
                self.mission.attitude(last, self.mission.epoch(last))?;
            }
            Pace::Wall { rate_hz } => {
                positive("the rate", rate_hz)?;
                self.mission.attitude(0, self.mission.start)?;
            }
        }
        Ok(())
    }

    /// Sends the attitude at an epoch; gives its packet's sequence count.
    fn send_attitude(&mut self, sequence: u32, epoch: Epoch) -> Result<u16, RunError> {
        /// Attitudes whose frames may still be under way.
        const REMEMBERED: usize = 1024;
        let attitude = self.mission.attitude(sequence, epoch)?;
        let time = time::to_wire(epoch).ok_or(RunError::Time { epoch })?;
        if self.sent.len() >= REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back((sequence, Instant::now()));
        Ok(self.exchange.send(&Command::Attitude(attitude), time)?)
    }

    fn run_stepped(
        &mut self,
        most_hz: Option<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let begin = Instant::now();
        for sequence in 0..self.mission.frames {
            if let Some(hz) = most_hz
                && pause(begin, f64::from(sequence) / hz, watch).is_break()
            {
                return Ok(ControlFlow::Break(()));
            }
            let count = self.send_attitude(sequence, self.mission.epoch(sequence))?;
            if self.await_frame(sequence, count, watch)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Listens until the frame of one attitude is whole, refused or lost.
    fn await_frame(
        &mut self,
        sequence: u32,
        count: u16,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let deadline = Instant::now() + self.mission.timeout;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return self.time_out(sequence, watch);
            }
            if watch(Event::Tick).is_break() {
                return Ok(ControlFlow::Break(()));
            }
            match self.exchange.receive(left.min(GRANT_AGAIN))? {
                None => self.exchange.grant()?,
                Some(Incoming::Frame(frame)) if frame.header.attitude_sequence == sequence => {
                    return Ok(self.take(&frame, watch));
                }
                Some(Incoming::Nack(nack))
                    if (nack.apid, nack.sequence_count) == (apid::ATTITUDE, count) =>
                {
                    self.report.refused += 1;
                    return Ok(self.note_nack(nack, watch));
                }
                Some(Incoming::Useless(error @ AssemblyError::BadPixels { .. })) => {
                    return Ok(self.lose(sequence, Loss::Damaged(error), watch));
                }
                Some(other) => {
                    if self.note(other, watch).is_break() {
                        return Ok(ControlFlow::Break(()));
                    }
                }
            }
        }
    }

    fn run_wall(
        &mut self,
        rate_hz: f64,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let begin = Instant::now();
        let (mut sequence, mut last_sign, mut last_grant) = (0u32, begin, begin);
        let mut last_frame: Option<u32> = None;
        let mut flow = ControlFlow::Continue(());
        while flow.is_continue()
            && watch(Event::Tick).is_continue()
            && self.report.frames.saturating_add(self.report.lost) < self.mission.frames
        {
            let due =
                Duration::try_from_secs_f64(f64::from(sequence) / rate_hz).unwrap_or(Duration::MAX);
            if begin.elapsed() >= due {
                let elapsed_s = begin.elapsed().as_secs_f64();
                let epoch = self.mission.start + hifitime::Duration::from_seconds(elapsed_s);
                self.send_attitude(sequence, epoch)?;
                // After a pause the attitudes missed in it are passed over, not sent in a burst.
                let period = (elapsed_s * rate_hz) as u32;
                sequence = sequence.max(period).saturating_add(1);
                continue;
            }
            if last_sign.elapsed() >= self.mission.timeout {
                last_sign = Instant::now();
                flow = self.time_out(self.last_sent(), watch)?;
                continue;
            }
            if last_grant.elapsed() >= GRANT_AGAIN {
                last_grant = Instant::now();
                self.exchange.grant()?;
            }
            let wait = due
                .saturating_sub(begin.elapsed())
                .min(GRANT_AGAIN)
                .max(Duration::from_micros(100));
            flow = match self.exchange.receive(wait)? {
                None => ControlFlow::Continue(()),
                Some(Incoming::Frame(frame)) => {
                    last_sign = Instant::now();
                    let number = frame.header.frame;
                    self.pass_over(last_frame.replace(number), number, watch);
                    self.take(&frame, watch)
                }
                Some(Incoming::Useless(error @ AssemblyError::BadPixels { .. })) => {
                    self.lose(self.last_sent(), Loss::Damaged(error), watch)
                }
                Some(other) => self.note(other, watch),
            };
        }
        Ok(flow)
    }

    /// Counts the frames whose numbers are missing between two.
    fn pass_over(&mut self, last: Option<u32>, number: u32, watch: &mut Watch<'_>) {
        /// A larger step is another emulator's count.
        const MOST: u32 = 1000;
        let skipped = last.map_or(0, |last| number.wrapping_sub(last).wrapping_sub(1));
        for _ in 0..if skipped < MOST { skipped } else { 0 } {
            // The frame that told is taken all the same.
            let _ = self.lose(self.last_sent(), Loss::Skipped, watch);
        }
    }

    /// Number of the latest attitude.
    fn last_sent(&self) -> u32 {
        self.sent.back().map_or(0, |(sequence, _)| *sequence)
    }

    /// Detects, then opens the labels and scores.
    fn take(&mut self, frame: &ReceivedFrame, watch: &mut Watch<'_>) -> ControlFlow<()> {
        let detections = detect(&frame.image(), &self.detector);
        let scored = score(frame, &detections);
        let sequence = frame.header.attitude_sequence;
        let sent = self
            .sent
            .iter()
            .rev()
            .find(|(number, _)| *number == sequence);
        let latency = sent.map(|(_, at)| frame.last_block.saturating_duration_since(*at));
        self.report.frames += 1;
        if let Some(latency) = latency {
            self.report.latencies.add(latency);
        }
        match &scored {
            Ok(score) => self.report.totals.add(score),
            Err(error) => {
                self.report.totals.unscored += 1;
                watch(Event::Problem(error.to_string()))?;
            }
        }
        watch(Event::Frame {
            frame,
            detections: &detections,
            labels: frame.labels(&detections).ok(),
            score: scored.as_ref().ok(),
            latency,
        })
    }

    fn time_out(
        &mut self,
        sequence: u32,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        let progress = self.exchange.give_up()?.pop();
        Ok(self.lose(sequence, Loss::TimedOut(progress), watch))
    }

    fn lose(&mut self, sequence: u32, loss: Loss, watch: &mut Watch<'_>) -> ControlFlow<()> {
        self.report.lost += 1;
        watch(Event::Lost { sequence, loss })
    }

    fn note_nack(&mut self, nack: NackRecord, watch: &mut Watch<'_>) -> ControlFlow<()> {
        let flow = watch(Event::Nack(&nack));
        self.report.nack(nack);
        flow
    }

    /// Books what is neither awaited nor decides anything.
    fn note(&mut self, incoming: Incoming, watch: &mut Watch<'_>) -> ControlFlow<()> {
        match incoming {
            Incoming::Nack(nack) => return self.note_nack(nack, watch),
            Incoming::Useless(error) => return watch(Event::Problem(error.to_string())),
            Incoming::Status(status) => self.report.status = Some(*status),
            Incoming::Frame(_) => self.report.late += 1,
            Incoming::Ack(_) | Incoming::Other => {}
        }
        ControlFlow::Continue(())
    }

    /// Asks for the emulator's account at the end. An emulator that has gone already gives none.
    fn ask_status(&mut self) -> Result<(), PortError> {
        let ping = self.exchange.command(&Command::Ping)?;
        let deadline = Instant::now() + STATUS_TIMEOUT;
        let mut answered = false;
        loop {
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            match self.exchange.receive(left)? {
                // The Status before this Ack answers an earlier Ping.
                Some(Incoming::Ack(ack)) => {
                    answered |= (ack.apid, ack.sequence_count) == (apid::COMMAND, ping)
                }
                Some(Incoming::Status(status)) => {
                    self.report.status = Some(*status);
                    if answered {
                        return Ok(());
                    }
                }
                Some(Incoming::Nack(nack)) => self.report.nack(nack),
                _ => {}
            }
        }
    }
}

/// Sleeps until `due_s` seconds after `begin`.
fn pause(begin: Instant, due_s: f64, watch: &mut Watch<'_>) -> ControlFlow<()> {
    let due = Duration::try_from_secs_f64(due_s).unwrap_or(Duration::MAX);
    loop {
        let left = due.saturating_sub(begin.elapsed());
        if left.is_zero() {
            return ControlFlow::Continue(());
        }
        watch(Event::Tick)?;
        std::thread::sleep(left.min(TICK));
    }
}

/// The caller's eyes.
type Watch<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + 'a;
