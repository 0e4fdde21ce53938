//! `skyloop bench`: what this machine makes of the works that take the time, as ratios of one run.

use super::progress;
use clap::{Args as ClapArgs, Subcommand};
use skyloop::measure::{Report, frames, orbits};
use skyloop_firmware_sim::console::say;

/// What is measured, and how it is told.
#[derive(ClapArgs)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    of: Option<Of>,
    #[command(flatten)]
    form: Form,
}

/// What is measured.
#[derive(Subcommand)]
enum Of {
    /// Frames (what is measured if nothing is named): noise against rand_distr, whole frames against their own slow path, two threads
    Frame(Form),
    /// A catalogue's orbits: vector instructions against the sgp4 crate, threads, tracks, a camera's whole step
    Orbit(Form),
}

/// How it is told.
#[derive(ClapArgs)]
struct Form {
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    match args.of.unwrap_or(Of::Frame(args.form)) {
        Of::Frame(form) => measure::<frames::Report>(form),
        Of::Orbit(form) => measure::<orbits::Report>(form),
    }
}

fn measure<R: Report>(form: Form) -> anyhow::Result<()> {
    let bar = progress(R::PARTS, "parts");
    let report = R::measure(|part| {
        bar.set_message(part.to_string());
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    match form.json {
        true => say(format_args!("{}\n", serde_json::to_string_pretty(&report)?))?,
        false => say(format_args!("{report}"))?,
    }
    Ok(())
}
