//! `skyloop catalog`: what is done with files of orbits. A subcommand is a file here and a line in [`Command`].

mod check;

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
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<()> {
    match args.command {
        Command::Check(args) => check::run(args),
    }
}
