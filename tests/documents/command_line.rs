//! The README lists every command, every subcommand and their options.

use super::{Names, README, first_column, names, section};
use std::process::Command;

/// The long options in a help text.
fn options(help: &str) -> Names {
    let lines = help.lines().map(str::trim_start);
    let usages = lines.filter_map(|line| line.split("  ").next().filter(|of| of.starts_with('-')));
    let words = usages.flat_map(|usage| usage.split([' ', ',', '.']));
    names(words.filter(|word| word.starts_with("--")))
}

/// The help of a command such as `catalog check`; of the program itself without a word.
fn help(command: &str) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_skyloop"))
        .args(command.split_whitespace())
        .arg("--help")
        .output()
        .unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stdout).unwrap()
}

/// The commands below `command`, and theirs.
fn commands(command: &str) -> Vec<String> {
    let help = help(command);
    let (_, listed) = help.split_once("Commands:\n").unwrap_or_default();
    let lines = listed.lines().take_while(|line| !line.is_empty());
    let names = lines.filter_map(|line| line.split_whitespace().next());
    let own = names.filter(|name| *name != "help");
    own.flat_map(|name| {
        let name = format!("{command} {name}").trim_start().to_string();
        let below = commands(&name);
        [name].into_iter().chain(below)
    })
    .collect()
}

/// The long options in a section of the README.
fn documented(heading: &str) -> Names {
    let cells = first_column(section(README, heading));
    let option = |cell: &String| cell.split(' ').next().unwrap_or_default().to_string();
    let options = cells.iter().map(option);
    options.filter(|name| name.starts_with("--")).collect()
}

#[test]
fn the_readme_lists_the_command_line() {
    let global = documented("### `skyloop`");
    assert_eq!(global, options(&help("")));
    let commands = commands("");
    assert!(commands.len() >= 4, "{commands:?}");
    for command in commands {
        let options = &options(&help(&command)) - &global;
        let listed = documented(&format!("### `skyloop {command}`"));
        assert_eq!(listed, options, "{command}");
    }
}
