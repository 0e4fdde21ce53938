//! `skyloop camera`: commands for camera files. A subcommand is a file here and a line in
//! [`Command`].

mod check;
mod new;

use clap::Subcommand;

#[derive(Subcommand)]
pub enum Command {
    /// Check a camera file and print field of view, scale, limiting and saturation magnitude
    Check(check::Args),
    /// Write a camera file from the values of a data sheet; prompts for missing values
    New(new::Args),
}

pub fn run(command: Command) -> anyhow::Result<()> {
    match command {
        Command::Check(args) => check::run(args),
        Command::New(args) => new::run(args),
    }
}
