//! By the client's clock: its attitudes and triggers tell the time, and exposures are made at the camera's cadence of that time, or at triggers.

use super::discipline::{Correction, Discipline};
use super::{Asked, Cadence, Clock, Due, Heard, MAX_WAITING, Sync, full};
use crate::camera::Camera;
use crate::serve::Latched;
use crate::serve::receive::Refusal;
use hifitime::Epoch;
use skyloop_orbit::time::seconds;
use skyloop_protocols::{Mode, Reason, SyncState};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How far ahead of the client's time a Trigger may ask, s: what lies further ahead would hold a place for nothing.
const MAX_AHEAD_S: f64 = 86_400.0;

/// A cadence by the client's time.
pub(super) struct External {
    cadence: Cadence,
    discipline: Discipline,
    /// When the client's time was last heard.
    heard: Option<Instant>,
    /// After this silence it is no longer followed.
    holdover: Duration,
    /// Triggers that wait for the end of their exposures, the first to end first; none where they ask for nothing.
    triggers: Option<Vec<Asked>>,
}

impl External {
    pub fn new(cadence: Cadence, packets: bool, holdover: Duration) -> External {
        External {
            cadence,
            discipline: Discipline::default(),
            heard: None,
            holdover,
            triggers: packets.then(Vec::new),
        }
    }

    /// When the exposure of a trigger has ended.
    fn end_of(&self, asked: &Asked) -> Option<Instant> {
        let end = asked.start + seconds(asked.camera.exposure_s);
        self.cadence.instant_of(end)
    }
}

impl Clock for External {
    fn mode(&self) -> Mode {
        Mode::External
    }

    fn cadence(&mut self) -> Option<&mut Cadence> {
        self.triggers.is_none().then_some(&mut self.cadence)
    }

    fn latched(&mut self, _: &Latched, _: &Arc<Camera>) {}

    fn hear(&mut self, told: Epoch, arrived: Instant) -> Heard {
        self.heard = Some(arrived);
        let own = self.cadence.scene_at(arrived);
        let Some(own) = own.filter(|_| !self.cadence.awaits_time()) else {
            self.discipline = Discipline::default();
            self.cadence.start(told, arrived);
            return Heard::Fits;
        };
        match self.discipline.hear(told, own) {
            Correction::Slew(ahead_s) => {
                self.cadence.set_ahead(ahead_s);
                Heard::Fits
            }
            Correction::Doubt(ahead_s) => Heard::Doubted(ahead_s),
            Correction::Jump => {
                self.cadence.start(told, arrived);
                Heard::Jumped
            }
        }
    }

    fn forget(&mut self) -> u32 {
        let waiting = self.triggers.as_mut();
        waiting.map_or(0, |waiting| waiting.drain(..).count() as u32)
    }

    fn triggered(&mut self, asked: Asked) -> Result<(), Refusal> {
        let Some(waiting) = &mut self.triggers else {
            return Err(super::no_triggers());
        };
        if waiting.len() >= MAX_WAITING {
            return Err(full("triggers"));
        }
        let now = self.cadence.scene_at(asked.arrived);
        let ahead_s = now.map_or(0.0, |now| (asked.start - now).to_seconds());
        if ahead_s > MAX_AHEAD_S {
            return Err(Refusal {
                reason: Reason::ValueOutOfRange,
                detail: format!(
                    "Trigger.start: {ahead_s:.0} s ahead of the client's clock, at most {MAX_AHEAD_S} s; send it nearer to its time"
                ),
            });
        }
        let ends = |asked: &Asked| asked.start + seconds(asked.camera.exposure_s);
        let end = ends(&asked);
        let at = waiting.partition_point(|other| ends(other) <= end);
        waiting.insert(at, asked);
        Ok(())
    }

    fn until_due(&self, now: Instant) -> Option<Duration> {
        match &self.triggers {
            None => Some(self.cadence.until_due(now)),
            Some(waiting) => {
                let end = self.end_of(waiting.first()?)?;
                Some(end.saturating_duration_since(now))
            }
        }
    }

    fn take_due(&mut self, camera: &Camera, now: Instant) -> Option<Due> {
        let Some(waiting) = &self.triggers else {
            return self.cadence.take_due(camera.exposure_s, now);
        };
        let first = waiting.first()?;
        let end = self.end_of(first).filter(|end| *end <= now)?;
        // A trigger that comes after the end of its exposure could be answered from then on.
        let end = end.max(first.arrived);
        let latency = self.cadence.latency();
        let asked = self.triggers.as_mut()?.remove(0);
        Some(Due {
            mid: asked.start + seconds(asked.camera.exposure_s / 2.0),
            end,
            deadline: Some(end + latency),
            trigger: asked.number,
            latched: None,
            camera: Some(asked.camera),
        })
    }

    fn end(&mut self, now: Instant) -> u32 {
        if self.triggers.is_none() {
            self.cadence.end(now);
        }
        self.forget()
    }

    fn missed(&self) -> u32 {
        // Where triggers ask for frames the cadence tells the time, and no exposures are due by it.
        match self.triggers {
            None => self.cadence.missed,
            Some(_) => 0,
        }
    }

    fn awaits_time(&self) -> bool {
        self.cadence.awaits_time()
    }

    fn pause(&mut self, now: Instant) {
        self.cadence.pause(now);
    }

    fn is_paused(&self) -> bool {
        self.cadence.is_paused()
    }

    fn resume(&mut self, now: Instant) {
        self.cadence.resume(now);
        // They have waited for this, and for nothing of ours.
        for asked in self.triggers.iter_mut().flatten() {
            asked.arrived = asked.arrived.max(now);
        }
    }

    fn clear(&mut self, rate_hz: f64, now: Instant) -> u32 {
        let waited = self.end(now);
        self.cadence.clear(rate_hz, now);
        (self.discipline, self.heard) = (Discipline::default(), None);
        waited
    }

    fn sync(&self, now: Instant) -> Sync {
        let state = match self.heard {
            None => SyncState::Waiting,
            Some(heard) if now.saturating_duration_since(heard) <= self.holdover => {
                SyncState::Locked
            }
            Some(_) => SyncState::Holdover,
        };
        Sync {
            state,
            offset_s: self.discipline.offset_s(),
        }
    }
}
