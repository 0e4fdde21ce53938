//! `skyloop completions` and `skyloop man`: what a shell and `man` make of the command line.

use super::Cli;
use anyhow::Context;
use clap::{Args as ClapArgs, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;
use skyloop_firmware_sim::console::say;
use std::path::PathBuf;

/// Arguments of `skyloop completions`.
#[derive(ClapArgs)]
pub struct Completions {
    /// The shell
    shell: Shell,
}

/// Arguments of `skyloop man`.
#[derive(ClapArgs)]
pub struct Manual {
    /// Folder for a page a command, skyloop.1, skyloop-run.1 and so on; made if it does not exist. Without it the page of skyloop itself is
    /// printed
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
}

/// Prints a script of completions.
pub fn completions(args: Completions) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "skyloop", &mut script);
    say(String::from_utf8_lossy(&script))?;
    Ok(())
}

/// Writes pages of the manual.
pub fn manual(args: Manual) -> anyhow::Result<()> {
    // Without this subcommands lack the program's name.
    let mut command = Cli::command();
    command.build();
    let Some(folder) = args.folder else {
        let mut page = Vec::new();
        Man::new(command).render(&mut page)?;
        say(String::from_utf8_lossy(&page))?;
        return Ok(());
    };
    let made = std::fs::create_dir_all(&folder);
    made.with_context(|| format!("{}: cannot be made", folder.display()))?;
    let written = clap_mangen::generate_to(command, &folder);
    written.with_context(|| format!("{}: cannot be written to", folder.display()))?;
    say(format_args!("wrote {}\n", folder.display()))?;
    Ok(())
}
