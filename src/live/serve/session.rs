//! The links of a run.

use super::budget;
use super::channel::Channel;
use super::diagnosis::count_withheld;
use super::reasons::{PASSED_OVER, name};
use crate::stats::{FrameCounters, Request};
use bytes::Bytes;
use skyloop_link::{LinkError, Roles, Standstill, Unsent, Wire};
use skyloop_protocols::{
    Ack, Counters, Header, MAX_PACKET, Nack, Output, Personality, PixelLevel, Reason, Reply,
    WireTime, Withheld,
};
use skyloop_render::camera::Camera;
use std::time::{Duration, Instant};

/// Wait at the end of a run for a client that takes nothing. A pseudo-terminal passes 4 KiB at
/// once, which takes a client 4.3 s at 9600 baud.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(5);

/// The links of a run, and the default content of frames.
pub(super) struct Session {
    pub channels: Vec<Channel>,
    /// Content of frames until a client sends Output.
    pub default_output: Output,
    pub personality: &'static Personality,
}

impl Session {
    pub fn new(
        links: impl IntoIterator<Item = (Wire, Roles)>,
        output: Output,
        personality: &'static Personality,
    ) -> Session {
        let channels = links.into_iter();
        let channels = channels.map(|(wire, roles)| Channel::new(wire, roles, output));
        Session {
            channels: channels.collect(),
            default_output: output,
            personality,
        }
    }

    pub fn outgoing(&self) -> impl Iterator<Item = &Channel> {
        let channels = self.channels.iter();
        channels.filter(|channel| channel.roles.bring_frames())
    }

    /// Index of the link that carries the truth.
    pub fn truth(&self) -> usize {
        let truth = self.channels.iter().position(|channel| channel.roles.truth);
        truth.unwrap_or(0)
    }

    /// Whether a client gets uncompressed pixels.
    pub fn wants_rows(&self) -> bool {
        self.channels.iter().any(|channel| {
            channel.roles.pixels && channel.exchange.output.pixels == PixelLevel::Frame
        })
    }

    pub fn awaits(&self, frame: u32) -> bool {
        self.channels.iter().any(|channel| channel.awaits(frame))
    }

    /// Whether the transmission time of this link counts for the late policy: the first link that
    /// carries pixels to a client, else the first that carries frames.
    pub fn counts_for_late_policy(&self, link: usize) -> bool {
        let first = |brings: fn(&Roles) -> bool| {
            let mut channels = self.channels.iter();
            channels.position(|one| brings(&one.roles) && one.exchange.muted.is_none())
        };
        let pixels = first(|roles| roles.pixels);
        pixels.or_else(|| first(Roles::bring_frames)) == Some(link)
    }

    /// Whether no other link carries frames.
    pub fn is_only_outgoing(&self, link: usize) -> bool {
        let mut channels = self.channels.iter().enumerate();
        !channels.any(|(other, channel)| other != link && channel.roles.bring_frames())
    }

    /// Notes on the links whether a frame is being rendered. A replay depends on it.
    pub fn set_rendering(&self, is_rendering: bool) {
        for channel in &self.channels {
            channel.wire.inbox.making(is_rendering);
        }
    }

    /// Whether a replay has a packet to be taken before the end of the present rendering.
    pub fn holds_frame(&self) -> bool {
        let mut channels = self.channels.iter();
        channels.any(|channel| channel.wire.inbox.holds_frame())
    }

    /// Sends waiting answers while the links have room; true when none waits any more.
    pub fn flush(&mut self) -> Result<bool, LinkError> {
        let mut all = true;
        for channel in &mut self.channels {
            all &= channel.flush()?;
        }
        Ok(all)
    }

    /// Sends one answer. Answers take no credit and go before the next packet of a frame.
    pub fn send(
        &mut self,
        link: usize,
        reply: &Reply<'_>,
        time: WireTime,
    ) -> Result<(), LinkError> {
        let mut buffer = [0; MAX_PACKET];
        let channel = &mut self.channels[link];
        let count = channel.counts.next(reply.apid());
        match (self.personality.encode_reply)(reply, count, time, &mut buffer) {
            Ok(length) => channel.answer(Bytes::copy_from_slice(&buffer[..length])),
            Err(error) => {
                tracing::error!(%error, apid = reply.apid(), "an answer could not be encoded");
                Ok(())
            }
        }
    }

    pub fn ack(&mut self, link: usize, header: &Header) -> Result<(), LinkError> {
        let ack = Ack {
            apid: header.apid,
            sequence_count: header.sequence_count,
        };
        self.send(link, &Reply::Ack(ack), header.time)
    }

    /// Refuses the packet with this APID and sequence count.
    pub fn nack(
        &mut self,
        link: usize,
        (apid, count): (u16, u16),
        reason: Reason,
        detail: &str,
        now: WireTime,
    ) -> Result<(), LinkError> {
        tracing::debug!(?reason, detail, "refused");
        let nack = Nack::new(apid, count, reason, detail);
        self.send(link, &Reply::Nack(nack), now)
    }

    /// Reports withheld frames on all outgoing links.
    pub fn report(&mut self, why: Withheld, detail: &str) {
        let channels = self.channels.iter_mut();
        for channel in channels.filter(|channel| channel.roles.bring_frames()) {
            channel.report(why, detail);
        }
    }

    /// Counts a request without a frame, on all outgoing links.
    pub fn fail(&mut self, request: Request, cause: &'static str) {
        let channels = self.channels.iter_mut();
        for channel in channels.filter(|channel| channel.roles.bring_frames()) {
            let entry = channel.frames.open(&request);
            count_withheld(channel, entry, cause);
        }
    }

    pub fn fail_all(&mut self, count: u32, cause: &'static str) {
        (0..count).for_each(|_| self.fail(Request::default(), cause));
    }

    /// Adds the counters of the links.
    pub fn add_to(&self, counters: &mut Counters) {
        for channel in &self.channels {
            channel.wire.tally.add_to(counters);
            counters.lost_outbound = counters.lost_outbound.wrapping_add(channel.lost);
        }
    }

    /// How long each level of output takes, on each link with a limited rate.
    pub fn levels(&self, camera: &Camera) -> String {
        let mut text = String::new();
        for Channel { wire, roles, .. } in &self.channels {
            let table = budget::table(wire, *roles, camera, &self.default_output);
            if !table.is_empty() {
                text += &format!("a frame over {} takes\n{table}", wire.address);
            }
        }
        text
    }

    /// Errors: a link cannot carry the default output at the camera's rate.
    pub fn check_rate(&self, camera: &Camera) -> Result<(), String> {
        for Channel { wire, roles, .. } in &self.channels {
            budget::fits(wire, *roles, camera, &self.default_output, camera.rate_hz)
                .map_err(|why| format!("link {}: {why}", wire.address))?;
        }
        Ok(())
    }

    /// Ends the links when all queued packets have left, when nothing moves for [`CLOSE_TIMEOUT`],
    /// or at `until`.
    pub fn close(&mut self, until: Option<Instant>) {
        for channel in &mut self.channels {
            let standstill = Standstill::of(&channel.wire.tally, CLOSE_TIMEOUT);
            channel.watch(Instant::now());
            let mut standstill = standstill.moved(channel.moved());
            if let Some(until) = until {
                standstill = standstill.until(until);
            }
            while let Ok(false) = channel.flush()
                && !standstill.is_over()
            {}
            channel.lose_answers();
            channel.wire.close(standstill);
            let is_unread = channel.wire.tally.why_given_up() == Some(Unsent::NotRead);
            let why = if is_unread {
                Withheld::NotRead
            } else {
                Withheld::SlowLink
            };
            channel.settle_superseded(name(why));
        }
    }

    /// The frame counters of a link, with the exposures that the clock skipped.
    pub fn counters_of(channel: &Channel, skipped: u32) -> FrameCounters {
        let frames = channel.frames.clone();
        frames.with(skipped as usize, PASSED_OVER)
    }
}
