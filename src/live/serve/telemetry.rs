//! Counters and measurements of a run.

use super::clock::due::Due;
use crate::metrics::{Metrics, Snapshot};
use crate::stats::{Absent, RunStats};
use crate::timing::FrameTimes;
use skyloop_protocols::Counters;
use skyloop_render::engine::{Emulator, ExposedFrame};
use skyloop_render::scene::Exposure;
use std::time::{Duration, Instant};

/// Interval of publications for `/metrics`.
const PUBLISH_INTERVAL: Duration = Duration::from_millis(100);

/// Adds to a counter, which wraps.
pub(super) fn add(counter: &mut u32, more: u32) {
    *counter = counter.wrapping_add(more);
}

/// A frame that has left a link, or never will.
#[derive(Debug, Clone, Copy)]
pub struct SentFrame {
    /// Its times.
    pub times: FrameTimes,
    /// The instant from which these times count.
    pub trigger: Instant,
    /// Its deadline; none: it is never late.
    pub deadline: Option<Instant>,
    /// Exposures without a frame until then.
    pub missed: u32,
    /// Its exposure, if known.
    pub exposure: Option<Exposure>,
}

/// Observes each frame that has left, on the server's thread.
pub type OnFrameSent = Box<dyn FnMut(&SentFrame) + Send>;

/// Counters, statistics and their observers.
pub(super) struct Telemetry {
    pub counters: Counters,
    /// Exposures without a frame, except those that the clock skipped.
    missed: u32,
    rejected_records: u32,
    pub stats: RunStats,
    pub metrics: Option<Metrics>,
    published: Option<Instant>,
    pub on_left: Option<OnFrameSent>,
    /// Objects that could not be rendered.
    absent: Absent,
}

impl Telemetry {
    pub fn new(emulator: &Emulator) -> Telemetry {
        Telemetry {
            counters: Counters::default(),
            missed: 0,
            rejected_records: emulator.rejected_records(),
            stats: RunStats::default(),
            metrics: None,
            published: None,
            on_left: None,
            absent: Absent::default(),
        }
    }

    /// Counts an exposure that has no frame.
    pub fn miss(&mut self, due: &Due) {
        add(&mut self.missed, 1);
        self.miss_trigger(due);
    }

    /// Counts the Trigger of an exposure that has no frame, if there is one.
    pub fn miss_trigger(&mut self, due: &Due) {
        let is_triggered = u32::from(due.trigger > 0);
        add(&mut self.counters.triggers_missed, is_triggered);
    }

    /// Counts Triggers that were dropped before their exposures.
    pub fn miss_dropped_triggers(&mut self, count: u32) {
        add(&mut self.missed, count);
        add(&mut self.counters.triggers_missed, count);
    }

    /// Counts a rendered frame.
    pub fn rendered(&mut self, exposed: &ExposedFrame, is_coarsened: bool) {
        let coarsened = u32::from(is_coarsened);
        add(&mut self.counters.frames_rendered, 1);
        add(&mut self.counters.frames_coarsened, coarsened);
        self.stats.add(exposed);
        add(&mut self.stats.coarsened, coarsened);
        self.absent.report(exposed);
    }

    /// Exposures without a frame, with those that the clock skipped.
    pub fn missed(&self, skipped: u32) -> u32 {
        skipped.wrapping_add(self.missed)
    }

    /// All counters but those of the links.
    pub fn counters(&self, skipped: u32) -> Counters {
        Counters {
            exposures_missed: self.missed(skipped),
            objects_without_state: self.absent.count,
            rejected_records: self.rejected_records,
            ..self.counters
        }
    }

    /// Whether a publication for `/metrics` is due.
    pub fn is_publication_due(&self, now: Instant) -> bool {
        let is_recent = |at| now.saturating_duration_since(at) < PUBLISH_INTERVAL;
        self.metrics.is_some() && !self.published.is_some_and(is_recent)
    }

    /// Publishes a snapshot for `/metrics`.
    pub fn publish(&mut self, snapshot: Snapshot, now: Instant) {
        if let Some(metrics) = &self.metrics {
            metrics.publish(snapshot);
        }
        self.published = Some(now);
    }

    /// Counts a frame that has left, or never will, and calls the observer.
    pub fn frame_left(&mut self, left: &SentFrame) {
        let is_missed = u32::from(left.times.spare_s < 0.0);
        add(&mut self.counters.deadlines_missed, is_missed);
        if let Some(on_left) = &mut self.on_left {
            on_left(left);
        }
    }
}
