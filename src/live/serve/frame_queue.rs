//! The frames of a run from the order to the renderer until they have left all links.

use super::channel::Channel;
use super::delivery::{Delivery, Stall};
use super::diagnosis::{report_standstill, report_superseded, standstill, withhold};
use super::exchange::Mute;
use super::frame_job::{FrameJob, FrameSource};
use super::frame_pool::FramePool;
use super::in_flight::{InFlight, InFlightFrame};
use super::reasons::{CLIENT_GONE, RESET, RUN_ENDED, name, of_unsent};
use super::session::Session;
use super::telemetry::{Telemetry, add};
use super::transmit::{Step, send_packet};
use crate::stats::{Pending, Request};
use skyloop_base::abort::Abort;
use skyloop_link::{LinkError, SOON, Unsent, standstill_timeout};
use skyloop_protocols::{Counters, Withheld};
use skyloop_render::engine::ExposedFrame;
use std::time::{Duration, Instant};

/// A client that takes and grants nothing for this long counts as gone: its frame is dropped.
const STALL_TIMEOUT: Duration = Duration::from_secs(2);
/// Time to receive packets while a frame waits for credit.
pub(super) const RECEIVE_TIME: Duration = Duration::from_millis(5);
/// Packets of one link before the next link's turn.
const BATCH: usize = 32;
/// Time to receive packets while others wait for room in a link's queue.
const RETRY: Duration = Duration::from_micros(200);

/// Frames that are rendered, sent or in flight.
pub(super) struct FrameQueue {
    pub jobs: Vec<FrameJob>,
    pub in_flight: InFlight,
    pub pool: FramePool<Box<ExposedFrame>>,
    /// The frame that is being rendered.
    rendering: Option<u32>,
    /// Cancels it.
    abort: Abort,
    pub next_frame: u32,
    /// Memory for the pixel values of the next frame.
    dn: Vec<u16>,
}

/// Result of a round over all links.
#[derive(Default)]
pub(super) struct Round {
    pub moved: bool,
    /// When the next round may send more, if known.
    pub pause: Option<Duration>,
}

impl Round {
    fn within(&mut self, pause: Duration) {
        self.pause = Some(self.pause.map_or(pause, |other| other.min(pause)));
    }
}

fn find(jobs: &mut [FrameJob], number: u32) -> Option<&mut FrameJob> {
    jobs.iter_mut().find(|job| job.number == number)
}

impl FrameQueue {
    pub fn new(next_frame: u32) -> FrameQueue {
        FrameQueue {
            jobs: Vec::new(),
            in_flight: InFlight::default(),
            pool: FramePool::new(),
            rendering: None,
            abort: Abort::default(),
            next_frame,
            dn: Vec::new(),
        }
    }

    pub fn is_rendering(&self) -> bool {
        self.rendering.is_some()
    }

    pub fn is_cancelled(&self) -> bool {
        self.abort.is_set()
    }

    pub fn cancel(&self) {
        self.abort.set();
    }

    /// Adds the frame that is rendered next; `abort` cancels it.
    pub fn start(&mut self, request: Request, source: FrameSource, abort: Abort) {
        let dn = std::mem::take(&mut self.dn);
        let number = self.next_frame;
        self.jobs.push(FrameJob::new(request, number, source, dn));
        self.rendering = Some(number);
        self.abort = abort;
    }

    pub fn rendering_job(&self) -> Option<usize> {
        let number = self.rendering?;
        self.jobs.iter().position(|job| job.number == number)
    }

    /// Completes the frame that was rendered.
    pub fn complete(&mut self, at: usize, exposed: Box<ExposedFrame>, ready: Instant) {
        self.dn = self.jobs[at].complete(exposed, ready);
        self.rendering = None;
        add(&mut self.next_frame, 1);
    }

    /// Removes the frame that cannot be rendered; its number is used again.
    pub fn remove_failed(&mut self, at: usize) -> FrameJob {
        self.rendering = None;
        self.jobs.remove(at)
    }

    /// Drops a frame whose rendering was cancelled. It keeps its number.
    pub fn abandon(&mut self, at: usize, session: &mut Session, telemetry: &mut Telemetry) {
        // Before the job is removed, so that a frame without a client counts as a missed deadline.
        self.end_unwanted(self.jobs[at].number, session);
        let job = self.jobs.remove(at);
        if let Some(request) = job.request {
            session.fail(request, RUN_ENDED);
        }
        telemetry.miss_trigger(&job.source.due);
        self.rendering = None;
        add(&mut self.next_frame, 1);
        add(&mut telemetry.counters.frames_abandoned, 1);
    }

    /// Cancels the present rendering if no client waits for the frame.
    pub fn cancel_unwanted(&self, session: &Session) {
        let Some(at) = self.rendering_job() else {
            return;
        };
        let job = &self.jobs[at];
        if job.request.is_none() && !session.awaits(job.number) {
            self.abort.set();
        }
    }

    /// Begins the deliveries of a frame on each link whose client has sent something; at most `max`
    /// frames wait on a link.
    pub fn begin(
        &mut self,
        number: u32,
        max: usize,
        session: &mut Session,
        telemetry: &mut Telemetry,
    ) {
        let Some(job) = find(&mut self.jobs, number) else {
            return;
        };
        let Some(request) = job.request.take() else {
            return;
        };
        let mut superseded = Vec::new();
        for (link, channel) in session.channels.iter_mut().enumerate() {
            if !channel.roles.bring_frames() {
                continue;
            }
            let entry = channel.frames.open(&request);
            // Evaluated in any case: a late proof of the address ends the mute.
            let is_muted = channel.is_muted();
            let has_gone = channel.has_gone(channel.exchange.number);
            if is_muted || has_gone || !channel.exchange.has_client {
                without_delivery(channel, number, entry);
                continue;
            }
            job.open += 1;
            let delivery = Delivery::new(number, entry, &channel.exchange, channel.progress());
            let older = channel.enqueue(delivery, max);
            superseded.extend(older.map(|older| (link, older)));
        }
        // A frame without deliveries is complete for no client.
        job.whole = job.open > 0;
        for (link, older) in superseded {
            let channel = &mut session.channels[link];
            let cause = report_superseded(channel, older.frame);
            add(&mut telemetry.counters.frames_dropped, 1);
            self.end(link, channel, older, Some(cause));
        }
    }

    /// Drops the frames that no link has begun to send, because their client has gone or sent
    /// Reset.
    pub fn drop_unsent(&mut self, session: &mut Session, cause: &'static str) {
        for job in &mut self.jobs {
            if let Some(request) = job.request.take() {
                job.whole = false;
                session.fail(request, cause);
            }
        }
    }

    /// Sends some packets over each link.
    pub fn deliver(&mut self, session: &mut Session) -> Result<Round, LinkError> {
        let mut round = Round::default();
        for link in 0..session.channels.len() {
            let channel = &mut session.channels[link];
            let Some(mut delivery) = channel.deliveries.pop_front() else {
                continue;
            };
            let mut step = Ok(Step::Sent);
            for _ in 0..BATCH {
                let job = find(&mut self.jobs, delivery.frame);
                step = send_packet(channel, &mut delivery, job, session.personality);
                if !matches!(step, Ok(Step::Sent)) {
                    break;
                }
            }
            let step = match step {
                Ok(step) => step,
                Err(error) => {
                    channel.deliveries.push_front(delivery);
                    return Err(error);
                }
            };
            if let Some(delivery) = self.after_step(step, link, delivery, session, &mut round) {
                session.channels[link].deliveries.push_front(delivery);
            }
        }
        Ok(round)
    }

    /// After a step, ends the delivery, or returns it to be continued.
    fn after_step(
        &mut self,
        step: Step,
        link: usize,
        mut delivery: Delivery,
        session: &mut Session,
        round: &mut Round,
    ) -> Option<Delivery> {
        let is_only = session.is_only_outgoing(link);
        let channel = &mut session.channels[link];
        let is_full = matches!(step, Step::NoRoom);
        match step {
            Step::Over(cause) => {
                round.moved = true;
                self.end(link, channel, delivery, cause);
                return None;
            }
            Step::Sent => round.moved = true,
            Step::NotYet(pause) => {
                delivery.stall = Stall::at(channel.progress());
                pause.into_iter().for_each(|pause| round.within(pause));
            }
            Step::NoCredit | Step::NoRoom => {
                round.within(if is_full { RETRY } else { RECEIVE_TIME });
                // While frame packets leave, a client on a slow line is not stalled.
                let has_packets = delivery.waiting.is_some() || channel.carries_frames();
                let stalled = delivery
                    .stall
                    .update(channel.progress(), has_packets, is_full);
                if stalled >= STALL_TIMEOUT {
                    self.drop_stalled(link, channel, delivery, !is_full, is_only);
                    return None;
                }
                // On a slow link one packet may take longer than `SOON`.
                let sends = is_full && !channel.wire.tally.awaits_proof();
                let airtime = channel.wire.airtime.as_ref().filter(|_| sends);
                if stalled >= standstill_timeout(airtime, SOON) {
                    report_standstill(channel, &mut delivery, !is_full);
                }
            }
        }
        Some(delivery)
    }

    /// Drops a frame of a client that takes nothing. Unless this is the only outgoing link
    /// (`is_only`), the client is muted.
    fn drop_stalled(
        &mut self,
        link: usize,
        channel: &mut Channel,
        delivery: Delivery,
        has_room: bool,
        is_only: bool,
    ) {
        let (why, detail) = standstill(channel, has_room);
        channel.exchange.muted = (!is_only).then_some(Mute {
            why,
            bytes: channel.wire.tally.bytes(),
            has_sent: false,
        });
        let detail = format!("frame {} is given up: {detail}", delivery.frame);
        channel.report(why, &detail);
        self.end(link, channel, delivery, Some(name(why)));
    }

    /// Ends a delivery: all packets are in the link's queue, or the frame is withheld for a
    /// `cause`.
    fn end(
        &mut self,
        link: usize,
        channel: &mut Channel,
        delivery: Delivery,
        cause: Option<&'static str>,
    ) {
        if let Some((_, true)) = delivery.waiting {
            // A packet that the link has refused is lost with its frame.
            add(&mut channel.lost, 1);
        }
        let Delivery {
            frame,
            entry,
            exchange,
            first_place,
            ..
        } = delivery;
        let job = find(&mut self.jobs, frame);
        // A frame without a job was refused while it was rendered.
        let cause = cause.or(job.is_none().then_some(name(Withheld::Refused)));
        let queued = if let Some(cause) = cause {
            withhold(channel, frame, entry, cause);
            None
        } else {
            if !channel.flow.in_status {
                channel.exchange.withheld = Withheld::None;
            }
            Some((channel.wire.tally.tx_complete.mark(first_place), entry))
        };
        let Some(job) = job else { return };
        job.open = job.open.saturating_sub(1);
        job.whole &= cause.is_none();
        // After a Reset and at the end of the run no client waits for it, so no deadline is missed.
        if !matches!(cause, Some(RESET | RUN_ENDED)) {
            let frame = InFlightFrame::new(job, link, exchange, queued);
            self.in_flight.push(frame);
        }
    }

    /// Ends all deliveries at the end of the run.
    pub fn end_all(&mut self, session: &mut Session) {
        for (link, channel) in session.channels.iter_mut().enumerate() {
            while let Some(delivery) = channel.deliveries.pop_front() {
                self.end(link, channel, delivery, Some(RUN_ENDED));
            }
        }
    }

    /// Ends the deliveries of a frame whose clients have gone or sent Reset.
    fn end_unwanted(&mut self, number: u32, session: &mut Session) {
        for (link, channel) in session.channels.iter_mut().enumerate() {
            let exchange = &channel.exchange;
            let is_unwanted = |one: &Delivery| one.frame == number && !one.is_for(exchange);
            let at = channel.deliveries.iter().position(is_unwanted);
            if let Some(delivery) = at.and_then(|at| channel.deliveries.remove(at)) {
                let has_gone = channel.has_gone(delivery.exchange);
                let cause = if has_gone { CLIENT_GONE } else { RESET };
                self.end(link, channel, delivery, Some(cause));
            }
        }
    }

    /// Withholds a frame that was queued on a link and not sent completely.
    pub fn lose(
        &mut self,
        frame: &InFlightFrame,
        channel: &mut Channel,
        entry: Pending,
        lost: Option<Unsent>,
        counters: &mut Counters,
    ) {
        let number = frame.left.times.frame;
        let given_up = channel.wire.tally.why_given_up();
        let lost = if channel.has_gone(frame.exchange) {
            Unsent::ClientGone
        } else {
            lost.or(given_up).unwrap_or(Unsent::NotRead)
        };
        let (why, cause) = of_unsent(lost);
        channel.frames.withhold(entry, cause);
        // The link itself reports the end of the run, and a new client did not expect this frame.
        if given_up.is_none() && channel.exchange.number == frame.exchange {
            let detail = format!("packets of frame {number} were given up in the link's queue");
            channel.report(why, &detail);
        }
        if frame.is_delivered {
            counters.frames_delivered = counters.frames_delivered.wrapping_sub(1);
            add(&mut counters.frames_abandoned, 1);
            self.in_flight.set_delivered(number, false);
        }
        if let Some(job) = find(&mut self.jobs, number) {
            job.whole = false;
        }
    }

    /// Takes a frame whose deliveries have ended, and counts it.
    pub fn take_done(&mut self, telemetry: &mut Telemetry) -> Option<FrameJob> {
        let at = self.jobs.iter().position(FrameJob::is_done)?;
        let job = self.jobs.remove(at);
        if job.whole {
            self.in_flight.set_delivered(job.number, true);
            add(&mut telemetry.counters.frames_delivered, 1);
        } else {
            add(&mut telemetry.counters.frames_abandoned, 1);
        }
        Some(job)
    }
}

/// Withholds a frame on a link whose client is absent or muted.
fn without_delivery(channel: &mut Channel, number: u32, entry: Pending) {
    let exchange = &channel.exchange;
    let (why, cause, detail) = if !exchange.has_client {
        let why = Withheld::NoClient;
        (why, name(why), "no valid packet has come yet")
    } else if channel.has_gone(exchange.number) {
        (Withheld::NoClient, CLIENT_GONE, "the client has gone")
    } else {
        match exchange.muted.map(|mute| mute.why) {
            None | Some(Withheld::NotRead) => {
                let why = Withheld::NotRead;
                (why, name(why), "the client takes nothing")
            }
            Some(why) => {
                let detail = "nothing is sent until the client sends a packet";
                (why, name(why), detail)
            }
        }
    };
    channel.frames.withhold(entry, cause);
    channel.report(why, &format!("frame {number}: {detail}"));
}
