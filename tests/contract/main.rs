//! The contract with users, from the program at 3edfec3. It must not change while the code is
//! reorganised: pixels, labels, headers, names of columns, metrics, options and keys, exit codes,
//! and the generated wire files. Prose may change: help, error texts, comments, and the reasons of
//! effects.
//!
//! The text files in this folder are never renewed to let a change pass.

mod files;
mod frames;
mod programs;

use std::path::{Path, PathBuf};
use std::process::Command;

/// A file of the repository.
fn repository(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(file)
}

/// `skyloop`, in a folder.
fn skyloop(at: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    command.current_dir(at);
    command
}

/// Standard output of `skyloop` with arguments separated by blanks. It must succeed.
fn output_of(at: &Path, arguments: &str) -> String {
    let output = skyloop(at)
        .args(arguments.split_whitespace())
        .output()
        .unwrap();
    let log = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "skyloop {arguments}: {log}");
    String::from_utf8(output.stdout).unwrap()
}

/// Compares lines with those of `tests/contract/NAME.txt`. If they differ, cargo's folder for tests
/// gets the new lines.
fn assert_unchanged(name: &str, made: &str) {
    let path = repository(&format!("tests/contract/{name}.txt"));
    let known = std::fs::read_to_string(&path).unwrap_or_default();
    if made == known {
        return;
    }
    let actual = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.txt"));
    std::fs::write(&actual, made).unwrap();
    let only_in = |a: &str, b: &str| {
        let other: std::collections::BTreeSet<&str> = b.lines().collect();
        let lines = a.lines().filter(|line| !other.contains(line)).take(20);
        lines.collect::<Vec<_>>().join("\n  ")
    };
    panic!(
        "{} differs from {}\ngone:\n  {}\nnew:\n  {}",
        actual.display(),
        path.display(),
        only_in(&known, made),
        only_in(made, &known)
    );
}
