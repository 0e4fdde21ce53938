//! What the settings of a run come to: whether its frames can leave as it asks, and how many are on their way at once.

use super::channel::Channel;
use super::overrun::Overrun;
use super::{Server, budget, clock};
use skyloop_base::range::nearest;
use skyloop_config::{Clock as Kind, OnOverrun, Run};
use skyloop_render::camera::RATE_HZ;

/// Frames that are on their way over a link at most: one that is sent, and one that waits, the newest.
const UNDER_WAY: usize = 2;
/// Frames that a device may hold back besides, by its delay.
const HELD_BACK: usize = 16;

impl Server {
    /// Keeps time and deals with attitudes as `run` says, and does what it says where a frame would be late: by the tolerances that the
    /// emulator has now, and coarser ones.
    pub fn set_run(&mut self, run: &Run) {
        let rate_hz = self.settings.camera.rate_hz;
        self.clock = clock::of(self.kind, run, rate_hz);
        (self.staleness, self.out_of_order) = (run.staleness, run.out_of_order);
        let (overrun, idle) = Overrun::new(run.on_overrun, self.fidelity, &run.coarsen);
        self.overrun = overrun;
        if let Some(emulator) = &mut self.emulator {
            emulator.work_limit_s = Some(run.work_limit_s);
        }
        // Of the run once.
        for step in idle.iter().filter(|_| !self.is_led) {
            tracing::warn!(
                "run.coarsen: {step} makes nothing coarser than what stands before it, the run's `fidelity` first, and is passed over; leave it out, or name what is coarser"
            );
        }
        let stays = run.on_overrun == OnOverrun::Coarsen && self.overrun.fidelity(1).is_none();
        if stays && !self.is_led {
            tracing::warn!(
                "run.on_overrun = \"coarsen\": none of `run.coarsen` makes frames coarser, so that those which would be late come late; name knobs such as \"wing_e = 1\""
            );
        }
        if self.kind == Kind::Stepped {
            let idle = run.idle_in_step().join(", ");
            if !idle.is_empty() && !self.is_led {
                tracing::warn!(
                    "{idle}: no meaning by the stepped clock, where frames leave as they are made and none is late; leave that out, or set run.clock"
                );
            }
            return;
        }
        self.delay = run.delay;
        if let Some(why) = self.never_in_time(run.latency_s.unwrap_or(1.0 / rate_hz)) {
            tracing::warn!("{why}; set run.latency_s above it");
        }
    }

    /// Why no frame leaves by a deadline so long (s) after its exposure's end, if the device holds each of them back until then.
    pub(super) fn never_in_time(&self, latency_s: f64) -> Option<String> {
        let delay_s = self.delay.delay_s;
        let left_out = match self.overrun.leaves_out() {
            true => ", so that run.on_overrun = \"drop\" leaves all of them out",
            false => "",
        };
        (delay_s >= latency_s).then(|| {
            format!(
                "run.delay_s = {delay_s}: no frame leaves before its deadline, {latency_s} s after its exposure's end{left_out}"
            )
        })
    }

    /// Whether the configured output leaves at the camera's rate, and the device's delay holds no more frames back than it may; else what is
    /// too slow. In step there is time.
    pub fn fits(&self) -> Result<(), String> {
        let camera = &self.settings.camera;
        self.may_hold_back(camera.rate_hz)
            .map_err(|why| format!("{why}, or lower timing.rate_hz"))?;
        for Channel { wire, roles, .. } in &self.channels {
            if self.kind != Kind::Stepped {
                budget::fits(wire, *roles, camera, &self.output, camera.rate_hz)
                    .map_err(|why| format!("link {}: {why}", wire.address))?;
            }
        }
        Ok(())
    }

    /// Frames that the device holds back at a rate, by its delay.
    fn held_back(&self, rate_hz: f64) -> f64 {
        (self.delay.delay_s + self.delay.jitter_s) * nearest(rate_hz, RATE_HZ)
    }

    /// Whether the device holds no more frames back at a rate than it may; else why not.
    pub(super) fn may_hold_back(&self, rate_hz: f64) -> Result<(), String> {
        let held_back = self.held_back(rate_hz);
        if held_back <= HELD_BACK as f64 {
            return Ok(());
        }
        Err(format!(
            "run.delay_s and run.jitter_s: {} s at {rate_hz} Hz hold back {held_back:.0} frames: at most {HELD_BACK}; shorten them",
            self.delay.delay_s + self.delay.jitter_s
        ))
    }

    /// Frames that are on their way over a link at most.
    pub(super) fn most_under_way(&mut self) -> usize {
        // Triggers come at any rate.
        match self.clock.cadence() {
            Some(_) => self.usually_under_way(),
            None => UNDER_WAY + HELD_BACK,
        }
    }

    /// Likewise, where they come at the camera's rate.
    fn usually_under_way(&self) -> usize {
        let held_back = self.held_back(self.settings.camera.rate_hz).ceil() as usize;
        UNDER_WAY + held_back.min(HELD_BACK)
    }

    /// Frames that there may be beside the one that is made, and so are: each link may be about another. In step there is none.
    pub(super) fn most_kept(&self) -> usize {
        let links = self.channels.iter();
        let links = links.filter(|channel| channel.roles.bring_frames()).count();
        match self.kind {
            Kind::Stepped => 0,
            Kind::Wall | Kind::External => self.usually_under_way() + links.saturating_sub(1),
        }
    }
}
