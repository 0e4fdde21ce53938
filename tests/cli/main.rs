//! The binary: its outputs, and its messages for wrong inputs.

mod attitude_files;
mod catalog;
mod cost;
mod docked;
mod drills;
mod files;
#[path = "../support/fixtures.rs"]
mod fixtures;
mod folder;
mod folders;
mod ground;
mod inputs;
mod lightcurve;
#[path = "../support/oem.rs"]
mod oem;
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
#[path = "../support/table.rs"]
mod table;
mod tools;
mod verdicts;

use folder::{Folder, Outcome, has, repository, repository_text};
use table::rows;

/// Epoch and attitude of the built-in scene's first frame.
const EPOCH: &str = "2019-06-15T23:35:50Z";
const Q: &str = "-0.070834,-0.644137,0.733522,-0.204975";
/// A state near CASSIOPE's at that epoch, km and km/s.
const STATE: &str = "-4340.768,848.975,-5362.534,5.544,-3.023,-4.387";

/// One frame at that epoch and attitude into the folder `o`.
fn render(more: &str) -> String {
    format!("render --epoch {EPOCH} --attitude {Q} --out o {more}")
}

/// The table of a sequence of one still frame.
fn still(epoch: &str) -> String {
    format!(
        "[sequence]\nepoch = \"{epoch}\"\nframes = 1\nperiod_s = 1.0\n\
         attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n"
    )
}

/// The text with the line of each of these keys replaced by `key = value`.
fn with_keys(text: &str, keys: &[(&str, &str)]) -> String {
    let line = |line: &str| {
        let key = line.split(' ').next().unwrap();
        match keys.iter().find(|(name, _)| *name == key) {
            Some((_, value)) => format!("{key} = {value}\n"),
            None => format!("{line}\n"),
        }
    };
    for (key, _) in keys {
        let is_line = |line: &str| line.split(' ').next() == Some(key);
        assert!(text.lines().any(is_line), "no {key} in {text}");
    }
    text.lines().map(line).collect()
}

/// A built-in camera with other values of these keys.
fn camera(name: &str, keys: &[(&str, &str)]) -> String {
    with_keys(
        &repository_text(&format!("configs/cameras/{name}.toml")),
        keys,
    )
}
