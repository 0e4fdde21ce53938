//! `skyloop soak`: minutes of a live run against a client of its own, and a verdict on deadlines and latencies.

mod joining;

use super::instruments::are_different;
use super::{Orbits, PANICKED, Records, cameras, levels, live, mission, with_level};
use anyhow::{Context, Error, bail};
use clap::Args as ClapArgs;
use joining::{Arrival, Joining};
use skyloop::config::{Clock, Config, Trigger};
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::host::Host;
use skyloop::link::{self, Roles};
use skyloop::serve::{Ended, Left, OnLeft, Server};
use skyloop::soak::{Camera, Drift, Limits, Measured, Report, suite};
use skyloop::stats::{row, table};
use skyloop_firmware_sim::console::{say, stop_at_ctrl_c};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::FlightComputer;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::Profile;
use skyloop_firmware_sim::text::decimal;
use skyloop_firmware_sim::verdict::{self, UNFINISHED, Verdict};
use skyloop_protocols::Counters;
use skyloop_protocols::personality::NATIVE;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Sender, channel};
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
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let started = Instant::now();
    let mut config = Config::load(&args.config)?;
    args.records.settle(&config)?;
    args.orbits.settle(&mut config);
    let name = args.config.display();
    let rate_hz = args.rate.unwrap_or(2.0 * config.camera.rate_hz);
    may_run(&args, &config, rate_hz)?;
    let interrupted = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    // Before minutes are spent on them; what ends without a verdict has not passed.
    write_untold(&args)?;
    let mission = mission(&config, Some(&args.config))?;
    let first = flight::vehicle(&mission, 0)?;
    let mission = endless(mission, rate_hz)?;
    let help = live::help(&config, args.metrics.as_deref())?;
    let options = link::Options {
        idle: Duration::from_secs_f64(config.run.idle_s),
        personality: &NATIVE,
        bus: None,
    };
    let emulator = Emulator::new(&mut config);
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
    let output = with_level(config.run.output, args.output.as_deref());
    let (mut server, mut heads) =
        cameras::serve(&config, emulator, links, Some(&first), output, &help)?;
    let (to_tell, left) = channel::<(usize, Left)>();
    let (arrived, arrivals) = channel::<Arrival>();
    let tells = |number: usize| -> OnLeft {
        let to_tell = to_tell.clone();
        // Who joins the times has gone only at the end.
        Box::new(move |told| {
            let _ = to_tell.send((number, *told));
        })
    };
    server.on_left(tells(0));
    for (number, head) in (1..).zip(&mut heads) {
        head.on_left(tells(number));
    }
    drop(to_tell);
    let limits = Limits {
        max_miss_rate: args.max_miss_rate,
        max_p99_ms: args.max_p99_ms,
        max_growth: args.max_growth,
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

    let (begin, host) = (Instant::now(), Host::now());
    let length = Duration::from_secs_f64(args.minutes * 60.0);
    let end = begin + length;
    let stop = AtomicBool::new(false);
    let interrupted = &interrupted;
    let (stop, over) = (&stop, AtomicBool::new(false));
    let (over, listening) = (&over, listening(&mission));
    // The first client stops taking then.
    let ended = OnceLock::new();
    let ended = &ended;
    let takes = |number: usize, arrived: Sender<Arrival>| {
        move |event: Event<'_>| {
            if let Event::Frame { frame, .. } = &event {
                let _ = arrived.send((number, frame.header.frame, frame.whole_at));
            }
            let ends = Instant::now() >= end || interrupted.load(Ordering::Relaxed);
            match ends || over.load(Ordering::Relaxed) {
                true => {
                    ended.get_or_init(Instant::now);
                    ControlFlow::Break(())
                }
                false => ControlFlow::Continue(()),
            }
        }
    };
    let heads_names = config.heads.iter().map(|head| head.name.as_str());
    let names = std::iter::once(config.camera.name.as_str()).chain(heads_names);
    let (closed, flown, joined) = std::thread::scope(|scope| {
        let joining = scope.spawn(|| {
            let cameras = names.map(|name| Camera {
                name: name.to_string(),
                latencies: limits.latencies(),
                drift: Drift::over(length),
            });
            let mut joining = Joining::new(cameras.collect(), length);
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
        let (mut serving, mut taking) = (vec![serve(server, tracing::Span::none())], Vec::new());
        let mut ports = ports.into_iter();
        let own = ports.next().into_iter().collect();
        let named = config.heads.iter().map(|head| live::of_head(&head.name));
        let heads = (1..).zip(heads.into_iter().zip(named).zip(ports));
        for (number, ((head, of), (port, roles))) in heads {
            serving.push(serve(head, of));
            let (mission, see) = (listening.clone(), takes(number, arrived.clone()));
            let client = FlightComputer::on_links(vec![(port, roles)], mission);
            taking.push(scope.spawn(move || client.taking_only().run(see).err()));
        }
        let see = takes(0, arrived);
        let flown = FlightComputer::on_links(own, mission)
            .taking_only()
            .run(see);
        over.store(true, Ordering::Relaxed);
        let ended = *ended.get_or_init(Instant::now);
        let mut errors = vec![flown.err()];
        let taken: Result<Vec<_>, _> = taking.into_iter().map(|taken| taken.join()).collect();
        stop.store(true, Ordering::Relaxed);
        // They tell of frames until they are closed.
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
    let (Ok((joining, ended)), Some(closed)) =
        (joined, closed.into_iter().collect::<Option<Vec<_>>>())
    else {
        bail!(PANICKED);
    };
    if let Some(error) = flown {
        return Err(anyhow::Error::from(error).context("the client of the run"));
    }
    // Of all cameras together.
    let mut counts: Vec<(&str, u32)> = Counters::default().iter().collect();
    for (_, counters) in &closed {
        for (sum, (_, count)) in counts.iter_mut().zip(counters.iter()) {
            sum.1 = sum.1.wrapping_add(count);
        }
    }
    counts.retain(|(_, count)| *count > 0);
    // Each camera hears of every one.
    let attitudes = closed.first().map_or(0, |(_, counters)| counters.attitudes);
    let of_heads = config.heads.iter().map(|head| head.camera.rate_hz);
    let rates = std::iter::once(config.camera.rate_hz).chain(of_heads);
    let missed = closed.iter().zip(rates).map(|((_, counters), rate_hz)| {
        let period = Duration::from_secs_f64(1.0 / rate_hz);
        (counters.exposures_missed, period)
    });
    let (first, memory) = (joining.first, joining.memory);
    let cameras = joining.end(ended, &missed.collect::<Vec<_>>());
    let minutes = ended.duration_since(begin).as_secs_f64() / 60.0;
    let stopped = interrupted
        .load(Ordering::Relaxed)
        .then(|| format!("stopped after {} of {} min", short(minutes), args.minutes));
    let measured = Measured {
        cameras,
        stopped,
        memory,
        first_frame_s: first.map(|at| at.saturating_duration_since(started).as_secs_f64()),
    };
    let report = Report::new(
        name.to_string(),
        minutes,
        limits,
        measured,
        Host::now().since(&host),
        help.granted,
        counts,
    );
    let reached_hz = f64::from(attitudes) / (60.0 * minutes);
    let rate = format!("{reached_hz:.1} a second, of {rate_hz} asked for");
    tell(&report, &args, rate)?;
    verdict::broken(&report.verdicts).map_or(Ok(()), |broken| bail!(broken))
}

/// Errors: what cannot be soaked, told before minutes are spent on it.
fn may_run(args: &Args, config: &Config, rate_hz: f64) -> anyhow::Result<()> {
    let name = args.config.display();
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
    let written = [("--junit", &args.junit), ("--json", &args.json)];
    let written = written
        .into_iter()
        .filter_map(|(name, file)| Some((name, file.as_deref()?)));
    let files: Vec<_> = std::iter::once(("--config", args.config.as_path()))
        .chain(written)
        .collect();
    are_different(&files)
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

/// The files that were asked for, as they are of a run that has told no verdict.
fn write_untold(args: &Args) -> anyhow::Result<()> {
    if let Some(path) = &args.junit {
        let unfinished = Verdict::new("run", false, UNFINISHED.to_string());
        let text = suite(&args.config).document(&[unfinished]);
        verdict::write(path, &text).map_err(Error::msg)?;
    }
    if let Some(path) = &args.json {
        let unfinished = serde_json::json!({ "passed": false, "error": UNFINISHED });
        verdict::write(path, &format!("{unfinished:#}\n")).map_err(Error::msg)?;
    }
    Ok(())
}

/// The table, with the rate of attitudes, and the files that were asked for.
fn tell(report: &Report, args: &Args, rate: String) -> anyhow::Result<()> {
    let mut rows = vec![row("minutes", short(report.minutes))];
    rows.extend(report.rows());
    rows.push(row("attitudes", rate));
    rows.extend(report.host.rows());
    let counts: Vec<String> = report
        .counters
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    rows.push(row("counters", counts.join(", ")));
    say(format_args!("\n{}", table(&rows)))?;
    say(verdict::table(&report.verdicts))?;
    if let Some(path) = &args.junit {
        let text = report.suite().document(&report.verdicts);
        verdict::write(path, &text).map_err(Error::msg)?;
    }
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(report)? + "\n";
        verdict::write(path, &text).map_err(Error::msg)?;
    }
    Ok(())
}
