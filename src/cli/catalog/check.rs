//! `skyloop catalog check`: what files of orbits hold, and what of it cannot be used.

use anyhow::bail;
use clap::Args as ClapArgs;
use skyloop::effect::counted;
use skyloop::orbit;
use skyloop_firmware_sim::console::say;
use std::path::PathBuf;

/// Arguments of `skyloop catalog check`.
#[derive(ClapArgs)]
pub struct Args {
    /// Files of orbits; the format is found from the text
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

/// Runs the subcommand.
pub fn run(args: Args) -> anyhow::Result<()> {
    let mut objects = 0;
    for file in &args.files {
        let loaded = match orbit::load(file) {
            Ok(loaded) => loaded,
            Err(error) => {
                say(format_args!("{error}\n"))?;
                continue;
            }
        };
        objects += loaded.objects.len();
        say(format_args!(
            "{}: {}, {} rejected\n",
            file.display(),
            counted(loaded.objects.len(), "object"),
            loaded.rejected.len()
        ))?;
        for rejected in &loaded.rejected {
            say(format_args!("  {rejected}\n"))?;
        }
    }
    if objects == 0 {
        bail!("no object in any of the files");
    }
    Ok(())
}
