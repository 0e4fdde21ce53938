//! `skyloop soak`: minutes of a live run against a client of its own, and a verdict on deadlines and latencies.

mod joining;
mod outputs;

use super::cameras::Links;
use super::instruments::are_different;
use super::{Force, Orbits, PANICKED, Records, cameras, levels, live, mission, with_level};
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use joining::{Arrival, Joining};
use outputs::Outputs;
use skyloop::config::{Clock, Config, Trigger};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::host::Host;
use skyloop::link::{self, Roles};
use skyloop::orbit::path_text;
use skyloop::serve::{Ended, Left, OnLeft, Server};
use skyloop::soak::{Camera, Drift, Limits, Measured, Report};
use skyloop::stats::{RunStats, row, table};
use skyloop_firmware_sim::console::{in_one_line, say, stop_at_ctrl_c};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::port::Port;
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::text::decimal;
use skyloop_firmware_sim::verdict;
use skyloop_protocols::Counters;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
use std::time::{Duration, Instant};

#[derive(ClapArgs)]
pub struct Args {
    /// Run file with a [sequence], whose first attitude and rates are flown; its clock is wall or external
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// How long
    #[arg(long, value_name = "M", default_value_t = 1.0, value_parser = decimal(0.001..=100_000.0), allow_negative_numbers = true)]
    minutes: f64,
    /// Frames that may miss their deadline, of all exposures
    #[arg(long, value_name = "SHARE", default_value_t = 1e-3, value_parser = decimal(0.0..=1.0), allow_negative_numbers = true)]
    max_miss_rate: f64,
    /// What 99 frames in 100 may take at most, from the trigger (the exposure's end, or its attitude's arrival if that is later) to the client's last packet; one that does not come whole takes longer than any [default: anything]
    #[arg(long, value_name = "X", value_parser = decimal(0.001..=1e6), allow_negative_numbers = true)]
    max_p99_ms: Option<f64>,
    /// By what share of it memory may have grown at the end, since a fifth of the run or a minute [default: anything]
    #[arg(long, value_name = "SHARE", value_parser = decimal(0.0..=1e6), allow_negative_numbers = true)]
    max_growth: Option<f64>,
    /// Link between emulator and client: memory, udp, serial, pty, can or slcan, as in `loopback`
    #[arg(long, default_value = "udp")]
    link: String,
    /// What frames bring [default: the file's]
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    output: Option<String>,
    /// Attitudes a second [default: two a frame]
    #[arg(long, value_name = "HZ", value_parser = decimal(1e-3..=1e5), allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Write the verdicts as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write everything as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Where the figures of the run can be fetched as Prometheus text, such as 127.0.0.1:9464 [default: the file's, else nowhere]
    #[arg(long, value_name = "ADDRESS")]
    metrics: Option<String>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    are_different(&args.files())?;
    let mut outputs = Outputs::open(&args)?;
    let done = soak(&args, &mut outputs);
    if let Err(error) = &done {
        outputs.fail(&args, &in_one_line(error.as_ref()))?;
    }
    done
}

/// Runs emulator and clients, and writes the verdicts.
fn soak(args: &Args, outputs: &mut Outputs) -> anyhow::Result<()> {
    let started = Instant::now();
    let mut config = Config::load(&args.config)?;
    args.records.settle(&config)?;
    args.orbits.settle(&mut config);
    let rate_hz = args.rate.unwrap_or(2.0 * config.camera.rate_hz);
    may_run(args, &config, rate_hz)?;
    let interrupted = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    // What ends without a verdict has not passed.
    outputs.begin(args)?;
    let mission = mission(&config, Some(&args.config))?;
    let first = flight::vehicle(&mission, 0)?;
    let mission = endless(mission, rate_hz)?;
    let help = live::help(&config, args.metrics.as_deref())?;
    let emulator = Emulator::new(&mut config);
    let (links, ports) = links(args, &config)?;
    let output = with_level(config.run.output, args.output.as_deref());
    let servers = cameras::serve(&config, emulator, links, Some(&first), output, &help)?;
    say(format_args!(
        "{help}{} ({} x {}) at {} Hz over {} for {} min\n",
        config.camera.name,
        config.camera.detector.width,
        config.camera.detector.height,
        config.camera.rate_hz,
        args.link,
        args.minutes
    ))?;
    let host = Host::now();
    let run = Run {
        config: &config,
        limits: args.limits(),
        begin: Instant::now(),
        length: Duration::from_secs_f64(args.minutes * 60.0),
        interrupted: &interrupted,
    };
    let flown = run.fly(servers, ports, mission)?;
    let stopped = interrupted.load(Ordering::Relaxed);
    let minutes = flown.ended.duration_since(run.begin).as_secs_f64() / 60.0;
    let stopped =
        stopped.then(|| format!("stopped after {} of {} min", short(minutes), args.minutes));
    let counts = summed(&flown.figures);
    let withheld = withheld(&flown.figures, &config);
    // Each camera receives every attitude.
    let attitudes = (flown.figures.first()).map_or(0, |(_, counters)| counters.attitudes);
    let measured = flown.measured(&config, started, stopped);
    let report = Report::new(
        path_text(&args.config),
        minutes,
        run.limits,
        measured,
        Host::now().since(&host),
        help.granted,
        counts,
    );
    let reached_hz = f64::from(attitudes) / (60.0 * minutes);
    print(
        &report,
        format!("{reached_hz:.1} a second, of {rate_hz} requested"),
        withheld,
    )?;
    outputs.finish(&report)?;
    verdict::broken(&report.verdicts).map_or(Ok(()), |broken| bail!(broken))
}

/// The emulator's links, and their other ends, of each camera.
fn links(args: &Args, config: &Config) -> anyhow::Result<(Vec<Links>, Vec<ClientEnd>)> {
    let options = live::link_options(&config.run, None);
    let (mut links, mut ports) = (Vec::new(), Vec::new());
    for camera in 0..=config.heads.len() {
        let (wire, port) = link::loopback(&args.link, &options)?;
        // Each camera has the vehicle from the first one's client.
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

/// A client's end of a link.
type ClientEnd = (Box<dyn Port + Send>, Roles);

struct Run<'a> {
    config: &'a Config,
    limits: Limits,
    begin: Instant,
    length: Duration,
    interrupted: &'a AtomicBool,
}

struct Flown {
    joining: Joining,
    /// When the first client stopped taking frames.
    ended: Instant,
    figures: Vec<(RunStats, Counters)>,
}

impl Run<'_> {
    fn fly(
        &self,
        (mut server, mut heads): (Server, Vec<Server>),
        ports: Vec<ClientEnd>,
        mission: Mission,
    ) -> anyhow::Result<Flown> {
        let (sender, left) = channel::<(usize, Left)>();
        let (arrived, arrivals) = channel::<Arrival>();
        for (number, server) in std::iter::once(&mut server).chain(&mut heads).enumerate() {
            let sender = sender.clone();
            let on_left: OnLeft = Box::new(move |left| {
                // The receiver ends last.
                let _ = sender.send((number, *left));
            });
            server.on_left(on_left);
        }
        drop(sender);
        let (stop, over) = (AtomicBool::new(false), AtomicBool::new(false));
        let (stop, over, listening) = (&stop, &over, listening(&mission));
        // The first client stops taking frames then.
        let ended = OnceLock::new();
        let ended = &ended;
        let takes = |number: usize, arrived: Sender<Arrival>| {
            move |event: Event<'_>| {
                if let Event::Frame { frame, .. } = &event {
                    let _ = arrived.send((number, frame.header.frame, frame.whole_at));
                }
                let is_over = self.is_over() || over.load(Ordering::Relaxed);
                if is_over {
                    ended.get_or_init(Instant::now);
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            }
        };
        let (closed, flown, joined) = std::thread::scope(|scope| {
            let joining = scope.spawn(|| {
                let mut joining = Joining::new(self.cameras(), self.length);
                joining.join(left, arrivals);
                joining
            });
            let serve = |mut server: Server, of: tracing::Span| {
                scope.spawn(move || {
                    let _of = of.entered();
                    let ended = server.run(stop, None, |_| {});
                    over.fetch_or(ended == Ended::Panicked, Ordering::Relaxed);
                    (server, ended)
                })
            };
            let (mut serving, mut taking) =
                (vec![serve(server, tracing::Span::none())], Vec::new());
            let mut ports = ports.into_iter();
            let own = ports.next().into_iter().collect();
            let named = self
                .config
                .heads
                .iter()
                .map(|head| live::of_head(&head.name));
            let heads = (1..).zip(heads.into_iter().zip(named).zip(ports));
            for (number, ((head, of), (port, roles))) in heads {
                serving.push(serve(head, of));
                let (mission, see) = (listening.clone(), takes(number, arrived.clone()));
                let client = FlightComputer::on_links(vec![(port, roles)], mission);
                taking.push(scope.spawn(move || client.taking_only().run(see).err()));
            }
            let see = takes(0, arrived);
            let client = FlightComputer::on_links(own, mission).taking_only();
            let mut errors = vec![client.run(see).err()];
            over.store(true, Ordering::Relaxed);
            let ended = *ended.get_or_init(Instant::now);
            let taken: Result<Vec<_>, _> = taking.into_iter().map(|taken| taken.join()).collect();
            stop.store(true, Ordering::Relaxed);
            // They report frames until they are closed.
            let closed: Vec<_> = serving
                .into_iter()
                .map(|serving| match serving.join() {
                    Ok((server, Ended::AsAsked | Ended::LinkGone)) => Some(server.close()),
                    Ok((_, Ended::Panicked)) | Err(_) => None,
                })
                .collect();
            let joined = joining.join().map(|joining| (joining, ended));
            let joined = taken.and_then(|taken| {
                errors.extend(taken);
                joined
            });
            (closed, errors.into_iter().flatten().next(), joined)
        });
        let closed: Option<Vec<_>> = closed.into_iter().collect();
        let (Ok((joining, ended)), Some(figures)) = (joined, closed) else {
            bail!(PANICKED);
        };
        if let Some(error) = flown {
            return Err(anyhow::Error::from(error).context("the client of the run"));
        }
        Ok(Flown {
            joining,
            ended,
            figures,
        })
    }

    /// Whether its time is over, or it was interrupted.
    fn is_over(&self) -> bool {
        self.begin.elapsed() >= self.length || self.interrupted.load(Ordering::Relaxed)
    }

    /// Where the times of each camera's frames are collected.
    fn cameras(&self) -> Vec<Camera> {
        let heads = self.config.heads.iter().map(|head| &head.name);
        let names = std::iter::once(&self.config.camera.name).chain(heads);
        let camera = |name: &String| Camera {
            name: name.clone(),
            latencies: self.limits.latencies(),
            drift: Drift::over(self.length),
        };
        names.map(camera).collect()
    }
}

impl Flown {
    /// What was measured, of a command that `started` then.
    fn measured(self, config: &Config, started: Instant, stopped: Option<String>) -> Measured {
        let of_heads = config.heads.iter().map(|head| head.camera.rate_hz);
        let rates = std::iter::once(config.camera.rate_hz).chain(of_heads);
        let missed = self
            .figures
            .iter()
            .zip(rates)
            .map(|((_, counters), rate_hz)| {
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

/// The counters of all cameras together, without those at 0.
fn summed(figures: &[(RunStats, Counters)]) -> Vec<(&'static str, u32)> {
    let mut counts: Vec<(&str, u32)> = Counters::default().iter().collect();
    for (_, counters) in figures {
        for (sum, (_, count)) in counts.iter_mut().zip(counters.iter()) {
            sum.1 = sum.1.wrapping_add(count);
        }
    }
    counts.retain(|(_, count)| *count > 0);
    counts
}

/// The rows of the frames that were withheld, camera by camera where there are several.
fn withheld(figures: &[(RunStats, Counters)], config: &Config) -> Vec<(String, String)> {
    let heads = config.heads.iter().map(|head| &head.name);
    let names = std::iter::once(&config.camera.name).chain(heads);
    let named = |(name, text): (String, String), camera| match config.heads.is_empty() {
        true => (name, text),
        false => (name, format!("{text}, of {camera}")),
    };
    let rows = figures.iter().zip(names).flat_map(|((stats, _), camera)| {
        let rows = stats.withheld_rows().into_iter();
        rows.map(move |row| named(row, camera))
    });
    rows.collect()
}

/// Errors: the configuration cannot be soaked; checked before the run.
fn may_run(args: &Args, config: &Config, rate_hz: f64) -> anyhow::Result<()> {
    let name = path_text(&args.config);
    if config.run.clock == Clock::Stepped {
        bail!(
            "{name}: run.clock is \"stepped\", where frames have no deadlines; set it to \"wall\" or \"external\""
        );
    }
    if config.run.trigger == Trigger::Packet {
        bail!(
            "{name}: run.trigger is \"packet\", and the client of a soak sends none; leave it out, so that frames come at the camera's rate"
        );
    }
    // What `run` refuses is no configuration to be soaked, though its links are others here.
    live::check_links(config, &args.config)?;
    if args.link == "can" && !config.heads.is_empty() {
        bail!(
            "--link can: there is one virtual bus, and the {} cameras of {name} need one each; give --link udp, pty or slcan",
            1 + config.heads.len()
        );
    }
    let attitudes = rate_hz * 60.0 * args.minutes;
    if attitudes > f64::from(u32::MAX) {
        bail!(
            "--minutes {}: {attitudes:.2e} attitudes, at {rate_hz} a second, are more than can be numbered (4.29e9); ask for less",
            args.minutes
        );
    }
    Ok(())
}

/// The mission by the wall clock, without an end: of a list of attitudes the first, turned on by its rates.
fn endless(mission: Mission, rate_hz: f64) -> anyhow::Result<Mission> {
    let (start, orbit) = (mission.start, mission.orbit.as_ref());
    let profile = match &mission.profile {
        Profile::List(_) => {
            let first = mission.profile.at(start, orbit)?;
            Profile::Slew {
                start,
                attitude: first.attitude,
                rates_rad_s: first.rates_rad_s,
            }
        }
        other => other.clone(),
    };
    Ok(Mission {
        frames: u32::MAX,
        pace: Pace::Wall { rate_hz },
        profile,
        ..mission
    })
}

/// A client that takes what others have made.
fn listening(mission: &Mission) -> Mission {
    Mission {
        pace: Pace::Listen,
        ..mission.clone()
    }
}

/// Minutes to two decimals, of less than a tenth to four.
fn short(minutes: f64) -> String {
    match minutes < 0.1 {
        true => format!("{minutes:.4}"),
        false => format!("{minutes:.2}"),
    }
}

impl Args {
    fn files(&self) -> Vec<(&'static str, &Path)> {
        let outputs = [("--junit", &self.junit), ("--json", &self.json)];
        let outputs = outputs
            .into_iter()
            .filter_map(|(name, file)| Some((name, file.as_deref()?)));
        std::iter::once(("--config", self.config.as_path()))
            .chain(outputs)
            .collect()
    }

    fn limits(&self) -> Limits {
        Limits {
            max_miss_rate: self.max_miss_rate,
            max_p99_ms: self.max_p99_ms,
            max_growth: self.max_growth,
        }
    }

    /// The limits that are checked, by the names of their verdicts.
    fn checks(&self) -> Vec<&'static str> {
        let checks = [
            ("deadlines", true),
            ("p99", self.max_p99_ms.is_some()),
            ("memory", self.max_growth.is_some()),
        ];
        let set = checks.iter().filter(|(_, is_set)| *is_set);
        set.map(|(name, _)| *name).collect()
    }
}

/// Prints the table, with the rate of attitudes and the frames that were withheld, and the verdicts.
fn print(report: &Report, rate: String, withheld: Vec<(String, String)>) -> anyhow::Result<()> {
    let mut rows = vec![row("minutes", short(report.minutes))];
    rows.extend(report.rows());
    rows.push(row("attitudes", rate));
    rows.extend(withheld);
    rows.extend(report.host.rows());
    let counts: Vec<String> = report
        .counters
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    rows.push(row("counters", counts.join(", ")));
    say(format_args!("\n{}", table(&rows)))?;
    say(verdict::table(&report.verdicts))?;
    Ok(())
}
