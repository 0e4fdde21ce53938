//! `skyloop run`: the emulator alone, waiting for a flight computer.

use super::budget::Budget;
use super::common::{Force, Orbits, PANICKED, Records, levels, mission};
use super::instruments::{Instruments, both};
use super::ready::{self, Head, Ready, ReadyFile};
use super::session::{Cameras, Links, Session, configure};
use super::{instruments, live};
use anyhow::{Context, anyhow, bail};
use clap::Args as ClapArgs;
use skyloop::config::{Clock, Config, Run, Trigger};
use skyloop::effect::counted;
use skyloop::flight;
use skyloop::link;
use skyloop::orbit::path_text;
use skyloop::serve::Ended;
use skyloop::stats::{RunStats, row, table};
use skyloop_firmware_sim::console::{say, stop_at_ctrl_c};
use skyloop_firmware_sim::text::{decimal, whole};
use skyloop_protocols::Counters;
use skyloop_protocols::personality::NATIVE;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(ClapArgs)]
pub struct Args {
    /// Configuration file (see configs/default.toml)
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Link to listen on, such as udp://127.0.0.1:4810 or serial:///dev/ttyUSB0?baud=921600;
    /// several with roles, such as --link 'udp://127.0.0.1:4810?roles=truth+labels' --link
    /// 'udp://127.0.0.1:4811?roles=pixels' [default: the file's]
    #[arg(long, value_name = "URL")]
    link: Vec<String>,
    /// Content of frames until a client changes it [default: the file's]
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    output: Option<String>,
    /// End after this many frames [default: at Ctrl-C]
    #[arg(long, value_name = "N", value_parser = whole(1..=u32::MAX), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// Address for Prometheus metrics, such as 127.0.0.1:9464 [default: the file's, else none]
    #[arg(long, value_name = "ADDRESS")]
    metrics: Option<String>,
    /// Fail if no client has connected after this many seconds
    #[arg(long, value_name = "S", value_parser = decimal(0.001..=1e7), allow_negative_numbers = true)]
    wait_for_client: Option<f64>,
    /// End after this many seconds; fail if --frames have not been sent by then
    #[arg(long, value_name = "S", value_parser = decimal(0.001..=1e7), allow_negative_numbers = true)]
    timeout: Option<f64>,
    /// Write a JSON file with the actual addresses when all links listen; removed at exit
    #[arg(long, value_name = "FILE")]
    ready_file: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    instruments: instruments::Choice,
    #[command(flatten)]
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
    #[command(flatten)]
    budget: Budget,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    let file = Some(args.config.as_path());
    let config = configure(file, &args.records, &args.orbits, args.output.as_deref())?;
    // Before the links, so that the name of a pseudo-terminal is removed at the end.
    let stop = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let (urls, key) = if args.link.is_empty() {
        let key = format!("{}: run.link", path_text(&args.config));
        (config.run.links.clone(), key)
    } else {
        (args.link.clone(), "--link".to_string())
    };
    let mut instruments = outputs(&args, &urls)?;
    let services = live::services(&config, args.metrics.as_deref())?;
    let (links, seen) = open_links(&config, &urls, key, &instruments)?;
    let mission = match config.sequence {
        Some(_) => Some(mission(&config, file)?),
        None => None,
    };
    let mut session = Session::new(config);
    let chosen = session.settle_budget(&args.budget, mission.as_ref(), &stop)?;
    let (recorded, objects) = (session.settings(), session.objects);
    let warm_up = match &mission {
        Some(mission) if session.config.run.clock != Clock::Stepped => {
            Some(flight::vehicle(mission, 0)?)
        }
        _ => None,
    };
    let (config, cameras) = session.live(links, warm_up.as_ref(), &services)?;
    let mut ready = ready_file(&args, &config, &cameras, services.metrics_address())?;
    // After all other checks, because it replaces earlier files.
    instruments.begin(recorded)?;
    let (_, error) = instruments.finish_after(|instruments| {
        warn_of_rates(&config);
        introduce(&config, objects, &cameras, &format!("{chosen}{services}"))?;
        ready.iter_mut().try_for_each(ReadyFile::publish)?;
        let served = serve(&args, &config, cameras, &seen, &stop);
        drop(ready);
        let reported = report(&config, &served, instruments);
        let ended = match served.ended {
            Ended::AsRequested => {
                ended_in_time(&args, served.cut, served.counters.frames_delivered)
            }
            Ended::Panicked => Err(anyhow!(PANICKED)),
            Ended::LinkGone => Err(anyhow!(
                "link {}: it was lost (see the log above); repair it and start the run again",
                served.gone
            )),
        };
        both(reported.err(), ended.err()).map_or(Ok(()), Err)
    });
    error.map_or(Ok(()), Err)
}

fn outputs(args: &Args, urls: &[String]) -> anyhow::Result<Instruments> {
    let ready_file = args.ready_file.as_deref();
    let config = ("--config", args.config.as_path());
    let named = ready_file.map(|file| ("--ready-file", file));
    args.instruments.check_files(Some(config), named, None)?;
    if let Some(file) = ready_file {
        ready::check(file, args.force.force)?;
    }
    args.instruments.prepare(urls, args.force.force)
}

/// The links of each camera, and a flag that the first packet of a client sets.
fn open_links(
    config: &Config,
    urls: &[String],
    key: String,
    instruments: &Instruments,
) -> anyhow::Result<(Vec<Links>, Arc<AtomicBool>)> {
    let options = live::link_options(&config.run, Some(instruments.bus()));
    let first = instruments.around(link::open_all(urls, &options).context(key)?)?;
    let further = config.cameras.iter().map(|head| {
        let context = || format!("head {} next to {}", head.name, urls.join(" and "));
        link::open_further(&head.links, &options).with_context(context)
    });
    let further: Vec<_> = further.collect::<Result<_, _>>()?;
    let mut links: Vec<_> = std::iter::once(first).chain(further).collect();
    let seen = Arc::new(AtomicBool::new(false));
    for (wire, _) in links.iter_mut().flatten() {
        wire.note_client(|packet| (NATIVE.decode_command)(packet).is_ok(), &seen);
    }
    Ok((links, seen))
}

fn introduce(
    config: &Config,
    objects: usize,
    cameras: &Cameras,
    notes: &str,
) -> anyhow::Result<()> {
    let camera = &config.camera;
    say(format_args!(
        "{notes}{} ({} x {}), {}, {}\n{}listening on {}; Ctrl-C ends the run\n",
        camera.name,
        camera.detector.width,
        camera.detector.height,
        counted(objects, "object"),
        pace(&config.run, camera.rate_hz),
        cameras.first.levels(),
        cameras.first.addresses().join(" and ")
    ))?;
    for (head, at) in config.cameras.iter().zip(&cameras.further) {
        say(format_args!(
            "head {}: {}, {}, {}\n",
            head.name,
            head.camera.name,
            pace(&config.run, head.camera.rate_hz),
            at.addresses()[1..].join(" and ")
        ))?;
    }
    Ok(())
}

fn ready_file(
    args: &Args,
    config: &Config,
    cameras: &Cameras,
    metrics: Option<String>,
) -> anyhow::Result<Option<ReadyFile>> {
    let Some(file) = &args.ready_file else {
        return Ok(None);
    };
    let further = config.cameras.iter().zip(&cameras.further);
    let further = further.map(|(head, at)| Head {
        name: &head.name,
        links: at.addresses()[1..].to_vec(),
    });
    let ready = Ready {
        pid: std::process::id(),
        links: cameras.first.addresses(),
        cameras: further.collect(),
        metrics,
    };
    ReadyFile::prepare(file, &ready).map(Some)
}

/// The end of the run, with the statistics of each camera.
struct Served {
    ended: Ended,
    cut: Option<Cut>,
    gone: String,
    stats: RunStats,
    counters: Counters,
    /// Further cameras, in the order of the run file.
    cameras: Vec<(RunStats, Counters)>,
}

fn serve(
    args: &Args,
    config: &Config,
    cameras: Cameras,
    seen: &AtomicBool,
    stop: &AtomicBool,
) -> Served {
    let Cameras {
        first: mut server,
        further,
    } = cameras;
    let ended_flag = AtomicBool::new(false);
    let begin = Instant::now();
    let timeout = args.timeout.map(Duration::try_from_secs_f64);
    let until = timeout.and_then(|timeout| begin.checked_add(timeout.ok()?));
    server.end_by(until);
    let (mut ended, cameras, cut) = std::thread::scope(|scope| {
        let cameras = config
            .cameras
            .iter()
            .zip(further)
            .map(|(head, mut server)| {
                let (ended, name) = (&ended_flag, &head.name);
                server.end_by(until);
                scope.spawn(move || {
                    let _of = live::of_head(name).entered();
                    let served = server.run(ended, None, |_| {});
                    if served == Ended::Panicked {
                        stop.store(true, Ordering::Relaxed);
                    }
                    (served, server.close())
                })
            });
        let cameras: Vec<_> = cameras.collect();
        let limits = scope.spawn(|| limit(args, begin, [seen, &ended_flag], stop));
        let served = server.run(stop, args.frames, |_| {});
        ended_flag.store(true, Ordering::Relaxed);
        limits.thread().unpark();
        let cameras: Vec<_> = cameras.into_iter().map(|head| head.join()).collect();
        (served, cameras, limits.join().ok().flatten())
    });
    let of_cameras = cameras.into_iter().map(|head| {
        let (served, stats) = head.unwrap_or((Ended::Panicked, Default::default()));
        if served == Ended::Panicked {
            ended = Ended::Panicked;
        }
        stats
    });
    let cameras = of_cameras.collect();
    let gone = server.gone().unwrap_or("of the run").to_string();
    let (stats, counters) = server.close();
    Served {
        ended,
        cut,
        gone,
        stats,
        counters,
        cameras,
    }
}

fn report(config: &Config, served: &Served, instruments: &Instruments) -> anyhow::Result<()> {
    let clock = config.run.clock;
    let mut first = rows(&served.stats, &served.counters, clock);
    first.extend(instruments.row());
    say(format_args!("\n{}", table(&first)))?;
    for (head, (stats, counters)) in config.cameras.iter().zip(&served.cameras) {
        let table = table(&rows(stats, counters, clock));
        say(format_args!("\nhead {}\n{table}", head.name))?;
    }
    Ok(())
}

/// The time limit that has ended a run.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    NoClient,
    TimedOut,
}

/// Stops the run when `--wait-for-client` or `--timeout`, counted from `begin`, has elapsed.
/// Further cameras end with the run.
fn limit(
    args: &Args,
    begin: Instant,
    [seen, ended]: [&AtomicBool; 2],
    stop: &AtomicBool,
) -> Option<Cut> {
    const INTERVAL: Duration = Duration::from_millis(20);
    let is_over = |s: Option<f64>| s.is_some_and(|s| begin.elapsed().as_secs_f64() >= s);
    while !ended.load(Ordering::Relaxed) {
        let cut = if is_over(args.wait_for_client) && !seen.load(Ordering::Relaxed) {
            Some(Cut::NoClient)
        } else {
            is_over(args.timeout).then_some(Cut::TimedOut)
        };
        if cut.is_some() {
            stop.store(true, Ordering::Relaxed);
        }
        if stop.load(Ordering::Relaxed) {
            ended.store(true, Ordering::Relaxed);
            return cut;
        }
        std::thread::park_timeout(INTERVAL);
    }
    None
}

/// Errors: `--frames` were not sent within the time limits.
fn ended_in_time(args: &Args, cut: Option<Cut>, sent: u32) -> anyhow::Result<()> {
    let seconds = |s: Option<f64>| s.unwrap_or_default();
    match (cut, args.frames) {
        (Some(Cut::NoClient), _) => bail!(
            "no client has come within {} s (--wait-for-client): check that it sends to the address above",
            seconds(args.wait_for_client)
        ),
        (cut, Some(requested)) if args.timeout.is_some() && sent < requested => {
            let (s, frames) = (seconds(args.timeout), counted(requested as usize, "frame"));
            match cut {
                Some(_) => bail!("stopped after {s} s (--timeout) with {sent} of {frames} sent"),
                None => bail!(
                    "{sent} of {frames} sent within {s} s (--timeout): `frames withheld` above says why"
                ),
            }
        }
        _ => Ok(()),
    }
}

/// Warns of rates of further cameras that have no effect with the stepped clock.
fn warn_of_rates(config: &Config) {
    let request = frame_request(&config.run).filter(|_| config.run.clock == Clock::Stepped);
    for head in config.cameras.iter().filter(|head| head.has_own_rate) {
        let Some(request) = request else { return };
        let _of = live::of_head(&head.name).entered();
        tracing::warn!(
            "rate_hz = {}: no meaning by the stepped clock, where each {request} gives its frame; leave it out, or set run.clock",
            head.camera.rate_hz
        );
    }
}

/// The packet that requests each frame; none if frames follow the camera's rate.
fn frame_request(run: &Run) -> Option<&'static str> {
    match (run.clock, run.trigger) {
        (_, Trigger::Packet) => Some("Trigger"),
        (Clock::Stepped, Trigger::Own) => Some("attitude"),
        (Clock::Wall | Clock::External, Trigger::Own) => None,
    }
}

fn pace(run: &Run, rate_hz: f64) -> String {
    if let Some(request) = frame_request(run) {
        return format!("a frame for each {request}");
    }
    let frames = if rate_hz == 1.0 { "frame" } else { "frames" };
    let clock = match run.clock {
        Clock::External => "client's",
        Clock::Wall | Clock::Stepped => "wall",
    };
    format!("{rate_hz} {frames} a second by the {clock} clock")
}

fn rows(stats: &RunStats, counters: &Counters, clock: Clock) -> Vec<(String, String)> {
    let mut rows = stats.rows();
    rows.extend(stats.latency_rows(clock != Clock::Stepped));
    let counts: Vec<String> = counters
        .iter()
        .filter(|(_, count)| *count > 0)
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    rows.push(row(
        "counters",
        if counts.is_empty() {
            "all 0".into()
        } else {
            counts.join(", ")
        },
    ));
    rows
}
