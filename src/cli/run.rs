//! `skyloop run`: the emulator alone, waiting for a flight computer.

use super::budget::{Budget, FRAMES, around};
use super::cost::spread;
use super::instruments::settings;
use super::ready::{self, Head, Ready, ReadyFile};
use super::{Orbits, PANICKED, Records, cameras, instruments, levels, live, mission, with_level};
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use skyloop::config::{Clock, Config, Run, Trigger};
use skyloop::effect::counted;
use skyloop::engine::Emulator;
use skyloop::flight;
use skyloop::link;
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

/// Arguments of `skyloop run`.
#[derive(ClapArgs)]
pub struct Args {
    /// Configuration file (see configs/default.toml)
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// Link to listen on, such as udp://127.0.0.1:4810 or serial:///dev/ttyUSB0?baud=921600; several with
    /// roles=truth, pixels, labels [default: the file's]
    #[arg(long, value_name = "URL")]
    link: Vec<String>,
    /// What frames bring until a client says otherwise [default: the file's]
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    output: Option<String>,
    /// End after this many frames [default: at Ctrl-C]
    #[arg(long, value_name = "N", value_parser = whole(1..=u32::MAX), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// Where the figures of the run can be fetched as Prometheus text, such as 127.0.0.1:9464 [default: the file's, else nowhere]
    #[arg(long, value_name = "ADDRESS")]
    metrics: Option<String>,
    /// End with an error if no client has come after this many seconds
    #[arg(long, value_name = "S", value_parser = decimal(0.001..=1e7), allow_negative_numbers = true)]
    wait_for_client: Option<f64>,
    /// End after this many seconds; with an error if --frames have not been sent by then
    #[arg(long, value_name = "S", value_parser = decimal(0.001..=1e7), allow_negative_numbers = true)]
    timeout: Option<f64>,
    /// Write a JSON file with the actual addresses once all links listen; removed at the end
    #[arg(long, value_name = "FILE")]
    ready_file: Option<PathBuf>,
    #[command(flatten)]
    instruments: instruments::Choice,
    #[command(flatten)]
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
    #[command(flatten)]
    budget: Budget,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let mut config = Config::load(&args.config)?;
    args.records.settle(&config)?;
    args.orbits.settle(&mut config);
    let idle = Duration::from_secs_f64(config.run.idle_s);
    let (urls, from) = match args.link.is_empty() {
        true => (
            &config.run.links,
            format!("{}: run.link", args.config.display()),
        ),
        false => (&args.link, "--link".to_string()),
    };
    let ready_file = args.ready_file.as_deref();
    let named = ready_file.map(|file| ("--ready-file", file));
    let named: Vec<_> = [("--config", args.config.as_path())]
        .into_iter()
        .chain(named)
        .collect();
    let mut instruments = args.instruments.prepare(urls, &named)?;
    // After the inputs are known: it is none.
    if let Some(file) = ready_file {
        ready::check(file)?;
    }
    let options = link::Options {
        idle,
        personality: &NATIVE,
        bus: Some(instruments.bus()),
    };
    // Before the links: what they make (the name of a pseudo-terminal) is removed at the end.
    let stop = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let help = live::help(&config, args.metrics.as_deref())?;
    let links = link::open_all(urls, &options).context(from)?;
    let mut links = instruments.around(links)?;
    let further = config.heads.iter().map(|head| {
        let beside = || format!("head {} beside {}", head.name, urls.join(" and "));
        link::open_further(&head.links, &options).with_context(beside)
    });
    let mut further: Vec<_> = further.collect::<Result<_, _>>()?;
    let seen = Arc::new(AtomicBool::new(false));
    for (wire, _) in links.iter_mut().chain(further.iter_mut().flatten()) {
        wire.note_client(|packet| (NATIVE.decode_command)(packet).is_ok(), &seen);
    }
    let (objects, clock) = (config.objects.len(), config.run.clock);
    let output = with_level(config.run.output, args.output.as_deref());
    let scene = match config.sequence {
        Some(_) => Some(mission(&config, Some(&args.config))?),
        None => None,
    };
    let mut emulator = Emulator::new(&mut config);
    let chosen = args.budget.settle(&mut emulator, &stop, || match &scene {
        Some(mission) => spread(mission, FRAMES),
        None => around(),
    })?;
    let first = match &scene {
        Some(mission) if clock != Clock::Stepped => Some(flight::vehicle(mission, 0)?),
        _ => None,
    };
    let recorded = settings(output, &emulator);
    let links = std::iter::once(links).chain(further).collect();
    let (mut server, heads) =
        cameras::serve(&config, emulator, links, first.as_ref(), output, &help)?;
    // The last that may fail: earlier files are replaced here.
    instruments.begin(recorded)?;
    warn_of_rates(&config);

    let camera = &config.camera;
    say(format_args!(
        "{chosen}{help}{} ({} x {}), {}, {}\n{}listening on {}; Ctrl-C ends the run\n",
        camera.name,
        camera.detector.width,
        camera.detector.height,
        counted(objects, "object"),
        pace(&config.run, camera.rate_hz),
        server.levels(),
        server.addresses().join(" and ")
    ))?;
    for (head, at) in config.heads.iter().zip(&heads) {
        say(format_args!(
            "head {}: {}, {}, {}\n",
            head.name,
            head.camera.name,
            pace(&config.run, head.camera.rate_hz),
            at.addresses()[1..].join(" and ")
        ))?;
    }
    let of_heads = config.heads.iter().zip(&heads).map(|(head, at)| Head {
        name: &head.name,
        links: at.addresses()[1..].to_vec(),
    });
    let ready = Ready {
        pid: std::process::id(),
        links: server.addresses().iter().map(ToString::to_string).collect(),
        heads: of_heads.collect(),
        metrics: help.metrics_address(),
    };
    let ready = ready_file.map(|file| ReadyFile::write(file, &ready));
    let ready = ready.transpose()?;
    let ended = AtomicBool::new(false);
    let (mut served, heads, cut) = std::thread::scope(|scope| {
        let heads = config.heads.iter().zip(heads).map(|(head, mut server)| {
            let (ended, stop, name) = (&ended, &stop, &head.name);
            scope.spawn(move || {
                let _of = live::of_head(name).entered();
                let served = server.run(ended, None, |_| {});
                if served == Ended::Panicked {
                    stop.store(true, Ordering::Relaxed);
                }
                (name, served, server.close())
            })
        });
        let heads: Vec<_> = heads.collect();
        let limits = scope.spawn(|| limit(&args, &seen, &ended, &stop));
        let served = server.run(&stop, args.frames, |_| {});
        ended.store(true, Ordering::Relaxed);
        let heads: Vec<_> = heads.into_iter().map(|head| head.join()).collect();
        (served, heads, limits.join().ok().flatten())
    });
    drop(ready);

    let gone = server.gone().unwrap_or("of the run").to_string();
    let (stats, counters) = server.close();
    let mut rows = rows(&stats, &counters, clock);
    rows.extend(instruments.rows());
    say(format_args!("\n{}", table(&rows)))?;
    for head in heads {
        let Ok((name, head_served, (stats, counters))) = head else {
            bail!(PANICKED);
        };
        if head_served == Ended::Panicked {
            served = Ended::Panicked;
        }
        say(format_args!(
            "\nhead {name}\n{}",
            table(&self::rows(&stats, &counters, clock))
        ))?;
    }
    instruments.finish()?;
    match served {
        Ended::AsAsked => ended_in_time(&args, cut, stats.frames),
        Ended::Panicked => bail!(PANICKED),
        Ended::LinkGone => bail!("link {gone}: it has gone (see the log above); open it again"),
    }
}

/// A limit of time that has ended a run.
#[derive(Clone, Copy, PartialEq)]
enum Cut {
    /// No client has come.
    NoClient,
    /// Its time is over.
    TimedOut,
}

/// Stops the run when `--wait-for-client` or `--timeout` is over, counted from now.
fn limit(args: &Args, seen: &AtomicBool, ended: &AtomicBool, stop: &AtomicBool) -> Option<Cut> {
    const LOOK: Duration = Duration::from_millis(20);
    let begin = Instant::now();
    let is_over = |s: Option<f64>| s.is_some_and(|s| begin.elapsed().as_secs_f64() >= s);
    while !ended.load(Ordering::Relaxed) {
        let cut = if is_over(args.wait_for_client) && !seen.load(Ordering::Relaxed) {
            Some(Cut::NoClient)
        } else {
            is_over(args.timeout).then_some(Cut::TimedOut)
        };
        if cut.is_some() {
            stop.store(true, Ordering::Relaxed);
            return cut;
        }
        std::thread::sleep(LOOK);
    }
    None
}

/// Errors: a limit of time has ended the run before it had what was asked for.
fn ended_in_time(args: &Args, cut: Option<Cut>, frames: u32) -> anyhow::Result<()> {
    let seconds = |s: Option<f64>| s.unwrap_or_default();
    match (cut, args.frames) {
        (Some(Cut::NoClient), _) => bail!(
            "no client has come within {} s (--wait-for-client): check that it sends to the address above",
            seconds(args.wait_for_client)
        ),
        (Some(Cut::TimedOut), Some(wanted)) if frames < wanted => bail!(
            "stopped after {} s (--timeout) with {frames} of {}",
            seconds(args.timeout),
            counted(wanted as usize, "frame")
        ),
        _ => Ok(()),
    }
}

/// A rate of its own has no meaning for a camera whose frames are asked for.
fn warn_of_rates(config: &Config) {
    let asks = asks(&config.run).filter(|_| config.run.clock == Clock::Stepped);
    for head in config.heads.iter().filter(|head| head.has_own_rate) {
        let Some(asks) = asks else { return };
        let _of = live::of_head(&head.name).entered();
        tracing::warn!(
            "rate_hz = {}: no meaning by the stepped clock, where each {asks} gives its frame; leave it out, or set run.clock",
            head.camera.rate_hz
        );
    }
}

/// What asks for each frame, where a camera's rate does not.
fn asks(run: &Run) -> Option<&'static str> {
    match (run.clock, run.trigger) {
        (_, Trigger::Packet) => Some("Trigger"),
        (Clock::Stepped, Trigger::Own) => Some("attitude"),
        (Clock::Wall | Clock::External, Trigger::Own) => None,
    }
}

/// When a camera's frames come.
fn pace(run: &Run, rate_hz: f64) -> String {
    if let Some(asks) = asks(run) {
        return format!("a frame for each {asks}");
    }
    let frames = if rate_hz == 1.0 { "frame" } else { "frames" };
    let clock = match run.clock {
        Clock::External => "client's",
        Clock::Wall | Clock::Stepped => "wall",
    };
    format!("{rate_hz} {frames} a second by the {clock} clock")
}

/// What is told of one camera at the end.
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
