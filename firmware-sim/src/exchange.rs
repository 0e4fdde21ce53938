//! The conversation with the emulator: commands numbered and sent, replies decoded, counted and put together, credit
//! granted as frame packets arrive.

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

/// Longest wait for a packet in one piece.
pub(crate) const TICK: Duration = Duration::from_millis(200);

/// What one packet brought.
pub(crate) enum Incoming {
    /// The last missing piece of a frame.
    Frame(Box<ReceivedFrame>),
    Ack(Ack),
    Nack(NackRecord),
    /// A packet came damaged at the emulator: it is lost, and may be sent again.
    Damaged(NackRecord),
    /// Settings and counters.
    Status(Box<Status>),
    /// A frame, or a packet of it, is of no use.
    Useless(AssemblyError),
    /// A piece of a frame, or a packet that is not ours.
    Other,
}

/// What became of a command.
pub(crate) enum Answer {
    Done,
    Refused(NackRecord),
    Silence,
    /// The caller broke it off.
    Stopped,
}

/// Waits between the copies of a command, which may be lost like its answer. The last copy leaves late, when an emulator
/// may have released a client that died.
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
    /// Parts of frames that the headers since the Reset have announced.
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

    /// Resets the emulator and opens a new exchange; commands `before` precede each Reset, their answers are ignored.
    /// `tick` is called at least five times a second and may break it off.
    pub(crate) fn open(
        &mut self,
        before: &[Command],
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        let waits = waits(timeout);
        let answer = self.ask_after(before, &Command::Reset, &waits, tick)?;
        // An emulator that does not reset is there all the same.
        if matches!(answer, Answer::Done | Answer::Refused(_)) {
            self.pacing = Pacing::new(self.port.window());
            self.assembler = Assembler::new(Limits::default());
            (self.header, self.announced) = (None, Roles::NONE);
            self.grant()?;
        }
        Ok(answer)
    }

    /// Repeats a command until it is answered, for `timeout` at most; `tick` as in [`Exchange::open`].
    pub(crate) fn ask(
        &mut self,
        command: &Command,
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        self.ask_after(&[], command, &waits(timeout), tick)
    }

    /// Sends `before` and the command once per entry of `waits`, and waits that long for the answer.
    pub(crate) fn ask_after(
        &mut self,
        before: &[Command],
        command: &Command,
        waits: &[Duration],
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        /// A command damaged on the way is sent again at once, but not for ever.
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
        // If every copy was damaged, or the emulator has another layout, its Nack says more than silence.
        Ok(damaged.pop().map_or(Answer::Silence, Answer::Refused))
    }

    /// Sends a command that is about the present moment; gives its sequence count.
    pub(crate) fn command(&mut self, command: &Command) -> Result<u16, PortError> {
        let now = Epoch::now().ok().and_then(time::to_wire);
        self.send(command, now.unwrap_or_default())
    }

    /// Sends a command; gives its sequence count.
    pub(crate) fn send(&mut self, command: &Command, time: WireTime) -> Result<u16, PortError> {
        let mut buffer = [0; MAX_PACKET];
        let count = self.counts.next(command.apid());
        let length = command.encode(count, time, &mut buffer)?;
        self.port.send(&buffer[..length])?;
        Ok(count)
    }

    /// Grants what the window allows. Repeating a grant does no harm, and repairs a lost one.
    pub(crate) fn grant(&mut self) -> Result<(), PortError> {
        let packets = self.pacing.renew();
        self.command(&Command::Credit { packets }).map(drop)
    }

    /// Waits for one packet and books it; `None` if none came. Asks for missing packets meanwhile.
    pub(crate) fn receive(&mut self, timeout: Duration) -> Result<Option<Incoming>, PortError> {
        let mut now = Instant::now();
        let deadline = now + timeout;
        loop {
            let left = deadline.saturating_duration_since(now);
            let wait = if self.assembler.is_idle() {
                left
            } else {
                self.look(now)?;
                left.min(self.recovery.pause())
            };
            match self.port.recv(wait)? {
                Some(packet) => return self.book(&packet).map(Some),
                None if wait == left => return Ok(None),
                None => now = Instant::now(),
            }
        }
    }

    fn book(&mut self, packet: &[u8]) -> Result<Incoming, PortError> {
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
                // A request that is lost on the way is made again, as long as packets are missing.
                if matches!(nack.reason, Reason::BadCrc | Reason::BadLength) {
                    self.recovery.damaged += 1;
                    return Ok(Incoming::Damaged(record));
                }
                if nack.apid == apid::COMMAND
                    && let Some(frame) = self.recovery.refusal(nack.sequence_count)
                {
                    // One that is busy may have them later.
                    if nack.reason != Reason::Busy {
                        self.assembler.forsake(frame);
                    }
                    if nack.reason == Reason::NotSupported {
                        self.recovery.stop();
                    }
                    return Ok(Incoming::Other);
                }
                Incoming::Nack(record)
            }
            Reply::Status(status) => {
                self.recovery.accounted();
                if self.pacing.rebase(status.packets_sent) {
                    self.grant()?;
                }
                Incoming::Status(Box::new(status))
            }
            _ => match self.assembler.accept(packet, &header, &reply, now) {
                Ok(Some(frame)) => Incoming::Frame(Box::new(frame)),
                Ok(None) => Incoming::Other,
                Err(error) => Incoming::Useless(error),
            },
        })
    }

    /// Asks for what is missing, if it is time. In silence a grant may be what was lost, or a whole window.
    fn look(&mut self, now: Instant) -> Result<(), PortError> {
        let Some(demand) = self.recovery.demand(now) else {
            return Ok(());
        };
        if self.recovery.knocks() {
            // The Status follows what the grant sets free.
            self.grant()?;
            self.command(&Command::Ping)?;
        }
        for Run {
            frame,
            first,
            count,
        } in self.assembler.ask(now, &demand)
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

    /// Asks for the emulator's account, by which lost credit is mended.
    pub(crate) fn query(&mut self) -> Result<(), PortError> {
        self.command(&Command::Ping)?;
        self.grant()
    }

    /// After a frame did not come: forgets what came of it, and asks for a `Status`, which tells what was lost.
    pub(crate) fn give_up(&mut self) -> Result<Vec<Progress>, PortError> {
        let progress = self.assembler.abandon();
        self.pacing.forget();
        self.query()?;
        Ok(progress)
    }

    /// Why the line cannot carry the latest frame within `timeout`.
    pub(crate) fn slow(&self, timeout: Duration) -> Option<Cause> {
        let header = self.header.as_ref()?;
        Cause::slow(header, |bytes| self.port.airtime(bytes), timeout)
    }

    pub(crate) fn account(&self, report: &mut Report) {
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
