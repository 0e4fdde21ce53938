//! `skyloop completions` and `skyloop man`: completion scripts and manual pages of the command
//! line.

use super::common::Force;
use clap::Args as ClapArgs;
use clap_complete::Shell;
use clap_mangen::Man;
use skyloop::orbit::Mark;
use skyloop::orbit::path_text;
use skyloop::output::write_files;
use skyloop_firmware_sim::console::say;
use std::path::PathBuf;

#[derive(ClapArgs)]
pub struct Completions {
    /// Shell
    shell: Shell,
}

#[derive(ClapArgs)]
pub struct Manual {
    /// Folder for one page per command (skyloop.1, skyloop-run.1, ...), created if needed; without
    /// it the page of skyloop is printed
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// The mark of a manual page.
const MARK: Mark = &["", ".TH skyloop"];

pub fn completions(args: Completions, mut command: clap::Command) -> anyhow::Result<()> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "skyloop", &mut script);
    say(String::from_utf8_lossy(&script))?;
    Ok(())
}

pub fn manual(args: Manual, command: clap::Command) -> anyhow::Result<()> {
    // Without this subcommands lack the program's name.
    let mut command = command.disable_help_subcommand(true);
    command.build();
    let Some(folder) = args.folder else {
        let mut page = Vec::new();
        Man::new(command).render(&mut page)?;
        say(String::from_utf8_lossy(&page))?;
        return Ok(());
    };
    let mut files = Vec::new();
    pages(&command, &mut files)?;
    write_files(&folder, &files, MARK, args.force.force)?;
    say(format_args!("wrote {}\n", path_text(&folder)))?;
    Ok(())
}

/// The page of a command and those of its subcommands, by file name.
fn pages(command: &clap::Command, files: &mut Vec<(String, Vec<u8>)>) -> std::io::Result<()> {
    for subcommand in command.get_subcommands() {
        pages(subcommand, files)?;
    }
    let man = Man::new(command.clone());
    let mut page = Vec::new();
    man.render(&mut page)?;
    files.push((man.get_filename(), page));
    Ok(())
}
