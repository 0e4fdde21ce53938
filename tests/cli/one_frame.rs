//! A frame without a scene file: the README's example, and where `--radec` and `--nadir` look.

use crate::{EPOCH, STATE, skyloop};
use nalgebra::Vector3;
use serde_json::Value;
use std::path::Path;

/// Exit code and both outputs.
fn run(at: &Path, words: &str) -> (i32, String, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let text = |octets| String::from_utf8(octets).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

/// What a command prints; it must go well, and say nothing on standard error.
fn said(at: &Path, words: &str) -> String {
    let (code, said, log) = run(at, words);
    assert!(code == 0 && log.is_empty(), "{words}: {log}");
    said
}

#[test]
fn the_readmes_example_prints_what_it_says() {
    let here = tempfile::tempdir().unwrap();
    let readme = include_str!("../../README.md");
    let (_, rest) = readme
        .split_once("A catalogue, an observer of it and one frame")
        .unwrap();
    let (_, rest) = rest.split_once("\n\n").unwrap();
    let lines = rest
        .lines()
        .take_while(|line| line.is_empty() || line.starts_with("    "));
    let lines = lines.filter(|line| !line.is_empty());
    let (commands, table): (Vec<&str>, Vec<&str>) =
        lines.partition(|line| line.starts_with("    skyloop "));
    assert_eq!((commands.len(), table.len()), (2, 7));
    let mut last = String::new();
    for command in commands {
        last = said(
            here.path(),
            command.trim_start().strip_prefix("skyloop ").unwrap(),
        );
    }
    let now: Vec<String> = last.lines().map(|line| format!("    {line}")).collect();
    assert_eq!(now.len(), table.len());
    for (line, now) in table.iter().zip(&now) {
        // Times depend on the machine.
        if !line.contains("render time") {
            assert_eq!(line, now, "README.md, skyloop render");
        }
    }
}

/// The labels of the frames.
fn labels(folder: &Path) -> Vec<Value> {
    let labels = std::fs::read_to_string(folder.join("labels.jsonl")).unwrap();
    labels
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn vector(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect()
}

#[test]
fn the_boresight_is_where_radec_says_whatever_the_mounting() {
    let here = tempfile::tempdir().unwrap();
    let fai = std::fs::read_to_string(crate::repository("configs/cameras/fai-nir.toml")).unwrap();
    let turned = fai + "\n[mounting]\nq_body_to_camera = [0.5, 0.5, 0.5, 0.5]\n";
    std::fs::write(here.path().join("turned.toml"), turned).unwrap();
    for camera in ["fai-nir", "turned.toml"] {
        said(
            here.path(),
            &format!("render --camera {camera} --epoch {EPOCH} --radec 248.112,9.215,30 --out o"),
        );
        let label = &labels(&here.path().join("o"))[0];
        let rows: Vec<Vec<f64>> = label["r_icrf_to_camera"]
            .as_array()
            .unwrap()
            .iter()
            .map(vector)
            .collect();
        // X-Val: by hand: the direction of that right ascension and declination.
        let (ra, dec) = (248.112_f64.to_radians(), 9.215_f64.to_radians());
        let wanted = [dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin()];
        for (axis, wanted) in wanted.iter().enumerate() {
            assert!((rows[2][axis] - wanted).abs() < 1e-12, "{camera}: {rows:?}");
        }
        // X-Val: by hand: north and east of that direction; up is 30 deg from north, through east.
        let north = [-dec.sin() * ra.cos(), -dec.sin() * ra.sin(), dec.cos()];
        let east = [-ra.sin(), ra.cos(), 0.0];
        let roll = 30.0_f64.to_radians();
        for axis in 0..3 {
            let up = north[axis] * roll.cos() + east[axis] * roll.sin();
            assert!((-rows[1][axis] - up).abs() < 1e-12, "{camera}: {rows:?}");
        }
    }
}

#[test]
fn nadir_is_where_the_earth_is_in_every_frame_and_x_goes_ahead() {
    let here = tempfile::tempdir().unwrap();
    let words =
        format!("render --epoch {EPOCH} --state {STATE} --nadir --frames 2 --period 60 --out o");
    assert_eq!(run(here.path(), &words).0, 0);
    let labels = labels(&here.path().join("o"));
    assert_eq!(labels.len(), 2);
    for label in labels {
        let state = vector(&label["state_gcrf_km"]);
        let [position, velocity] =
            [0, 3].map(|first| Vector3::from_column_slice(&state[first..first + 3]));
        // X-Val: by hand: +Y against the orbit's normal r x v, +X perpendicular to both, to where the velocity is.
        let (z, y) = (-position.normalize(), velocity.cross(&position).normalize());
        let x = y.cross(&z);
        assert!(x.dot(&velocity) > 0.99 * velocity.norm());
        for (row, axis) in [x, y, z].iter().enumerate() {
            let seen = vector(&label["r_icrf_to_camera"][row]);
            let off = (Vector3::from_column_slice(&seen) - axis).norm();
            assert!(off < 1e-9, "{row}: {seen:?} {axis:?}");
        }
    }
}

#[test]
fn ways_to_point_exclude_each_other() {
    let here = tempfile::tempdir().unwrap();
    for (words, code, says) in [
        ("--nadir --radec 0,0,0", 2, "cannot be used with"),
        ("--nadir --rates 0,0,1", 1, "leave --rates out"),
        ("", 2, "--radec"),
        ("--radec 0,91,0", 1, "DEC -90 to 90"),
        ("--radec 0,0", 2, "3 numbers are wanted, not 2"),
        (
            "--nadir",
            1,
            "needs an orbit: give [observer] state or orbit in the scene",
        ),
    ] {
        let (got, _, log) = run(
            here.path(),
            &format!("render --epoch {EPOCH} --out o {words}"),
        );
        assert!(got == code && log.contains(says), "{words}: {got} {log}");
    }
}
