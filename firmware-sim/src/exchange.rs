//! The conversation with the emulator: commands numbered and sent, replies decoded, counted and put together, credit
//! granted as frame packets arrive.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use hifitime::Epoch;
use skyloop_protocols::sequence::SequenceCounts;
use skyloop_protocols::{Ack, Command, MAX_PACKET, Reply, Status, WireTime};

use crate::pacing::Pacing;
use crate::port::{Port, PortError};
use crate::reassembly::{Assembler, AssemblyError, Limits, Progress};
use crate::received::ReceivedFrame;
use crate::report::{NackRecord, Report};
use crate::time;

/// Frame packets that may be under way: their datagrams fit a socket's usual receive buffer (some 90 of 1,400 octets).
const WINDOW: u32 = 64;

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

/// One end of the conversation.
pub(crate) struct Exchange<P> {
    port: P,
    counts: SequenceCounts,
    pacing: Pacing,
    assembler: Assembler,
    undecodable: u64,
    /// Octets of all packets that came.
    octets: u64,
}

impl<P: Port> Exchange<P> {
    pub(crate) fn new(port: P) -> Self {
        Self {
            port,
            counts: SequenceCounts::new(),
            pacing: Pacing::new(WINDOW),
            assembler: Assembler::new(Limits::default()),
            undecodable: 0,
            octets: 0,
        }
    }

    /// Resets the emulator's side and opens a new exchange. [`Answer::Silence`] if nobody answered within `timeout`;
    /// `tick` comes at least five times a second and may break it off.
    pub(crate) fn open(
        &mut self,
        timeout: Duration,
        tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        let answer = self.ask(&Command::Reset, timeout, tick)?;
        // An emulator that does not reset is there all the same.
        if matches!(answer, Answer::Done | Answer::Refused(_)) {
            self.pacing = Pacing::new(WINDOW);
            self.assembler = Assembler::new(Limits::default());
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
        mut tick: impl FnMut() -> ControlFlow<()>,
    ) -> Result<Answer, PortError> {
        /// A command or its answer may be lost: it is sent as often as this.
        const TRIES: u32 = 4;
        let mut asked = Vec::new();
        for _ in 0..TRIES {
            asked.push((command.apid(), self.command(command)?));
            let deadline = Instant::now() + timeout / TRIES;
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
                    _ => {}
                }
            }
        }
        Ok(Answer::Silence)
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

    /// Waits for one packet and books it; `None` if none came.
    pub(crate) fn receive(&mut self, timeout: Duration) -> Result<Option<Incoming>, PortError> {
        let Some(packet) = self.port.recv(timeout)? else {
            return Ok(None);
        };
        self.octets += packet.len() as u64;
        let Ok((header, reply)) = Reply::decode(&packet) else {
            self.undecodable += 1;
            return Ok(Some(Incoming::Other));
        };
        if reply.takes_credit() && self.pacing.arrived(header.apid, header.sequence_count) {
            self.grant()?;
        }
        Ok(Some(match reply {
            Reply::Ack(ack) => Incoming::Ack(ack),
            Reply::Nack(nack) => Incoming::Nack(NackRecord {
                apid: nack.apid,
                sequence_count: nack.sequence_count,
                reason: nack.reason,
                detail: nack.detail.to_owned(),
            }),
            Reply::Status(status) => {
                self.pacing.rebase(status.packets_sent);
                Incoming::Status(Box::new(status))
            }
            _ => match self.assembler.accept(&packet, &header, &reply) {
                Ok(Some(frame)) => Incoming::Frame(Box::new(frame)),
                Ok(None) => Incoming::Other,
                Err(error) => Incoming::Useless(error),
            },
        }))
    }

    /// After a frame did not come: forgets what came of it, and asks for a `Status`, which tells what was lost.
    pub(crate) fn give_up(&mut self) -> Result<Vec<Progress>, PortError> {
        let progress = self.assembler.abandon();
        self.command(&Command::Ping)?;
        self.grant()?;
        Ok(progress)
    }

    /// Writes its counts into the report.
    pub(crate) fn account(&self, report: &mut Report) {
        report.undecodable = self.undecodable;
        report.octets = self.octets;
        report.dropped = self.port.dropped();
        report.missing_packets = self.pacing.missing();
        report.assembly = self.assembler.counts();
    }
}
