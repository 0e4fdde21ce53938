//! The program: parses the command line, runs the command, prints an error once.

mod cli;

use clap::Parser;
use skyloop_firmware_sim::console::{in_one_line, printable, refuse};
use std::process::ExitCode;

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
