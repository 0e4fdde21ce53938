//! `skyloop bench`: what this machine makes of the works that take the time.

mod frame;
mod orbit;

use clap::Subcommand;

/// What is measured.
#[derive(Subcommand)]
pub enum Args {
    /// Frames: noise against rand_distr, whole frames against their own slow path, two threads
    Frame(frame::Args),
    /// A catalogue's orbits: vector instructions against the sgp4 crate, threads, tracks, a camera's whole step
    Orbit(orbit::Args),
}

/// Runs the command.
pub fn run(args: Args) -> anyhow::Result<()> {
    match args {
        Args::Frame(args) => frame::run(args),
        Args::Orbit(args) => orbit::run(args),
    }
}
