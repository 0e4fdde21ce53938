//! `skyloop soak`: minutes of a live run against a client of its own, and a verdict on deadlines and latencies.

use super::{Orbits, Records, live, mission};
use anyhow::{Context, anyhow, bail};
use clap::Args as ClapArgs;
use skyloop::config::{Clock, Config, Trigger};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::host::Host;
use skyloop::junit;
use skyloop::link::{self, Roles};
use skyloop::serve::{Left, Server};
use skyloop::soak::{Limits, Report};
use skyloop::stats::{row, table};
use skyloop::timing::{FrameTimes, Latencies};
use skyloop_firmware_sim::console::{say, stop_at_ctrl_c};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::text::decimal;
use skyloop_protocols::personality::NATIVE;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Arguments of `skyloop soak`.
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
    /// What 99 frames in 100 may take at most, from the exposure's end to the client's last packet [default: anything]
    #[arg(long, value_name = "X", value_parser = decimal(0.001..=1e6), allow_negative_numbers = true)]
    max_p99_ms: Option<f64>,
    /// Link between emulator and client: memory, udp, serial, pty, can or slcan, as in `loopback`
    #[arg(long, default_value = "udp")]
    link: String,
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
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
}

/// How long a frame's last packet may be on its way at the end.
const PARTING: Duration = Duration::from_secs(1);

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = Config::load(&args.config)?;
    args.records.settle(&config)?;
    args.orbits.settle(&mut config);
    let name = args.config.display();
    let clock = config.run.clock;
    if clock == Clock::Stepped || config.run.trigger == Trigger::Packet {
        bail!(
            "{name}: run.clock is \"stepped\" or run.trigger \"packet\", where frames have no deadlines of their own: give a run by the \"wall\" or the \
             \"external\" clock"
        );
    }
    // Before minutes are spent on them.
    for path in args.junit.iter().chain(&args.json) {
        std::fs::write(path, "").map_err(|error| {
            anyhow!(
                "cannot write {}: {error}; name another file",
                path.display()
            )
        })?;
    }
    let rate_hz = args.rate.unwrap_or(2.0 * config.camera.rate_hz);
    let first = flight::vehicle(&mission(&config, Some(&args.config))?, 0)?;
    let mission = endless(mission(&config, Some(&args.config))?, rate_hz)?;
    let help = live::help(&config.run, args.metrics.as_deref())?;
    let options = link::Options {
        idle: Duration::from_secs_f64(config.run.idle_s),
        personality: &NATIVE,
        bus: None,
    };
    let (wire, port) = link::loopback(&args.link, &options)?;
    let output = config.run.output;
    let mut emulator = Emulator::new(&mut config);
    emulator.warm_up(&first);
    let mut server = Server::new(emulator, vec![(wire, Roles::ALL)], output, clock, &NATIVE);
    server.set_run(&config.run);
    help.serve(&mut server);
    server.fits().map_err(anyhow::Error::msg)?;
    let limits = Limits {
        max_miss_rate: args.max_miss_rate,
        max_p99_ms: args.max_p99_ms,
    };
    say(format_args!(
        "{help}{} ({} x {}) at {} Hz over {} for {} min\n",
        config.camera.name,
        config.camera.detector.width,
        config.camera.detector.height,
        config.camera.rate_hz,
        args.link,
        args.minutes
    ))?;

    let interrupted = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let (to_tell, left) = channel::<Left>();
    let (arrived, arrivals) = channel::<(u32, Instant)>();
    server.on_left(Box::new(move |told| {
        // Who joins the times has gone only at the end.
        let _ = to_tell.send(*told);
    }));
    let (begin, host) = (Instant::now(), Host::now());
    let end = begin + Duration::from_secs_f64(args.minutes * 60.0);
    let stop = AtomicBool::new(false);
    let (server, flown, latencies) = std::thread::scope(|scope| {
        let joining = scope.spawn(|| join(left, arrivals, limits.latencies()));
        let serving = scope.spawn(|| {
            server.run(&stop, None, |_| {});
            server
        });
        let flown = FlightComputer::new(port, mission)
            .taking_only()
            .run(|event| {
                if let Event::Frame { frame, .. } = &event {
                    let _ = arrived.send((frame.header.frame, frame.last_block));
                }
                match Instant::now() >= end || interrupted.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            });
        drop(arrived);
        stop.store(true, Ordering::Relaxed);
        // It tells of frames until it is closed.
        let closed = serving.join().map(Server::close);
        (closed, flown, joining.join())
    });
    let (Ok((stats, counters)), Ok(mut latencies)) = (server, latencies) else {
        bail!("a thread of the run has panicked: please report it with the command you gave");
    };
    flown.context("the client of the run")?;
    // An exposure without a frame has missed its deadline, too.
    for _ in 0..counters.exposures_missed {
        latencies.add(&incomplete(stats.frames));
    }
    let minutes = begin.elapsed().as_secs_f64() / 60.0;
    let counts = counters.iter().filter(|(_, count)| *count > 0).collect();
    let report = Report::new(
        name.to_string(),
        minutes,
        limits,
        latencies,
        Host::now().since(&host),
        help.granted,
        counts,
    );
    tell(&report, &args)?;
    if interrupted.load(Ordering::Relaxed) {
        bail!("stopped after {minutes:.2} of {} min", args.minutes);
    }
    if !report.passed {
        let broken = report.verdicts.iter().filter(|verdict| !verdict.passed);
        let broken: Vec<&str> = broken.map(|verdict| verdict.text.as_str()).collect();
        bail!("{}", broken.join("; "));
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

/// Times as the client has them: from each frame's trigger to its last packet there. A frame that never came whole has missed its deadline.
fn join(
    left: Receiver<Left>,
    arrivals: Receiver<(u32, Instant)>,
    mut latencies: Latencies,
) -> Latencies {
    let mut waiting = BTreeMap::new();
    let mut came = BTreeMap::new();
    for told in left {
        came.extend(arrivals.try_iter());
        waiting.insert(told.times.frame, told);
        settle(&mut waiting, &mut came, &mut latencies);
    }
    let over = Instant::now() + PARTING;
    while !waiting.is_empty() {
        let rest = over.saturating_duration_since(Instant::now());
        let Ok(arrival) = arrivals.recv_timeout(rest) else {
            break;
        };
        came.extend([arrival]);
        settle(&mut waiting, &mut came, &mut latencies);
    }
    // The last ones were on their way when the run was ended.
    let ended = waiting.values().filter(|told| told.times.whole);
    let last = ended.map(|told| told.times.frame).max();
    for told in waiting
        .into_values()
        .filter(|told| Some(told.times.frame) != last)
    {
        latencies.add(&incomplete(told.times.frame));
    }
    latencies
}

fn settle(
    waiting: &mut BTreeMap<u32, Left>,
    came: &mut BTreeMap<u32, Instant>,
    latencies: &mut Latencies,
) {
    waiting.retain(|frame, told| match came.remove(frame) {
        None => true,
        Some(at) => {
            let spare_s = match told.deadline {
                Some(deadline) if at > deadline => -(at - deadline).as_secs_f64(),
                Some(deadline) => (deadline - at).as_secs_f64(),
                None => f64::INFINITY,
            };
            latencies.add(&FrameTimes {
                last_octet: at.saturating_duration_since(told.trigger),
                spare_s,
                whole: true,
                ..told.times
            });
            false
        }
    });
}

fn incomplete(frame: u32) -> FrameTimes {
    FrameTimes {
        frame,
        attitude_age_s: 0.0,
        first_pixel: Duration::ZERO,
        last_pixel: Duration::ZERO,
        first_octet: Duration::ZERO,
        last_octet: Duration::ZERO,
        spare_s: f64::NEG_INFINITY,
        whole: false,
    }
}

/// The table, and the files that were asked for.
fn tell(report: &Report, args: &Args) -> anyhow::Result<()> {
    let mut rows = vec![row("minutes", format!("{:.2}", report.minutes))];
    rows.extend(report.latencies.rows());
    rows.extend(report.host.rows());
    let counts: Vec<String> = report
        .counters
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    rows.push(row("counters", counts.join(", ")));
    say(format_args!("\n{}", table(&rows)))?;
    for verdict in &report.verdicts {
        say(format_args!(
            "{}: {}\n",
            if verdict.passed { "kept" } else { "broken" },
            verdict.text
        ))?;
    }
    let write = |path: &Path, text: String| {
        std::fs::write(path, text)
            .map_err(|error| anyhow!("cannot write {}: {error}", path.display()))
    };
    if let Some(path) = &args.junit {
        write(path, junit::document("skyloop soak", &report.cases()))?;
    }
    if let Some(path) = &args.json {
        write(path, serde_json::to_string_pretty(report)? + "\n")?;
    }
    Ok(())
}
