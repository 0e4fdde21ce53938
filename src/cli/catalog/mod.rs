//! `skyloop catalog`: what is done with files of orbits. A subcommand is a file here and a line in [`Command`].

mod check;
mod convert;
mod info;
mod source;
mod synth;

use clap::{Args as ClapArgs, Subcommand};

/// Arguments of `skyloop catalog`.
#[derive(ClapArgs)]
#[command(arg_required_else_help = true)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Say what files of orbits hold, and what of it cannot be used, with line and reason
    Check(check::Args),
    /// Count the objects of files by kind of orbit, or tell one
    Info(info::Args),
    /// Write element sets in another format
    Convert(convert::Args),
    /// Make a population up, with the mix of the real one, for scale tests
    Synth(synth::Args),
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<()> {
    match args.command {
        Command::Check(args) => check::run(args),
        Command::Info(args) => info::run(args),
        Command::Convert(args) => convert::run(args),
        Command::Synth(args) => synth::run(args),
    }
}
