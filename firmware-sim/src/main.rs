//! `skyloop-fc`: a flight computer for an emulator on the other end of a UDP or serial link.

mod cli;

use std::cmp::Ordering;
use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{self, AtomicBool};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use cli::{LoopArgs, OutputArgs, ProfileArgs, parse_fault, parse_pause};
use hifitime::Epoch;
use skyloop_firmware_sim::console::{in_one_line, printable, refuse, say, stop_at_ctrl_c};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::{FlightComputer, Pause, RunError};
use skyloop_firmware_sim::link;
use skyloop_firmware_sim::mission::{Mission, Pace};
use skyloop_firmware_sim::profile::{OrbitSource, orbit_of};
use skyloop_firmware_sim::received::Content;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::text::{whole, within};
use skyloop_firmware_sim::verdict::{self, Limits, Suite, UNFINISHED, Verdict, VerdictFile};
use skyloop_orbit::time::parse_utc;
use skyloop_orbit::{Ages, LoadError, file_and_name, set_ut1_utc};
use skyloop_protocols::{Fault, LabelLevel};

/// A mock flight computer: sends attitudes and positions, receives frames, detects stars and
/// compares them with the labels.
#[derive(Debug, Parser)]
#[command(name = "skyloop-fc", version)]
struct Args {
    /// Link to the emulator: udp://127.0.0.1:PORT, serial:///dev/NAME?baud=115200, can:// or
    /// slcan://; several with the roles of the emulator's links, such as --link
    /// 'udp://127.0.0.1:4810?roles=truth+labels' --link 'udp://127.0.0.1:4811?roles=pixels'
    #[arg(long, value_name = "URL", required = true)]
    link: Vec<String>,
    /// TLE, 3LE, CCSDS OMM or OEM file; NAME picks an object by name or identifier
    #[arg(long, value_name = "FILE[:NAME]")]
    orbit: Option<String>,
    /// UT1 - UTC in s (IERS Bulletin A), for OEM and AEM files in Earth-fixed axes or in UT1
    /// without a value of their own
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    ut1_utc: Option<f64>,
    /// Middle of the first exposure, UTC; with --wall the default is now
    #[arg(long, value_name = "UTC", value_parser = parse_utc, required_unless_present_any = ["wall", "closed", "listen"])]
    epoch: Option<Epoch>,
    /// Number of frames
    #[arg(long, default_value_t = 10, value_parser = whole(1..=u32::MAX), allow_negative_numbers = true)]
    frames: u32,
    /// Time from frame to frame, s
    #[arg(
        long,
        default_value_t = 0.5,
        value_name = "S",
        value_parser = within(1e-6..=1e6, "s"),
        allow_negative_numbers = true
    )]
    period: f64,
    #[command(flatten)]
    profile: ProfileArgs,
    /// Attitudes per second: a maximum in stepped mode, the rate with --wall (default 10)
    #[arg(long, value_name = "HZ", value_parser = within(1e-6..=1e5, "Hz"), allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Send attitudes by the wall clock and receive frames as they come
    #[arg(long)]
    wall: bool,
    /// Time to wait for a frame, s
    #[arg(
        long,
        default_value_t = 8.0,
        value_name = "S",
        value_parser = within(1e-3..=1e6, "s"),
        allow_negative_numbers = true
    )]
    timeout: f64,
    /// Request a fault from the emulator, from the start, for S seconds or to the end; may be
    /// repeated; kinds: section 3.2 of the ICD
    #[arg(long, value_name = "KIND:in|out:VALUE[:S]", value_parser = parse_fault)]
    fault: Vec<Fault>,
    /// Pause the emulator for S seconds, AFTER seconds after the first attitude
    #[arg(long, value_name = "AFTER:S", value_parser = parse_pause, requires = "wall", allow_hyphen_values = true)]
    pause: Option<Pause>,
    #[command(flatten)]
    closed: LoopArgs,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    limits: Limits,
    /// Overwrite the file of --junit even if skyloop did not write it
    #[arg(long)]
    force: bool,
}

const PRINTED_REFUSALS: u32 = 5;

fn main() -> ExitCode {
    let args = Args::try_parse().unwrap_or_else(|error| refuse(&error));
    match run(args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            note(in_one_line(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}

/// Prints a line on standard error.
fn note(text: impl Display) {
    eprintln!("skyloop-fc: {}", printable(&text.to_string()));
}

fn run(args: Args) -> Result<()> {
    let mut suite = Suite {
        name: "skyloop-fc",
        classname: "skyloop.fc".to_string(),
        properties: vec![("link".to_string(), args.link.join(" "))],
        ..Suite::default()
    };
    let mut junit = args.limits.open(args.force).map_err(anyhow::Error::msg)?;
    let done = run_mission(&args, &mut suite, junit.as_mut());
    if let (Err(error), Some(junit)) = (&done, &mut junit) {
        let verdicts = args.limits.not_run(&in_one_line(error.as_ref()));
        let written = junit.fail(&suite.document(&verdicts));
        written.map_err(anyhow::Error::msg)?;
    }
    done
}

/// Runs the mission and writes its verdicts.
fn run_mission(args: &Args, suite: &mut Suite, mut junit: Option<&mut VerdictFile>) -> Result<()> {
    let started = Instant::now();
    if let Some(seconds) = args.ut1_utc {
        set_ut1_utc(seconds).map_err(|why| anyhow!("--ut1-utc {why}"))?;
    }
    // With --wall, the mission starts now, before the links are open.
    let zero = args.epoch.is_none().then_some(started);
    let mission = mission(args)?;
    let closed = args.closed.settings(args.wall, &mission)?;
    if let Some(junit) = &mut junit {
        let unfinished = suite.document(&args.limits.not_run(UNFINISHED));
        junit.begin(&unfinished).map_err(anyhow::Error::msg)?;
    }
    let links = args.link.iter().map(|link| link::open(link));
    let mut links = links.collect::<Result<Vec<_>, _>>()?;
    for (link, _) in &mut links {
        link.on_notice(Box::new(|notices| note(notices)));
    }
    let stop = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let flight_computer = FlightComputer::on_links(links, mission)
        .with_faults(args.fault.clone())
        .with_pause(args.pause)
        .with_control(closed)
        .with_start_instant(zero);
    let (report, cut_short) = match report_events(flight_computer, args.profile.listens(), &stop) {
        Ok(report) => (report, None),
        Err(RunError::CutShort { report, source }) => (*report, Some(source)),
        Err(error) => return Err(error.into()),
    };
    let control = report.control.as_ref();
    let off = control.and_then(|control| args.closed.broken(control));
    let mut verdicts = args.limits.assess(&report);
    verdicts.extend(off.map(|off| Verdict::new("pointing", false, off)));
    if let Some(error) = &cut_short {
        verdicts.push(Verdict::new("run", false, error.to_string()));
    }
    suite.seconds = started.elapsed().as_secs_f64();
    suite.table = report.to_string();
    if let Some(junit) = junit {
        let text = suite.document(&verdicts);
        junit.finish(&text).map_err(anyhow::Error::msg)?;
    }
    say(format_args!("{report}{}", verdict::table(&verdicts[1..])))?;
    if let Some(error) = cut_short {
        return Err((*error).into());
    }
    check_complete(&report, &stop)?;
    verdict::broken(&verdicts).map_or(Ok(()), |broken| bail!(broken))
}

fn report_events(
    flight_computer: FlightComputer,
    listens: bool,
    stop: &AtomicBool,
) -> Result<Report, RunError> {
    let mut refusals = 0;
    flight_computer.run(|event| {
        refusals += u32::from(matches!(event, Event::Nack(_)));
        let printed = match (&event, refusals.cmp(&PRINTED_REFUSALS)) {
            (Event::Nack(_), Ordering::Greater) => Ok(()),
            (Event::Nack(nack), Ordering::Equal) => {
                say(format_args!("{nack}; further ones are counted\n"))
            }
            _ => print_event(&event, listens),
        };
        // If printing fails now, it fails again with the report.
        if printed.is_err() || stop.load(atomic::Ordering::Relaxed) {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    })
}

fn check_complete(report: &Report, stop: &AtomicBool) -> Result<()> {
    let (whole, requested) = (report.frames, report.requested);
    let gone = report.gone.as_ref().map(|gone| format!(": {gone}"));
    if whole >= requested {
        return Ok(());
    }
    if stop.load(atomic::Ordering::Relaxed) {
        let gone = gone.unwrap_or_default();
        bail!("stopped after {whole} of {requested} frames{gone}");
    }
    let see = ": see the losses and refusals above, and the emulator's own messages";
    let why = gone.as_deref().unwrap_or(see);
    bail!("{whole} of {requested} frames were complete{why}")
}

fn mission(args: &Args) -> Result<Mission> {
    let start = match args.epoch {
        Some(epoch) => epoch,
        None => Epoch::now().map_err(|error| anyhow!("no system time ({error}): give --epoch"))?,
    };
    let orbit = args.orbit.as_deref().map(|text| orbit(text, start));
    let orbit = orbit.transpose()?;
    let rate_hz = args.rate.unwrap_or(10.0);
    let pace = match (args.profile.listens(), args.wall) {
        (true, _) => Pace::Listen,
        (false, true) => Pace::Wall { rate_hz },
        (false, false) => Pace::Stepped { most_hz: args.rate },
    };
    let profile = args.profile.profile(start)?;
    let (output, positions) = args.output.requested()?;
    Ok(Mission {
        start,
        period_s: args.period,
        frames: args.frames,
        profile,
        orbit,
        timeout: Duration::from_secs_f64(args.timeout),
        pace,
        output,
        positions,
    })
}

/// Loads the object of `FILE[:NAME]`.
fn orbit(text: &str, start: Epoch) -> Result<OrbitSource> {
    let (file, name) = file_and_name(text, |file| Path::new(file).exists());
    if Path::new(file).is_dir() {
        bail!(
            "--orbit {file} is a folder: name one file in it, as {file}/FILE or {file}/FILE:NAME"
        );
    }
    let loaded = skyloop_orbit::load(Path::new(file)).map_err(|error| match error {
        LoadError::Read { .. } => anyhow!("{error}; --orbit takes a TLE, 3LE, OMM or OEM file"),
        other => other.into(),
    })?;
    for assumed in &loaded.assumed {
        note(assumed);
    }
    let (object, rejected) = loaded.pick(name).map_err(|why| anyhow!("{file}: {why}"))?;
    for rejected in rejected.iter().take(5) {
        note(rejected);
    }
    if rejected.len() > 5 {
        let more = rejected.len() - 5;
        note(format_args!("and {more} more records of {file} are no use"));
    }
    if let Some(ages) = Ages::of(std::slice::from_ref(&object), start).filter(Ages::are_old) {
        note(format_args!("{}: {ages}", object.label()));
    }
    Ok(orbit_of(object))
}

fn print_event(event: &Event<'_>, listens: bool) -> std::io::Result<()> {
    match event {
        Event::Frame {
            frame,
            detections,
            score,
            latency,
            ..
        } => {
            // Unknown for another client's attitudes.
            let ms = latency.map(|latency| latency.as_secs_f64() * 1e3);
            let after = |what| ms.map_or(String::new(), |ms| format!(", {what}after {ms:.1} ms"));
            let (number, attitude) = (frame.header.frame, frame.header.attitude_sequence);
            let what = if frame.content == Content::None {
                let labels = match frame.header.label_level {
                    LabelLevel::Text => "a label".to_string(),
                    _ => format!(
                        "{} objects",
                        frame.objects(detections).unwrap_or_default().len()
                    ),
                };
                format!("{labels}, no pixels{}", after(""))
            } else {
                let matched = score.map_or(0, |score| score.matches.len());
                let (found, after) = (detections.list().len(), after("last block "));
                format!("{found} detections, {matched} matched{after}")
            };
            say(format_args!(
                "frame {number} of attitude {attitude}: {what}\n"
            ))
        }
        Event::Lost { loss, .. } if listens => say(format_args!("frame lost: {loss}\n")),
        Event::Lost { sequence, loss } => {
            say(format_args!("attitude {sequence}: frame lost: {loss}\n"))
        }
        Event::Nack(nack) => say(format_args!("{nack}\n")),
        Event::Problem(problem) => say(format_args!("{problem}\n")),
        Event::Tick | Event::Progress => Ok(()),
    }
}
