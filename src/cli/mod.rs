//! The command line. A command is a file here and a line in [`Command`].

mod bench;
mod budget;
mod camera;
mod cameras;
mod catalog;
mod cost;
mod instruments;
mod interval;
mod lightcurve;
mod live;
mod loopback;
mod passes;
mod plan;
mod pointing;
#[cfg(target_os = "linux")]
mod pty;
mod ready;
mod render;
mod replay;
mod run;
mod schema;
mod shell;
mod soak;

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use clap::{Parser, Subcommand};
use hifitime::Epoch;
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;
use skyloop::config::{Config, Observer};
use skyloop::effect::counted;
use skyloop::flight;
use skyloop::load::orbits::{of_one_name, several_sets, shared_names};
use skyloop::orbit::path_text;
use skyloop::orbit::{Ages, Object, is_same, set_ut1_utc};
use skyloop_firmware_sim::console::{printable_line, say};
use skyloop_firmware_sim::mission::Mission;
use skyloop_protocols::Output;
use std::io::IsTerminal;
use std::path::Path;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::field::MakeExt;
use tracing_subscriber::fmt::format::debug_fn;

/// Hardware-in-the-loop star-tracker emulator: attitude in, labelled frames out.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    /// Log what is refused, and which effects the first frame needs and why
    #[arg(short, long, global = true, overrides_with = "verbose")]
    pub verbose: bool,
    /// UT1 - UTC in s (IERS Bulletin A) of OEM and AEM files in Earth-fixed axes or in UT1 that do not give it themselves
    #[arg(long, global = true, value_name = "S", allow_negative_numbers = true)]
    ut1_utc: Option<f64>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run emulator and mock flight computer against each other; needs nothing
    Loopback(loopback::Args),
    /// Run the emulator alone and wait for a flight computer
    Run(run::Args),
    /// Run for minutes against a client that takes all frames, and fail where deadlines or latencies are not kept
    Soak(soak::Args),
    /// Render frames and labels into a folder, without a flight computer
    Render(Box<render::Args>),
    /// Say what a frame simulates and what not, why, and what that costs
    Plan(plan::Args),
    /// Render a scene at each setting of the tolerances, and set their errors against their times
    Cost(cost::Args),
    /// Say which objects cross the camera's field, when, and how bright
    ///
    /// Durations are SI seconds: over a leap second they are one longer than the UTC times differ.
    Passes(Box<passes::Args>),
    /// Write the magnitude of an object against time, as a table and a plot
    Lightcurve(lightcurve::Args),
    /// What this machine makes of the works that take the time
    Bench(bench::Args),
    /// Check, count and make files of orbits
    Catalog(Group<catalog::Command>),
    /// Check camera files and make new ones
    Camera(Group<camera::Command>),
    /// Make a named pair of pseudo-terminals joined by a line of a baud rate
    #[cfg(target_os = "linux")]
    Pty(pty::Args),
    /// Feed a recorded run to the emulator again and compare what it sends
    Replay(replay::Args),
    /// Print the JSON Schema of a kind of file
    Schema(schema::Args),
    /// Print a shell's script for completion of commands and options
    Completions(shell::Completions),
    /// Print the manual page, or write one for each command
    Man(shell::Manual),
}

/// A command that only has subcommands.
#[derive(clap::Args)]
#[command(arg_required_else_help = true)]
struct Group<C: Subcommand> {
    #[command(subcommand)]
    command: C,
}

impl Cli {
    pub fn run(self) -> anyhow::Result<()> {
        if let Some(seconds) = self.ut1_utc {
            set_ut1_utc(seconds).map_err(|why| anyhow::anyhow!("--ut1-utc {why}"))?;
        }
        match self.command {
            Command::Loopback(args) => loopback::run(args),
            Command::Run(args) => run::run(args),
            Command::Soak(args) => soak::run(args),
            Command::Render(args) => render::run(*args),
            Command::Plan(args) => plan::run(args),
            Command::Cost(args) => cost::run(args),
            Command::Passes(args) => passes::run(*args),
            Command::Lightcurve(args) => lightcurve::run(args),
            Command::Bench(args) => bench::run(args),
            Command::Catalog(args) => catalog::run(args.command),
            Command::Camera(args) => camera::run(args.command),
            Command::Schema(args) => schema::run(args),
            Command::Completions(args) => shell::completions(args),
            Command::Man(args) => shell::manual(args),
            #[cfg(target_os = "linux")]
            Command::Pty(args) => pty::run(args),
            Command::Replay(args) => replay::run(args, self.verbose),
        }
    }
}

pub fn start_log(verbose: bool) {
    let level = if verbose {
        LevelFilter::DEBUG
    } else {
        LevelFilter::WARN
    };
    // Names in a message come from outside.
    let fields = debug_fn(|writer, field, value| {
        let text = format!("{value:?}");
        let text = printable_line(&text);
        match field.name() {
            "message" => write!(writer, "{text}"),
            name => write!(writer, "{name}={text}"),
        }
    });
    tracing_subscriber::fmt()
        .fmt_fields(fields.delimited(" "))
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(level)
        .with_target(false)
        .without_time()
        .init();
}

fn scene(file: Option<&Path>) -> anyhow::Result<Config> {
    Ok(match file {
        Some(file) => Config::load(file)?,
        None => Config::builtin()?,
    })
}

/// What a scene is called: its file.
fn scene_name(file: Option<&Path>) -> String {
    file.map_or("the built-in scene".to_string(), path_text)
}

/// How orbits are worked out.
#[derive(clap::Args)]
struct Orbits {
    /// Ask SGP4 for every object in every frame, instead of for those alone that may be in the field; frames and labels are the same
    #[arg(long)]
    exact: bool,
}

impl Orbits {
    fn settle(&self, config: &mut Config) {
        if self.exact {
            config.fidelity.orbits = skyloop::fidelity::Orbits::Exact;
        }
    }
}

/// What is done about records of orbit files that cannot be used.
#[derive(clap::Args, Default)]
struct Records {
    /// Stop with an error if a record or a file of orbits cannot be used, which is else left out
    #[arg(long)]
    strict: bool,
}

/// What is done about files in the place of an output that skyloop did not make.
#[derive(clap::Args)]
struct Force {
    /// Replace files in the place of outputs even if skyloop did not make them
    #[arg(long)]
    force: bool,
}

/// Prints a report as JSON.
fn say_json(report: &impl Serialize) -> anyhow::Result<()> {
    say(format_args!("{}\n", serde_json::to_string_pretty(report)?))?;
    Ok(())
}

/// Whether an output that is one text names standard output.
fn is_stdout(path: &Path) -> bool {
    path == Path::new("-")
}

/// Records that are named at most.
const NAMED: usize = 10;

/// What a run says that has ended so.
const PANICKED: &str =
    "a thread of the run has panicked: please report it with the command you gave";

impl Records {
    /// Logs what was refused of a scene's orbit files; an error if nothing may be.
    fn settle(&self, config: &Config) -> anyhow::Result<()> {
        self.settle_lines(&config.rejected)?;
        for line in &config.notices {
            tracing::warn!("{line}");
        }
        let shared = shared_names(&config.objects);
        let lines = several_sets(&config.objects).into_iter();
        for line in lines.chain(of_one_name(&shared)) {
            tracing::warn!("{line}");
        }
        Ok(())
    }

    /// The same for the lines of records, where there is no scene.
    fn settle_lines(&self, rejected: &[String]) -> anyhow::Result<()> {
        let mut lines: Vec<String> = rejected.iter().take(NAMED).cloned().collect();
        if let Some(others @ 1..) = rejected.len().checked_sub(NAMED) {
            lines.push(format!(
                "{others} more; skyloop catalog check FILE names them all"
            ));
        }
        if self.strict && !rejected.is_empty() {
            bail!(
                "--strict: {} of orbit files cannot be used:\n  {}",
                counted(rejected.len(), "record"),
                lines.join("\n  ")
            );
        }
        for line in lines {
            tracing::warn!("refused: {line}");
        }
        Ok(())
    }
}

/// Warns where most element sets are of another time.
fn warn_of_old(objects: &[Object], at: Epoch) {
    if let Some(ages) = Ages::of(objects, at).filter(Ages::are_old) {
        tracing::warn!("{ages}");
    }
}

/// Warns where an observer's element sets are of another time than the `ends` of a run.
fn warn_of_observer(observer: &Object, ends: [Epoch; 2]) {
    let at = |end| Ages::of(std::slice::from_ref(observer), end).filter(Ages::are_old);
    if let Some(ages) = ends.into_iter().find_map(at) {
        tracing::warn!("the observer, {}: {ages}", observer.label());
    }
}

/// Refuses to look at the observer with its own eyes.
fn not_itself(observer: &Object, object: &Object) -> anyhow::Result<()> {
    if is_same(observer, object) {
        anyhow::bail!("--object {}: that is the observer itself", object.label());
    }
    Ok(())
}

/// The mission of a configuration; an error names the scene file that it comes from.
fn mission(config: &Config, scene: Option<&Path>) -> anyhow::Result<Mission> {
    let mission = match (flight::mission(config), scene) {
        (mission, Some(scene)) => mission.with_context(|| path_text(scene))?,
        (mission, None) => mission?,
    };
    if let Some(Observer::Object(observer)) = &config.observer {
        let last = mission.epoch(mission.frames.saturating_sub(1));
        warn_of_observer(observer, [mission.start, last]);
    }
    Ok(mission)
}

fn levels() -> PossibleValuesParser {
    PossibleValuesParser::new(Output::PRESETS.map(|(name, ..)| name))
}

/// `output` at the level called `name`, if one is given.
fn with_level(output: Output, name: Option<&str>) -> Output {
    let preset = name.and_then(Output::preset);
    preset.map_or(output, |preset| Output {
        pixels: preset.pixels,
        labels: preset.labels,
        ..output
    })
}

/// A progress bar over so many `steps` of `what`; nothing where standard error is no terminal.
fn progress(steps: u32, what: &str) -> ProgressBar {
    let template = format!("{{bar:40}} {{pos}}/{{len}} {what}  {{msg}}");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(u64::from(steps))
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
