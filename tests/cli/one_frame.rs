//! A frame without a scene file: the example of `docs/how-to/render.md`, and the directions of
//! `--radec` and `--nadir`.

use crate::{EPOCH, Folder, STATE, camera};
use nalgebra::Vector3;
use serde_json::Value;

#[test]
fn the_example_of_the_guide_has_its_output() {
    let here = Folder::new();
    let guide = include_str!("../../docs/how-to/render.md");
    let (_, rest) = guide.split_once("Here the catalogue is made up").unwrap();
    let (_, rest) = rest.split_once("\n\n").unwrap();
    let is_shown = |line: &&str| line.is_empty() || line.starts_with("    ");
    let lines = rest.lines().take_while(is_shown);
    let lines = lines.filter_map(|line| line.strip_prefix("    "));
    let (commands, table): (Vec<&str>, Vec<&str>) =
        lines.partition(|line| line.starts_with("skyloop "));
    assert_eq!((commands.len(), table.len()), (2, 7));
    let mut last = String::new();
    for command in commands {
        last = here.run(command.strip_prefix("skyloop ").unwrap()).quiet();
    }
    let now: Vec<&str> = last.lines().collect();
    assert_eq!(now.len(), table.len());
    for (line, now) in table.iter().zip(now) {
        // Times depend on the machine.
        if !line.contains("render time") {
            assert_eq!(*line, now, "docs/how-to/render.md");
        }
    }
}

fn vector(value: &Value) -> Vec<f64> {
    let numbers = value.as_array().unwrap().iter();
    numbers.map(|x| x.as_f64().unwrap()).collect()
}

/// A row of the label's rotation from ICRF to the camera: an axis of the camera.
fn axis(label: &Value, row: usize) -> Vector3<f64> {
    Vector3::from_column_slice(&vector(&label["r_icrf_to_camera"][row]))
}

#[test]
fn the_boresight_has_the_direction_of_radec_for_any_mounting() {
    let turned = "\n[mounting]\nq_body_to_camera = [0.5, 0.5, 0.5, 0.5]\n";
    let here = Folder::with(&[("turned.toml", &(camera("fai-nir", &[]) + turned))]);
    // X-Val: by hand: the direction of that right ascension and declination, with its north and
    // east; up is 30 deg from north towards east.
    let [ra, dec, roll] = [248.112_f64, 9.215, 30.0].map(f64::to_radians);
    let boresight = Vector3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
    let north = Vector3::new(-dec.sin() * ra.cos(), -dec.sin() * ra.sin(), dec.cos());
    let east = Vector3::new(-ra.sin(), ra.cos(), 0.0);
    let up = north * roll.cos() + east * roll.sin();
    for camera in ["fai-nir", "turned.toml"] {
        let look = format!("--epoch {EPOCH} --radec 248.112,9.215,30");
        here.run(&format!("render --camera {camera} {look} --out o"))
            .quiet();
        let label = &here.labels("o")[0];
        let off = (axis(label, 2) - boresight)
            .amax()
            .max((axis(label, 1) + up).amax());
        assert!(off < 1e-12, "{camera}: {label}");
    }
}

#[test]
fn nadir_points_to_the_earth_with_x_ahead_in_every_frame() {
    let here = Folder::new();
    let vehicle = format!("--epoch {EPOCH} --state {STATE} --nadir");
    here.run(&format!("render {vehicle} --frames 2 --period 60 --out o"))
        .exits(0);
    let labels = here.labels("o");
    assert_eq!(labels.len(), 2);
    for label in labels {
        let state = vector(&label["state_gcrf_km"]);
        let [position, velocity] =
            [0, 3].map(|first| Vector3::from_column_slice(&state[first..first + 3]));
        // X-Val: by hand: +Y against the orbit's normal r x v, +X perpendicular to both, towards
        // the velocity.
        let (z, y) = (-position.normalize(), velocity.cross(&position).normalize());
        let x = y.cross(&z);
        assert!(x.dot(&velocity) > 0.99 * velocity.norm());
        for (row, expected) in [x, y, z].iter().enumerate() {
            let off = (axis(&label, row) - expected).norm();
            assert!(off < 1e-9, "{row}: {label} {expected:?}");
        }
    }
}

#[test]
fn pointing_options_exclude_each_other() {
    Folder::new().refuses(
        &format!("render --epoch {EPOCH} --out o"),
        "--nadir --radec 0,0,0 | cannot be used with
         --nadir --rates 0,0,1 | leave --rates out
         --label-snr 1         | --radec
         --radec 0,91,0        | DEC -90 to 90
         --radec 0,0           | 3 numbers are wanted, not 2
         --nadir               | needs an orbit: give [observer] state or orbit in the scene",
    );
}
