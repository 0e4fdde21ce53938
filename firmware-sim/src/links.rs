//! All links of a run, with their roles and exchanges, used as one.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use skyloop_protocols::{Command, Fault, LabelLevel, Output, PixelLevel, Positions, WireTime};

use crate::cause::{Cause, Named};
use crate::exchange::{Answer, Exchange, Incoming};
use crate::join::Joiner;
use crate::port::{Port, PortError};
use crate::reassembly::Progress;
use crate::received::ReceivedFrame;
use crate::report::Report;
use crate::roles::Roles;

/// Wait per link when there are several.
const SLICE: Duration = Duration::from_millis(1);

pub(crate) struct Links {
    ends: Vec<End>,
    joiner: Joiner,
    output: Option<Output>,
    /// Index of the next link to poll.
    turn: usize,
    /// Index of the link of the last request.
    last_request: usize,
}

struct End {
    exchange: Exchange,
    roles: Roles,
    /// Parts of frames on this link: the roles, without parts that the output excludes.
    brings: Roles,
}

impl End {
    fn named(&self) -> Named {
        Named {
            name: self.exchange.port.name().into(),
            roles: self.roles,
        }
    }
}

impl Links {
    /// Links with their roles; `output` is the requested content, if any.
    pub(crate) fn new(ports: Vec<(Box<dyn Port + Send>, Roles)>, output: Option<Output>) -> Self {
        let requested = output.map_or(Roles::ALL, |o| Roles::brought(o.pixels, o.labels));
        let requested = Roles {
            truth: false,
            ..requested
        };
        let end = |(port, roles): (_, Roles)| End {
            exchange: Exchange::new(port),
            roles,
            brings: roles.and(requested),
        };
        let ends: Vec<End> = ports.into_iter().map(end).collect();
        Self {
            joiner: Joiner::new(ends.iter().map(|end| end.brings)),
            ends,
            output,
            turn: 0,
            last_request: 0,
        }
    }

    pub(crate) fn any(&self, has: impl Fn(&Roles) -> bool) -> bool {
        self.ends.iter().any(|end| has(&end.roles))
    }

    /// The link for attitudes: the first with the role truth.
    fn truth(&mut self) -> Result<&mut Exchange, PortError> {
        let mut ends = self.ends.iter_mut();
        let truth = ends.find(|end| end.roles.truth);
        truth.map(|end| &mut end.exchange).ok_or(PortError::Closed)
    }

    /// Opens an exchange on each link; stops at the first without a reply. Commands that end a
    /// fault in `faults` come first, because a fault left by an earlier client may block everything
    /// else.
    pub(crate) fn open(
        &mut self,
        faults: &[Fault],
        timeout: Duration,
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        let ending = faults.iter().filter(|fault| fault.value == 0.0);
        let ending: Vec<Command> = ending.map(|fault| Command::Fault(*fault)).collect();
        for (at, end) in self.ends.iter_mut().enumerate() {
            self.last_request = at;
            let answer = end.exchange.open(&ending, timeout, &mut tick)?;
            if matches!(answer, Answer::Silence | Answer::Stopped) {
                return Ok(answer);
            }
        }
        Ok(Answer::Done)
    }

    /// Sends the output to each link with pixels or labels; stops at the first refusal.
    pub(crate) fn set(
        &mut self,
        output: Option<Output>,
        positions: Option<Positions>,
        timeout: Duration,
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        let ends = self.ends.iter_mut().enumerate();
        for (at, end) in ends.filter(|(_, end)| end.roles.bring_frames()) {
            self.last_request = at;
            let output = output.map(|mut output| {
                if !end.roles.pixels {
                    output.pixels = PixelLevel::None;
                }
                if !end.roles.labels {
                    output.labels = LabelLevel::None;
                }
                Command::Output(output)
            });
            let positions = positions.map(Command::Positions);
            for command in output.into_iter().chain(positions) {
                match end.exchange.request(&command, timeout, &mut tick)? {
                    Answer::Done => {}
                    other => return Ok(other),
                }
            }
        }
        Ok(Answer::Done)
    }

    /// Starts a fault on each link; stops at the first refusal.
    pub(crate) fn start_fault(
        &mut self,
        fault: Fault,
        timeout: Duration,
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        /// Wait for a fault that blocks the link: its reply may be blocked too, and a repeated
        /// command would restart it. A refusal comes sooner.
        const ONCE: Duration = Duration::from_millis(300);
        let command = Command::Fault(fault);
        let blocks = fault.kind.is_switch() && fault.value > 0.0;
        for (at, end) in self.ends.iter_mut().enumerate() {
            self.last_request = at;
            let exchange = &mut end.exchange;
            let answer = if blocks {
                exchange.request_after(&[], &command, &[ONCE], &mut tick)?
            } else {
                exchange.request(&command, timeout, &mut tick)?
            };
            match answer {
                Answer::Done => {}
                Answer::Silence if blocks => {}
                other => return Ok(other),
            }
        }
        Ok(Answer::Done)
    }

    pub(crate) fn recycle(&mut self, frame: ReceivedFrame) {
        // Only the pixels are large.
        if let Some(end) = self.ends.iter_mut().find(|end| end.brings.pixels) {
            end.exchange.assembler.recycle(frame);
        }
    }

    /// Sends a command with the current time on the truth link. Returns its sequence count.
    pub(crate) fn command(&mut self, command: &Command) -> Result<u16, PortError> {
        self.truth()?.command(command)
    }

    /// Sends a command on the truth link. Returns its sequence count.
    pub(crate) fn send(&mut self, command: &Command, time: WireTime) -> Result<u16, PortError> {
        self.truth()?.send(command, time)
    }

    /// Frees the emulator's side of all links. A lost link is free already.
    pub(crate) fn release(&mut self) {
        for end in &mut self.ends {
            let _ = end.exchange.command(&Command::Reset);
        }
    }

    /// Name of the link of the last request, and whether the system has reported a closed port
    /// there.
    pub(crate) fn unanswered(&self) -> (String, bool) {
        let requested = self.ends.get(self.last_request).map(|end| &end.exchange);
        requested.map_or_else(Default::default, |requested| {
            (requested.port.name().into(), requested.port.is_refused())
        })
    }

    pub(crate) fn names(&self) -> String {
        let names: Vec<&str> = self
            .ends
            .iter()
            .map(|end| end.exchange.port.name())
            .collect();
        names.join(", ")
    }

    pub(crate) fn gone(&self) -> Option<PortError> {
        self.ends.iter().find_map(|end| end.exchange.port.gone())
    }

    pub(crate) fn last_packet(&self) -> Option<Instant> {
        let packets = self.ends.iter().map(|end| end.exchange.last_packet);
        packets.max().flatten()
    }

    pub(crate) fn grant(&mut self) -> Result<(), PortError> {
        self.each(Exchange::grant)
    }

    pub(crate) fn query(&mut self) -> Result<(), PortError> {
        self.each(Exchange::query)
    }

    fn each(
        &mut self,
        act: impl Fn(&mut Exchange) -> Result<(), PortError>,
    ) -> Result<(), PortError> {
        let mut ends = self.ends.iter_mut();
        ends.try_for_each(|end| act(&mut end.exchange))
    }

    /// Waits for one packet on any link and processes it.
    pub(crate) fn receive(&mut self, timeout: Duration) -> Result<Option<Incoming>, PortError> {
        if let [end] = &mut self.ends[..] {
            let incoming = end.exchange.receive(timeout)?;
            return Ok(incoming.map(|incoming| self.process(0, incoming)));
        }
        let deadline = Instant::now() + timeout;
        let count = self.ends.len();
        loop {
            self.turn = (self.turn + 1) % count.max(1);
            let left = deadline.saturating_duration_since(Instant::now());
            // Poll all links, then wait briefly on one.
            let waits = std::iter::repeat_n(Duration::ZERO, count).chain([left.min(SLICE)]);
            for (step, wait) in waits.enumerate() {
                let at = (self.turn + step) % count.max(1);
                let Some(end) = self.ends.get_mut(at) else {
                    return Err(PortError::Closed);
                };
                if let Some(incoming) = end.exchange.receive(wait)? {
                    return Ok(Some(self.process(at, incoming)));
                }
            }
            if left.is_zero() {
                return Ok(None);
            }
        }
    }

    /// Joins parts of frames; drops replies of links without the role truth.
    fn process(&mut self, at: usize, incoming: Incoming) -> Incoming {
        let Some(end) = self.ends.get(at) else {
            return incoming;
        };
        match incoming {
            Incoming::Frame(frame) => {
                let number = frame.header.frame;
                match self.joiner.join(*frame, end.brings) {
                    Ok(Some(frame)) => {
                        for end in &mut self.ends {
                            end.exchange.assembler.forget(number);
                        }
                        Incoming::Frame(Box::new(frame))
                    }
                    Ok(None) => {
                        // Even the header of the other part may be missing.
                        for end in &mut self.ends {
                            if self.joiner.lacks(number, end.brings) {
                                end.exchange.assembler.expect_header(number);
                            }
                        }
                        Incoming::Other
                    }
                    Err(error) => Incoming::Unusable(error),
                }
            }
            // Replies and counters of the run are those of the truth link.
            Incoming::Ack(_) | Incoming::Status(_) if !end.roles.truth => Incoming::Other,
            other => other,
        }
    }

    /// Limits requests for missing packets to frames of this attitude; none: all frames.
    pub(crate) fn set_attitude(&mut self, attitude: Option<u32>) {
        for end in &mut self.ends {
            end.exchange.recovery.attitude = attitude;
        }
    }

    pub(crate) fn last_frame_packet(&self) -> Option<Instant> {
        let packets = self.ends.iter();
        let packets = packets.map(|end| end.exchange.recovery.last_packet());
        packets.max().flatten()
    }

    /// Mean time between frame packets on the slowest link.
    pub(crate) fn spacing(&self) -> Duration {
        let spacings = self.ends.iter().map(|end| end.exchange.recovery.spacing());
        spacings.max().unwrap_or_default()
    }

    pub(crate) fn has_begun(&self, attitude: u32) -> bool {
        let mut ends = self.ends.iter();
        self.joiner.has_begun(attitude)
            || ends.any(|end| end.exchange.assembler.has_begun(attitude))
    }

    /// Whether this frame has arrived in part.
    pub(crate) fn is_in_flight(&self, frame: u32) -> bool {
        let mut ends = self.ends.iter();
        self.joiner.has(frame) || ends.any(|end| end.exchange.assembler.is_in_flight(frame))
    }

    pub(crate) fn give_up(&mut self) -> Result<Vec<Progress>, PortError> {
        let mut progress = self.joiner.abandon();
        for end in &mut self.ends {
            progress.extend(end.exchange.give_up()?);
        }
        Ok(progress)
    }

    /// A mismatch of roles: a link brings a part expected on another, or one link brings nothing
    /// while others do.
    pub(crate) fn misplaced(&self) -> Option<Cause> {
        let mut missing = Roles::ALL;
        for end in &self.ends {
            missing = missing.without(end.exchange.announced.and(end.brings));
        }
        for on in &self.ends {
            let stray = on.exchange.announced.without(on.roles).and(missing);
            for off in &self.ends {
                let what = stray.and(off.brings);
                if what.bring_frames() {
                    let (on, off) = (on.named(), off.named());
                    return Some(Cause::Elsewhere { what, on, off });
                }
            }
        }
        let brought = |end: &End| end.exchange.announced != Roles::NONE;
        let mut ends = self.ends.iter();
        let silent = ends.find(|end| end.brings.and(missing).bring_frames() && !brought(end));
        let silent = silent.filter(|_| self.ends.iter().any(brought));
        silent.map(|end| Cause::Silent { link: end.named() })
    }

    /// The cause, if pixels were requested but no link has the role for them at both ends.
    pub(crate) fn without_pixels(&self, frames: u32) -> Option<Cause> {
        let what = match self.output?.pixels {
            PixelLevel::None => return None,
            PixelLevel::Windows => "windows",
            PixelLevel::Frame => "frames",
            PixelLevel::Compressed => "compressed frames",
        };
        let come = self.ends.iter().any(|end| end.exchange.announced.pixels);
        // Before the first frame only the roles at this end are known.
        let known = frames > 0 || !self.any(|roles| roles.pixels);
        (known && !come).then(|| Cause::NoPixels {
            what,
            links: self.ends.iter().map(End::named).collect(),
        })
    }

    /// The cause, if a line cannot carry its share of a frame in this time.
    pub(crate) fn slow(&self, timeout: Duration) -> Option<Cause> {
        let mut ends = self.ends.iter();
        ends.find_map(|end| end.exchange.slow(timeout))
    }

    pub(crate) fn add_counts(&self, report: &mut Report) {
        for end in &self.ends {
            end.exchange.add_counts(report);
        }
        report.recovery.duplicates += self.joiner.duplicates;
        report.assembly.incomplete += self.joiner.incomplete;
    }
}
