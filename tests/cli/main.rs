//! The binary: what it makes, and what it says of wrong inputs.

mod attitude_files;
mod beside;
mod catalog;
mod cost;
mod drills;
mod files;
mod folders;
mod ground;
mod inputs;
mod offline;
mod old;
mod one_frame;
mod orbit_folders;
mod outputs;
mod passes;
mod plan;
mod pty;
mod python;
mod replay;
mod run;
mod soak;
#[path = "../support/mod.rs"]
mod support;
mod synth;
mod tools;
mod verdicts;

use assert_cmd::Command;
use std::path::Path;

/// Epoch and attitude of the built-in scene's first frame.
const EPOCH: &str = "2019-06-15T23:35:50Z";
const Q: &str = "-0.070834,-0.644137,0.733522,-0.204975";
/// A state near CASSIOPE's at that epoch, km and km/s.
const STATE: &str = "-4340.768,848.975,-5362.534,5.544,-3.023,-4.387";

/// `skyloop`, in folder `at`.
fn skyloop(at: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    command.current_dir(at).timeout(support::PATIENCE * 3);
    command
}

/// A file of the repository.
fn repository(file: &str) -> String {
    format!("{}/{file}", env!("CARGO_MANIFEST_DIR"))
}

/// The files of a folder, in order, with their contents.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap())
        .map(|entry| {
            let name = entry.file_name().into_string().unwrap();
            (name, std::fs::read(entry.path()).unwrap())
        })
        .collect();
    files.sort();
    files
}

fn names(folder: &Path) -> Vec<String> {
    contents(folder).into_iter().map(|(name, _)| name).collect()
}
