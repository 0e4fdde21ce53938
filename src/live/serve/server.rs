//! The emulator with its links: drives the parts of a run.

use super::client::Client;
use super::diagnosis::report_silence;
use super::exposure::{abandon, handle_event, start_exposure, until_due};
use super::followers::Followers;
use super::frame_queue::FrameQueue;
use super::late_policy::LatePolicy;
use super::reasons::RUN_ENDED;
use super::receive::{receive, receive_waiting};
use super::render_thread::{Renderer, Task, renderer};
use super::session::Session;
use super::state::State;
use super::telemetry::{OnFrameSent, Telemetry};
use crate::metrics::Metrics;
use crate::stats::RunStats;
use skyloop_config::{Clock as Kind, OnOverrun, Run};
use skyloop_link::{LinkError, Roles, Wire};
use skyloop_protocols::{Counters, Output, Personality};
use skyloop_render::engine::{Emulator, ExposedFrame};
use skyloop_render::fidelity::Fidelity;
use skyloop_render::render::BAND_ROWS;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Maximum pause while nothing is due.
const POLL: Duration = Duration::from_millis(20);
/// How long the end of a run waits after a signal, for all links together.
const STOP_TIMEOUT: Duration = Duration::from_millis(1500);

/// The emulator with its links.
pub struct Server {
    /// `None` while the render thread uses it.
    emulator: Option<Emulator>,
    fidelity: Fidelity,
    state: State,
    /// When the run was stopped, if it was.
    stopped: Option<Instant>,
    /// When sending ends, unless the run was stopped.
    until: Option<Instant>,
}

/// How a run ended.
#[must_use = "a run may have ended because of an error of its own"]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It was stopped, or has rendered its frames.
    AsRequested,
    /// The other end of the link has gone for good.
    LinkGone,
    /// The render thread has panicked.
    Panicked,
}

impl Server {
    /// Connects `emulator` to its links. Frames contain `output` until a client sends Output.
    pub fn new(
        emulator: Emulator,
        links: impl IntoIterator<Item = (Wire, Roles)>,
        output: Output,
        clock: Kind,
        personality: &'static Personality,
    ) -> Server {
        let fidelity = *emulator.fidelity();
        let state = State {
            session: Session::new(links, output, personality),
            client: Client::new(&emulator, clock),
            frames: FrameQueue::new(emulator.next_frame()),
            late: LatePolicy::new(OnOverrun::Late, fidelity, &[]).0,
            telemetry: Telemetry::new(&emulator),
            followers: Followers::default(),
        };
        Server {
            emulator: Some(emulator),
            fidelity,
            state,
            stopped: None,
            until: None,
        }
    }

    /// Connects the `emulator` of a further camera to links that carry its frames. It gets copies
    /// of the packets about the vehicle, with their arrival times. Cameras render one after
    /// another, each with all threads. It runs in a separate thread, and ends with this server.
    pub fn head(
        &mut self,
        emulator: Emulator,
        links: impl IntoIterator<Item = (Wire, Roles)>,
        run: &Run,
    ) -> Server {
        let (followers, relay) = self.state.followers.add();
        let links = std::iter::once(relay).chain(links);
        let Session {
            default_output,
            personality,
            ..
        } = self.state.session;
        let kind = self.state.client.kind;
        let mut server = Server::new(emulator, links, default_output, kind, personality);
        server.state.followers = followers;
        server.set_run(run);
        server
    }

    /// Sets clock, order of attitudes and late policy. The policy starts from the emulator's
    /// tolerances.
    pub fn set_run(&mut self, run: &Run) {
        let State {
            client,
            late,
            followers,
            ..
        } = &mut self.state;
        client.set_run(run);
        let (policy, idle) = LatePolicy::new(run.on_overrun, self.fidelity, &run.coarsen);
        *late = policy;
        if let Some(emulator) = &mut self.emulator {
            emulator.work_limit_s = Some(run.work_limit_s);
        }
        // Only the first camera logs warnings about the run.
        if !followers.is_follower {
            for step in idle {
                tracing::warn!(
                    "run.coarsen: {step} makes nothing coarser than the step before it, or the run's `fidelity`, and is skipped; remove it, or name a coarser one"
                );
            }
            if run.on_overrun == OnOverrun::Coarsen && late.fidelity(1).is_none() {
                tracing::warn!(
                    "run.on_overrun = \"coarsen\": none of `run.coarsen` makes frames coarser, so late frames are sent late; name a tolerance such as \"wing_e = 1\""
                );
            }
            let idle = run.idle_in_step().join(", ");
            if client.is_stepped() && !idle.is_empty() {
                tracing::warn!(
                    "{idle}: no effect with the stepped clock, where no frame is late; remove it, or set run.clock"
                );
            }
        }
        if client.is_stepped() {
            return;
        }
        late.delay = run.delay;
        let period_s = 1.0 / client.camera().rate_hz;
        if let Some(why) = late.never_in_time(run.latency_s.unwrap_or(period_s)) {
            tracing::warn!("{why}; set run.latency_s above it");
        }
    }

    /// Ends the links at `until` at the latest, if the run is not stopped.
    pub fn end_by(&mut self, until: Option<Instant>) {
        self.until = until;
    }

    /// Publishes the metrics of the run in `metrics` ten times a second.
    pub fn set_metrics(&mut self, metrics: Metrics) {
        self.state.telemetry.metrics = Some(metrics);
    }

    /// Calls `on_left` for each frame that has left.
    pub fn on_left(&mut self, on_left: OnFrameSent) {
        self.state.telemetry.on_left = Some(on_left);
    }

    /// Errors: a link cannot carry the default output at the camera's rate, or the device's delay
    /// holds too many frames.
    pub fn fits(&self) -> Result<(), String> {
        let client = &self.state.client;
        let camera = client.camera();
        let held = self.state.late.check_held(camera.rate_hz);
        held.map_err(|why| format!("{why}, or lower timing.rate_hz"))?;
        if client.is_stepped() {
            return Ok(());
        }
        self.state.session.check_rate(camera)
    }

    /// The addresses of the links.
    pub fn addresses(&self) -> Vec<String> {
        let channels = self.state.session.channels.iter();
        let addresses = channels.map(|channel| channel.wire.address.clone());
        addresses.collect()
    }

    /// How long each level of output takes, on each link with a limited rate.
    pub fn levels(&self) -> String {
        self.state.session.levels(self.state.client.camera())
    }

    /// The address of the link that has ended.
    pub fn gone(&self) -> Option<&str> {
        let mut channels = self.state.session.channels.iter();
        let gone = channels.find(|channel| channel.gone)?;
        Some(&gone.wire.address)
    }

    /// All counters, with those of the links.
    pub fn counters(&self) -> Counters {
        self.state.counters()
    }

    /// Statistics of the run.
    pub fn stats(&self) -> &RunStats {
        &self.state.telemetry.stats
    }

    /// Serves until `stop` is set or `limit` frames are rendered. `on_exposed` gets each frame when
    /// it was queued on its links or dropped; its memory is reused after that.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        mut on_exposed: impl FnMut(&ExposedFrame),
    ) -> Ended {
        self.run_until(stop, limit, &mut on_exposed)
    }

    /// [`Self::run`], compiled once, in this crate.
    fn run_until(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_exposed: &mut dyn FnMut(&ExposedFrame),
    ) -> Ended {
        let Some(mut emulator) = self.emulator.take() else {
            return Ended::AsRequested;
        };
        let ended = std::thread::scope(|scope| {
            let (renderer, render_thread) = renderer(std::thread::current());
            let turn = self.state.followers.render_turn.clone();
            let (emulator, span) = (&mut emulator, tracing::Span::current());
            let rendering =
                scope.spawn(move || span.in_scope(|| render_thread.run(emulator, &turn)));
            let ended = self.serve(&renderer, stop, limit, on_exposed);
            drop(renderer);
            if rendering.join().is_err() {
                return Ok(Ended::Panicked);
            }
            ended
        });
        self.emulator = Some(emulator);
        let state = &mut self.state;
        let waiting = state.client.clock.end(Instant::now());
        state.abandon(waiting, RUN_ENDED);
        if matches!(ended, Ok(Ended::Panicked)) {
            while !state.frames.jobs.is_empty() {
                abandon(state, 0);
            }
        }
        // Receiving or sending detects first that a link has ended.
        ended.unwrap_or_else(|error| {
            tracing::debug!(%error, "nothing can be sent any more");
            Ended::LinkGone
        })
    }

    /// Serves until the end, and then completes the present rendering.
    fn serve(
        &mut self,
        renderer: &Renderer,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_exposed: &mut dyn FnMut(&ExposedFrame),
    ) -> Result<Ended, LinkError> {
        let state = &mut self.state;
        for channel in &state.session.channels {
            channel.wire.inbox.unparks(std::thread::current());
        }
        if !state.client.is_stepped() && state.session.wants_rows() {
            let detector = &state.client.camera().detector;
            let bands = detector.height.div_ceil(BAND_ROWS);
            renderer.buffers().fill(bands, detector.width * BAND_ROWS);
        }
        let ended = run_loop(state, renderer, stop, limit, on_exposed);
        if stop.load(Ordering::Relaxed) && matches!(ended, Ok(Ended::AsRequested)) {
            self.stopped = Some(Instant::now());
        }
        state.frames.end_all(&mut state.session);
        state.frames.cancel();
        while state.frames.is_rendering()
            && let Ok(event) = renderer.wait()
        {
            // The link for a refusal may have closed.
            let _ = handle_event(state, event, renderer.buffers());
        }
        state.frames.end_all(&mut state.session);
        settle(state, renderer, on_exposed);
        ended
    }

    /// Ends the links when all queued packets have left, when nothing moves for 5 s, 1.5 s after
    /// the run was stopped, or at [`Self::end_by`]. Returns statistics and counters of the run.
    pub fn close(mut self) -> (RunStats, Counters) {
        let stopped = self.stopped.map(|stopped| stopped + STOP_TIMEOUT);
        self.state.session.close(stopped.or(self.until));
        self.state.record_tx_complete();
        self.state.count_unsent();
        let counters = self.state.counters();
        let State {
            session,
            client,
            telemetry: Telemetry { mut stats, .. },
            ..
        } = self.state;
        let skipped = client.clock.missed();
        let outgoing = session.channels.into_iter();
        let outgoing = outgoing.filter(|channel| channel.roles.bring_frames());
        for (number, channel) in outgoing.enumerate() {
            let frames = Session::counters_of(&channel, skipped);
            let address = channel.wire.address;
            stats.frame_counters.push((address.clone(), frames));
            if number == 0 {
                (stats.link, stats.latencies) = (address, channel.latencies);
            } else {
                stats.further.push((address, channel.latencies));
            }
        }
        (stats, counters)
    }
}

/// Packets, pixels and exposures in turn, until the end.
fn run_loop(
    state: &mut State,
    renderer: &Renderer,
    stop: &AtomicBool,
    limit: Option<u32>,
    on_exposed: &mut dyn FnMut(&ExposedFrame),
) -> Result<Ended, LinkError> {
    while !stop.load(Ordering::Relaxed) {
        while !(state.frames.is_rendering() && state.session.holds_frame()) {
            match renderer.poll() {
                Ok(Some(event)) => handle_event(state, event, renderer.buffers())?,
                Ok(None) => break,
                Err(()) => return Ok(Ended::Panicked),
            }
        }
        // Commands and attitudes come first.
        if !receive_waiting(state)? {
            return Ok(Ended::LinkGone);
        }
        let round = state.frames.deliver(&mut state.session)?;
        let now = Instant::now();
        let needs_trigger = state.client.has_attitude() && state.client.is_requested_by("Trigger");
        for channel in &mut state.session.channels {
            report_silence(channel, needs_trigger, now);
        }
        let settled = settle(state, renderer, on_exposed);
        state.publish(Instant::now());
        let is_complete = limit.is_some_and(|limit| state.telemetry.stats.frames >= limit);
        if is_complete && state.frames.jobs.is_empty() {
            break;
        }
        let exposed = start_exposure(state, renderer, limit)?;
        if round.moved || settled || exposed {
            continue;
        }
        let until_due = until_due(state, limit).unwrap_or(POLL).min(POLL);
        let pause = round.pause.unwrap_or(POLL).min(until_due);
        if !receive(state, pause)? {
            return Ok(Ended::LinkGone);
        }
    }
    Ok(Ended::AsRequested)
}

/// Takes the frames whose deliveries have ended; returns whether there was one.
fn settle(
    state: &mut State,
    renderer: &Renderer,
    on_exposed: &mut dyn FnMut(&ExposedFrame),
) -> bool {
    state.record_tx_complete();
    let mut any = false;
    while let Some(job) = state.frames.take_done(&mut state.telemetry) {
        any = true;
        if let Some(exposed) = job.into_exposed() {
            on_exposed(&exposed);
            state.frames.pool.put(exposed);
        }
    }
    let max = state.max_frames();
    let in_flight = state.frames.jobs.len();
    while let Some(exposed) = state.frames.pool.take_surplus(in_flight, max) {
        // A thread that has ended does not need it.
        let _ = renderer.order(Task::Recycle(exposed));
    }
    any
}
