//! A run: sends attitudes, receives frames, detects, scores and reports.
//!
//! A frame that is lost, damaged or refused is counted, and the run goes on.

mod error;
mod opening;
mod pause;
mod stepped;
mod wall;

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_protocols::{Command, Fault, LabelLevel, apid};

pub use self::error::RunError;
pub use self::pause::Pause;
use crate::control::{Control, ControlSettings, Exposed};
use crate::detector::{Detections, DetectorSettings};
use crate::event::{Event, Loss};
use crate::exchange::{Answer, Incoming, TICK};
use crate::links::Links;
use crate::mission::{Mission, Pace};
use crate::port::{Port, PortError};
use crate::profile::Profile;
use crate::received::ReceivedFrame;
use crate::report::{NackRecord, Report};
use crate::roles::Roles;
use crate::score::score;
use crate::time;

/// Interval of repeated grants, because a grant may be lost.
const GRANT_AGAIN: Duration = TICK;
/// Hint for an emulator that does not answer.
const IDLE: &str = "A link that another client left without a Reset is free once that client has been silent for idle_s (5 s)";
/// The same for a run without a command that ends a fault.
const IDLE_OR_STUCK: &str = "A link that another client left without a Reset is free once that client has been silent for \
    idle_s (5 s); a fault that it left active ends with --fault stuck:in:0 (or down, out)";
const STATUS_TIMEOUT: Duration = Duration::from_secs(1);
/// Time-out of the final `Status` after a request to stop.
const SHORT_STATUS_TIMEOUT: Duration = Duration::from_millis(200);

/// The flight computer's end of one or more links.
pub struct FlightComputer {
    mission: Mission,
    faults: Vec<Fault>,
    pause: Option<Pause>,
    closed: Option<ControlSettings>,
    control: Option<Control>,
    /// None: frames are counted but not analysed.
    detector: Option<DetectorSettings>,
    links: Links,
    report: Report,
    /// Send times of the latest attitudes.
    sent: VecDeque<(u32, Instant)>,
    /// Stepped mode: the latest attitudes with received frames.
    taken: VecDeque<u32>,
    /// Stepped mode: mean time from an attitude to the first packet of its frame.
    usual_answer: Option<Duration>,
    /// Whether misplaced roles have been reported.
    warned: bool,
    /// Send time of the first attitude.
    begin: Instant,
    /// Wall-clock time of the mission's start; none: the first attitude's send time.
    zero: Option<Instant>,
    /// Consecutive attitudes without any received packet.
    silent_attitudes: u32,
}

impl FlightComputer {
    /// A flight computer with one link for all roles.
    #[must_use]
    pub fn new(port: Box<dyn Port + Send>, mission: Mission) -> Self {
        Self::on_links(vec![(port, Roles::ALL)], mission)
    }

    /// A flight computer with several links. Attitudes go out on the first link with the role
    /// truth; pixels and labels come on any.
    #[must_use]
    pub fn on_links(links: Vec<(Box<dyn Port + Send>, Roles)>, mission: Mission) -> Self {
        Self {
            links: Links::new(links, mission.output),
            report: Report {
                requested: mission.frames,
                ..Report::default()
            },
            mission,
            faults: Vec::new(),
            pause: None,
            closed: None,
            control: None,
            detector: Some(DetectorSettings::default()),
            sent: VecDeque::new(),
            taken: VecDeque::new(),
            usual_answer: None,
            warned: false,
            begin: Instant::now(),
            zero: None,
            silent_attitudes: 0,
        }
    }

    /// Requests these faults on each link before the first attitude.
    #[must_use]
    pub fn with_faults(self, faults: Vec<Fault>) -> Self {
        Self { faults, ..self }
    }

    /// Receives frames without analysing pixels or labels: for measurements of the emulator.
    #[must_use]
    pub fn without_detection(self) -> Self {
        Self {
            detector: None,
            ..self
        }
    }

    /// Requests a pause of the emulator. Wall-clock mode only.
    #[must_use]
    pub fn with_pause(self, pause: Option<Pause>) -> Self {
        Self { pause, ..self }
    }

    /// Sets the wall-clock time of the mission's start; none: the first attitude's send time.
    #[must_use]
    pub fn with_start_instant(self, zero: Option<Instant>) -> Self {
        Self { zero, ..self }
    }

    /// Closes the loop: holds the mission's attitude against a drift. Wall-clock mode only.
    #[must_use]
    pub fn with_control(self, closed: Option<ControlSettings>) -> Self {
        Self { closed, ..self }
    }

    /// Opens the exchange by a Reset and runs the mission. `watch` gets all events and may stop the
    /// run.
    ///
    /// # Errors
    /// [`RunError`]: settings out of range, no attitude or state for a frame, no reply, or a link
    /// that is gone. [`RunError::CutShort`] after the emulator's first reply. Lost and refused
    /// frames are counted in the report.
    pub fn run(
        mut self,
        mut watch: impl FnMut(Event<'_>) -> ControlFlow<()>,
    ) -> Result<Report, RunError> {
        self.check()?;
        self.control = self.closed_loop()?;
        let waited = self.mission.timeout;
        let tick = || watch(Event::Tick);
        match self.links.open(&self.faults, waited, tick)? {
            Answer::Done | Answer::Refused(_) => {}
            Answer::Silence => return Err(self.no_answer()),
            Answer::Stopped => return Ok(self.final_report()),
        }
        if self.set_output(&mut watch)?.is_break() || self.start_faults(&mut watch)?.is_break() {
            self.links.release();
            return Ok(self.final_report());
        }
        self.begin = Instant::now();
        // A stopped run has a report too, and an emulator may end after the last frame.
        let flown = match self.mission.pace {
            Pace::Stepped { most_hz } => self.run_stepped(most_hz, &mut watch),
            Pace::Wall { rate_hz } => self.run_wall(Some(rate_hz), &mut watch),
            Pace::Listen => self.run_wall(None, &mut watch),
        };
        let timeout = match flown {
            Ok(ControlFlow::Continue(())) => STATUS_TIMEOUT,
            _ => SHORT_STATUS_TIMEOUT,
        };
        if self.links.gone().is_none() {
            let _ = self.request_status(timeout);
        }
        // Frees the emulator for the next client, which otherwise waits for the idle time.
        self.links.release();
        self.links.add_counts(&mut self.report);
        match flown {
            Ok(_) => Ok(self.final_report()),
            Err(source) => Err(RunError::CutShort {
                report: Box::new(self.final_report()),
                source: Box::new(source),
            }),
        }
    }

    /// The final report, with the state of the links.
    fn final_report(self) -> Report {
        Report {
            control: self.control.map(|control| control.telemetry),
            gone: self.links.gone().map(|gone| gone.to_string()),
            warning: self
                .links
                .without_pixels(self.report.frames)
                .map(|cause| cause.to_string()),
            ..self.report
        }
    }

    fn no_answer(&self) -> RunError {
        if let Some(gone) = self.links.gone() {
            return gone.into();
        }
        let (link, refused) = self.links.unanswered();
        let ends_some = self.faults.iter().any(|fault| fault.value == 0.0);
        let hint = match (refused, ends_some) {
            (true, _) => "No process listens there",
            (false, true) => IDLE,
            (false, false) => IDLE_OR_STUCK,
        };
        RunError::NoAnswer {
            link,
            hint,
            waited: self.mission.timeout,
        }
    }

    /// Errors before anything is sent: settings, and the attitudes at both ends of a stepped run.
    fn check(&self) -> Result<(), RunError> {
        let listens = self.mission.pace == Pace::Listen;
        for (role, has) in [
            ("truth", listens || self.links.any(|roles| roles.truth)),
            ("pixels or labels", self.links.any(Roles::bring_frames)),
        ] {
            if !has {
                return Err(RunError::Role { role });
            }
        }
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
            Pace::Listen => {}
        }
        Ok(())
    }

    fn closed_loop(&self) -> Result<Option<Control>, RunError> {
        let Some(settings) = self.closed else {
            return Ok(None);
        };
        let remedy = match (self.mission.pace, &self.mission.profile) {
            (Pace::Stepped { .. } | Pace::Listen, _) => "give --wall",
            (_, Profile::Hold(hold)) => {
                positive("the focal length in pixels", settings.focal_px)?;
                return Ok(Some(Control::new(settings, *hold, self.mission.start)));
            }
            _ => "give it by --hold x,y,z,w",
        };
        Err(RunError::Loop { remedy })
    }

    /// Mission time at this number of seconds after the first attitude, by the wall clock.
    fn by_the_clock(&self, seconds: f64) -> Epoch {
        let zero = self.zero.unwrap_or(self.begin);
        let waited_s = self.begin.saturating_duration_since(zero).as_secs_f64();
        self.mission.start + hifitime::Duration::from_seconds(waited_s + seconds)
    }

    /// Sends the attitude at an epoch. Returns its packet's sequence count.
    fn send_attitude(&mut self, sequence: u32, epoch: Epoch) -> Result<u16, RunError> {
        /// Attitudes whose frames may still arrive.
        const REMEMBERED: usize = 1024;
        let attitude = match &mut self.control {
            Some(control) => {
                let pointing = control.steer(epoch);
                self.mission.message(sequence, epoch, &pointing)?
            }
            None => self.mission.attitude(sequence, epoch)?,
        };
        let time = time::to_wire(epoch).ok_or(RunError::Time { epoch })?;
        if self.sent.len() >= REMEMBERED {
            self.sent.pop_front();
        }
        self.sent.push_back((sequence, Instant::now()));
        Ok(self.links.send(&Command::Attitude(attitude), time)?)
    }

    fn last_sent(&self) -> u32 {
        self.sent.back().map_or(0, |(sequence, _)| *sequence)
    }

    /// Detects stars, then opens the labels and scores.
    fn take(&mut self, frame: &ReceivedFrame, watch: &mut Watch<'_>) -> ControlFlow<()> {
        let sequence = frame.header.attitude_sequence;
        let mut sent = self.sent.iter().rev();
        let sent = sent.find(|(number, _)| *number == sequence);
        let latency = sent.map(|(_, at)| frame.last_data_at.saturating_duration_since(*at));
        self.report.frames += 1;
        if !self.warned
            && let Some(cause) = self.links.misplaced()
        {
            self.warned = true;
            watch(Event::Problem(cause.to_string()))?;
        }
        self.report.timings.add(&frame.end.timing);
        latency
            .into_iter()
            .for_each(|latency| self.report.latencies.add(latency));
        let Some(detector) = &self.detector else {
            return watch(Event::Frame {
                frame,
                detections: &Detections::none(frame.header.frame),
                labels: None,
                score: None,
                latency,
            });
        };
        let detections = frame.detect(detector);
        let taken = self.by_the_clock(self.begin.elapsed().as_secs_f64());
        if let Some(control) = &mut self.control {
            let exposed = Exposed {
                mid: time::to_epoch(frame.mid_exposure),
                taken,
                size: [frame.header.width, frame.header.height],
            };
            control.take(&exposed, &detections);
        }
        let scored = score(frame, &detections);
        self.report.contents.add(frame, &detections);
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
            labels: match frame.header.label_level {
                LabelLevel::Text => frame.labels(&detections).ok(),
                LabelLevel::None | LabelLevel::Objects => None,
            },
            score: scored.as_ref().ok(),
            latency,
        })
    }

    fn time_out(
        &mut self,
        sequence: u32,
        watch: &mut Watch<'_>,
    ) -> Result<ControlFlow<()>, RunError> {
        self.check_silence()?;
        let progress = self.links.give_up()?.pop();
        let misplaced = self.links.misplaced();
        let cause = misplaced.or_else(|| self.links.slow(self.mission.timeout));
        Ok(self.lose(sequence, Loss::TimedOut { progress, cause }, watch))
    }

    /// Ends the run after many attitudes without any packet, although each was followed by a Ping.
    fn check_silence(&mut self) -> Result<(), RunError> {
        /// Consecutive attitudes, and minimum duration.
        const MAX: u32 = 5;
        const MIN: Duration = Duration::from_secs(10);
        let last = self.links.last_packet().max(Some(self.begin));
        let silent = last.map(|at| at.elapsed()).unwrap_or_default();
        if silent < self.mission.timeout {
            self.silent_attitudes = 0;
            return Ok(());
        }
        self.silent_attitudes += 1;
        // A fault of this run may stop the line for its duration.
        let faults = self.faults.iter().map(|fault| fault.seconds);
        let silent_s = silent.as_secs_f64();
        let min_s = MIN.as_secs_f64() + faults.fold(0.0, f64::max);
        if self.silent_attitudes < MAX || silent_s < min_s {
            return Ok(());
        }
        Err(match self.links.gone() {
            Some(gone) => gone.into(),
            None => RunError::Silent {
                links: self.links.names(),
                silent_s,
                attitudes: self.silent_attitudes,
            },
        })
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

    /// Records a packet that does not end the wait for a frame.
    fn note(&mut self, incoming: Incoming, watch: &mut Watch<'_>) -> ControlFlow<()> {
        match incoming {
            Incoming::Nack(nack) => return self.note_nack(nack, watch),
            Incoming::Unusable(error) => return watch(Event::Problem(error.to_string())),
            Incoming::Status(status) => self.report.status = Some(*status),
            Incoming::Frame(_) => self.report.late += 1,
            Incoming::Ack(_) | Incoming::Damaged(_) | Incoming::Other => {}
        }
        ControlFlow::Continue(())
    }

    /// Requests the emulator's final counters. An emulator that has ended gives none.
    fn request_status(&mut self, timeout: Duration) -> Result<(), PortError> {
        /// Request or reply may be lost.
        const TRIES: u32 = 4;
        let mut pings = Vec::new();
        let mut answered = false;
        for _ in 0..TRIES {
            pings.push(self.links.command(&Command::Ping)?);
            let deadline = Instant::now() + timeout / TRIES;
            loop {
                let left = deadline.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                match self.links.receive(left)? {
                    // A Status before this Ack belongs to an earlier Ping.
                    Some(Incoming::Ack(ack)) => {
                        answered |=
                            ack.apid == apid::COMMAND && pings.contains(&ack.sequence_count);
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
        Ok(())
    }
}

type Watch<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + 'a;

fn positive(what: &'static str, value: f64) -> Result<(), RunError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(RunError::Setting { what, value })
    }
}
