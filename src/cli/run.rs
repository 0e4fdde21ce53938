//! `skyloop run`: the emulator alone, waiting for a flight computer.

use super::budget::{Budget, FRAMES, around};
use super::cost::spread;
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
use skyloop_firmware_sim::text::whole;
use skyloop_protocols::Counters;
use skyloop_protocols::personality::NATIVE;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

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
    let instruments = args
        .instruments
        .prepare(urls, Some(("--config", &args.config)))?;
    let options = link::Options {
        idle,
        personality: &NATIVE,
        bus: Some(instruments.bus()),
    };
    // Before the links: what they make (the name of a pseudo-terminal) is removed at the end.
    let stop = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let help = live::help(&config, args.metrics.as_deref())?;
    let links = link::open_all(urls, &options).context(from)?;
    let links = instruments.around(links)?;
    let further = config.heads.iter().map(|head| {
        let beside = || format!("head {} beside {}", head.name, urls.join(" and "));
        link::open_further(&head.links, &options).with_context(beside)
    });
    let further: Vec<_> = further.collect::<Result<_, _>>()?;
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
    let links = std::iter::once(links).chain(further).collect();
    let (mut server, heads) =
        cameras::serve(&config, emulator, links, first.as_ref(), output, &help)?;
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
    let ended = AtomicBool::new(false);
    let (mut served, heads) = std::thread::scope(|scope| {
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
        let served = server.run(&stop, args.frames, |_| {});
        ended.store(true, Ordering::Relaxed);
        let heads: Vec<_> = heads.into_iter().map(|head| head.join()).collect();
        (served, heads)
    });

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
        Ended::AsAsked => Ok(()),
        Ended::Panicked => bail!(PANICKED),
        Ended::LinkGone => bail!("link {gone}: it has gone (see the log above); open it again"),
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
