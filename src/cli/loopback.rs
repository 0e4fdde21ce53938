//! `skyloop loopback`: the emulator against the mock flight computer.

use super::budget::Budget;
use super::common::{Force, Orbits, PANICKED, Records, levels, mission, progress};
use super::instruments;
use super::instruments::{Instruments, both};
use super::live::link_options;
use super::session::{Session, configure};
use anyhow::{Context, Error, anyhow, bail};
use clap::Args as ClapArgs;
use indicatif::ProgressBar;
use skyloop::config::Config;
use skyloop::effect::counted;
use skyloop::engine::ExposedFrame;
use skyloop::link::fault::{Needs, Stop};
use skyloop::link::{self, Roles};
use skyloop::orbit::path_text;
use skyloop::output::{OutputError, Writer};
use skyloop::serve::{Ended, Server};
use skyloop::stats::{RunStats, row, table, times};
use skyloop_firmware_sim::console::{in_one_line, say, stop_at_ctrl_c};
use skyloop_firmware_sim::event::Event;
use skyloop_firmware_sim::flight_computer::{FlightComputer, RunError};
use skyloop_firmware_sim::mission::Mission;
use skyloop_firmware_sim::port::Port;
use skyloop_firmware_sim::report::Report;
use skyloop_firmware_sim::text::whole;
use skyloop_firmware_sim::verdict::{self, Limits, Suite, UNFINISHED, Verdict, VerdictFile};
use skyloop_protocols::PixelLevel;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::{Duration, Instant};

#[derive(ClapArgs)]
pub struct Args {
    /// Link between the two: memory, udp (sockets on 127.0.0.1), serial (a pseudo-terminal), pty
    /// (one at the pace of a baud rate, such as pty?baud=921600), can (on vcan0) or slcan (CAN
    /// frames over a pseudo-terminal)
    #[arg(long, default_value = "memory")]
    link: String,
    /// Scene file [default: the built-in FAI on CASSIOPE, 15 June 2019]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Content of frames [default: the scene's]
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    output: Option<String>,
    /// Number of frames [default: the scene's]
    #[arg(long, value_name = "N", value_parser = whole(1..=1_000_000u32), allow_negative_numbers = true)]
    frames: Option<u32>,
    /// Folder for frames and labels, created if needed
    #[arg(long, value_name = "DIR", default_value = "skyloop-out")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    limits: Limits,
    #[command(flatten)]
    instruments: instruments::Choice,
    #[command(flatten)]
    records: Records,
    #[command(flatten)]
    orbits: Orbits,
    #[command(flatten)]
    budget: Budget,
}

/// Maximum number of frames that wait for the writer; then the emulator waits.
const WRITE_QUEUE: usize = 8;

/// Time without a frame after which a link that a fault has stopped counts as failed.
const STALL_TIMEOUT_OF_FAULT: Duration = Duration::from_secs(5);

pub fn run(args: Args) -> anyhow::Result<()> {
    let scene = args.scene.as_deref().map(|scene| ("--scene", scene));
    let junit = args.limits.junit().map(|file| ("--junit", file));
    (args.instruments).check_files(scene, junit, Some(&args.out))?;
    let mut suite = Suite {
        name: "skyloop loopback",
        classname: "skyloop.loopback".to_string(),
        properties: vec![("link".to_string(), args.link.clone())],
        ..Suite::default()
    };
    let mut junit = args.limits.open(args.force.force).map_err(Error::msg)?;
    let done = fly(&args, &mut suite, junit.as_mut());
    if let (Err(error), Some(junit)) = (&done, &mut junit) {
        let verdicts = args.limits.not_run(&in_one_line(error.as_ref()));
        let written = junit.fail(&suite.document(&verdicts));
        written.map_err(Error::msg)?;
    }
    done
}

/// Runs both programs, and writes frames and verdicts.
fn fly(args: &Args, suite: &mut Suite, mut junit: Option<&mut VerdictFile>) -> anyhow::Result<()> {
    let started = Instant::now();
    let config = scene_with_frames(args)?;
    let mission = mission(&config, args.scene.as_deref())?;
    let links = std::slice::from_ref(&args.link);
    let mut instruments = args.instruments.prepare(links, args.force.force)?;
    if let Some(junit) = &mut junit {
        let unfinished = suite.document(&args.limits.not_run(UNFINISHED));
        junit.begin(&unfinished).map_err(Error::msg)?;
    }
    let options = link_options(&config.run, Some(instruments.bus()));
    let (wire, port) = link::loopback(&args.link, &options)?;
    let links = instruments.around(vec![(wire, Roles::ALL)])?;
    let pixels = config.run.output.pixels;
    let needs = Needs {
        timeout: mission.timeout,
        long_packets: matches!(pixels, PixelLevel::Frame | PixelLevel::Compressed),
    };
    let mut session = Session::new(config);
    let interrupted = stop_at_ctrl_c().context("watching for Ctrl-C")?;
    let chosen = session.settle_budget(&args.budget, Some(&mission), &interrupted)?;
    let writer = Writer::create_over(&args.out, mission.frames, args.force.force)?;
    instruments.begin(session.settings())?;
    let (config, server) = session.stepped(links);
    let introduction = format!(
        "{chosen}{}{} of {} over {}\n",
        server.levels(),
        counted(mission.frames as usize, "frame"),
        config.camera.name,
        server.addresses().join(" and ")
    );
    let (flown, unwritten) = instruments.finish_after(|instruments| {
        say(format_args!("{introduction}"))?;
        let pair = (server, port, mission);
        run_pair(args, pair, writer, (instruments, needs), &interrupted)
    });
    let Some((report, cut_short, table)) = flown else {
        return unwritten.map_or(Ok(()), Err);
    };
    (suite.table, suite.seconds) = (table, started.elapsed().as_secs_f64());
    // An incomplete recording fails the run, also in the JUnit file.
    let cut_short = both(cut_short, unwritten);
    let verdicts = conclude(args, suite, &report, cut_short.as_ref(), junit)?;
    cut_short.map_or(Ok(()), Err)?;
    check_all_frames_arrived(&report, &interrupted)?;
    verdict::broken(&verdicts).map_or(Ok(()), |broken| bail!(broken))
}

/// Runs emulator and flight computer; returns the report, the error that cut it short, and the
/// table.
fn run_pair(
    args: &Args,
    (server, port, mission): (Server, Box<dyn Port + Send>, Mission),
    writer: Writer,
    (instruments, needs): (&Instruments, Needs),
    interrupted: &AtomicBool,
) -> anyhow::Result<(Report, Option<Error>, String)> {
    let bar = progress(mission.frames, "frames");
    let flight_computer = FlightComputer::new(port, mission);
    let to = (instruments, needs);
    let flown = exchange(server, flight_computer, writer, to, interrupted, &bar)?;
    let (report, cut_short) = match flown.report {
        Ok(report) => (report, None),
        Err(error) => attribute_to_faults(error, instruments.faults())?,
    };
    let table = table(&rows(&flown.stats, &report, instruments));
    let stopped = || flown.stopped.map(|stop| stopped_by(&stop, &args.link));
    Ok((report, cut_short.or_else(stopped), table))
}

/// Prints the table and the verdicts, and writes the JUnit file.
fn conclude(
    args: &Args,
    suite: &Suite,
    report: &Report,
    cut_short: Option<&Error>,
    junit: Option<&mut VerdictFile>,
) -> anyhow::Result<Vec<Verdict>> {
    let mut verdicts = args.limits.assess(report);
    verdicts.extend(cut_short.map(|error| Verdict::new("run", false, error.to_string())));
    say(format_args!(
        "{}{}wrote {}\n",
        suite.table,
        verdict::table(&verdicts[1..]),
        path_text(&args.out)
    ))?;
    if let Some(junit) = junit {
        let text = suite.document(&verdicts);
        junit.finish(&text).map_err(Error::msg)?;
    }
    Ok(verdicts)
}

/// The scene, changed by the options.
fn scene_with_frames(args: &Args) -> anyhow::Result<Config> {
    let (scene, output) = (args.scene.as_deref(), args.output.as_deref());
    let mut config = configure(scene, &args.records, &args.orbits, output)?;
    if let (Some(sequence), Some(frames)) = (&mut config.sequence, args.frames) {
        sequence.frames = frames;
    }
    Ok(config)
}

struct RunResults {
    report: Result<Report, RunError>,
    stats: RunStats,
    /// The fault that stopped the link permanently.
    stopped: Option<Stop>,
}

/// Runs emulator and flight computer against each other, and writes the frames.
fn exchange(
    mut server: Server,
    flight_computer: FlightComputer,
    writer: Writer,
    (instruments, needs): (&Instruments, Needs),
    interrupted: &AtomicBool,
    bar: &ProgressBar,
) -> anyhow::Result<RunResults> {
    let (stop, over) = (AtomicBool::new(false), AtomicBool::new(false));
    let (exposed_frames, to_write) = sync_channel::<ExposedFrame>(WRITE_QUEUE);
    let mut stopped = None;
    let (report, served, written) = std::thread::scope(|scope| {
        let emulator = scope.spawn(|| {
            // The flight computer closes the link after its frames, and reports other causes.
            let ended = server.run(&stop, None, |exposed| {
                // The channel is closed only if the writer has failed, which is reported below.
                let _ = exposed_frames.send(exposed.clone());
            });
            drop(exposed_frames);
            over.store(true, Ordering::Relaxed);
            (server.stats().clone(), ended)
        });
        let writing = scope.spawn(|| write(writer, to_write));
        let mut last_event = Instant::now();
        let report = flight_computer.run(|event| {
            if matches!(event, Event::Frame { .. } | Event::Progress) {
                last_event = Instant::now();
            }
            show(&event, bar);
            if last_event.elapsed() > STALL_TIMEOUT_OF_FAULT {
                stopped = instruments.stopped(last_event, needs);
            }
            let ends = interrupted.load(Ordering::Relaxed) || over.load(Ordering::Relaxed);
            if ends || stopped.is_some() {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        });
        stop.store(true, Ordering::Relaxed);
        (report, emulator.join(), writing.join())
    });
    bar.finish_and_clear();
    let (Ok((stats, Ended::AsRequested | Ended::LinkGone)), Ok(written)) = (served, written) else {
        bail!(PANICKED);
    };
    written.context("writing the frames")?;
    Ok(RunResults {
        report,
        stats,
        stopped,
    })
}

/// Shows an event of the flight computer with the progress bar.
fn show(event: &Event<'_>, bar: &ProgressBar) {
    match event {
        Event::Frame { .. } => bar.inc(1),
        Event::Lost { sequence, loss } => {
            bar.suspend(|| tracing::warn!("frame {sequence} lost: {loss}"));
        }
        Event::Nack(nack) => bar.suspend(|| tracing::warn!("{nack}")),
        Event::Problem(problem) => bar.suspend(|| tracing::warn!("{problem}")),
        Event::Tick | Event::Progress => {}
    }
}

/// The error of a link that a fault has stopped permanently.
fn stopped_by(stop: &Stop, link: &str) -> Error {
    let s = STALL_TIMEOUT_OF_FAULT.as_secs();
    let Stop { fault, packets, .. } = stop;
    let (lasts, remedy) = match stop.lasts {
        None => ("has no end".to_string(), "a for_s"),
        Some(lasts) => (
            format!("lasts {:.0} s longer", lasts.as_secs_f64()),
            "a shorter for_s",
        ),
    };
    anyhow!(
        "{link}: a fault blocks the link: the fault {fault} {lasts} and has affected {}, and no packet of a frame has arrived for {s} s; give it \
         {remedy}, a lower value, or an at_s after the last frame",
        counted(*packets as usize, "packet")
    )
}

/// Errors: the run was interrupted, or frames did not arrive. The number of frames in the error is
/// the same as in the verdict.
fn check_all_frames_arrived(report: &Report, interrupted: &AtomicBool) -> anyhow::Result<()> {
    let all = counted(report.requested as usize, "frame");
    if interrupted.load(Ordering::Relaxed) {
        bail!("stopped: {} of {all} were complete", report.frames);
    }
    if report.frames != report.requested {
        let missing = report.requested - report.frames;
        bail!("{missing} of {all} are missing or incomplete (see the log above)");
    }
    Ok(())
}

/// If faults were injected that may have ended the run: its report, and an error that names them.
/// Any other error is returned.
fn attribute_to_faults(
    error: RunError,
    faults: Option<String>,
) -> anyhow::Result<(Report, Option<anyhow::Error>)> {
    let (report, why) = match (error, faults) {
        (RunError::NoAnswer { waited, .. }, Some(done)) => (
            Report::default(),
            anyhow!(
                "no answer within {} s: faults are injected ({done}); give those that let nothing through a for_s, or an at_s \
                 after the start",
                waited.as_secs_f64()
            ),
        ),
        (RunError::CutShort { report, source }, Some(done)) => {
            (*report, anyhow!("{source}; faults are injected ({done})"))
        }
        (error, _) => return Err(error.into()),
    };
    Ok((report, Some(why)))
}

fn write(mut writer: Writer, frames: Receiver<ExposedFrame>) -> Result<(), OutputError> {
    for exposed in frames {
        writer.write(&exposed)?;
    }
    writer.finish()
}

fn rows(stats: &RunStats, report: &Report, instruments: &Instruments) -> Vec<(String, String)> {
    let mut rows = stats.rows();
    let latencies = times(&report.latencies, &[0.5, 0.99]);
    rows.insert(2, row("attitude to last block p50 / p99", latencies));
    rows.push(row(
        "centroids, measured - labelled",
        match report.totals.residual() {
            Some(residual) => format!(
                "rms {:.3} px, median {:.3} px ({} unsaturated, isolated objects)",
                residual.rms_px, residual.median_px, residual.count
            ),
            None => "none".to_string(),
        },
    ));
    rows.push(row(
        "detections",
        format!(
            "{}, of them false: {}; missed above snr 10: {}",
            report.totals.detections, report.totals.false_detections, report.totals.missed
        ),
    ));
    rows.extend(instruments.row());
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn injected_silence_is_not_reported_as_a_missing_emulator() {
        let silent = || RunError::NoAnswer {
            link: "udp://A".into(),
            hint: "",
            waited: Duration::from_secs(30),
        };
        let done = "in: stuck 4; out: none".to_string();
        let (report, why) = attribute_to_faults(silent(), Some(done.clone())).unwrap();
        let text = why.unwrap().to_string();
        for word in ["within 30 s", "faults are injected (in: stuck 4", "for_s"] {
            assert!(text.contains(word), "no {word:?} in {text}");
        }
        assert!(!text.contains("listening"), "{text}");
        assert_eq!(report.frames, 0);
        let short = RunError::CutShort {
            report: Box::default(),
            source: Box::new(silent()),
        };
        let (_, why) = attribute_to_faults(short, Some(done)).unwrap();
        assert!(why.unwrap().to_string().contains("faults are injected"));
        assert!(attribute_to_faults(silent(), None).is_err());
    }
}
