//! `skyloop bench frame`: what frames take, as ratios of one run.

use crate::cli::progress;
use clap::Args as ClapArgs;
use skyloop::measure::frames::Report;
use skyloop_firmware_sim::console::say;

/// Arguments of `skyloop bench frame`.
#[derive(ClapArgs)]
pub struct Args {
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    let bar = progress(Report::PARTS, "parts");
    let report = Report::measure(|part| {
        bar.set_message(part.to_string());
        bar.inc(1);
    })?;
    bar.finish_and_clear();
    match args.json {
        true => say(format_args!("{}\n", serde_json::to_string_pretty(&report)?))?,
        false => say(format_args!("{report}"))?,
    }
    Ok(())
}
