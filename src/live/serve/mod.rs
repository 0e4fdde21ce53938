//! The live run: packets from the wire become vehicle states, shots become packets.
//!
//! One thread takes turns: receive, latch, deliver, expose. Another makes the frames (`shooter`), and the links have theirs: so packets come and go
//! while a frame is made, its upper rows leave while the lower ones are made, and the next is made while the last one leaves. In step one
//! frame is made and sent after the other, whatever that takes: a run is a function of what comes, and of how many frames had been made by then.

mod answer;
mod budget;
mod channel;
mod clock;
mod cut;
mod deliver;
mod expose;
mod heads;
mod history;
mod kept;
mod latch;
mod leaving;
mod obey;
mod overrun;
mod packed;
mod passed;
mod picture;
mod receive;
mod select;
mod settled;
mod shooter;
mod told;
mod withheld;

use crate::metrics::Metrics;
use crate::stats::{Absent, Request, RunStats};
use channel::Channel;
use clock::Clock;
use history::History;
use kept::Kept;
use leaving::Leaving;
pub use leaving::Left;
use overrun::Overrun;
use picture::Picture;
use shooter::{Shooter, shooter};
use skyloop_base::abort::Abort;
use skyloop_config::{Clock as Kind, Delay, OnOverrun, OutOfOrder, Run, Staleness};
use skyloop_link::{LinkError, Relay, Roles, Standstill, Unsent, Wire};
use skyloop_protocols::{Counters, Header, Output, Personality, Withheld};
use skyloop_render::attitude::VehicleState;
use skyloop_render::camera::Camera;
use skyloop_render::engine::{Emulator, Shot};
use skyloop_render::fidelity::Fidelity;
use skyloop_render::render::BAND_ROWS;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use withheld::{CLIENT_GONE, RESET, RUN_ENDED, name};

/// How long a pause lasts in which nothing is due but a packet may come.
const POLL: Duration = Duration::from_millis(20);
/// How long the end of a run waits for a client that takes nothing. A pseudo-terminal lets 4 KiB pass at once:
/// 4.3 s for a client that reads at the pace of 9600 baud.
const GIVE_UP: Duration = Duration::from_secs(5);
/// How long it waits after a signal, for all links together.
const GIVE_UP_ON_STOP: Duration = Duration::from_millis(1500);

/// Adds to a counter, which wraps.
fn add(counter: &mut u32, more: u32) {
    *counter = counter.wrapping_add(more);
}

/// An attitude that has been accepted.
#[derive(Debug, Clone)]
struct Latched {
    vehicle: VehicleState,
    header: Header,
    arrived: Instant,
    /// Its number among all that were accepted.
    number: u64,
    /// Whether one of a later time had come before it.
    out_of_order: bool,
}

/// What the link of the truth has brought.
#[derive(Debug, Default)]
struct Truth {
    history: History,
    /// The attitude that the last frame went by, and frames made of it so far (not in step).
    shown: Option<(u64, u32)>,
    /// The attitude that was refused after it had been accepted (likewise).
    refused: Option<u64>,
}

/// The camera, as it is configured and as it was commanded.
struct Settings {
    configured: Arc<Camera>,
    camera: Arc<Camera>,
}

impl Settings {
    /// The camera, to be commanded; frames under way keep theirs.
    fn change(&mut self) -> &mut Camera {
        Arc::make_mut(&mut self.camera)
    }
}

/// Sees each frame that has left, on the server's thread.
pub type OnLeft = Box<dyn FnMut(&Left) + Send>;

/// The emulator at its links.
pub struct Server {
    /// None while its thread has it.
    emulator: Option<Emulator>,
    settings: Settings,
    fidelity: Fidelity,
    has_objects: bool,
    rejected_records: u32,
    channels: Vec<Channel>,
    /// What frames bring until a client says otherwise.
    output: Output,
    personality: &'static Personality,
    kind: Kind,
    clock: Box<dyn Clock>,
    staleness: Staleness,
    out_of_order: OutOfOrder,
    /// None in step.
    delay: Delay,
    /// Number of the camera, the first of all 0.
    camera: u32,
    overrun: Overrun,
    truth: Truth,
    /// Attitudes accepted so far.
    accepted: u64,
    /// Frames that are made or sent.
    pictures: Vec<Picture>,
    /// Frames that have left, until their memory is needed.
    kept: Kept<Box<Shot>>,
    /// Frames whose last packet is in a link's queue.
    leaving: Vec<Leaving>,
    /// The frame that is being made.
    making: Option<u32>,
    /// Cancels it.
    abort: Abort,
    next_frame: u32,
    /// Memory for the pixels of the next frame, as they come.
    digits: Vec<u16>,
    counters: Counters,
    /// Exposures without a frame, besides those that the clock passed over.
    missed: u32,
    /// What the run measured.
    pub stats: RunStats,
    /// Where the figures of the run are left now and then.
    metrics: Option<Metrics>,
    /// When they were left last.
    looked: Option<Instant>,
    /// Sees each frame that has left.
    on_left: Option<OnLeft>,
    /// Further cameras, which hear of the vehicle.
    told: Vec<Relay>,
    /// Whether this is one of them.
    is_led: bool,
    /// Whose turn it is to make a frame.
    darkroom: Arc<Mutex<()>>,
    /// Objects that could not be shown.
    absent: Absent,
    /// When the run was stopped, if it was.
    stopped: Option<Instant>,
    /// When nothing is sent any more, unless the run was stopped.
    until: Option<Instant>,
}

/// How a run came to its end.
#[must_use = "a run may have ended because of an error of its own"]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// It was stopped, or has made its frames.
    AsAsked,
    /// The other end of the link has gone for good.
    LinkGone,
    /// The thread that makes frames has panicked.
    Panicked,
}

impl Server {
    /// Puts `emulator` at its links; frames bring `output` until a client says otherwise.
    pub fn new(
        emulator: Emulator,
        links: impl IntoIterator<Item = (Wire, Roles)>,
        output: Output,
        clock: Kind,
        personality: &'static Personality,
    ) -> Server {
        let run = Run::default();
        let (camera, fidelity) = (emulator.camera(), *emulator.fidelity());
        let links = links.into_iter();
        Server {
            overrun: Overrun::new(OnOverrun::Late, fidelity, &[]).0,
            settings: Settings {
                configured: camera.clone(),
                camera: camera.clone(),
            },
            fidelity,
            has_objects: emulator.has_objects(),
            rejected_records: emulator.rejected_records(),
            next_frame: emulator.next_frame(),
            emulator: Some(emulator),
            channels: links
                .map(|(wire, roles)| Channel::new(wire, roles, output))
                .collect(),
            output,
            personality,
            kind: clock,
            clock: clock::of(clock, &run, camera.rate_hz),
            staleness: run.staleness,
            out_of_order: run.out_of_order,
            delay: Delay::default(),
            camera: 0,
            truth: Truth::default(),
            accepted: 0,
            pictures: Vec::new(),
            kept: Kept::new(),
            leaving: Vec::new(),
            making: None,
            abort: Abort::default(),
            digits: Vec::new(),
            counters: Counters::default(),
            missed: 0,
            stats: RunStats::default(),
            metrics: None,
            looked: None,
            on_left: None,
            told: Vec::new(),
            is_led: false,
            darkroom: Arc::default(),
            absent: Absent::default(),
            stopped: None,
            until: None,
        }
    }

    /// Ends the links at `until` at the latest, where the run ends of itself.
    pub fn end_by(&mut self, until: Option<Instant>) {
        self.until = until;
    }

    /// Leaves the figures of the run in `metrics` ten times a second.
    pub fn set_metrics(&mut self, metrics: Metrics) {
        self.metrics = Some(metrics);
    }

    /// Lets `on_left` see each frame that has left.
    pub fn on_left(&mut self, on_left: OnLeft) {
        self.on_left = Some(on_left);
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
        let camera = &self.settings.camera;
        let mut text = String::new();
        for Channel { wire, roles, .. } in &self.channels {
            let table = budget::table(wire, *roles, camera, &self.output);
            if !table.is_empty() {
                text += &format!("a frame over {} takes\n{table}", wire.address);
            }
        }
        text
    }

    /// The address of the link that has ended.
    pub fn gone(&self) -> Option<&str> {
        let gone = self.channels.iter().find(|channel| channel.gone);
        Some(&gone?.wire.address)
    }

    /// Serves until `stop` is set or `limit` frames are made; `on_shot` sees each when it has been given to its links, or given up. A later one
    /// is made in its memory.
    pub fn run(
        &mut self,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_shot: impl FnMut(&Shot),
    ) -> Ended {
        let Some(mut emulator) = self.emulator.take() else {
            return Ended::AsAsked;
        };
        let ended = std::thread::scope(|scope| {
            let (shooter, darkroom) = shooter(std::thread::current());
            let (emulator, turn) = (&mut emulator, self.darkroom.clone());
            let span = tracing::Span::current();
            let making = scope.spawn(move || span.in_scope(|| darkroom.work(emulator, &turn)));
            let ended = self.serve(shooter, stop, limit, on_shot);
            match making.join() {
                Ok(()) => ended,
                Err(_) => Ok(Ended::Panicked),
            }
        });
        self.emulator = Some(emulator);
        let waited = self.clock.end(Instant::now());
        self.abandon(waited, RUN_ENDED);
        if matches!(ended, Ok(Ended::Panicked)) {
            while !self.pictures.is_empty() {
                self.abandon_picture(0);
            }
        }
        // That a link has ended is noticed by whoever uses it first: what receives, or what sends.
        ended.unwrap_or_else(|error| {
            tracing::debug!(%error, "nothing can be sent any more");
            Ended::LinkGone
        })
    }

    fn serve(
        &mut self,
        shooter: Shooter,
        stop: &AtomicBool,
        limit: Option<u32>,
        mut on_shot: impl FnMut(&Shot),
    ) -> Result<Ended, LinkError> {
        for channel in &self.channels {
            channel.wire.inbox.unparks(std::thread::current());
        }
        if self.kind != Kind::Stepped && self.wants_rows() {
            let detector = &self.settings.camera.detector;
            let bands = detector.height.div_ceil(BAND_ROWS);
            shooter.spare().fill(bands, detector.width * BAND_ROWS);
        }
        let ended = self.turn(&shooter, stop, limit, &mut on_shot);
        self.give_all_up();
        self.abort.set();
        while self.making.is_some()
            && let Ok(news) = shooter.await_news()
        {
            // What cannot be shown any more is refused over a link that may have gone.
            let _ = self.learn(news, shooter.spare());
        }
        self.give_all_up();
        self.settle(&shooter, &mut on_shot);
        ended
    }

    /// Packets, pixels and exposures in turns, until the end.
    fn turn(
        &mut self,
        shooter: &Shooter,
        stop: &AtomicBool,
        limit: Option<u32>,
        on_shot: &mut impl FnMut(&Shot),
    ) -> Result<Ended, LinkError> {
        while !stop.load(Ordering::Relaxed) {
            while !self.holds_frame() {
                match shooter.news() {
                    Ok(Some(news)) => self.learn(news, shooter.spare())?,
                    Ok(None) => break,
                    Err(()) => return Ok(Ended::Panicked),
                }
            }
            // Whatever else there is to do: commands and attitudes come first.
            if !self.receive_waiting()? {
                return Ok(Ended::LinkGone);
            }
            let round = self.deliver()?;
            self.report_silence(Instant::now());
            let settled = self.settle(shooter, on_shot);
            self.publish(Instant::now());
            if limit.is_some_and(|most| self.stats.frames >= most) && self.pictures.is_empty() {
                break;
            }
            let exposed = self.expose(shooter, limit)?;
            if round.moved || settled || exposed {
                continue;
            }
            let pause = round.pause.unwrap_or(POLL).min(self.until_due(limit));
            if !self.receive(pause)? {
                return Ok(Ended::LinkGone);
            }
        }
        if stop.load(Ordering::Relaxed) {
            self.stopped = Some(Instant::now());
        }
        Ok(Ended::AsAsked)
    }

    /// Whether a replay has a packet to be taken before the frame that is made may end.
    fn holds_frame(&self) -> bool {
        let channels = || self.channels.iter();
        self.making.is_some() && channels().any(|channel| channel.wire.inbox.holds_frame())
    }

    /// The frame `number` is made from now on; none: no frame is.
    fn makes(&mut self, number: Option<u32>) {
        self.making = number;
        for channel in &self.channels {
            channel.wire.inbox.making(number.is_some());
        }
    }

    /// The link that brings the truth.
    fn truth_channel(&self) -> usize {
        let truth = self.channels.iter().position(|channel| channel.roles.truth);
        truth.unwrap_or(0)
    }

    /// All begins anew: another client, or a Reset of the one that brings the truth.
    fn clear_truth(&mut self, is_reset: bool, now: Instant) {
        self.truth = Truth::default();
        self.forsake(is_reset);
        self.settings.camera = self.settings.configured.clone();
        let waited = self.clock.clear(self.settings.camera.rate_hz, now);
        self.abandon(waited, if is_reset { RESET } else { CLIENT_GONE });
    }

    /// Counts requests that will have no frame.
    fn abandon(&mut self, waited: u32, cause: &'static str) {
        add(&mut self.counters.frames_abandoned, waited);
        if self.is_requested_by("Trigger") {
            add(&mut self.counters.triggers_missed, waited);
        }
        (0..waited).for_each(|_| self.fail(Request::default(), cause));
    }

    /// Ends the links when everything queued has left, when nothing moves for 5 s, 1.5 s after the run was stopped, or at [`Self::end_by`]. Returns what the run measured
    /// and counted.
    pub fn close(mut self) -> (RunStats, Counters) {
        let stopped = self.stopped.map(|stopped| stopped + GIVE_UP_ON_STOP);
        let until = stopped.or(self.until);
        for channel in &mut self.channels {
            let standstill = Standstill::of(&channel.wire.tally, GIVE_UP);
            channel.watch(Instant::now());
            let mut standstill = standstill.moved(channel.moved());
            if let Some(until) = until {
                standstill = standstill.until(until);
            }
            while let Ok(false) = channel.flush()
                && !standstill.is_over()
            {}
            channel.lose_answers();
            channel.wire.close(standstill);
            let is_unread = channel.wire.tally.why_given_up() == Some(Unsent::NotRead);
            let why = if is_unread {
                Withheld::NotRead
            } else {
                Withheld::SlowLink
            };
            channel.count_open(name(why));
        }
        self.see_leave();
        self.count_unsent();
        let counters = self.counters();
        let accounts = self.bringing().map(|channel| {
            let account = self.account(channel);
            (channel.wire.address.clone(), account)
        });
        self.stats.accounts = accounts.collect();
        let links = self
            .channels
            .into_iter()
            .filter(|channel| channel.roles.bring_frames());
        let mut links = links.map(|channel| (channel.wire.address, channel.latencies));
        let first = links.next();
        self.stats.further = links.collect();
        if let Some((address, latencies)) = first {
            (self.stats.link, self.stats.latencies) = (address, latencies);
        }
        (self.stats, counters)
    }

    /// Exposures that have no frame.
    fn exposures_missed(&self) -> u32 {
        self.clock.missed().wrapping_add(self.missed)
    }

    /// All counts, the links' among them.
    pub fn counters(&self) -> Counters {
        let mut counters = Counters {
            exposures_missed: self.exposures_missed(),
            objects_without_state: self.absent.count,
            rejected_records: self.rejected_records,
            ..self.counters
        };
        for channel in &self.channels {
            channel.wire.tally.add_to(&mut counters);
            add(&mut counters.lost_outbound, channel.lost);
        }
        counters
    }
}
