//! An exposure that is due becomes a frame that is asked for, and what is told of that becomes a picture.

use super::channel::Channel;
use super::clock::Due;
use super::history::Pointing;
use super::latch::tellable;
use super::overrun::Verdict;
use super::picture::{Asked, Picture};
use super::shooter::{Order, Progress, Shooter, Spare, Task};
use super::withheld::{LEFT_OUT, NO_ATTITUDE, RUN_ENDED};
use super::{POLL, Server, add};
use crate::stats::Request;
use skyloop_base::abort::Abort;
use skyloop_config::Clock as Kind;
use skyloop_link::LinkError;
use skyloop_protocols::{AttitudeSource, PixelLevel};
use skyloop_render::engine::Shot;
use skyloop_render::scene::Exposure;
use std::time::{Duration, Instant};

impl Server {
    /// Time until an exposure is due that can be made, or somewhat less.
    pub(super) fn until_due(&self, limit: Option<u32>) -> Duration {
        if !self.is_free(limit) {
            return POLL;
        }
        let due = self.clock.until_due(Instant::now());
        due.map_or(POLL, |due| due.min(POLL))
    }

    /// Whether another frame may be asked for.
    fn is_free(&self, limit: Option<u32>) -> bool {
        // In step one frame is made and sent after the other.
        let in_step = self.kind != Kind::Stepped || self.pictures.is_empty();
        self.making.is_none() && in_step && limit.is_none_or(|most| self.stats.frames < most)
    }

    /// Asks for the frame of an exposure that is due; whether there was one.
    pub(super) fn expose(
        &mut self,
        shooter: &Shooter,
        limit: Option<u32>,
    ) -> Result<bool, LinkError> {
        if !self.is_free(limit) {
            return Ok(false);
        }
        let now = Instant::now();
        let camera = self.settings.camera.clone();
        let Some(due) = self.clock.take_due(&camera, now) else {
            return Ok(false);
        };
        let camera = due.camera.clone().unwrap_or(camera);
        let exposure = Exposure::around(due.mid, camera.exposure_s);
        let pointing = match &due.latched {
            Some(latched) => Some(Pointing {
                vehicle: latched.vehicle.clone(),
                message: latched.clone(),
                source: AttitudeSource::Exact,
                age_s: 0.0,
            }),
            None => self.truth.history.over(&exposure, &self.staleness),
        };
        let request = Request::default();
        let Some(pointing) = pointing else {
            self.fail(request, NO_ATTITUDE);
            self.miss(&due);
            return Ok(true);
        };
        if let Err(why) = tellable(&exposure) {
            let message = (pointing.message.number, pointing.message.header);
            self.refuse_later(Some(request), message, &due, &why)?;
            return Ok(true);
        }
        let spare = due
            .deadline
            .map(|deadline| deadline.saturating_duration_since(now));
        // Nobody foresees the jitter.
        let foreseen = due.end + Duration::from_secs_f64(self.delay.delay_s);
        let held = foreseen.saturating_duration_since(now);
        let Verdict::Shoot { level, overrun } = self.overrun.decide(spare, held) else {
            self.fail(request, LEFT_OUT);
            self.miss(&due);
            self.stats.dropped = self.overrun.dropped;
            return Ok(true);
        };
        let repeat = self.show(&pointing, due.latched.is_some());
        let in_step = self.kind == Kind::Stepped;
        let number = self.next_frame;
        let release = due.end + self.delay.of(self.camera, number);
        // By the jitter, which nothing could be done about.
        let is_late = due.deadline.is_some_and(|deadline| release > deadline);
        let overrun = if is_late { Some("late") } else { overrun };
        let order = Order {
            number,
            camera,
            vehicle: pointing.vehicle,
            repeat,
            fidelity: self.overrun.fidelity(level),
            overrun,
            streams: !in_step && self.wants_rows(),
            abort: Abort::default(),
            coarser: self.overrun.coarser_than(level),
        };
        self.abort = order.abort.clone();
        let asked = Asked {
            release,
            due,
            header: pointing.message.header,
            arrived: pointing.message.arrived,
            message: pointing.message.number,
            source: pointing.source,
            age_s: pointing.age_s,
            out_of_order: pointing.message.out_of_order,
            sync: self.sync(now),
            level,
            overrun,
            is_timed: !in_step,
        };
        let digits = std::mem::take(&mut self.digits);
        let picture = Picture::new(request, number, asked, digits);
        self.pictures.push(picture);
        self.makes(Some(number));
        if !shooter.give(Task::Make(Box::new(order))) {
            tracing::error!("the renderer's thread has ended");
        }
        Ok(true)
    }

    /// An exposure has no frame.
    pub(super) fn miss(&mut self, due: &Due) {
        add(&mut self.missed, 1);
        self.miss_trigger(due);
    }

    /// Counts the Trigger of an exposure that has no frame, if one asked for it.
    fn miss_trigger(&mut self, due: &Due) {
        add(
            &mut self.counters.triggers_missed,
            u32::from(due.trigger > 0),
        );
    }

    /// Books the attitude that a frame shows; how many frames were made of it before: in step none, each asks for its own.
    fn show(&mut self, pointing: &Pointing, asks: bool) -> u32 {
        let (stale, future) = match pointing.source {
            AttitudeSource::Future => (0, 1),
            AttitudeSource::Held | AttitudeSource::Invalid if pointing.age_s < 0.0 => (0, 1),
            AttitudeSource::Stale | AttitudeSource::Held | AttitudeSource::Invalid => (1, 0),
            _ => (0, 0),
        };
        add(&mut self.counters.attitudes_stale, stale);
        add(&mut self.counters.attitudes_future, future);
        let number = pointing.message.number;
        let repeat = match self.truth.shown {
            Some((shown, frames)) if shown == number && !asks => frames.wrapping_add(1),
            _ => 0,
        };
        self.truth.shown = Some((number, repeat));
        repeat
    }

    /// Whether somebody gets rows of pixels as they are.
    pub(super) fn wants_rows(&self) -> bool {
        self.channels.iter().any(|channel| {
            let output = &channel.exchange.output;
            channel.roles.pixels && output.pixels == PixelLevel::Frame
        })
    }

    /// What the renderer tells.
    pub(super) fn learn(&mut self, news: Progress, spare: &Spare) -> Result<(), LinkError> {
        let Some(number) = self.making else {
            return Ok(());
        };
        let mut pictures = self.pictures.iter();
        let Some(at) = pictures.position(|picture| picture.number == number) else {
            return Ok(());
        };
        let picture = &mut self.pictures[at];
        match news {
            Progress::Coarsened => {
                picture.asked.level += 1;
                picture.asked.overrun = Some("coarsen");
            }
            // It was complete, or refused, before the renderer saw that it is cancelled.
            Progress::Made(shot, ..) if self.abort.is_set() => {
                self.kept.keep(shot);
                self.abandon_picture(at);
            }
            Progress::Failed(_) if self.abort.is_set() => self.abandon_picture(at),
            Progress::Abandoned => self.abandon_picture(at),
            Progress::Labelled(opening) => {
                picture.opening = Some(opening);
                self.begin(number);
            }
            Progress::Developed(first, digits, at) => picture.develop(first, digits, at, spare),
            Progress::Made(shot, at, took) => {
                self.overrun.learn(picture.asked.level, took);
                let coarsened = u32::from(picture.asked.level > 0);
                add(&mut self.counters.frames_rendered, 1);
                add(&mut self.counters.frames_coarsened, coarsened);
                self.stats.add(&shot);
                add(&mut self.stats.coarsened, coarsened);
                self.absent.report(&shot);
                self.digits = picture.complete(shot, at);
                self.makes(None);
                add(&mut self.next_frame, 1);
                self.begin(number);
            }
            Progress::Failed(why) => {
                let picture = self.pictures.remove(at);
                self.makes(None);
                let message = (picture.asked.message, picture.asked.header);
                self.refuse_later(picture.request, message, &picture.asked.due, &why)?;
            }
        }
        Ok(())
    }

    /// The frame that was made is given up. It has a number, however far it came.
    pub(super) fn abandon_picture(&mut self, at: usize) {
        // While it has a picture: a frame that did not leave whole for its client has missed its deadline.
        self.end_unwanted(self.pictures[at].number);
        let picture = self.pictures.remove(at);
        if let Some(request) = picture.request {
            self.fail(request, RUN_ENDED);
        }
        self.miss_trigger(&picture.asked.due);
        self.makes(None);
        add(&mut self.next_frame, 1);
        add(&mut self.counters.frames_abandoned, 1);
    }

    /// Cancels the frame that is made if nobody gets it.
    pub(super) fn cancel_unwanted(&mut self) {
        let Some(number) = self.making else { return };
        let is_begun = |picture: &Picture| picture.number == number && picture.request.is_none();
        let is_wanted = |channel: &Channel| channel.awaits(number);
        if self.pictures.iter().any(is_begun) && !self.channels.iter().any(is_wanted) {
            self.abort.set();
        }
    }

    /// Frames that are on their way nowhere any more are done with; whether there was one.
    pub(super) fn settle(&mut self, shooter: &Shooter, on_shot: &mut impl FnMut(&Shot)) -> bool {
        self.see_leave();
        let mut any = false;
        while let Some(at) = self.pictures.iter().position(|picture| {
            picture.request.is_none() && picture.open == 0 && picture.shot.is_some()
        }) {
            any = true;
            let picture = self.pictures.remove(at);
            if picture.whole {
                self.note_delivered(picture.number);
                add(&mut self.counters.frames_delivered, 1);
            } else {
                add(&mut self.counters.frames_abandoned, 1);
            }
            let Some(shot) = picture.into_shot() else {
                continue;
            };
            on_shot(&shot);
            self.kept.keep(shot);
        }
        let most = self.most_kept();
        while let Some(shot) = self.kept.spare(self.pictures.len(), most) {
            // A thread that has ended needs no memory.
            let _ = shooter.give(Task::Recycle(shot));
        }
        any
    }
}
