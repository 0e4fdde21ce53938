//! `skyloop replay`: runs the inputs of a recording again, and compares the packets.

use super::common::{Orbits, Records, levels};
use super::session::{Session, configure};
use anyhow::{Context, bail};
use clap::Args as ClapArgs;
use skyloop::config::Clock;
use skyloop::effect::counted;
use skyloop::link::capture::Origin;
use skyloop::link::capture::replay::{Progress, Recording, Replay, Same, load};
use skyloop::orbit::inputs;
use skyloop::orbit::path_text;
use skyloop::serve::{Ended, Server};
use skyloop_firmware_sim::console::{say, stop_at_ctrl_c};
use skyloop_protocols::Direction;
use skyloop_protocols::personality::NATIVE;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

#[derive(ClapArgs)]
pub struct Args {
    /// Recording made with --capture, or a log of candump
    file: PathBuf,
    /// Run file of the recorded run; its clock is stepped
    #[arg(long, value_name = "FILE", conflicts_with = "scene")]
    config: Option<PathBuf>,
    /// Scene file of the recorded loopback [default: the built-in scene]
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// The recorded run's --output, if it had one
    #[arg(long, value_name = "LEVEL", value_parser = levels())]
    output: Option<String>,
    /// Fail if one step, such as a frame, takes longer than this
    #[arg(long = "patience", alias = "timeout", value_name = "SECONDS", value_parser = seconds, default_value = "600", allow_negative_numbers = true)]
    timeout: Duration,
}

/// Idle time of the emulator after which the replay fails. It is longer than the 2 s after which
/// the emulator drops a frame whose packets are not taken.
const SILENCE: Duration = Duration::from_secs(10);

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds = text.parse::<f64>().ok().filter(|s| *s > 0.0);
    let duration = seconds.and_then(|s| Duration::try_from_secs_f64(s).ok());
    duration.ok_or_else(|| "seconds, above 0".to_string())
}

/// Runs the command; `verbose` lists the frames.
pub fn run(args: Args, verbose: bool) -> anyhow::Result<()> {
    let recording = load(&args.file, &NATIVE)?;
    let file = args.config.as_deref().or(args.scene.as_deref());
    let (records, orbits) = (Records::default(), Orbits::default());
    let config = configure(file, &records, &orbits, args.output.as_deref())?;
    if let (Some(file), Clock::Wall) = (&args.config, config.run.clock) {
        bail!(
            "{}: run.clock = \"wall\": only stepped runs can be replayed: by the wall clock frames depend on the moment",
            path_text(file)
        );
    }
    let gaps = gaps(&recording);
    say(has_both_directions(&args, &recording, &gaps)?)?;
    let interrupted = stop_at_ctrl_c().context("watching for Ctrl-C")?;
    let session = Session::new(config);
    let hint = compare_origins(&args, &recording, session.settings());
    let (links, replay) = Replay::of(recording, &NATIVE);
    let (config, mut server) = session.stepped(links);
    server.set_run(&config.run);
    wait(&args, server, &replay, &interrupted, &hint)?;
    let progress = replay.progress();
    if verbose {
        list(&progress)?;
    }
    let whole = count_whole_frames(&progress);
    if let Some(difference) = progress.difference {
        bail!(
            "after {} that came back the same: {difference}; {hint}",
            counted(whole, "frame")
        );
    }
    if whole == 0 {
        bail!(
            "{}: no whole frame is in it: there is nothing to compare{gaps}",
            path_text(&args.file)
        );
    }
    say(format_args!(
        "the same: {}, {}\n",
        counted(whole, "frame"),
        counted(progress.packets as usize, "packet")
    ))?;
    if !gaps.is_empty() {
        say(format_args!("{}\n", gaps.trim_start_matches("; ")))?;
    }
    Ok(())
}

/// A line of text about the recording.
///
/// Errors: nothing was received or sent in the recording.
fn has_both_directions(args: &Args, recording: &Recording, gaps: &str) -> anyhow::Result<String> {
    let count = |direction| {
        let events = recording.events.iter();
        events.filter(|event| event.direction == direction).count()
    };
    let (received, sent) = (count(Direction::In), count(Direction::Out));
    let file = path_text(&args.file);
    if received == 0 {
        bail!("{file}: nothing was received in it");
    }
    if sent == 0 {
        let what = if recording.on_the_bus {
            "packet of a frame"
        } else {
            "packet"
        };
        bail!("{file}: no {what} was sent in it: there is nothing to compare{gaps}");
    }
    Ok(format!(
        "replaying {file}: {received} packets received, {sent} sent\n"
    ))
}

/// Warns of files and settings that differ from the recording; returns a hint at the cause of a
/// difference.
fn compare_origins(args: &Args, recording: &Recording, settings: Vec<(String, String)>) -> String {
    let inputs = inputs().into_iter();
    let now = Origin {
        settings,
        inputs: inputs.filter(|input| input.path != args.file).collect(),
    };
    let origin = recording.origin.as_ref();
    let differences = origin.map(|origin| origin.differences(&now));
    for difference in differences.iter().flatten() {
        tracing::warn!("not as recorded: {difference}");
    }
    let hint = hint(args, differences.as_deref());
    if recording.on_the_bus {
        return hint + " A log of CAN frames does not list its inputs: compare them yourself";
    }
    hint
}

/// Runs the server until the replay is over.
///
/// Errors: it was interrupted, exceeded the timeout of a step, or has panicked.
fn wait(
    args: &Args,
    mut server: Server,
    replay: &Replay,
    interrupted: &AtomicBool,
    hint: &str,
) -> anyhow::Result<()> {
    // Not scoped: a frame that takes too long cannot be stopped, so its thread is abandoned.
    let serving = std::thread::spawn({
        let replay = replay.clone();
        move || server.run(replay.over(), None, |_| {})
    });
    while !replay.over().load(Ordering::Relaxed) {
        if serving.is_finished() {
            if serving.join().unwrap_or(Ended::Panicked) == Ended::Panicked {
                bail!("a thread of the replay has panicked: please report it with the recording");
            }
            break;
        }
        std::thread::sleep(Duration::from_millis(5));
        let same = || counted(count_whole_frames(&replay.progress()), "frame");
        if interrupted.load(Ordering::Relaxed) {
            bail!("stopped after {} that came back the same", same());
        }
        if replay.idle() > SILENCE {
            replay.give_up();
        }
        if replay.still() > args.timeout {
            bail!(
                "{}: after {} that came back the same, the next step of the emulator takes more than {} s (--patience); {hint}",
                path_text(&args.file),
                same(),
                args.timeout.as_secs_f64()
            );
        }
    }
    Ok(())
}

fn list(progress: &Progress) -> anyhow::Result<()> {
    for Same {
        frame,
        link: _,
        attitude,
        packets,
        crc32,
        whole,
    } in &progress.frames
    {
        let note = if *whole { "" } else { "  (incomplete)" };
        say(format_args!(
            "  frame {frame:5}  attitude {attitude:5}  {packets:5} packets  crc32 {crc32:08x}{note}\n"
        ))?;
    }
    Ok(())
}

/// The possible cause of a difference. `differences`: none if the recording lacks its origin.
fn hint(args: &Args, differences: Option<&[String]>) -> String {
    match (differences, &args.config, &args.scene) {
        (Some([]), ..) => "files and settings are those of the recording: has the recording itself been changed, or was it made by \
                           another build?"
            .to_string(),
        (Some(differences), ..) => format!("not as recorded: {}", differences.join("; ")),
        (None, Some(_), _) => "is it the same --config, and --output?".to_string(),
        (None, None, Some(_)) => "is it the same --scene, and --output?".to_string(),
        (None, None, None) => "was it a loopback's built-in scene? A run needs its --config, another scene its --scene, both their --output"
            .to_string(),
    }
}

fn count_whole_frames(progress: &Progress) -> usize {
    progress.frames.iter().filter(|frame| frame.whole).count()
}

/// Text about the frames that cannot be compared, in a recording made on a CAN bus.
fn gaps(recording: &Recording) -> String {
    let mut text = String::new();
    if recording.torn > 0 {
        let torn = recording.torn;
        text += &format!(
            "; frames of which packets are missing in it: {torn} (the others were compared)"
        );
    }
    if recording.doubled > 0 {
        let doubled = recording.doubled;
        text += &format!(
            "; frames not compared: {doubled}, packets of them are there twice without a Resend"
        );
    }
    text
}
