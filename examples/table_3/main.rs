//! Renders and writes the sequences of the paper's Table 3, and prints their times with the
//! paper's. `cargo run --release --example table_3 -- --help` lists the options.

mod sequence;
mod table;

use clap::Parser;
use skyloop_firmware_sim::console::{in_one_line, say};
use std::io::IsTerminal;
use std::process::ExitCode;
use tracing::level_filters::LevelFilter;

fn main() -> ExitCode {
    let args = table::Args::parse();
    tracing_subscriber::fmt()
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_max_level(LevelFilter::WARN)
        .with_target(false)
        .without_time()
        .init();
    match table::print(&args, |text| say(text)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", in_one_line(error.as_ref()));
            ExitCode::FAILURE
        }
    }
}
