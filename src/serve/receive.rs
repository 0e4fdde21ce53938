//! From the wire: packets to commands to the emulator's settings and the latched vehicle state.

use super::deliver::LISTEN;
use super::{Exchange, Server};
use crate::link::{Inbound, LinkError, QUEUE};
use skyloop_protocols::{Command, Reason, Reply, packet};
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::time::{Duration, Instant};

/// Why a valid packet is refused.
pub(super) struct Refusal {
    pub reason: Reason,
    pub detail: String,
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
                self.counters.refuse_undecodable(&error);
                let (apid, count) = packet::identify(&inbound.packet).unwrap_or((0, 0));
                self.see_refused(apid, count);
                return self.nack(apid, count, error.reason(), &error.to_string());
            }
        };
        // A Reset begins the counts anew.
        let missing = match command {
            Command::Reset => 0,
            _ => {
                let gaps = &mut self.exchange.gaps;
                gaps.missing(header.apid, header.sequence_count)
            }
        };
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
                self.wall.advance(Instant::now());
                self.send(&Reply::Status(self.status()), self.now())
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
        self.lose_answers();
        self.exchange = Exchange {
            number,
            ..Exchange::default()
        };
        self.emulator.reset_camera();
        self.wall
            .clear(self.emulator.camera().rate_hz, Instant::now());
    }

    /// Counts the attitudes that will have no frame.
    pub(super) fn abandon_waiting(&mut self) {
        let waiting = self.exchange.waiting.drain(..).count() as u32;
        self.counters.frames_abandoned = self.counters.frames_abandoned.wrapping_add(waiting);
    }
}
