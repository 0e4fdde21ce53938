//! Packet exchange with the emulator: commands are numbered and sent; replies are decoded, counted
//! and reassembled; credit is granted as frame packets arrive.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{
    Ack, Command, FrameHeader, MAX_PACKET, Reason, Reply, Status, WireTime, apid,
};

use crate::cause::Cause;
use crate::pacing::Pacing;
use crate::port::{Port, PortError};
use crate::reassembly::{Assembler, AssemblyError, Limits, Progress, Run};
use crate::received::ReceivedFrame;
use crate::recovery::Recovery;
use crate::report::{NackRecord, Report};
use crate::roles::Roles;
use crate::time;

/// Longest single wait for a packet.
pub(crate) const TICK: Duration = Duration::from_millis(200);

pub(crate) enum Incoming {
    Frame(Box<ReceivedFrame>),
    Ack(Ack),
    Nack(NackRecord),
    /// The emulator received a damaged packet; it may be sent again.
    Damaged(NackRecord),
    Status(Box<Status>),
    /// A frame, or a packet of it, is unusable.
    Unusable(AssemblyError),
    /// Part of a frame, or an undecodable packet.
    Other,
}

pub(crate) enum Answer {
    Done,
    Refused(NackRecord),
    Silence,
    Stopped,
}

/// Waits after the copies of a command: command or reply may be lost. The last copy is sent late,
/// because the emulator may have released an earlier, silent client by then.
fn waits(timeout: Duration) -> [Duration; 5] {
    const SIXTEENTHS: [u32; 5] = [1, 2, 4, 5, 4];
    SIXTEENTHS.map(|share| timeout * share / 16)
}

pub(crate) struct Exchange {
    pub(crate) port: Box<dyn Port + Send>,
    counts: SequenceCounts,
    pacing: Pacing,
    pub(crate) assembler: Assembler,
    pub(crate) recovery: Recovery,
    undecodable: u64,
    /// Bytes of all packets received.
    bytes: u64,
    /// Arrival time of the last packet of any kind.
    pub(crate) last_packet: Option<Instant>,
    header: Option<FrameHeader>,
    /// Parts of frames announced by headers since the Reset.
    pub(crate) announced: Roles,
}

impl Exchange {
    pub(crate) fn new(port: Box<dyn Port + Send>) -> Self {
        Self {
            recovery: Recovery::new(port.window(), port.airtime(MAX_PACKET)),
            pacing: Pacing::new(port.window()),
            port,
            counts: SequenceCounts::new(),
            assembler: Assembler::new(Limits::default()),
            undecodable: 0,
            bytes: 0,
            last_packet: None,
            header: None,
            announced: Roles::NONE,
        }
    }

    /// Resets the emulator and opens a new exchange. Commands `before` precede each Reset; their
    /// replies are ignored. `tick` is called at least five times a second and may stop it.
    pub(crate) fn open(
        &mut self,
        before: &[Command],
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        let waits = waits(timeout);
        let answer = self.request_after(before, &Command::Reset, &waits, tick)?;
        // An emulator that refuses the Reset is present too.
        if matches!(answer, Answer::Done | Answer::Refused(_)) {
            self.pacing = Pacing::new(self.port.window());
            self.assembler = Assembler::new(Limits::default());
            (self.header, self.announced) = (None, Roles::NONE);
            self.grant()?;
        }
        Ok(answer)
    }

    /// Repeats a command until its reply, at most for `timeout`; `tick` as in [`Exchange::open`].
    pub(crate) fn request(
        &mut self,
        command: &Command,
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        self.request_after(&[], command, &waits(timeout), tick)
    }

    /// Sends `before` and the command once per entry of `waits`, and waits that long for the reply.
    pub(crate) fn request_after(
        &mut self,
        before: &[Command],
        command: &Command,
        waits: &[Duration],
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        /// Limit of immediate copies after damage in transit.
        const MAX_DAMAGED: usize = 16;
        let mut requested = Vec::new();
        let mut damaged = Vec::new();
        for wait in waits {
            for command in before {
                self.command(command)?;
            }
            requested.push((command.apid(), self.command(command)?));
            let deadline = Instant::now() + *wait;
            loop {
                let left = deadline.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                if tick().is_break() {
                    return Ok(Answer::Stopped);
                }
                let is_ours = |apid, count| requested.contains(&(apid, count));
                match self.receive(left.min(TICK))? {
                    Some(Incoming::Ack(ack)) if is_ours(ack.apid, ack.sequence_count) => {
                        return Ok(Answer::Done);
                    }
                    Some(Incoming::Nack(nack)) if is_ours(nack.apid, nack.sequence_count) => {
                        return Ok(Answer::Refused(nack));
                    }
                    Some(Incoming::Damaged(nack)) if is_ours(nack.apid, nack.sequence_count) => {
                        damaged.push(nack);
                        if damaged.len() < MAX_DAMAGED {
                            requested.push((command.apid(), self.command(command)?));
                        }
                    }
                    _ => {}
                }
            }
        }
        // If every copy was damaged, or the emulator has another packet layout, return its Nack.
        Ok(damaged.pop().map_or(Answer::Silence, Answer::Refused))
    }

    /// Sends a command with the current time. Returns its sequence count.
    pub(crate) fn command(&mut self, command: &Command) -> Result<u16, PortError> {
        let now = Epoch::now().ok().and_then(time::to_wire);
        self.send(command, now.unwrap_or_default())
    }

    /// Sends a command. Returns its sequence count.
    pub(crate) fn send(&mut self, command: &Command, time: WireTime) -> Result<u16, PortError> {
        let mut buffer = [0; MAX_PACKET];
        let count = self.counts.next(command.apid());
        let length = command.encode(count, time, &mut buffer)?;
        self.port.send(&buffer[..length])?;
        Ok(count)
    }

    /// Grants the window's credit. A repeated grant is harmless, and repairs a lost one.
    pub(crate) fn grant(&mut self) -> Result<(), PortError> {
        let packets = self.pacing.renew();
        self.command(&Command::Credit { packets }).map(drop)
    }

    /// Waits for one packet and processes it. Requests missing packets meanwhile.
    pub(crate) fn receive(&mut self, timeout: Duration) -> Result<Option<Incoming>, PortError> {
        let mut now = Instant::now();
        let deadline = now + timeout;
        loop {
            let left = deadline.saturating_duration_since(now);
            let wait = if self.assembler.is_idle() {
                left
            } else {
                self.request_missing(now)?;
                left.min(self.recovery.pause())
            };
            match self.port.recv(wait)? {
                Some(packet) => return self.process(&packet).map(Some),
                None if wait == left => return Ok(None),
                None => now = Instant::now(),
            }
        }
    }

    fn process(&mut self, packet: &[u8]) -> Result<Incoming, PortError> {
        self.bytes += packet.len() as u64;
        let now = Instant::now();
        self.last_packet = Some(now);
        let Ok((header, reply)) = Reply::decode(packet) else {
            self.undecodable += 1;
            return Ok(Incoming::Other);
        };
        if reply.takes_credit() {
            let flowing = !self.assembler.is_idle();
            self.recovery.arrived(now, flowing);
            if self.pacing.arrived(header.apid, header.sequence_count) {
                self.grant()?;
            }
        }
        if let Reply::FrameHeader(header) = reply {
            self.header = Some(header);
            let brought = Roles::brought(header.pixel_level, header.label_level);
            self.announced = self.announced.with(brought);
        }
        Ok(match reply {
            Reply::Ack(ack) => Incoming::Ack(ack),
            Reply::Nack(nack) => {
                let record = NackRecord {
                    apid: nack.apid,
                    sequence_count: nack.sequence_count,
                    reason: nack.reason,
                    detail: nack.detail.to_owned(),
                };
                // A request damaged in transit is repeated while packets are missing.
                if matches!(nack.reason, Reason::BadCrc | Reason::BadLength) {
                    self.recovery.damaged += 1;
                    return Ok(Incoming::Damaged(record));
                }
                if nack.apid == apid::COMMAND
                    && let Some(frame) = self.recovery.refusal(nack.sequence_count)
                {
                    // A busy emulator may have the packets later.
                    if nack.reason != Reason::Busy {
                        self.assembler.stop_requests(frame);
                    }
                    if nack.reason == Reason::NotSupported {
                        self.recovery.stop();
                    }
                    return Ok(Incoming::Other);
                }
                Incoming::Nack(record)
            }
            Reply::Status(status) => {
                self.recovery.status_received();
                if self.pacing.rebase(status.packets_sent) {
                    self.grant()?;
                }
                Incoming::Status(Box::new(status))
            }
            _ => match self.assembler.accept(packet, &header, &reply, now) {
                Ok(Some(frame)) => Incoming::Frame(Box::new(frame)),
                Ok(None) => Incoming::Other,
                Err(error) => Incoming::Unusable(error),
            },
        })
    }

    /// Requests missing packets when due. After silence the cause may be a lost grant, or a lost
    /// window.
    fn request_missing(&mut self, now: Instant) -> Result<(), PortError> {
        let Some(demand) = self.recovery.demand(now) else {
            return Ok(());
        };
        if self.recovery.poll_is_due() {
            // The Status follows the packets that the grant releases.
            self.grant()?;
            self.command(&Command::Ping)?;
        }
        for Run {
            frame,
            first,
            count,
        } in self.assembler.missing_runs(now, &demand)
        {
            let request = Command::Resend {
                frame,
                first,
                count,
            };
            let sequence_count = self.command(&request)?;
            self.recovery.requested(sequence_count, frame);
        }
        Ok(())
    }

    /// Requests the emulator's counters, which reveal lost credit.
    pub(crate) fn query(&mut self) -> Result<(), PortError> {
        self.command(&Command::Ping)?;
        self.grant()
    }

    /// After a frame time-out: drops its parts, and requests a `Status` with the counters.
    pub(crate) fn give_up(&mut self) -> Result<Vec<Progress>, PortError> {
        let progress = self.assembler.abandon();
        self.pacing.forget();
        self.query()?;
        Ok(progress)
    }

    /// The cause, if the line cannot carry the latest frame within `timeout`.
    pub(crate) fn slow(&self, timeout: Duration) -> Option<Cause> {
        let header = self.header.as_ref()?;
        Cause::slow(header, |bytes| self.port.airtime(bytes), timeout)
    }

    pub(crate) fn add_counts(&self, report: &mut Report) {
        report.undecodable += self.undecodable;
        report.bytes += self.bytes;
        report.dropped += self.port.dropped();
        report.missing_packets += self.pacing.missing();
        report.assembly.add_all(&self.assembler.counts());
        report.recovery.requested += self.recovery.requested;
        report.recovery.refused += self.recovery.refused;
        report.recovery.damaged += self.recovery.damaged;
    }
}
