//! The parts of a server, and the operations that need several of them.

use super::client::Client;
use super::clock::due::Due;
use super::followers::Followers;
use super::frame_queue::FrameQueue;
use super::history::Latched;
use super::in_flight::InFlightFrame;
use super::late_policy::LatePolicy;
use super::reasons::{CLIENT_GONE, RESET, name};
use super::session::Session;
use super::telemetry::{Telemetry, add};
use crate::metrics::Snapshot;
use crate::stats::Request;
use skyloop_link::{Exit, LinkError};
use skyloop_protocols::{Counters, Reason, Withheld};
use std::time::Instant;

/// The parts of a server. Each owns its state.
pub(super) struct State {
    pub session: Session,
    pub client: Client,
    pub frames: FrameQueue,
    pub late: LatePolicy,
    pub telemetry: Telemetry,
    pub followers: Followers,
}

impl State {
    /// Restarts the state of the client: another follows, or it sent Reset.
    pub fn restart_client(&mut self, is_reset: bool, now: Instant) {
        let cause = if is_reset { RESET } else { CLIENT_GONE };
        self.frames.drop_unsent(&mut self.session, cause);
        let waiting = self.client.restart(now);
        self.abandon(waiting, cause);
    }

    /// Counts requests that get no frame.
    pub fn abandon(&mut self, requests: u32, cause: &'static str) {
        let counters = &mut self.telemetry.counters;
        add(&mut counters.frames_abandoned, requests);
        if self.client.is_requested_by("Trigger") {
            add(&mut counters.triggers_missed, requests);
        }
        self.session.fail_all(requests, cause);
    }

    /// Refuses an attitude that had been accepted: its exposure cannot be rendered. The refusal is
    /// sent once, and each such exposure is missed. `request` is none if deliveries have begun:
    /// those end link by link.
    pub fn refuse_accepted(
        &mut self,
        request: Option<Request>,
        message: &Latched,
        due: &Due,
        why: &str,
    ) -> Result<(), LinkError> {
        self.telemetry.miss(due);
        if let Some(request) = request {
            self.session.fail(request, name(Withheld::Refused));
        }
        if !self.client.refuse_once(message.number) {
            return Ok(());
        }
        let reason = Reason::ValueOutOfRange;
        self.telemetry.counters.refuse(reason);
        self.session.report(Withheld::Refused, why);
        let packet = (message.header.apid, message.header.sequence_count);
        let (truth, now) = (self.session.truth(), self.client.now());
        self.session.nack(truth, packet, reason, why, now)
    }

    /// Maximum number of frames that wait on a link. Triggers come at any rate.
    pub fn max_in_flight(&mut self) -> usize {
        self.late.max_in_flight(self.client.cadence_hz())
    }

    /// Maximum number of frames besides the one that is rendered. Each link may send another one.
    pub fn max_frames(&self) -> usize {
        if self.client.is_stepped() {
            return 0;
        }
        let links = self.session.outgoing().count();
        let rate_hz = self.client.camera().rate_hz;
        self.late.max_in_flight(Some(rate_hz)) + links.saturating_sub(1)
    }

    /// Counts the frames that have left their links.
    pub fn record_tx_complete(&mut self) {
        while let Some((frame, exit)) = self
            .frames
            .in_flight
            .take_tx_complete(&self.session.channels)
        {
            self.count_frame(frame, exit);
        }
    }

    /// Counts the frames with unsent packets at the end of a run.
    pub fn count_unsent(&mut self) {
        while let Some(frame) = self.frames.in_flight.take_oldest() {
            self.count_frame(frame, None);
        }
    }

    /// Counts a frame that has left its link; without an exit it never will.
    fn count_frame(&mut self, mut frame: InFlightFrame, exit: Option<Exit>) {
        let lost = exit.and_then(|exit| exit.lost);
        let last = exit.filter(|_| lost.is_none()).map(|exit| exit.at);
        let counts_for_late_policy = self.session.counts_for_late_policy(frame.link);
        let channel = &mut self.session.channels[frame.link];
        let counters = &mut self.telemetry.counters;
        match frame.queued.take() {
            Some((_, entry)) if last.is_some() => channel.frames.deliver(entry),
            Some((_, entry)) => self.frames.lose(&frame, channel, entry, lost, counters),
            None => {}
        }
        let mut left = frame.left;
        left.missed = self.telemetry.missed(self.client.clock.missed());
        if let Some(last) = last {
            left.times = left.times.ended(left.trigger, left.deadline, last);
            if counts_for_late_policy {
                let after = left.times.last_byte.saturating_sub(frame.ready);
                self.late.learn_transmission(after);
            }
        } else if left.deadline.is_none() {
            left.times.spare_s = f64::INFINITY;
        }
        channel.latencies.add(&left.times);
        channel.latest = Some(left);
        if left.times.whole {
            channel.last = Some(left);
        }
        self.telemetry.frame_left(&left);
    }

    /// All counters, with those of the links.
    pub fn counters(&self) -> Counters {
        let mut counters = self.telemetry.counters(self.client.clock.missed());
        self.session.add_to(&mut counters);
        counters
    }

    /// Publishes the metrics, ten times a second.
    pub fn publish(&mut self, now: Instant) {
        if self.telemetry.is_publication_due(now) {
            let snapshot = self.snapshot(now);
            self.telemetry.publish(snapshot, now);
        }
    }

    fn snapshot(&self, now: Instant) -> Snapshot {
        let skipped = self.client.clock.missed();
        let several = self.session.outgoing().count() > 1;
        let mut links = self.session.outgoing().map(|channel| {
            let frames = Session::counters_of(channel, skipped);
            let mut snapshot = channel.snapshot(frames);
            snapshot.link = several.then(|| channel.wire.address.clone());
            snapshot
        });
        let mut snapshot = links.next().unwrap_or_default();
        snapshot.further = links.collect();
        snapshot.counters = self.counters().iter().collect();
        let sync = self.client.sync(now);
        snapshot.clock_offset_s = Some(sync.offset_s);
        snapshot.sync = Some(sync.state.code());
        snapshot
    }
}
