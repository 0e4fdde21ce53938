//! Frames whose last packet is in a link's queue: when it leaves, the frame's times are known, of that link. A client that takes nothing spoils no other's figures.

use super::channel::Channel;
use super::picture::Picture;
use super::withheld::of_unsent;
use super::{Server, add};
use crate::metrics::Snapshot;
use crate::stats::Pending;
use crate::timing::FrameTimes;
use skyloop_link::{Exit, Mark, QUEUE, Unsent};
use skyloop_orbit::time::utc_days_since_j2000;
use skyloop_render::scene::Exposure;
use std::time::{Duration, Instant};

/// Frames of each link whose times are waited for at most: as many as its queue may hold.
const MOST: usize = QUEUE;
/// Between two looks at the figures of a run.
const LOOK: Duration = Duration::from_millis(100);

/// A frame that has left, or never will.
#[derive(Debug, Clone, Copy)]
pub struct Left {
    /// Its times.
    pub times: FrameTimes,
    /// What they count from.
    pub trigger: Instant,
    /// When it was late; none: never.
    pub deadline: Option<Instant>,
    /// Exposures without a frame until then.
    pub missed: u32,
    /// When it was exposed, where that is known.
    pub exposure: Option<Exposure>,
}

/// A frame that leaves a link.
pub(super) struct Leaving {
    /// Its times but those of its end.
    left: Left,
    /// When all of it could have left.
    ready: Duration,
    /// The link.
    at: usize,
    /// The place of its last packet in the link's queue, and its entry in the link's account; none: it was not put there whole.
    queued: Option<(Mark, Pending)>,
    /// The exchange of its client.
    exchange: u32,
    /// Whether the frame was counted as delivered.
    is_delivered: bool,
}

impl Leaving {
    pub fn of(
        picture: &Picture,
        at: usize,
        exchange: u32,
        queued: Option<(Mark, Pending)>,
    ) -> Leaving {
        let last_pixel = picture.since_trigger(picture.last_pixel);
        Leaving {
            left: Left {
                times: FrameTimes {
                    attitude_age_s: picture.asked.age_s,
                    first_pixel: picture.since_trigger(picture.first_pixel),
                    last_pixel,
                    first_octet: picture.since_trigger(picture.first_octet),
                    ..FrameTimes::incomplete(picture.number)
                },
                trigger: picture.trigger(),
                deadline: picture.asked.due.deadline,
                missed: 0,
                exposure: picture.opening.as_ref().map(|opening| opening.exposure),
            },
            ready: last_pixel.max(picture.since_trigger(Some(picture.asked.release))),
            at,
            exchange,
            queued,
            is_delivered: false,
        }
    }
}

impl Server {
    /// Books the frames that have left their links.
    pub(super) fn see_leave(&mut self) {
        // Of too many the oldest is taken for one that never leaves.
        if self.leaving.len() > MOST * self.channels.len() {
            let oldest = self.leaving.remove(0);
            if let (Some((mark, _)), Some(channel)) = (&oldest.queued, self.channels.get(oldest.at))
            {
                channel.wire.tally.departed.forget(*mark);
            }
            self.book(oldest, None);
        }
        let mut at = 0;
        while let Some(leaving) = self.leaving.get(at) {
            let departed = self.channels.get(leaving.at);
            let departed = departed.map(|channel| &channel.wire.tally.departed);
            let mark = leaving.queued.as_ref().map(|(mark, _)| *mark);
            let exit = mark.map(|mark| departed.and_then(|d| d.left(mark)));
            match exit {
                Some(None) => at += 1,
                exit => {
                    let leaving = self.leaving.remove(at);
                    self.book(leaving, exit.flatten());
                }
            }
        }
    }

    /// Withholds a frame that was put into its link's queue and did not leave it whole, because of `lost` where that is known.
    fn lose(&mut self, leaving: &Leaving, entry: Pending, lost: Option<Unsent>) {
        let frame = leaving.left.times.frame;
        let Some(channel) = self.channels.get_mut(leaving.at) else {
            return;
        };
        let given_up = channel.wire.tally.why_given_up();
        let lost = match lost.or(given_up) {
            _ if channel.has_gone(leaving.exchange) => Unsent::ClientGone,
            lost => lost.unwrap_or(Unsent::NotRead),
        };
        let (why, cause) = of_unsent(lost);
        channel.frames.withhold(entry, cause);
        // At the run's end the link has said so; another client has lost nothing.
        if given_up.is_none() && channel.exchange.number == leaving.exchange {
            let detail = format!("packets of frame {frame} were given up in the link's queue");
            self.report(leaving.at, why, &detail);
        }
        if leaving.is_delivered {
            self.take_back(frame);
        }
        if let Some(picture) = Picture::of(&mut self.pictures, frame) {
            picture.whole = false;
        }
    }

    /// Notes that a frame counts as delivered: packets of it may still be queued.
    pub(super) fn note_delivered(&mut self, frame: u32) {
        for leaving in &mut self.leaving {
            leaving.is_delivered |= leaving.left.times.frame == frame;
        }
    }

    /// At the end of a run: counts the frames of which packets are still queued. A fault holds them back, or their clients have not read them.
    pub(super) fn count_unsent(&mut self) {
        while !self.leaving.is_empty() {
            let leaving = self.leaving.remove(0);
            self.book(leaving, None);
        }
    }

    /// A frame that was counted as delivered has not left one of its links.
    fn take_back(&mut self, frame: u32) {
        let counters = &mut self.counters;
        counters.frames_delivered = counters.frames_delivered.wrapping_sub(1);
        add(&mut counters.frames_abandoned, 1);
        for other in &mut self.leaving {
            other.is_delivered &= other.left.times.frame != frame;
        }
    }

    /// Books a frame that has left its link; none: it never will.
    fn book(&mut self, mut leaving: Leaving, exit: Option<Exit>) {
        let mut left = leaving.left;
        let lost = exit.and_then(|exit| exit.lost);
        let last = exit.filter(|_| lost.is_none()).map(|exit| exit.at);
        if let Some((_, entry)) = leaving.queued.take() {
            if last.is_none() {
                self.lose(&leaving, entry, lost);
            } else if let Some(channel) = self.channels.get_mut(leaving.at) {
                channel.frames.deliver(entry);
            }
        }
        left.missed = self.exposures_missed();
        if let Some(last) = last {
            left.times = left.times.ended(left.trigger, left.deadline, last);
            if self.leads(leaving.at) {
                let after = left.times.last_octet.saturating_sub(leaving.ready);
                self.overrun.learn_way(after);
            }
        } else if left.deadline.is_none() {
            left.times.spare_s = f64::INFINITY;
        }
        let times = left.times;
        let is_missed = u32::from(times.spare_s < 0.0);
        add(&mut self.counters.deadlines_missed, is_missed);
        if let Some(channel) = self.channels.get_mut(leaving.at) {
            channel.latencies.add(&times);
            channel.latest = Some(left);
            if times.whole {
                channel.last = Some(left);
            }
        }
        if let Some(told) = &mut self.on_left {
            told(&left);
        }
    }

    /// Whether a link's way is the one that frames are judged by: the first that brings pixels to somebody. One that listens beside it costs them nothing.
    fn leads(&self, at: usize) -> bool {
        let channels = self.channels.iter();
        let first = |brings: fn(&Channel) -> bool| {
            let brings = |channel: &Channel| brings(channel) && channel.exchange.deaf.is_none();
            channels.clone().position(brings)
        };
        let pixels = first(|channel| channel.roles.pixels);
        pixels.or_else(|| first(|channel| channel.roles.bring_frames())) == Some(at)
    }

    /// Leaves the figures of now where they can be fetched, now and then.
    pub(super) fn publish(&mut self, now: Instant) {
        let Some(metrics) = &self.metrics else {
            return;
        };
        let is_recent = |at| now.saturating_duration_since(at) < LOOK;
        if self.looked.is_some_and(is_recent) {
            return;
        }
        let several = self.bringing().count() > 1;
        let mut links = self.bringing().map(|channel| {
            let mut snapshot = Snapshot::of(&channel.latencies);
            snapshot.link = several.then(|| channel.wire.address.clone());
            let account = self.account(channel);
            (snapshot.requested, snapshot.delivered) = (account.requested, account.delivered);
            snapshot.withheld = account.withheld.into_iter().collect();
            if let Some(Left {
                times, exposure, ..
            }) = &channel.latest
            {
                snapshot.attitude_age_s = Some(times.attitude_age_s);
                snapshot.deadline_spare_s =
                    Some(times.spare_s).filter(|spare_s| *spare_s != f64::INFINITY);
                snapshot.exposure_s = exposure.map(|exposure| {
                    // 1970-01-01 is J2000.0 less 10957.5 days.
                    let unix_s = |at| (utc_days_since_j2000(at) + 10_957.5) * 86_400.0;
                    [exposure.start, exposure.mid, exposure.end].map(unix_s)
                });
            }
            snapshot
        });
        let mut snapshot = links.next().unwrap_or_default();
        snapshot.further = links.collect();
        snapshot.counters = self.counters().iter().collect();
        let sync = self.sync(now);
        snapshot.clock_offset_s = Some(sync.offset_s);
        snapshot.sync = Some(sync.state.code());
        metrics.publish(snapshot);
        self.looked = Some(now);
    }

    /// The links that bring frames.
    pub(super) fn bringing(&self) -> impl Iterator<Item = &Channel> {
        self.channels
            .iter()
            .filter(|channel| channel.roles.bring_frames())
    }
}
