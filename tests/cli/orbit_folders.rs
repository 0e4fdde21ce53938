//! Folders that hold more than orbits, and files that cannot be opened.

use super::catalog::{DELTA, VANGUARD, has, run, scene};
use serde_json::Value;

#[test]
fn the_folder_of_a_population_holds_nothing_that_is_refused() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let synth = ["catalog", "synth", "--objects", "300", "--out", "pop"];
    assert_eq!(run(at, &synth).0, Some(0));
    let (code, out, log) = run(at, &["catalog", "check", "pop", "--strict"]);
    assert_eq!(code, Some(0), "{out}{log}");
    has(
        &out,
        &[
            "passed over: 1 entry is no file of orbits (pop/population.toml)",
            "300 records of 300 objects; 0 records",
        ],
    );
    std::fs::write(at.join("delta.3le"), DELTA).unwrap();
    std::fs::write(at.join("scene.toml"), scene("\"pop\"")).unwrap();
    let (code, _, log) = run(at, &["plan", "--scene", "scene.toml", "--strict"]);
    assert_eq!(code, Some(0), "{log}");
    has(&log, &["passed over: 1 entry is no file of orbits"]);
    assert!(!log.contains("refused"), "{log}");
}

/// A pipe would be waited for without end, a device may have none.
#[test]
#[cfg(unix)]
fn what_is_no_file_in_a_folder_is_passed_over_and_a_file_of_no_use_is_not() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let orbits = at.join("orbits");
    std::fs::create_dir(&orbits).unwrap();
    std::fs::write(orbits.join("a.3le"), VANGUARD).unwrap();
    let made = std::process::Command::new("mkfifo")
        .arg(orbits.join("pipe"))
        .status();
    assert!(made.unwrap().success());
    let _socket = std::os::unix::net::UnixListener::bind(orbits.join("socket")).unwrap();
    std::os::unix::fs::symlink("/dev/zero", orbits.join("zero")).unwrap();
    std::os::unix::fs::symlink("a.3le", orbits.join("link")).unwrap();
    std::fs::write(orbits.join("picture"), b"\x89PNG\0\0").unwrap();
    let passed = "passed over: 4 entries are no files of orbits (orbits/picture, orbits/pipe, orbits/socket, ...)";
    let (code, out, _) = run(at, &["catalog", "check", "orbits", "--strict"]);
    assert_eq!(code, Some(0), "{out}");
    has(
        &out,
        &[
            passed,
            "orbits/link: 3le, 1 record",
            "2 files: 2 records of 1 object",
        ],
    );
    let (code, _, log) = run(
        at,
        &["catalog", "convert", "orbits", "--to", "tle", "--strict"],
    );
    assert_eq!(code, Some(0));
    has(&log, &[passed]);

    // A link that leads nowhere, and a table without a line, are losses.
    std::os::unix::fs::symlink("nowhere", orbits.join("gone")).unwrap();
    std::fs::write(orbits.join("none.csv"), "NORAD_CAT_ID,EPOCH,MEAN_MOTION\n").unwrap();
    let (code, _, log) = run(at, &["catalog", "check", "orbits", "--strict"]);
    assert_eq!(code, Some(1));
    has(&log, &["--strict: 0 records and 2 files"]);
    std::fs::write(at.join("delta.3le"), DELTA).unwrap();
    std::fs::write(at.join("scene.toml"), scene("\"orbits\"")).unwrap();
    let (code, _, log) = run(at, &["plan", "--scene", "scene.toml", "--strict"]);
    assert_eq!(code, Some(1));
    has(
        &log,
        &[
            "orbits/gone: No such file",
            "orbits/none.csv: omm-csv, and no record",
        ],
    );
}

#[test]
fn a_file_that_is_named_and_cannot_be_opened_is_an_error() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    std::fs::write(at.join("good.tle"), VANGUARD).unwrap();
    let (code, out, log) = run(at, &["catalog", "check", "good.tle", "none"]);
    assert_eq!(code, Some(1));
    has(
        &out,
        &["good.tle: 3le, 1 record", "cannot read the orbit file none"],
    );
    has(&log, &["1 file of the command line cannot be opened"]);
    for more in [&["info"][..], &["convert", "--to", "tle"]] {
        let args = [&["catalog"], more, &["good.tle", "none"]].concat();
        let (code, out, log) = run(at, &args);
        assert_eq!((code, out.as_str()), (Some(1), ""), "{more:?}");
        has(&log, &["cannot read the orbit file none"]);
    }
    // One that is no orbit file can be, and is refused.
    std::fs::write(at.join("readme"), "Nothing that moves.\n").unwrap();
    let (code, out, _) = run(at, &["catalog", "check", "--json", "good.tle", "readme"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, report["unusable"].as_u64()), (Some(0), Some(1)));
}

#[test]
fn help_of_catalog_speaks_of_no_scene() {
    let here = tempfile::tempdir().unwrap();
    for command in ["info", "convert"] {
        let (_, out, _) = run(here.path(), &["catalog", command, "--help"]);
        has(&out, &["--strict"]);
        assert!(!out.contains("scene"), "{out}");
    }
}

/// Lines are those of the whole file, at META_START, whatever comes before.
#[test]
fn a_refused_orbit_of_a_joined_file_has_its_line() {
    let here = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| std::fs::write(here.path().join(name), text).unwrap();
    let first = ephemeris("58002B");
    file("joined", &format!("\n\n{first}{VANGUARD}{first}"));
    let before = 2 + first.lines().count() + VANGUARD.lines().count();
    file("further", &format!("# Of another day\n{first}"));
    let (_, out, log) = run(here.path(), &["catalog", "check", "joined", "further"]);
    for line in [
        "joined:4: 58002B (V) is ".to_string(),
        format!("joined:{}: 58002B (V) is ", before + 2),
        "further:3: 58002B (V) is ".to_string(),
    ] {
        assert!(out.contains(&line), "{line}: {out}{log}");
    }
}

fn ephemeris(id: &str) -> String {
    format!(
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = V\nOBJECT_ID = {id}\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
         TIME_SYSTEM = UTC\nSTART_TIME = 2006-06-25T19:00:00\nSTOP_TIME = 2006-06-25T21:00:00\nMETA_STOP\n\
         2006-06-25T19:00:00 7000 0 0 0 7.5 0\n2006-06-25T21:00:00 7000 75 0 0 7.5 0\n"
    )
}

#[test]
fn check_refuses_what_a_scene_refuses() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let file = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    file("delta.3le", DELTA);
    std::fs::create_dir(at.join("orbits")).unwrap();
    file("orbits/a.3le", VANGUARD);
    file("orbits/b.oem", &ephemeris("58002B"));
    file("orbits/c.oem", &ephemeris("1959-001A"));
    file("orbits/d.oem", &ephemeris("59001A"));
    file("scene.toml", &scene("\"orbits\""));
    let refused = [
        "orbits/b.oem:2: 58002B (V) is NORAD 5 (VANGUARD 1) in orbits/a.3le: keep one of the two",
        "orbits/d.oem:2: 59001A (V) is 1959-001A (V) in orbits/c.oem: keep one of the two",
    ];
    let (code, out, log) = run(at, &["catalog", "check", "orbits"]);
    assert_eq!(code, Some(0), "{log}");
    has(&out, &refused);
    has(
        &out,
        &["4 files: 4 records of 2 objects; 2 records and 0 files"],
    );
    let (code, out, log) = run(at, &["catalog", "info", "orbits"]);
    assert_eq!(code, Some(0));
    has(&out, &["2 objects\n"]);
    has(
        &log,
        &[
            "orbits/b.oem:2: 58002B (V) is NORAD 5",
            "orbits/d.oem:2: 59001A (V) is",
        ],
    );
    let render = ["render", "--scene", "scene.toml", "--out", "o"];
    let (code, out, log) = run(at, &render);
    assert_eq!(code, Some(0), "{log}");
    has(&log, &refused);
    let words = |line: &str| line.split_whitespace().eq(["objects", "2"]);
    assert!(out.lines().any(words), "{out}");
}

#[test]
fn a_record_that_links_two_others_makes_one_object_of_them_for_every_command() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let file = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    let csv = |number: u32, designator: &str, day: u32| {
        format!(
            "OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,\
             BSTAR\n{designator},2006-06-{day}T03:04:05,15.2,.001,51.6,120,90,270,{number},0\n"
        )
    };
    file("number.csv", &csv(25544, "", 21));
    file("designator.csv", &csv(0, "1998-067A", 22));
    file("both.csv", &csv(25544, "98067A", 23));
    file("delta.3le", DELTA);
    file(
        "iss.oem",
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = ISS\nOBJECT_ID = 1998-067-A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
         TIME_SYSTEM = UTC\nSTART_TIME = 2006-06-25T19:00:00\nSTOP_TIME = 2006-06-25T19:00:10\nMETA_STOP\n\
         2006-06-25T19:00:00 7000 0 0 0 7.5 0\n2006-06-25T19:00:10 7000 75 0 0 7.5 0\n",
    );
    for (files, refused) in [
        (["number.csv", "designator.csv", "both.csv"], 0),
        (["designator.csv", "number.csv", "both.csv"], 0),
        (["both.csv", "designator.csv", "number.csv"], 0),
        (["number.csv", "iss.oem", "both.csv"], 1),
        (["iss.oem", "number.csv", "both.csv"], 2),
        (["both.csv", "number.csv", "iss.oem"], 1),
    ] {
        let json = |command: &str| {
            let (code, out, log) = run(at, &[&["catalog", command, "--json"], &files[..]].concat());
            assert_eq!(code, Some(0), "{files:?}: {log}");
            serde_json::from_str::<serde_json::Value>(&out).unwrap()
        };
        let report = json("check");
        let counts = ["objects", "records", "rejected"].map(|key| report[key].as_u64().unwrap());
        assert_eq!(counts, [1, 3, refused], "{files:?}");
        let info = json("info");
        assert_eq!(info.as_array().unwrap().len(), 1, "{files:?}");
        assert_eq!(info[0]["id"], "NORAD 25544", "{files:?}");
        file(
            "scene.toml",
            &scene(&format!("{files:?}").replace(['[', ']'], "")),
        );
        let (code, out, log) = run(
            at,
            &["render", "--scene", "scene.toml", "--out", "o", "--force"],
        );
        assert_eq!(code, Some(0), "{files:?}: {log}");
        let one = |line: &str| line.split_whitespace().eq(["objects", "1"]);
        assert!(out.lines().any(one), "{files:?}: {out}");
        // One file with the same records.
        let convert = [
            &[
                "catalog",
                "convert",
                "--to",
                "omm-json",
                "--out",
                "whole.json",
                "--force",
            ],
            &files[..],
        ];
        assert_eq!(run(at, &convert.concat()).0, Some(0), "{files:?}");
        let (_, out, _) = run(at, &["catalog", "check", "whole.json"]);
        assert!(out.contains(" of 1 object, 0 rejected"), "{files:?}: {out}");
    }
}
