//! The tutorials of `docs/tutorials`, run as they are written.
//!
//! The text after an opening fence sets the use of the block. `file=NAME` is saved. `sh` is run by
//! bash and must succeed; `sh fails` must fail. Each line of `text expected` must be in the output
//! of the last command (`...` stands for any text).
#![cfg(target_os = "linux")]

use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The port in the tutorials. The tests use a free one, so that a running emulator does not
/// disturb them.
const PORT: &str = "4810";

/// The fenced blocks of a page: what follows the opening fence, and the lines up to the closing
/// one.
fn blocks(page: &str) -> Vec<(&str, String)> {
    let mut blocks = Vec::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        if let Some(info) = line.strip_prefix("```") {
            let text = lines.by_ref().take_while(|line| *line != "```");
            blocks.push((info, text.map(|line| format!("{line}\n")).collect()));
        }
    }
    blocks
}

/// What the commands print, and whether they succeed. They run in `at`, with the programs under
/// test on the `PATH`.
fn run(commands: &str, at: &Path) -> (bool, String) {
    let programs = Path::new(env!("CARGO_BIN_EXE_skyloop")).parent().unwrap();
    assert!(
        programs.join("skyloop-fc").exists(),
        "skyloop-fc is not built: run `cargo build` first"
    );
    let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap());
    let output = Command::new("timeout")
        .args(["180", "bash", "-e", "-c", commands])
        .env("PATH", path)
        .current_dir(at)
        .output()
        .unwrap();
    let printed = [output.stdout, output.stderr].concat();
    let printed = String::from_utf8(printed).unwrap();
    (output.status.success(), printed)
}

/// Whether a printed line is the expected one.
fn is_expected(printed: &str, expected: &str) -> bool {
    let mut rest = printed;
    let parts: Vec<&str> = expected.split("...").collect();
    let (last, first) = parts.split_last().unwrap();
    for (number, part) in first.iter().enumerate() {
        match rest.find(part) {
            Some(at) if at == 0 || number > 0 => rest = &rest[at + part.len()..],
            _ => return false,
        }
    }
    if first.is_empty() {
        rest == *last
    } else {
        rest.ends_with(last)
    }
}

fn follow(tutorial: &Path) {
    let page = std::fs::read_to_string(tutorial).unwrap();
    let free = UdpSocket::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap();
    let page = page.replace(PORT, &free.port().to_string());
    let here = tempfile::tempdir().unwrap();
    let (mut printed, mut commands) = (String::new(), 0);
    for (info, text) in blocks(&page) {
        let what = tutorial.display();
        if let Some((_, name)) = info.split_once("file=") {
            std::fs::write(here.path().join(name), text).unwrap();
        } else if info == "sh" || info == "sh fails" {
            let succeeds;
            (succeeds, printed) = run(&text, here.path());
            assert_eq!(succeeds, info == "sh", "{what}:\n{text}\n{printed}");
            commands += 1;
        } else if info == "text expected" {
            for expected in text.lines() {
                let found = printed.lines().any(|line| is_expected(line, expected));
                assert!(found, "{what}: no line {expected:?} in\n{printed}");
            }
        }
    }
    assert!(commands > 0, "{}: no commands", tutorial.display());
}

/// Follows the tutorials whose commands use Python, or the others.
fn follow_all(with_python: bool) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tutorials");
    let mut pages: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    pages.sort();
    assert_eq!(pages.len(), 4);
    let has_python = |page: &PathBuf| std::fs::read_to_string(page).unwrap().contains("python3 ");
    pages.retain(|page| has_python(page) == with_python);
    assert_eq!(pages.len(), 2);
    pages.iter().for_each(|page| follow(page));
}

#[test]
fn tutorials_run_as_they_are_written() {
    follow_all(false);
}

#[test]
#[ignore = "tools: needs python3; tests/run all runs it"]
fn tools_tutorials_with_python_run_as_they_are_written() {
    follow_all(true);
}
