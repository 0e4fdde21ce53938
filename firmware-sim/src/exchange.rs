//! The conversation with the emulator: commands numbered and sent, replies decoded, counted and put together, credit
//! granted as frame packets arrive.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{
    Ack, Command, FrameHeader, LabelLevel, MAX_PACKET, PixelLevel, Reason, Reply, Status, WireTime,
    apid,
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
    /// A command was carried out.
    Ack(Ack),
    /// A packet was refused.
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
    /// It was carried out.
    Done,
    /// It was refused.
    Refused(NackRecord),
    /// Nobody answered.
    Silence,
    /// The caller broke it off.
    Stopped,
}

/// A command or its answer may be lost: it is sent again after these waits. Late in it, too, when an emulator may have let go of a client that has died.
fn waits(timeout: Duration) -> [Duration; 5] {
    const SIXTEENTHS: [u32; 5] = [1, 2, 4, 5, 4];
    SIXTEENTHS.map(|share| timeout * share / 16)
}

/// One end of the conversation.
pub(crate) struct Exchange<P> {
    port: P,
    counts: SequenceCounts,
    pacing: Pacing,
    assembler: Assembler,
    recovery: Recovery,
    undecodable: u64,
    /// Octets of all packets that came.
    octets: u64,
    /// When the last of them came.
    last_packet: Option<Instant>,
    /// The latest frame header.
    header: Option<FrameHeader>,
    /// What frame headers have announced so far.
    announced: Roles,
}

impl<P: Port> Exchange<P> {
    pub(crate) fn new(port: P) -> Self {
        Self {
            recovery: Recovery::new(port.window(), port.airtime(MAX_PACKET)),
            pacing: Pacing::new(port.window()),
            port,
            counts: SequenceCounts::new(),
            assembler: Assembler::new(Limits::default()),
            undecodable: 0,
            octets: 0,
            last_packet: None,
            header: None,
            announced: Roles::NONE,
        }
    }

    /// Resets the emulator's side and opens a new exchange, after each of `before`, whose answers are not awaited.
    /// [`Answer::Silence`] if nobody answered within `timeout`; `tick` comes at least five times a second and may break it off.
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

    /// Sends a command until it is answered, `timeout` at most; `tick` comes at least five times a second and may
    /// break it off.
    pub(crate) fn ask(
        &mut self,
        command: &Command,
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        self.ask_after(&[], command, &waits(timeout), tick)
    }

    /// Sends a command once for each of `waits`, and waits so long for the answer; those of `before` go first each time.
    pub(crate) fn ask_after(
        &mut self,
        before: &[Command],
        command: &Command,
        waits: &[Duration],
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        /// A command damaged on the way is sent again at once, but not for ever.
        const MOST_DAMAGED: usize = 16;
        let mut asked = Vec::new();
        let mut damaged = Vec::new();
        for wait in waits {
            for command in before {
                self.command(command)?;
            }
            asked.push((command.apid(), self.command(command)?));
            let deadline = Instant::now() + *wait;
            loop {
                let left = deadline.saturating_duration_since(Instant::now());
                if left.is_zero() {
                    break;
                }
                if tick().is_break() {
                    return Ok(Answer::Stopped);
                }
                match self.receive(left.min(TICK))? {
                    Some(Incoming::Ack(ack)) if asked.contains(&(ack.apid, ack.sequence_count)) => {
                        return Ok(Answer::Done);
                    }
                    Some(Incoming::Nack(nack))
                        if asked.contains(&(nack.apid, nack.sequence_count)) =>
                    {
                        return Ok(Answer::Refused(nack));
                    }
                    Some(Incoming::Damaged(nack))
                        if asked.contains(&(nack.apid, nack.sequence_count)) =>
                    {
                        damaged.push(nack);
                        if damaged.len() < MOST_DAMAGED {
                            asked.push((command.apid(), self.command(command)?));
                        }
                    }
                    _ => {}
                }
            }
        }
        // Of a line that harms every copy, or an emulator that has another layout, the words say more than silence.
        Ok(damaged.pop().map_or(Answer::Silence, Answer::Refused))
    }

    /// Sends a command that is about the present moment; gives its sequence count.
    pub(crate) fn command(&mut self, command: &Command) -> Result<u16, PortError> {
        let now = Epoch::now()
            .ok()
            .and_then(time::to_wire)
            .unwrap_or_default();
        self.send(command, now)
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
        self.octets += packet.len() as u64;
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
            self.announced = self.announced.with(Roles {
                truth: false,
                pixels: header.pixel_level != PixelLevel::None,
                labels: header.label_level != LabelLevel::None,
            });
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

    /// Missing packets are asked for of frames that show this attitude; without one, of all.
    pub(crate) fn want(&mut self, attitude: Option<u32>) {
        self.recovery.attitude = attitude;
    }

    /// See [`Assembler::take_back`].
    pub(crate) fn take_back(&mut self, frame: ReceivedFrame) {
        self.assembler.take_back(frame);
    }

    /// See [`Assembler::look_out_for`].
    pub(crate) fn look_out_for(&mut self, frame: u32) {
        self.assembler.look_out_for(frame);
    }

    /// See [`Assembler::dismiss`].
    pub(crate) fn dismiss(&mut self, frame: u32) {
        self.assembler.dismiss(frame);
    }

    /// When the last frame packet came.
    pub(crate) fn heard(&self) -> Option<Instant> {
        self.recovery.heard()
    }

    /// The usual time between frame packets.
    pub(crate) fn spacing(&self) -> Duration {
        self.recovery.spacing()
    }

    /// Whether some of a frame that may show this attitude has come.
    pub(crate) fn has_begun(&self, attitude: u32) -> bool {
        self.assembler.has_begun(attitude)
    }

    /// Whether some of this frame has come, and not all.
    pub(crate) fn is_under_way(&self, frame: u32) -> bool {
        self.assembler.is_under_way(frame)
    }

    /// After a frame did not come: forgets what came of it, and asks for a `Status`, which tells what was lost.
    pub(crate) fn give_up(&mut self) -> Result<Vec<Progress>, PortError> {
        let progress = self.assembler.abandon();
        self.pacing.forget();
        self.query()?;
        Ok(progress)
    }

    /// Why nothing passes, if the line has gone.
    pub(crate) fn gone(&self) -> Option<PortError> {
        self.port.gone()
    }

    /// See [`Port::is_unheard`].
    pub(crate) fn is_unheard(&self) -> bool {
        self.port.is_unheard()
    }

    /// When the last packet of any kind came.
    pub(crate) fn last_packet(&self) -> Option<Instant> {
        self.last_packet
    }

    /// The port's name, for people.
    pub(crate) fn name(&self) -> &str {
        self.port.name()
    }

    /// What of frames has come so far, by their headers.
    pub(crate) fn announced(&self) -> Roles {
        self.announced
    }

    /// Whether the line does not carry the latest frame in this time.
    pub(crate) fn slow(&self, timeout: Duration) -> Option<Cause> {
        let header = self.header.as_ref()?;
        Cause::slow(header, |octets| self.port.airtime(octets), timeout)
    }

    /// Adds its counts to the report.
    pub(crate) fn account(&self, report: &mut Report) {
        report.undecodable += self.undecodable;
        report.octets += self.octets;
        report.dropped += self.port.dropped();
        report.missing_packets += self.pacing.missing();
        report.assembly.add_all(&self.assembler.counts());
        report.recovery.asked += self.recovery.asked;
        report.recovery.refused += self.recovery.refused;
        report.recovery.damaged += self.recovery.damaged;
    }
}
