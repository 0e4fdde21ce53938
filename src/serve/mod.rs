//! The live run: packets from the wire become vehicle states, shots become packets.
//!
//! One thread: receive, latch, shoot, deliver. While a frame waits for credit or room in the link's queue,
//! packets are still received, so commands and attitudes are never left lying.

mod answer;
mod clock;
mod deliver;
mod latch;
mod obey;
mod receive;

use crate::attitude::VehicleState;
use crate::camera::Camera;
use crate::config::Clock;
use crate::engine::{Emulator, Shot};
use crate::link::{LinkError, Standstill, Wire};
use crate::scene::Exposure;
use crate::stats::{Absent, RunStats};
use bytes::Bytes;
use clock::WallClock;
use latch::tellable;
use skyloop_protocols::credit::CreditAccount;
use skyloop_protocols::sequence::{GapDetector, SequenceCounts};
use skyloop_protocols::{Counters, Header, Personality};
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

/// What one client has agreed with the emulator.
#[derive(Debug, Default)]
struct Exchange {
    number: u32,
    credit: CreditAccount,
    gaps: GapDetector,
    /// Attitudes that wait for their frame (stepped).
    waiting: VecDeque<Latched>,
    /// The last attitude accepted.
    latest: Option<Latched>,
    /// Frames made of it so far (wall clock).
    repeat: u32,
    /// Whether it has been refused since (wall clock).
    refused: bool,
    /// Counts Resets, so that a frame under way notices one.
    resets: u32,
    /// Answers for which the link has no room yet, oldest first.
    answers: VecDeque<Bytes>,
    /// Whether answers had to be dropped.
    overrun: bool,
    /// When the client asked to be released, until the link has been told.
    release: Option<Instant>,
}

/// The emulator at a wire.
pub struct Server {
    emulator: Emulator,
    wire: Wire,
    personality: &'static Personality,
    clock: Clock,
    wall: WallClock,
    exchange: Exchange,
    counts: SequenceCounts,
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
    /// Puts `emulator` at `wire`.
    pub fn new(
        emulator: Emulator,
        wire: Wire,
        clock: Clock,
        personality: &'static Personality,
    ) -> Server {
        let wall = WallClock::new(emulator.camera().rate_hz);
        Server {
            emulator,
            wire,
            personality,
            clock,
            wall,
            exchange: Exchange::default(),
            counts: SequenceCounts::new(),
            counters: Counters::default(),
            stats: RunStats::default(),
            absent: Absent::default(),
        }
    }

    /// Where the emulator listens.
    pub fn address(&self) -> &str {
        &self.wire.address
    }

    /// Serves until `stop` is set or `limit` frames are made; `on_shot` sees each after its delivery.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_shot: impl FnMut(Shot),
    ) -> Result<Ended, LinkError> {
        let ended = self.serve(stop, limit, on_shot);
        self.abandon_waiting();
        self.wall.end(Instant::now());
        ended
    }

    fn serve(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        mut on_shot: impl FnMut(Shot),
    ) -> Result<Ended, LinkError> {
        while !stop.load(Ordering::Relaxed) && limit.is_none_or(|n| self.stats.frames < n) {
            // Frames may fall due without a pause: commands and attitudes still come first.
            if !self.receive_waiting()? {
                return Ok(Ended::LinkGone);
            }
            let due = match self.clock {
                Clock::Stepped => self
                    .exchange
                    .waiting
                    .pop_front()
                    .map(|latched| (latched.vehicle.clone(), latched, 0)),
                Clock::Wall => self.due_on_the_wall(),
            };
            let Some((vehicle, latched, repeat)) = due else {
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
                    self.refuse_later(&latched.header, &why)?;
                    continue;
                }
            };
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
            on_shot(shot);
        }
        Ok(Ended::AsAsked)
    }

    fn shoot(&mut self, latched: &Latched, vehicle: &VehicleState, n: u32) -> Result<Shot, String> {
        // By the wall clock the vehicle has been carried on since it was latched.
        tellable(&Exposure::around(vehicle.epoch, latched.camera.exposure_s))?;
        let shot = self.emulator.shoot_with(&latched.camera, vehicle, n);
        shot.map_err(|error| error.to_string())
    }

    /// The vehicle carried to the exposure whose end has come, and how many frames its attitude made before.
    fn due_on_the_wall(&mut self) -> Option<(VehicleState, Latched, u32)> {
        let mut latched = self.exchange.latest.clone()?;
        latched.camera = self.emulator.camera();
        let mid = self
            .wall
            .take_due(latched.camera.exposure_s, Instant::now())?;
        let repeat = self.exchange.repeat;
        self.exchange.repeat = repeat.wrapping_add(1);
        Some((latched.vehicle.at(mid), latched, repeat))
    }

    /// Ends the link when everything queued has left, or nothing moves for 5 s; then tells what the run measured
    /// and counted.
    pub fn close(mut self) -> (RunStats, Counters) {
        let mut standstill = Standstill::of(&self.wire.tally, GIVE_UP);
        while let Ok(false) = self.flush()
            && !standstill.is_over()
        {}
        self.lose_answers();
        self.wire.close(standstill);
        let counters = self.counters();
        (self.stats, counters)
    }

    /// All counts, the link's among them.
    pub fn counters(&self) -> Counters {
        let tally = &self.wire.tally;
        Counters {
            foreign_packets: tally.foreign(),
            overflows: tally.dropped(),
            bad_framing: tally.bad_framing(),
            bad_crc: tally.bad_crc().wrapping_add(self.counters.bad_crc),
            runts: tally.runts().wrapping_add(self.counters.runts),
            oversize: tally.oversize().wrapping_add(self.counters.oversize),
            reconnects: tally.reconnects(),
            incomplete: tally.incomplete(),
            bus_errors: tally.bus_errors(),
            bus_off: tally.bus_off(),
            lost_outbound: tally.lost().wrapping_add(self.counters.lost_outbound),
            exposures_missed: self.wall.missed,
            objects_without_state: self.absent.count,
            rejected_records: self.emulator.rejected_records(),
            ..self.counters
        }
    }
}
