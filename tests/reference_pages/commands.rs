//! The page of a program's command line, from its help texts.

use super::page::{code, head, prose, row, wrapped};
use std::process::Command;

/// The help of a command.
#[derive(Default)]
struct Help {
    about: String,
    usage: String,
    commands: Vec<Entry>,
    options: Vec<Entry>,
}

/// A command, an argument or an option.
#[derive(Default)]
struct Entry {
    name: String,
    text: String,
}

/// The sections of a program's commands; `path` is the program's file.
pub fn sections(program: &str, path: &str) -> String {
    let root = help(path, &[]);
    let mut text = section(program, &root, &[]);
    for command in root.commands.iter().filter(|one| one.name != "help") {
        text += &below(program, path, &[&command.name], &root.options);
    }
    text
}

/// The sections of a command and its subcommands, without the options of the program itself.
fn below(program: &str, path: &str, words: &[&str], global: &[Entry]) -> String {
    let help = help(path, words);
    let name = format!("{program} {}", words.join(" "));
    let mut text = section(&name, &help, global);
    for command in help.commands.iter().filter(|one| one.name != "help") {
        text += &below(program, path, &[words, &[&command.name]].concat(), global);
    }
    text
}

fn section(name: &str, help: &Help, global: &[Entry]) -> String {
    let mut text = format!("## `{name}`\n\n");
    for paragraph in help.about.trim().split("\n\n") {
        text += &format!("{}\n\n", wrapped(paragraph, ""));
    }
    text += &format!("```text\n{}\n```\n\n", help.usage.trim());
    let commands = help.commands.iter().filter(|one| one.name != "help");
    let commands: String = commands
        .map(|one| row(&[&code(&one.name), &prose(&one.text)]))
        .collect();
    if !commands.is_empty() {
        text += &format!("{}{commands}\n", head(&["Command", "Meaning"]));
    }
    let is_own = |one: &&Entry| global.iter().all(|other| other.name != one.name);
    let options: String = help.options.iter().filter(is_own).map(Entry::row).collect();
    if !options.is_empty() {
        text += &format!("{}{options}\n", head(&["Option", "Default", "Meaning"]));
    }
    text
}

/// Reads the help of a command, `words` after the program's name.
fn help(path: &str, words: &[&str]) -> Help {
    let output = Command::new(path)
        .args(words)
        .arg("--help")
        .output()
        .unwrap();
    assert!(output.status.success(), "{words:?} --help");
    let text = String::from_utf8(output.stdout).unwrap();
    let mut help = Help::default();
    let mut part = "About";
    for line in text.lines() {
        if let Some(usage) = line.strip_prefix("Usage: ") {
            part = "Usage";
            help.usage = usage.to_string();
        } else if let Some(name) = line.strip_suffix(':').filter(|name| !name.starts_with(' ')) {
            part = name;
        } else {
            help.add(part, line);
        }
    }
    // Options of both, as every subcommand has them.
    help.options
        .retain(|one| !["-h, --help", "-V, --version"].contains(&one.name.as_str()));
    help
}

impl Help {
    fn add(&mut self, part: &str, line: &str) {
        let entries = match part {
            "About" => return self.about += &format!("{line}\n"),
            "Usage" => return self.usage += &format!("\n{}", line.trim()),
            "Commands" => &mut self.commands,
            _ => &mut self.options,
        };
        // Texts are on the line of the name, or indented on lines of their own.
        let is_name = line.len() - line.trim_start().len() < 10;
        let line = line.trim();
        if line.is_empty() {
            return;
        }
        if is_name {
            let (name, text) = line.split_once("  ").unwrap_or((line, ""));
            let [name, text] = [name, text].map(|text| text.trim().to_string());
            return entries.push(Entry { name, text });
        }
        let Some(entry) = entries.last_mut() else {
            return;
        };
        let value = line
            .strip_prefix("- ")
            .and_then(|value| value.split_once(':'));
        entry.text += &match (line, value) {
            ("Possible values:", _) => ":".to_string(),
            (_, Some((value, meaning))) => format!(" `{value}`: {};", meaning.trim()),
            _ => format!(" {line}"),
        };
    }
}

impl Entry {
    /// The row of an option. Its default and possible values are in brackets after the help text.
    fn row(&self) -> String {
        let mut text = self.text.trim_end_matches(';').to_string();
        let default = take(&mut text, "[default: ").unwrap_or_default();
        if let Some(values) = take(&mut text, "[possible values: ") {
            let values: Vec<String> = values.split(", ").map(code).collect();
            text = format!("{}: {}", text.trim(), values.join(", "));
        }
        let default = if default.contains(' ') || default.is_empty() {
            prose(&default)
        } else {
            code(&default)
        };
        row(&[&code(&self.name), &default, &prose(&text)])
    }
}

/// Removes the part in brackets that starts with `begin` from a text and returns it.
fn take(text: &mut String, begin: &str) -> Option<String> {
    let (before, rest) = text.split_once(begin)?;
    let (part, after) = rest.split_once(']')?;
    let part = part.to_string();
    *text = format!("{before} {after}");
    Some(part)
}
