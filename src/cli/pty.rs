//! `skyloop pty`: two pseudo-terminals joined by a line, for tests without serial ports.

use anyhow::Context;
use clap::Args as ClapArgs;
use skyloop::link::Pair;
use skyloop::orbit::path_text;
use skyloop_firmware_sim::console::{say, stop_at_ctrl_c};
use skyloop_firmware_sim::text::whole;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Args {
    /// Path of one end, which opens as a serial port; removed at exit
    #[arg(value_name = "PATH_A")]
    a: PathBuf,
    /// Path of the other end
    #[arg(value_name = "PATH_B")]
    b: PathBuf,
    /// Baud rate in both directions; a byte takes 10 bit times
    #[arg(long, value_name = "N", default_value_t = 115_200, value_parser = whole(9_600..=3_000_000u32), allow_negative_numbers = true)]
    baud: u32,
}

pub fn run(args: Args) -> anyhow::Result<()> {
    // Before the names exist, so that every end of the program removes them.
    let stop = stop_at_ctrl_c().context("cannot watch for Ctrl-C")?;
    let pair = Pair::open([&args.a, &args.b], args.baud)?;
    say(format_args!(
        "{} <-> {} at {} baud, {} bytes/s in each direction; Ctrl-C removes both\n",
        path_text(&args.a),
        path_text(&args.b),
        args.baud,
        f64::from(args.baud) / 10.0,
    ))?;
    Ok(pair.run(&stop)?)
}
