//! The command line. A command is a file here and a line in [`Command`].

mod bench;
mod budget;
mod camera;
mod catalog;
mod common;
mod cost;
mod instruments;
mod interval;
mod lightcurve;
mod live;
mod loopback;
mod numbers;
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
mod session;
mod shell;
mod soak;

use clap::{CommandFactory, Parser, Subcommand};
use skyloop::orbit::set_ut1_utc;
use skyloop_firmware_sim::console::printable_line;
use std::io::IsTerminal;
use tracing::level_filters::LevelFilter;
use tracing_subscriber::field::MakeExt;
use tracing_subscriber::fmt::format::debug_fn;

/// Hardware-in-the-loop star-tracker emulator: attitude in, labelled frames out.
#[derive(Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Cli {
    /// Log refused packets and files, and which effects the first frame needs and why
    #[arg(short, long, global = true, overrides_with = "verbose")]
    pub verbose: bool,
    /// UT1 - UTC in s (IERS Bulletin A), for OEM and AEM files in Earth-fixed axes or in UT1
    /// without a value of their own
    #[arg(long, global = true, value_name = "S", allow_negative_numbers = true)]
    ut1_utc: Option<f64>,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Run the emulator against its own flight computer, without hardware
    Loopback(loopback::Args),
    /// Run the emulator alone and wait for a flight computer
    Run(run::Args),
    /// Run for minutes against a client that takes all frames; fail if deadlines or latencies
    /// exceed their limits
    Soak(soak::Args),
    /// Render frames and labels into a folder, without a flight computer
    Render(Box<render::Args>),
    /// Show which effects a frame simulates, why, and at which error and time
    Plan(plan::Args),
    /// Measure errors and times of a scene at each setting of the tolerances
    Cost(cost::Args),
    /// List the objects that cross the camera's field, with times and magnitudes
    ///
    /// Durations are SI seconds. Over a leap second they are 1 s longer than the difference of the
    /// UTC times.
    Passes(Box<passes::Args>),
    /// Write the magnitude of an object against time, as a table and a plot
    Lightcurve(lightcurve::Args),
    /// Benchmark the expensive steps on this machine
    Bench(bench::Args),
    /// Check, count and generate orbit files
    Catalog(Group<catalog::Command>),
    /// Check camera files and write new ones
    Camera(Group<camera::Command>),
    /// Connect two named pseudo-terminals by a line with a baud rate
    #[cfg(target_os = "linux")]
    Pty(pty::Args),
    /// Send a recorded run to the emulator again and compare its packets
    Replay(replay::Args),
    /// Print the JSON Schema of a kind of file
    Schema(schema::Args),
    /// Print the completion script for a shell
    Completions(shell::Completions),
    /// Print the manual page, or write a page for each command
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
            Command::Completions(args) => shell::completions(args, Cli::command()),
            Command::Man(args) => shell::manual(args, Cli::command()),
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
    // Names in a message are external input.
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
