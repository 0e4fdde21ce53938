//! The live run: packets from the wire become vehicle states, shots become packets.
//!
//! One thread: receive, latch, shoot, deliver. While a frame waits for credit or room in the link's queue,
//! packets are still received, so commands and attitudes are never left lying.

mod answer;
mod budget;
mod channel;
mod clock;
mod cut;
mod deliver;
mod latch;
mod obey;
mod overrun;
mod packed;
mod receive;
mod select;

use crate::attitude::VehicleState;
use crate::camera::Camera;
use crate::config::{Clock, OnOverrun, Run};
use crate::engine::{Emulator, Shot};
use crate::link::{LinkError, Roles, Standstill, Wire};
use crate::scene::Exposure;
use crate::stats::{Absent, RunStats};
use channel::Channel;
use clock::WallClock;
use latch::tellable;
use overrun::{Overrun, Verdict};
use skyloop_protocols::{Counters, Header, Output, Personality};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Attitudes that may wait for their frame in stepped mode; more are refused as busy.
const MAX_WAITING: usize = 64;
/// How long a pause lasts in which nothing is due but a packet may come.
const POLL: Duration = Duration::from_millis(50);
/// How long the end of a run waits for a client that takes nothing. A pseudo-terminal lets 4 KiB pass at once:
/// 4.3 s for a client that reads at the pace of 9600 baud.
const GIVE_UP: Duration = Duration::from_secs(5);

/// An attitude that has been accepted.
#[derive(Debug, Clone)]
struct Latched {
    vehicle: VehicleState,
    /// As it was set when the attitude came (stepped), or as it is now (wall clock).
    camera: Arc<Camera>,
    header: Header,
    arrived: Instant,
}

/// What the link of the truth has brought.
#[derive(Debug, Default)]
struct Truth {
    /// Attitudes that wait for their frame (stepped).
    waiting: VecDeque<Latched>,
    /// The last attitude accepted.
    latest: Option<Latched>,
    /// Frames made of it so far (wall clock).
    repeat: u32,
    /// Whether it has been refused since (wall clock).
    refused: bool,
}

/// The emulator at its links.
pub struct Server {
    emulator: Emulator,
    channels: Vec<Channel>,
    /// What frames bring until a client says otherwise.
    output: Output,
    personality: &'static Personality,
    clock: Clock,
    wall: WallClock,
    overrun: Overrun,
    truth: Truth,
    counters: Counters,
    /// What the run measured.
    pub stats: RunStats,
    /// Objects that could not be shown.
    absent: Absent,
}

/// How a run came to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It was stopped, or has made its frames.
    AsAsked,
    /// The other end of the link has gone for good.
    LinkGone,
}

/// Why a frame did not reach its client whole.
enum Undelivered {
    /// Reset, another client, the run's end, or a client that takes nothing any more.
    Abandoned,
    /// The link is gone.
    Link(LinkError),
}

impl Server {
    /// Puts `emulator` at its links; frames bring `output` until a client says otherwise.
    pub fn new(
        emulator: Emulator,
        links: impl IntoIterator<Item = (Wire, Roles)>,
        output: Output,
        clock: Clock,
        personality: &'static Personality,
    ) -> Server {
        let wall = WallClock::new(emulator.camera().rate_hz);
        let links = links.into_iter();
        Server {
            overrun: Overrun::new(OnOverrun::Late, *emulator.fidelity(), &[]).0,
            emulator,
            channels: links
                .map(|(wire, roles)| Channel::new(wire, roles, output))
                .collect(),
            output,
            personality,
            clock,
            wall,
            truth: Truth::default(),
            counters: Counters::default(),
            stats: RunStats::default(),
            absent: Absent::default(),
        }
    }

    /// Does what `run` says where a frame would be late by the wall clock; by the tolerances that the emulator has now, and coarser ones.
    pub fn set_overrun(&mut self, run: &Run) {
        let fidelity = *self.emulator.fidelity();
        let (overrun, idle) = Overrun::new(run.on_overrun, fidelity, &run.coarsen);
        self.overrun = overrun;
        for step in idle {
            tracing::warn!(
                "run.coarsen: {step} makes nothing coarser than what stands before it, the run's `fidelity` first, and is passed over; leave it out, or name what is coarser"
            );
        }
        if run.on_overrun == OnOverrun::Coarsen && self.overrun.fidelity(1).is_none() {
            tracing::warn!(
                "run.on_overrun = \"coarsen\": none of `run.coarsen` makes frames coarser, so that those which would be late come late; name knobs such as \"wing_e = 1\""
            );
        }
    }

    /// Where the emulator listens, link by link.
    pub fn addresses(&self) -> Vec<String> {
        let addresses = self.channels.iter();
        addresses
            .map(|channel| channel.wire.address.clone())
            .collect()
    }

    /// How long each level of output takes, of each link that limits it.
    pub fn levels(&self) -> String {
        let camera = self.emulator.camera();
        let mut text = String::new();
        for Channel { wire, roles, .. } in &self.channels {
            let table = budget::table(wire, *roles, &camera, &self.output);
            if !table.is_empty() {
                text += &format!("a frame over {} takes\n{table}", wire.address);
            }
        }
        text
    }

    /// Whether the configured output leaves at the camera's rate, by the wall clock; else which link is too slow.
    pub fn fits(&self) -> Result<(), String> {
        let camera = self.emulator.camera();
        for Channel { wire, roles, .. } in &self.channels {
            if self.clock == Clock::Wall {
                budget::fits(wire, *roles, &camera, &self.output, camera.rate_hz)
                    .map_err(|why| format!("link {}: {why}", wire.address))?;
            }
        }
        Ok(())
    }

    /// The address of the link that has ended.
    pub fn gone(&self) -> Option<&str> {
        let gone = self.channels.iter().find(|channel| channel.gone);
        Some(&gone?.wire.address)
    }

    /// Serves until `stop` is set or `limit` frames are made; `on_shot` sees each after its delivery. The next is made in its memory.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_shot: impl FnMut(&Shot),
    ) -> Ended {
        let ended = self.serve(stop, limit, on_shot);
        self.abandon_waiting();
        self.wall.end(Instant::now());
        // That a link has ended is noticed by whoever uses it first: what receives, or what sends.
        ended.unwrap_or_else(|error| {
            tracing::debug!(%error, "nothing can be sent any more");
            Ended::LinkGone
        })
    }

    fn serve(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        mut on_shot: impl FnMut(&Shot),
    ) -> Result<Ended, LinkError> {
        for channel in &self.channels {
            channel.wire.inbox.unparks(std::thread::current());
        }
        while !stop.load(Ordering::Relaxed) && limit.is_none_or(|n| self.stats.frames < n) {
            // Frames may fall due without a pause: commands and attitudes still come first.
            if !self.receive_waiting()? {
                return Ok(Ended::LinkGone);
            }
            let due = match self.clock {
                Clock::Stepped => self
                    .truth
                    .waiting
                    .pop_front()
                    .map(|latched| (latched.vehicle.clone(), latched, 0, 0)),
                Clock::Wall => self.due_on_the_wall(),
            };
            let Some((vehicle, latched, repeat, level)) = due else {
                let pause = match self.clock {
                    Clock::Stepped => POLL,
                    Clock::Wall => self.wall.until_due(Instant::now()).min(POLL),
                };
                if !self.receive(pause)? {
                    return Ok(Ended::LinkGone);
                }
                continue;
            };
            let shot = match self.shoot(&latched, &vehicle, repeat) {
                Ok(shot) => shot,
                Err(why) => {
                    self.refuse_later(self.truth_channel(), &latched.header, &why)?;
                    continue;
                }
            };
            self.overrun.learn(level, shot.render_time);
            let late = self.clock == Clock::Wall && self.wall.is_late(Instant::now());
            self.stats.late += u32::from(late);
            self.counters.frames_rendered = self.counters.frames_rendered.wrapping_add(1);
            self.stats.add(&shot);
            self.absent.report(&shot);
            let counter = match self.deliver(&shot, stop) {
                Ok(()) => {
                    // Later frames of one attitude answer the clock.
                    if repeat == 0 {
                        self.stats.answer.add(latched.arrived.elapsed());
                    }
                    &mut self.counters.frames_delivered
                }
                Err(Undelivered::Abandoned) => &mut self.counters.frames_abandoned,
                Err(Undelivered::Link(error)) => {
                    let counter = &mut self.counters.frames_abandoned;
                    *counter = counter.wrapping_add(1);
                    return Err(error);
                }
            };
            *counter = counter.wrapping_add(1);
            on_shot(&shot);
            self.emulator.recycle(shot.frame);
        }
        Ok(Ended::AsAsked)
    }

    fn shoot(&mut self, latched: &Latched, vehicle: &VehicleState, n: u32) -> Result<Shot, String> {
        // By the wall clock the vehicle has been carried on since it was latched.
        tellable(&Exposure::around(vehicle.epoch, latched.camera.exposure_s))?;
        let shot = self.emulator.shoot_with(&latched.camera, vehicle, n);
        shot.map_err(|error| error.to_string())
    }

    /// The vehicle carried to the exposure whose end has come, how many frames its attitude made before, and by which level of tolerances it is
    /// rendered; none where it is left out.
    fn due_on_the_wall(&mut self) -> Option<(VehicleState, Latched, u32, usize)> {
        let mut latched = self.truth.latest.clone()?;
        latched.camera = self.emulator.camera();
        let mid = self
            .wall
            .take_due(latched.camera.exposure_s, Instant::now())?;
        let Verdict::Shoot { level, overrun } =
            self.overrun.decide(self.wall.spare(Instant::now()))
        else {
            self.wall.missed = self.wall.missed.wrapping_add(1);
            self.stats.dropped = self.overrun.dropped;
            return None;
        };
        if let Some(fidelity) = self.overrun.fidelity(level) {
            self.emulator.set_fidelity(fidelity);
        }
        self.emulator.overrun = overrun;
        let repeat = self.truth.repeat;
        self.truth.repeat = repeat.wrapping_add(1);
        Some((latched.vehicle.at(mid), latched, repeat, level))
    }

    /// The link that brings the truth.
    fn truth_channel(&self) -> usize {
        let truth = self.channels.iter().position(|channel| channel.roles.truth);
        truth.unwrap_or(0)
    }

    /// Ends the links when everything queued has left, or nothing moves for 5 s; then tells what the run measured
    /// and counted.
    pub fn close(mut self) -> (RunStats, Counters) {
        for channel in &mut self.channels {
            let mut standstill = Standstill::of(&channel.wire.tally, GIVE_UP);
            while let Ok(false) = channel.flush()
                && !standstill.is_over()
            {}
            channel.lose_answers();
            channel.wire.close(standstill);
        }
        let counters = self.counters();
        (self.stats, counters)
    }

    /// All counts, the links' among them.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters {
            exposures_missed: self.wall.missed,
            objects_without_state: self.absent.count,
            rejected_records: self.emulator.rejected_records(),
            ..self.counters
        };
        for channel in &self.channels {
            channel.wire.tally.add_to(&mut counters);
            counters.lost_outbound = counters.lost_outbound.wrapping_add(channel.lost);
        }
        counters
    }
}
