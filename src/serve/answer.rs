//! To the wire: answers (`Ack`, `Nack`, `Status`). They take no credit and go before the next packet of a frame.

use super::Server;
use crate::config::Clock;
use crate::link::{LinkError, Outbound};
use bytes::Bytes;
use skyloop_firmware_sim::time::to_wire;
use skyloop_protocols::{
    Ack, Header, MAX_PACKET, Mode, Nack, Output, Packing, Reason, Reply, Status, WireTime,
};

/// Answers that may wait for room in the link's queue.
const MAX_ANSWERS: usize = 1024;

impl Server {
    pub(super) fn ack(&mut self, header: &Header) -> Result<(), LinkError> {
        let ack = Ack {
            apid: header.apid,
            sequence_count: header.sequence_count,
        };
        self.send(&Reply::Ack(ack), header.time)
    }

    pub(super) fn nack(
        &mut self,
        apid: u16,
        count: u16,
        reason: Reason,
        detail: &str,
    ) -> Result<(), LinkError> {
        tracing::debug!(?reason, detail, "refused");
        self.send(
            &Reply::Nack(Nack::new(apid, count, reason, detail)),
            self.now(),
        )
    }

    /// Sends one answer.
    pub(super) fn send(&mut self, reply: &Reply<'_>, time: WireTime) -> Result<(), LinkError> {
        let mut buffer = [0; MAX_PACKET];
        let count = self.counts.next(reply.apid());
        match (self.personality.encode_reply)(reply, count, time, &mut buffer) {
            Ok(length) => self.queue(Bytes::copy_from_slice(&buffer[..length])),
            Err(error) => {
                tracing::error!(%error, apid = reply.apid(), "an answer could not be encoded");
                Ok(())
            }
        }
    }

    /// Queues an answer behind those that wait. A client that takes nothing loses answers beyond [`MAX_ANSWERS`].
    fn queue(&mut self, answer: Bytes) -> Result<(), LinkError> {
        if self.exchange.answers.len() >= MAX_ANSWERS {
            self.counters.lost_outbound = self.counters.lost_outbound.wrapping_add(1);
            if !std::mem::replace(&mut self.exchange.overrun, true) {
                tracing::warn!(
                    "{MAX_ANSWERS} answers wait for a client that does not read: more are lost, and counted"
                );
            }
            return Ok(());
        }
        self.exchange.answers.push_back(answer);
        self.flush().map(|_| ())
    }

    /// Hands waiting answers to the link while it has room; true when nothing waits any more.
    pub(super) fn flush(&mut self) -> Result<bool, LinkError> {
        let exchange = self.exchange.number;
        while let Some(packet) = self.exchange.answers.front() {
            let packet = packet.clone();
            let back = self
                .wire
                .outbox
                .offer(Outbound::Packet { exchange, packet })?;
            if back.is_some() {
                return Ok(false);
            }
            self.exchange.answers.pop_front();
        }
        if let Some(asked) = self.exchange.release {
            let back = self
                .wire
                .outbox
                .offer(Outbound::Release { exchange, asked })?;
            if back.is_some() {
                return Ok(false);
            }
            self.exchange.release = None;
        }
        Ok(true)
    }

    /// Counts the answers that wait as lost.
    pub(super) fn lose_answers(&mut self) {
        let waiting = self.exchange.answers.drain(..).count() as u32;
        self.counters.lost_outbound = self.counters.lost_outbound.wrapping_add(waiting);
    }

    pub(super) fn status(&self) -> Status {
        let camera = self.emulator.camera();
        let detector = &camera.detector;
        Status {
            mode: match self.clock {
                Clock::Stepped => Mode::Stepped,
                Clock::Wall => Mode::Wall,
            },
            width: detector.width as u16,
            height: detector.height as u16,
            bits: detector.bits,
            packing: Packing::for_bits(detector.bits),
            output: Output::default(),
            exposure_s: camera.exposure_s,
            gain_e_per_dn: detector.gain_e_per_dn,
            frame_rate_hz: camera.rate_hz,
            next_frame: self.emulator.next_frame(),
            packets_sent: self.exchange.credit.sent(),
            counters: self.counters(),
        }
    }

    /// The emulator's present time: that of the last attitude.
    pub(super) fn now(&self) -> WireTime {
        self.exchange
            .latest
            .as_ref()
            .and_then(|latched| to_wire(latched.vehicle.epoch))
            .unwrap_or_default()
    }
}
