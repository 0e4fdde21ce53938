//! Objects beside the observer, which may be docked to it: one warning a run.

use crate::skyloop;
use std::path::Path;

/// A station, one that is 0.6 km ahead of it and one that is 60 km ahead, made up.
const SETS: &str = "\
    OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
    STATION,2026-101A,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270,5,0\n\
    FERRY,2026-101B,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270.005,6,0\n\
    AHEAD,2026-101C,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270.5,7,0\n";

/// What a run of two frames logs that looks there.
fn log(at: &Path, radec: &str) -> String {
    let words = format!(
        "render --epoch 2026-07-12T03:04:05Z --orbit sets.csv:STATION --rso sets.csv --radec {radec} --frames 2 --out o"
    );
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    assert!(output.status.success());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn what_may_be_docked_is_told_once() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("sets.csv"), SETS).unwrap();
    // X-Val: where the velocity points that the frame's label has (state_gcrf_km).
    let ahead = log(here.path(), "-150.420,51.749,0");
    let lines: Vec<&str> = ahead.lines().collect();
    let says = "1 object in the field within 10 km of the observer (FERRY at 0.601 km)";
    assert!(lines.len() == 1 && lines[0].contains(says), "{ahead}");
    let back = log(here.path(), "29.580,-51.749,0");
    assert!(!back.contains("within 10 km"), "{back}");
}
