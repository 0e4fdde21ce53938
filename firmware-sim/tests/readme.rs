//! The README lists the options of `skyloop-fc`.

use std::collections::BTreeSet;
use std::process::Command;

const README: &str = include_str!("../../README.md");

#[test]
fn the_readme_lists_the_command_line() {
    let output = Command::new(env!("CARGO_BIN_EXE_skyloop-fc"))
        .arg("--help")
        .output()
        .unwrap();
    let help = String::from_utf8(output.stdout).unwrap();
    let offered: BTreeSet<&str> = help
        .lines()
        .filter_map(|line| line.split_whitespace().find(|word| word.starts_with("--")))
        .filter(|option| !["--help", "--version"].contains(option))
        .collect();
    let (_, section) = README.split_once("\n### `skyloop-fc`\n").unwrap();
    let section = section.split("\n## ").next().unwrap();
    let listed: BTreeSet<&str> = section
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split(['`', ' ']).next())
        .collect();
    assert!(!listed.is_empty());
    assert_eq!(listed, offered);
}
