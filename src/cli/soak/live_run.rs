//! Emulator and clients of a soak, each on its threads.

use super::joining::{Arrival, Joining};
use crate::cli::common::PANICKED;
use crate::cli::live;
use crate::cli::session::{Cameras, Links};
use anyhow::bail;
use skyloop::config::Config;
use skyloop::link::{self, Roles};
use skyloop::serve::{Ended, OnFrameSent, SentFrame, Server};
use skyloop::soak::{Camera, Drift, Limits, Measured};
use skyloop::stats::RunStats;
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::{FlightComputer, RunError};
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::Port;
use skyloop_protocols::Counters;
use std::iter::once;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// A client's end of a link.
type ClientEnd = (Box<dyn Port + Send>, Roles);

/// Opens a link for each camera: the emulator's ends and the clients' ends.
pub fn open_links(link: &str, config: &Config) -> anyhow::Result<(Vec<Links>, Vec<ClientEnd>)> {
    let options = live::link_options(&config.run, None);
    let (mut links, mut ports) = (Vec::new(), Vec::new());
    for camera in 0..=config.cameras.len() {
        let (wire, port) = link::loopback(link, &options)?;
        // Further cameras get the state of the vehicle from the client of the first camera.
        let truth = camera == 0;
        let roles = Roles {
            truth,
            ..Roles::ALL
        };
        links.push(vec![(wire, roles)]);
        ports.push((port, roles));
    }
    Ok((links, ports))
}

/// A run of a given length.
pub struct LiveRun<'a> {
    config: &'a Config,
    limits: Limits,
    begin: Instant,
    length: Duration,
    interrupted: &'a AtomicBool,
    /// Ends the servers.
    stop: AtomicBool,
    /// Ends the clients early.
    over: AtomicBool,
    /// When the first client stopped taking frames.
    ended: OnceLock<Instant>,
}

/// Results of a run.
pub struct RunResults {
    joining: Joining,
    begin: Instant,
    ended: Instant,
    figures: Vec<(RunStats, Counters)>,
}

impl LiveRun<'_> {
    /// A run that begins now.
    pub fn new<'a>(
        config: &'a Config,
        limits: Limits,
        minutes: f64,
        interrupted: &'a AtomicBool,
    ) -> LiveRun<'a> {
        LiveRun {
            config,
            limits,
            begin: Instant::now(),
            length: Duration::from_secs_f64(minutes * 60.0),
            interrupted,
            stop: AtomicBool::new(false),
            over: AtomicBool::new(false),
            ended: OnceLock::new(),
        }
    }

    /// Serves all cameras, with a client at each, until the time is over.
    pub fn fly(
        &self,
        cameras: Cameras,
        ports: Vec<ClientEnd>,
        mission: Mission,
    ) -> anyhow::Result<RunResults> {
        let mut servers: Vec<Server> = once(cameras.first).chain(cameras.further).collect();
        let left = observe(&mut servers);
        let (arrived, arrivals) = channel();
        let cameras = self.config.cameras.iter();
        let spans =
            once(tracing::Span::none()).chain(cameras.map(|head| live::of_head(&head.name)));
        let mut clients = (0..).zip(clients(ports, mission));
        let (closed, errors, joined) = std::thread::scope(|scope| {
            let joining = scope.spawn(|| self.join(left, arrivals));
            let serving = servers.into_iter().zip(spans);
            let serving = serving
                .map(|(server, span)| scope.spawn(move || span.in_scope(|| self.serve(server))));
            let serving: Vec<_> = serving.collect();
            let first = clients.next();
            let taking = clients.map(|(number, client)| {
                let arrived = arrived.clone();
                scope.spawn(move || self.take(number, client, arrived))
            });
            let taking: Vec<_> = taking.collect();
            let mut errors = Vec::new();
            if let Some((number, client)) = first {
                errors.push(self.take(number, client, arrived));
            }
            self.over.store(true, Ordering::Relaxed);
            self.ended.get_or_init(Instant::now);
            let taken: Result<Vec<_>, _> = taking.into_iter().map(|taken| taken.join()).collect();
            self.stop.store(true, Ordering::Relaxed);
            // Servers report frames until they are closed.
            let closed: Option<Vec<_>> = serving
                .into_iter()
                .map(|serving| serving.join().ok().flatten().map(Server::close))
                .collect();
            let joined = joining.join();
            let taken = taken.map(|taken| errors.extend(taken));
            (closed, errors, taken.and(joined))
        });
        let (Ok(joining), Some(figures)) = (joined, closed) else {
            bail!(PANICKED);
        };
        if let Some(error) = errors.into_iter().flatten().next() {
            return Err(anyhow::Error::from(error).context("the client of the run"));
        }
        Ok(RunResults {
            joining,
            begin: self.begin,
            ended: *self.ended.get_or_init(Instant::now),
            figures,
        })
    }

    /// Joins departures and arrivals until their senders have ended.
    fn join(&self, left: Receiver<(usize, SentFrame)>, arrivals: Receiver<Arrival>) -> Joining {
        let cameras = self.config.cameras.iter().map(|head| &head.name);
        let cameras = once(&self.config.camera.name)
            .chain(cameras)
            .map(|name| Camera {
                name: name.clone(),
                latencies: self.limits.latencies(),
                drift: Drift::over(self.length),
            });
        let mut joining = Joining::new(cameras.collect(), self.length);
        joining.join(left, arrivals);
        joining
    }

    fn serve(&self, mut server: Server) -> Option<Server> {
        if server.run(&self.stop, None, |_| {}) == Ended::Panicked {
            self.over.store(true, Ordering::Relaxed);
            return None;
        }
        Some(server)
    }

    /// Runs the client of a camera, and reports the frames that arrive whole.
    fn take(
        &self,
        camera: usize,
        client: FlightComputer,
        arrived: Sender<Arrival>,
    ) -> Option<RunError> {
        let run = client.without_detection().run(|event| {
            if let Event::Frame { frame, .. } = &event {
                let _ = arrived.send((camera, frame.header.frame, frame.completed_at));
            }
            if !self.is_over() {
                return ControlFlow::Continue(());
            }
            self.ended.get_or_init(Instant::now);
            ControlFlow::Break(())
        });
        run.err()
    }

    /// Whether its time is over, it was interrupted, or it has failed.
    fn is_over(&self) -> bool {
        self.begin.elapsed() >= self.length
            || self.interrupted.load(Ordering::Relaxed)
            || self.over.load(Ordering::Relaxed)
    }
}

/// Makes each server report the frames that it has sent.
fn observe(servers: &mut [Server]) -> Receiver<(usize, SentFrame)> {
    let (sender, left) = channel();
    for (camera, server) in servers.iter_mut().enumerate() {
        let sender = sender.clone();
        let on_left: OnFrameSent = Box::new(move |left| {
            // The receiver outlives the senders.
            let _ = sender.send((camera, *left));
        });
        server.on_left(on_left);
    }
    left
}

/// A client for each camera: the first sends the attitudes of the mission, the others only receive.
fn clients(ports: Vec<ClientEnd>, mission: Mission) -> Vec<FlightComputer> {
    let listening = Mission {
        pace: Pace::Listen,
        ..mission.clone()
    };
    let missions = once(mission).chain(std::iter::repeat(listening));
    let clients = ports.into_iter().zip(missions);
    clients
        .map(|(port, mission)| FlightComputer::on_links(vec![port], mission))
        .collect()
}

impl RunResults {
    /// Duration of the run.
    pub fn minutes(&self) -> f64 {
        self.ended.duration_since(self.begin).as_secs_f64() / 60.0
    }

    /// Number of attitudes. Each camera receives all of them.
    pub fn attitudes(&self) -> u32 {
        let first = self.figures.first();
        first.map_or(0, |(_, counters)| counters.attitudes)
    }

    /// The counters of all cameras together, without those at 0.
    pub fn counters(&self) -> Vec<(&'static str, u32)> {
        let mut counts: Vec<(&str, u32)> = Counters::default().iter().collect();
        for (_, counters) in &self.figures {
            for (sum, (_, count)) in counts.iter_mut().zip(counters.iter()) {
                sum.1 = sum.1.wrapping_add(count);
            }
        }
        counts.retain(|(_, count)| *count > 0);
        counts
    }

    /// The rows of withheld frames, by camera if there are several.
    pub fn withheld_rows(&self, config: &Config) -> Vec<(String, String)> {
        let cameras = config.cameras.iter().map(|head| &head.name);
        let names = once(&config.camera.name).chain(cameras);
        let mut rows = Vec::new();
        for ((stats, _), camera) in self.figures.iter().zip(names) {
            for (name, mut text) in stats.withheld_rows() {
                if !config.cameras.is_empty() {
                    text += &format!(", of {camera}");
                }
                rows.push((name, text));
            }
        }
        rows
    }

    /// The measurements, for a command that started at `started`.
    pub fn measured(self, config: &Config, started: Instant, stopped: Option<String>) -> Measured {
        let cameras = config.cameras.iter().map(|head| head.camera.rate_hz);
        let rates = once(config.camera.rate_hz).chain(cameras);
        let missed = self.figures.iter().zip(rates);
        let missed = missed.map(|((_, counters), rate_hz)| {
            let period = Duration::from_secs_f64(1.0 / rate_hz);
            (counters.exposures_missed, period)
        });
        let missed: Vec<_> = missed.collect();
        let (first, memory) = (self.joining.first, self.joining.memory);
        Measured {
            cameras: self.joining.end(self.ended, &missed),
            stopped,
            memory,
            first_frame_s: first.map(|at| at.saturating_duration_since(started).as_secs_f64()),
        }
    }
}
