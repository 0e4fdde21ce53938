//! The front door: reads the command line, runs the command, prints an error once.

mod cli;

use clap::Parser;
use skyloop_firmware_sim::console::{in_one_line, printable, refuse};
use snmalloc_rs::SnMalloc;
use std::process::ExitCode;

/// What one thread takes and another gives back costs little; the C library's keeps both waiting, a fourth of a frame full of objects. What was taken is kept, so that
/// no frame waits for the system, and a run holds as much after a day as after a minute.
#[global_allocator]
static MEMORY: SnMalloc = SnMalloc;

fn main() -> ExitCode {
    let cli = cli::Cli::try_parse().unwrap_or_else(|error| refuse(&error));
    cli::start_log(cli.verbose);
    match cli.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", printable(&in_one_line(error.as_ref())));
            ExitCode::FAILURE
        }
    }
}
