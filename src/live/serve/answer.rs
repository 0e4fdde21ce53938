//! To the wire: answers (`Ack`, `Nack`, `Status`). They take no credit and go before the next packet of a frame.

use super::Server;
use super::clock::Sync;
use crate::timing::FrameTimes;
use bytes::Bytes;
use hifitime::Epoch;
use skyloop_firmware_sim::time::to_wire;
use skyloop_link::LinkError;
use skyloop_protocols::{
    Ack, Counters, Header, MAX_PACKET, Nack, Packing, Reason, Reply, Status, SyncState, Timing,
    WireTime, Withheld,
};
use skyloop_render::scene::Exposure;
use std::time::Instant;

impl Server {
    pub(super) fn ack(&mut self, at: usize, header: &Header) -> Result<(), LinkError> {
        let ack = Ack {
            apid: header.apid,
            sequence_count: header.sequence_count,
        };
        self.send(at, &Reply::Ack(ack), header.time)
    }

    pub(super) fn nack(
        &mut self,
        at: usize,
        apid: u16,
        count: u16,
        reason: Reason,
        detail: &str,
    ) -> Result<(), LinkError> {
        tracing::debug!(?reason, detail, "refused");
        self.send(
            at,
            &Reply::Nack(Nack::new(apid, count, reason, detail)),
            self.now(),
        )
    }

    /// Sends one answer.
    pub(super) fn send(
        &mut self,
        at: usize,
        reply: &Reply<'_>,
        time: WireTime,
    ) -> Result<(), LinkError> {
        let mut buffer = [0; MAX_PACKET];
        let channel = &mut self.channels[at];
        let count = channel.counts.next(reply.apid());
        match (self.personality.encode_reply)(reply, count, time, &mut buffer) {
            Ok(length) => channel.answer(Bytes::copy_from_slice(&buffer[..length])),
            Err(error) => {
                tracing::error!(%error, apid = reply.apid(), "an answer could not be encoded");
                Ok(())
            }
        }
    }

    /// Hands waiting answers to the links while they have room; true when nothing waits any more.
    pub(super) fn flush(&mut self) -> Result<bool, LinkError> {
        let mut all = true;
        for channel in &mut self.channels {
            all &= channel.flush()?;
        }
        Ok(all)
    }

    pub(super) fn status(&self, at: usize) -> Status {
        let channel = &self.channels[at];
        // A link that brings no frames tells of the first that does.
        let of = match channel.roles.bring_frames() {
            true => Some(channel),
            false => self.bringing().next(),
        };
        let exchange = &channel.exchange;
        let camera = &self.settings.camera;
        let detector = &camera.detector;
        let sync = self.sync(Instant::now());
        let last = of.and_then(|of| of.last.as_ref());
        let exposed = |at: fn(&Exposure) -> Epoch| {
            let exposure = last.and_then(|last| last.exposure.as_ref());
            exposure
                .and_then(|exposure| to_wire(at(exposure)))
                .unwrap_or_default()
        };
        let latency_s = |fraction| {
            let latency = of.and_then(|of| of.latencies.last_octet.quantile(fraction));
            latency.map_or(0.0, |latency| latency.as_secs_f32())
        };
        Status {
            mode: self.clock.mode(),
            width: detector.width as u16,
            height: detector.height as u16,
            bits: detector.bits,
            packing: Packing::for_bits(detector.bits),
            output: exchange.output,
            exposure_s: camera.exposure_s,
            gain_e_per_dn: detector.gain_e_per_dn,
            frame_rate_hz: camera.rate_hz,
            next_frame: self.next_frame,
            packets_sent: exchange.credit.sent(),
            sync: sync.state,
            clock_offset_s: sync.offset_s,
            exposure_start: exposed(|exposure| exposure.start),
            exposure_end: exposed(|exposure| exposure.end),
            timing: last.map(|last| timing(&last.times)).unwrap_or_default(),
            latency_p50_s: latency_s(0.5),
            latency_p99_s: latency_s(0.99),
            latency_max_s: latency_s(1.0),
            withheld: of.map_or(Withheld::None, |of| of.exchange.withheld),
            counters: Counters {
                deadlines_missed: of.map_or(0, |of| of.latencies.missed as u32),
                ..self.counters()
            },
        }
    }

    /// What the clock goes by for the client's time, or that exposures are paused.
    pub(super) fn sync(&self, now: Instant) -> Sync {
        let sync = self.clock.sync(now);
        let state = match self.clock.is_paused() {
            true => SyncState::Paused,
            false => sync.state,
        };
        Sync { state, ..sync }
    }

    /// The emulator's present time: that of the last attitude.
    pub(super) fn now(&self) -> WireTime {
        self.truth
            .history
            .latest()
            .and_then(|latched| to_wire(latched.vehicle.epoch))
            .unwrap_or_default()
    }
}

/// The times of a frame that has left, as the wire has them.
fn timing(times: &FrameTimes) -> Timing {
    Timing {
        attitude_age_s: times.attitude_age_s as f32,
        first_pixel_s: times.first_pixel.as_secs_f32(),
        last_pixel_s: times.last_pixel.as_secs_f32(),
        first_octet_s: times.first_octet.as_secs_f32(),
        last_octet_s: times.last_octet.as_secs_f32(),
        spare_s: if times.spare_s.is_finite() {
            times.spare_s as f32
        } else {
            0.0
        },
    }
}
