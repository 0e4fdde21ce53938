//! Folders with other files than orbits, and files that cannot be opened.

use crate::Folder;
use crate::catalog::{DELTA, VANGUARD, scene};

#[test]
fn all_files_of_a_population_folder_are_accepted() {
    let here = Folder::with(&[("delta.3le", DELTA), ("scene.toml", &scene("\"pop\""))]);
    here.run("catalog synth --objects 300 --out pop").exits(0);
    here.run("catalog check pop --strict").exits(0).prints(&[
        "skipped: 1 entry is not an orbit file (pop/population.toml)",
        "300 records of 300 objects; 0 records",
    ]);
    let plan = here.run("plan --scene scene.toml --strict").exits(0);
    plan.logs(&["skipped: 1 entry is not an orbit file"])
        .lacks("refused");
}

/// Reading a pipe may block, reading a device may not end.
#[test]
#[cfg(unix)]
fn special_files_in_a_folder_are_skipped_and_invalid_files_reported() {
    use std::os::unix::fs::symlink;
    let here = Folder::with(&[
        ("delta.3le", DELTA),
        ("scene.toml", &scene("\"orbits\"")),
        ("orbits/a.3le", VANGUARD),
        ("orbits/picture", "\u{89}PNG\0\0"),
    ]);
    here.pipe("orbits/pipe");
    let _socket = std::os::unix::net::UnixListener::bind(here.join("orbits/socket")).unwrap();
    symlink("/dev/zero", here.join("orbits/zero")).unwrap();
    symlink("a.3le", here.join("orbits/link")).unwrap();
    let passed =
        "skipped: 4 entries are not orbit files (orbits/picture, orbits/pipe, orbits/socket, ...)";
    here.run("catalog check orbits --strict").exits(0).prints(&[
        passed,
        "orbits/link: 3le, 1 record",
        "2 files: 2 records of 1 object",
    ]);
    here.run("catalog info orbits --strict")
        .exits(0)
        .logs(&[passed]);

    // A broken link and a table without rows are reported.
    symlink("nowhere", here.join("orbits/gone")).unwrap();
    here.write("orbits/none.csv", "NORAD_CAT_ID,EPOCH,MEAN_MOTION\n");
    let check = here.run("catalog check orbits --strict").exits(1);
    check.logs(&["--strict: 0 records and 2 files"]);
    here.run("plan --scene scene.toml --strict")
        .exits(1)
        .logs(&[
            "orbits/gone: No such file",
            "orbits/none.csv: omm-csv, and no record",
        ]);
}

#[test]
fn a_named_file_that_cannot_be_opened_is_an_error() {
    let here = Folder::with(&[("good.tle", VANGUARD), ("readme", "Nothing that moves.\n")]);
    let check = here.run("catalog check good.tle none").exits(1);
    check
        .prints(&["good.tle: 3le, 1 record", "cannot read the orbit file none"])
        .logs(&["1 file of the command line cannot be opened"]);
    let refused = here.run("catalog info good.tle none").exits(1);
    assert_eq!(refused.out, "");
    refused.logs(&["cannot read the orbit file none"]);
    // A file without orbits can be opened, and is refused.
    let report = here.run("catalog check --json good.tle readme").exits(0);
    assert_eq!(report.json()["unusable"], 1);
}

#[test]
fn help_of_catalog_does_not_mention_scenes() {
    let help = Folder::new().run("catalog info --help");
    help.prints(&["--strict"]).lacks("scene");
}

fn ephemeris(name: &str, id: &str, stop: &str) -> String {
    format!(
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = {name}\nOBJECT_ID = {id}\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
         TIME_SYSTEM = UTC\nSTART_TIME = 2006-06-25T19:00:00\nSTOP_TIME = {stop}\nMETA_STOP\n\
         2006-06-25T19:00:00 7000 0 0 0 7.5 0\n{stop} 7000 75 0 0 7.5 0\n"
    )
}

/// An ephemeris of two hours of an object called V.
fn hours(id: &str) -> String {
    ephemeris("V", id, "2006-06-25T21:00:00")
}

/// Line numbers count from the start of the file and are those of META_START.
#[test]
fn a_refused_orbit_of_a_joined_file_has_its_line() {
    let first = hours("58002B");
    let before = 2 + first.lines().count() + VANGUARD.lines().count();
    let here = Folder::with(&[
        ("joined", &format!("\n\n{first}{VANGUARD}{first}")),
        ("further", &format!("# Of another day\n{first}")),
    ]);
    here.run("catalog check joined further").prints(&[
        "joined:4: 58002B (V) is ",
        &format!("joined:{}: 58002B (V) is ", before + 2),
        "further:3: 58002B (V) is ",
    ]);
}

/// Whether a table of a command has a row `objects COUNT`.
fn has_objects(table: &str, count: &str) -> bool {
    let is_it = |line: &str| line.split_whitespace().eq(["objects", count]);
    table.lines().any(is_it)
}

#[test]
fn check_refuses_what_a_scene_refuses() {
    let here = Folder::with(&[
        ("delta.3le", DELTA),
        ("orbits/a.3le", VANGUARD),
        ("orbits/b.oem", &hours("58002B")),
        ("orbits/c.oem", &hours("1959-001A")),
        ("orbits/d.oem", &hours("59001A")),
        ("scene.toml", &scene("\"orbits\"")),
    ]);
    let refused = [
        "orbits/b.oem:2: 58002B (V) is NORAD 5 (VANGUARD 1) in orbits/a.3le: keep one of the two",
        "orbits/d.oem:2: 59001A (V) is 1959-001A (V) in orbits/c.oem: keep one of the two",
    ];
    let count = "4 files: 4 records of 2 objects; 2 records and 0 files";
    let check = here.run("catalog check orbits").exits(0);
    check.prints(&refused).prints(&[count]);
    let info = here.run("catalog info orbits").exits(0);
    let info = info.prints(&["2 objects\n"]);
    info.logs(&refused.map(|line| line.split(" in ").next().unwrap()));
    let render = here.run("render --scene scene.toml --out o").exits(0);
    let render = render.logs(&refused);
    assert!(has_objects(&render.out, "2"), "{}", render.out);
}

#[test]
fn a_record_that_identifies_two_others_joins_them_in_every_command() {
    let csv = |number: u32, designator: &str, day: u32| {
        format!(
            "OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,\
             BSTAR\n{designator},2006-06-{day}T03:04:05,15.2,.001,51.6,120,90,270,{number},0\n"
        )
    };
    let here = Folder::with(&[
        ("number.csv", &csv(25544, "", 21)),
        ("designator.csv", &csv(0, "1998-067A", 22)),
        ("both.csv", &csv(25544, "98067A", 23)),
        ("delta.3le", DELTA),
        (
            "iss.oem",
            &ephemeris("ISS", "1998-067-A", "2006-06-25T19:00:10"),
        ),
    ]);
    for (files, refused) in [
        ("number.csv designator.csv both.csv", 0),
        ("designator.csv number.csv both.csv", 0),
        ("both.csv designator.csv number.csv", 0),
        ("number.csv iss.oem both.csv", 1),
        ("iss.oem number.csv both.csv", 2),
        ("both.csv number.csv iss.oem", 1),
    ] {
        let json = |command: &str| here.run(&format!("catalog {command} --json {files}"));
        let report = json("check").exits(0).json();
        let counts = ["objects", "records", "rejected"].map(|key| report[key].as_u64().unwrap());
        assert_eq!(counts, [1, 3, refused], "{files}");
        let info = json("info").exits(0).json();
        assert_eq!(info.as_array().unwrap().len(), 1, "{files}");
        assert_eq!(info[0]["id"], "NORAD 25544", "{files}");
        let list = format!("\"{}\"", files.replace(' ', "\", \""));
        here.write("scene.toml", scene(&list));
        let render = here
            .run("render --scene scene.toml --out o --force")
            .exits(0);
        assert!(has_objects(&render.out, "1"), "{files}: {}", render.out);
    }
}
