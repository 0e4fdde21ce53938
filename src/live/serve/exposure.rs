//! A due exposure becomes an order to the renderer, and the renderer's events complete the frame.

use super::client::check_representable;
use super::clock::due::Due;
use super::frame_job::FrameSource;
use super::history::Pointing;
use super::late_policy::Decision;
use super::reasons::{NO_ATTITUDE, WOULD_BE_LATE};
use super::render_thread::{RenderEvent, RenderOrder, Renderer, RowBuffers, Task};
use super::state::State;
use super::telemetry::{Telemetry, add};
use crate::stats::Request;
use skyloop_base::abort::Abort;
use skyloop_link::LinkError;
use skyloop_protocols::AttitudeSource;
use skyloop_render::camera::Camera;
use skyloop_render::scene::Exposure;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Whether another frame may be rendered. The stepped clock renders and sends one after the other.
fn is_free(state: &State, limit: Option<u32>) -> bool {
    let is_idle = !state.client.is_stepped() || state.frames.jobs.is_empty();
    let is_wanted = limit.is_none_or(|limit| state.telemetry.stats.frames < limit);
    is_idle && is_wanted && !state.frames.is_rendering()
}

/// Time until an exposure is due that can be rendered, or slightly less; none: not known.
pub(super) fn until_due(state: &State, limit: Option<u32>) -> Option<Duration> {
    if !is_free(state, limit) {
        return None;
    }
    state.client.clock.until_due(Instant::now())
}

/// Orders the frame of a due exposure; returns whether one was due.
pub(super) fn start_exposure(
    state: &mut State,
    renderer: &Renderer,
    limit: Option<u32>,
) -> Result<bool, LinkError> {
    if !is_free(state, limit) {
        return Ok(false);
    }
    let now = Instant::now();
    let camera = state.client.camera().clone();
    let Some(mut due) = state.client.clock.take_due(&camera, now) else {
        return Ok(false);
    };
    let camera = due.camera.take().unwrap_or(camera);
    let exposure = Exposure::around(due.mid, camera.exposure_s);
    let Some(pointing) = state.client.pointing(&due, &exposure) else {
        drop_exposure(state, &due, NO_ATTITUDE);
        return Ok(true);
    };
    if let Err(why) = check_representable(&exposure) {
        let request = Some(Request::default());
        state.refuse_accepted(request, &pointing.message, &due, &why)?;
        return Ok(true);
    }
    let until_s = |at: Instant| {
        let [left, past] =
            [(at, now), (now, at)].map(|(to, from)| to.saturating_duration_since(from));
        left.as_secs_f64() - past.as_secs_f64()
    };
    // Without the jitter, which is drawn later.
    let release = due.end + Duration::from_secs_f64(state.late.delay.delay_s);
    let spare_s = due.deadline.map(until_s);
    let Decision::Render { level, overrun } = state.late.decide(spare_s, until_s(release)) else {
        drop_exposure(state, &due, WOULD_BE_LATE);
        state.telemetry.stats.dropped = state.late.dropped;
        return Ok(true);
    };
    let delay = state.late.delay;
    let release = due.end + delay.of(state.followers.camera, state.frames.next_frame);
    // Late because of the jitter alone.
    let is_late = due.deadline.is_some_and(|deadline| release > deadline);
    let source = FrameSource {
        due,
        pointing,
        sync: state.client.sync(now),
        level,
        overrun: if is_late { Some("late") } else { overrun },
        is_timed: !state.client.is_stepped(),
        release,
    };
    order_frame(state, renderer, camera, source);
    Ok(true)
}

/// Counts an exposure that gets no frame.
fn drop_exposure(state: &mut State, due: &Due, cause: &'static str) {
    state.session.fail(Request::default(), cause);
    state.telemetry.miss(due);
}

/// Orders a frame from the renderer.
fn order_frame(state: &mut State, renderer: &Renderer, camera: Arc<Camera>, source: FrameSource) {
    let FrameSource {
        due,
        pointing,
        level,
        ..
    } = &source;
    count_source(&mut state.telemetry, pointing);
    let (number, is_requested) = (pointing.message.number, due.latched.is_some());
    let abort = Abort::default();
    let order = RenderOrder {
        number: state.frames.next_frame,
        camera,
        vehicle: pointing.vehicle.clone(),
        repeat: state.client.count_repeat(number, is_requested),
        fidelity: state.late.fidelity(*level),
        overrun: source.overrun,
        streams: source.is_timed && state.session.wants_rows(),
        abort: abort.clone(),
        coarser: state.late.coarser_than(*level),
    };
    state.frames.start(Request::default(), source, abort);
    state.session.set_rendering(true);
    if !renderer.order(Task::Render(Box::new(order))) {
        tracing::error!("the renderer's thread has ended");
    }
}

/// Counts a frame from an attitude that is too old, or of the future.
fn count_source(telemetry: &mut Telemetry, pointing: &Pointing) {
    let counters = &mut telemetry.counters;
    let counter = match pointing.source {
        AttitudeSource::Future => &mut counters.attitudes_future,
        AttitudeSource::Held | AttitudeSource::Invalid if pointing.age_s < 0.0 => {
            &mut counters.attitudes_future
        }
        AttitudeSource::Stale | AttitudeSource::Held | AttitudeSource::Invalid => {
            &mut counters.attitudes_stale
        }
        AttitudeSource::Exact | AttitudeSource::Interpolated | AttitudeSource::Extrapolated => {
            return;
        }
    };
    add(counter, 1);
}

/// Handles an event of the renderer.
pub(super) fn handle_event(
    state: &mut State,
    event: RenderEvent,
    buffers: &RowBuffers,
) -> Result<(), LinkError> {
    let Some(at) = state.frames.rendering_job() else {
        return Ok(());
    };
    // A frame may be complete or refused before the renderer detects the cancellation.
    let is_cancelled = state.frames.is_cancelled();
    let job = &mut state.frames.jobs[at];
    match event {
        RenderEvent::Coarsened => {
            job.source.level += 1;
            job.source.overrun = Some("coarsen");
        }
        RenderEvent::Labelled(opening) => {
            job.opening = Some(opening);
            begin_deliveries(state, at);
        }
        RenderEvent::Rows(first, dn, ready) => job.add_rows(first, dn, ready, buffers),
        RenderEvent::Complete(exposed, ..) if is_cancelled => {
            state.frames.pool.put(exposed);
            abandon(state, at);
        }
        RenderEvent::Failed(_) if is_cancelled => abandon(state, at),
        RenderEvent::Abandoned => abandon(state, at),
        RenderEvent::Complete(exposed, ready, took) => {
            state.late.learn(job.source.level, took);
            state.telemetry.rendered(&exposed, job.source.level > 0);
            state.frames.complete(at, exposed, ready);
            state.session.set_rendering(false);
            begin_deliveries(state, at);
        }
        RenderEvent::Failed(why) => {
            let job = state.frames.remove_failed(at);
            state.session.set_rendering(false);
            let (message, due) = (&job.source.pointing.message, &job.source.due);
            state.refuse_accepted(job.request, message, due, &why)?;
        }
    }
    Ok(())
}

fn begin_deliveries(state: &mut State, at: usize) {
    let max = state.max_in_flight();
    let number = state.frames.jobs[at].number;
    let (session, telemetry) = (&mut state.session, &mut state.telemetry);
    state.frames.begin(number, max, session, telemetry);
}

/// Drops the frame that is being rendered.
pub(super) fn abandon(state: &mut State, at: usize) {
    let (session, telemetry) = (&mut state.session, &mut state.telemetry);
    state.frames.abandon(at, session, telemetry);
    state.session.set_rendering(false);
}
