//! `skyloop catalog`, folders of orbit files and `--strict`.

use super::skyloop;
use serde_json::Value;
use std::path::Path;
use std::process::Output;

/// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification sets 00005 and 06251.
pub const VANGUARD: &str = "VANGUARD 1\n\
    1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
    2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
pub const DELTA: &str = "DELTA 1 DEB\n\
    1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n\
    2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";
/// A made-up object with a number that no TLE can hold, and a name that no 3LE can.
const NEW: &str = "\
    OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
    MADE UP,2026-101A,2026-07-12T03:04:05.678912,15.20000001,.0010001,97.5001,120.0002,90.0003,270.0004,799500123,.1E-3\n\
    A NAME OF THIRTY CHARACTERS ...,2026-101B,2026-07-12T03:04:05.678912,1.0027,.0001,.5,1,2,3,100002,0\n";

/// A scene with these objects, seen from one of them.
pub fn scene(files: &str) -> String {
    format!(
        "[objects]\nfiles = [{files}]\n[observer]\norbit = \"delta.3le\"\n\
         [sequence]\nepoch = \"2006-06-25T20:00:00Z\"\nframes = 1\nperiod_s = 1.0\n\
         attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n"
    )
}

/// A folder of orbits in three formats, with a remark and a subfolder beside them.
fn folder(at: &Path) {
    std::fs::create_dir_all(at.join("orbits/below")).unwrap();
    let file = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    file("delta.3le", DELTA);
    file("orbits/a.txt", VANGUARD);
    file("orbits/b.csv", NEW);
    file("orbits/readme.txt", "Nothing that moves.\n");
    // Another set of the first object, ten days later, and one that is spoilt.
    let later = VANGUARD
        .replace("00179", "00189")
        .replace("  4753", "  4754");
    let spoilt = DELTA.replace("15.56387291", "15.56387292");
    file("orbits/c.3le", &format!("{later}{spoilt}"));
}

pub fn run(at: &Path, args: &[&str]) -> (Option<i32>, String, String) {
    let Output {
        status,
        stdout,
        stderr,
    } = skyloop(at).args(args).output().unwrap();
    let text = |octets: Vec<u8>| String::from_utf8(octets).unwrap();
    (status.code(), text(stdout), text(stderr))
}

pub fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
}

#[test]
fn check_tells_what_files_hold_and_what_is_no_use() {
    let here = tempfile::tempdir().unwrap();
    folder(here.path());
    let (code, out, _) = run(here.path(), &["catalog", "check", "orbits"]);
    assert_eq!(code, Some(0), "{out}");
    has(
        &out,
        &[
            "orbits/a.txt: 3le, 1 record of 1 object, 0 rejected",
            "epochs 2000-06-27T18:50:19.733568Z to",
            "orbits/b.csv: omm-csv, 2 records of 2 objects",
            "numbers beyond 99999: 2",
            "orbits/c.3le:6: bad checksum in line 2",
            "passed over: 2 entries are no files of orbits (orbits/below, orbits/readme.txt)",
            "3 files: 4 records of 3 objects; 1 record and 0 files cannot be used",
        ],
    );
    let (code, _, log) = run(here.path(), &["catalog", "check", "orbits", "--strict"]);
    assert_eq!(code, Some(1));
    has(&log, &["--strict: 1 record and 0 files cannot be used"]);

    let (code, out, _) = run(here.path(), &["catalog", "check", "--json", "orbits"]);
    let report: Value = serde_json::from_str(&out).unwrap();
    assert_eq!((code, report["objects"].as_u64()), (Some(0), Some(3)));
    assert_eq!(report["passed_over"][1], "orbits/readme.txt");
    let c = &report["files"][2];
    assert_eq!(c["rejected"][0]["line"], 6);
    assert_eq!((&c["format"], &c["records"]), (&"3le".into(), &1.into()));

    let oem = "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = E\nOBJECT_ID = 2019-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
               TIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T00:10:00\nMETA_STOP\n\
               2019-06-15T00:00:00 7000 0 0 1 0 0\n2019-06-15T00:10:00 7600 0 0 1 0 0\n";
    std::fs::write(here.path().join("mixed"), format!("{oem}{VANGUARD}")).unwrap();
    let (_, out, _) = run(here.path(), &["catalog", "check", "mixed"]);
    has(
        &out,
        &[
            "covers 2019-06-15T00:00:00.000Z to 2019-06-15T00:10:00.000Z\n",
            "epochs 2000-06-27T18:50:19.733568Z to 2000-06-27T18:50:19.733568Z\n",
        ],
    );

    let twice = format!(
        "{VANGUARD}{}",
        VANGUARD
            .replace("  .00000023", " -.00000023")
            .replace("4753", "4754")
    );
    std::fs::write(here.path().join("twice.3le"), twice).unwrap();
    let (_, out, _) = run(here.path(), &["catalog", "check", "twice.3le"]);
    has(
        &out,
        &[
            "2 records of 1 object",
            "several element sets: 1 object (NORAD 5: 2)",
        ],
    );

    let (code, out, log) = run(
        here.path(),
        &["catalog", "check", "orbits/readme.txt", "none"],
    );
    assert_eq!(code, Some(1));
    has(&out, &["no orbit found", "cannot read the orbit file none"]);
    has(&log, &["no object in 2 files"]);
}

#[test]
fn check_counts_objects_that_nothing_tells_apart_and_says_what_it_assumed() {
    let here = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| std::fs::write(here.path().join(name), text).unwrap();
    // Two orbits without a number, and one of them again in another file.
    let zero = |set: &str| {
        let bare = set.split_once('\n').unwrap().1;
        // Sums of digits behind the lines, which numbers change.
        let sealed = bare.lines().map(|line| {
            let line = line.replace("00005", "00000").replace("06251", "00000");
            let line = line.replace("58002B", "      ").replace("62025E", "      ");
            let digit = |c: char| c.to_digit(10).unwrap_or((c == '-').into());
            format!(
                "{}{}\n",
                &line[..68],
                line[..68].chars().map(digit).sum::<u32>() % 10
            )
        });
        sealed.collect::<String>()
    };
    file("one.tle", &format!("{}{}", zero(VANGUARD), zero(DELTA)));
    file("two.tle", &zero(DELTA));
    let (code, out, log) = run(here.path(), &["catalog", "check", "one.tle", "two.tle"]);
    assert_eq!(code, Some(0), "{log}");
    has(
        &out,
        &[
            "one.tle: tle, 2 records of 2 objects",
            "2 files: 3 records of 2 objects",
        ],
    );
    let (_, out, _) = run(here.path(), &["catalog", "info", "one.tle", "two.tle"]);
    has(&out, &["  0 #2 ", "  0  "]);
    // One name without a number is no identity.
    file("three.tle", &format!("CUBE\n{}", zero(VANGUARD)));
    file("four.tle", &format!("cube\n{}", zero(DELTA)));
    for (other, objects, shared) in [("three.tle", 2, 1), ("four.tle", 1, 0)] {
        let (_, out, _) = run(here.path(), &["catalog", "check", other, "four.tle"]);
        has(&out, &[&format!("2 files: 2 records of {objects} object")]);
        let said = "objects of one name without number, designator and OBJECT_ID (CUBE: 2)";
        assert_eq!(out.matches(said).count(), shared, "{out}");
    }

    let omm = NEW.replacen("BSTAR\n", "BSTAR,MEAN_ELEMENT_THEORY\n", 1);
    file(
        "old.csv",
        &omm.replace(".1E-3\n", ".1E-3,SGP\n")
            .replace("100002,0\n", "100002,0,SGP4-XP\n"),
    );
    let (code, out, _) = run(here.path(), &["catalog", "check", "old.csv"]);
    assert_eq!(code, Some(0));
    has(
        &out,
        &[
            "old.csv: omm-csv, 1 record of 1 object, 1 rejected",
            "assumed: old.csv:2: MEAN_ELEMENT_THEORY = SGP: flown by SGP4",
            "old.csv:3: record 2: MEAN_ELEMENT_THEORY 'SGP4-XP': elements of SGP4-XP",
        ],
    );
    let (_, _, log) = run(
        here.path(),
        &["catalog", "convert", "old.csv", "--to", "tle"],
    );
    has(&log, &["MEAN_ELEMENT_THEORY = SGP: flown by SGP4"]);
    file("delta.3le", DELTA);
    file("scene.toml", &scene("\"old.csv\""));
    let (_, _, log) = run(here.path(), &["plan", "--scene", "scene.toml"]);
    has(&log, &["MEAN_ELEMENT_THEORY = SGP: flown by SGP4"]);

    file("answer.json", r#"{"error":"You must be logged in"}"#);
    let (code, out, _) = run(here.path(), &["catalog", "check", "answer.json"]);
    assert_eq!(code, Some(1));
    has(
        &out,
        &["answer.json: no orbits, but the answer of a server: \"You must be logged in\""],
    );
}

#[test]
fn check_tells_sets_without_a_state_by_the_references_code() {
    let here = tempfile::tempdir().unwrap();
    // So low that its mean orbit lies inside the Earth.
    let low = NEW
        .replace("15.20000001", "17.5")
        .replace("MADE UP", "SUNK");
    std::fs::write(here.path().join("low.csv"), low).unwrap();
    let (code, out, _) = run(here.path(), &["catalog", "check", "low.csv"]);
    assert_eq!(code, Some(0));
    has(
        &out,
        &[
            "no state by SGP4 at their own epoch: code 6: 1",
            "low.csv:2: NORAD 799500123: the object has decayed",
        ],
    );
}

#[test]
fn info_counts_kinds_of_orbits_and_tells_one() {
    let here = tempfile::tempdir().unwrap();
    folder(here.path());
    let (code, out, log) = run(here.path(), &["catalog", "info", "orbits"]);
    assert_eq!(code, Some(0), "{log}");
    let rows: Vec<Vec<&str>> = out
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    let count = |kind: &str| {
        let row = rows.iter().find(|row| row.first() == Some(&kind)).unwrap();
        row.iter().rev().nth(2).unwrap().to_string()
    };
    assert_eq!(
        ["LEO", "MEO", "GEO", "HEO"].map(count),
        ["1", "1", "1", "0"]
    );
    assert_eq!(count("several"), "1");
    has(&out, &["799500123", "A NAME OF THIRTY CHARACTERS ..."]);
    has(
        &log,
        &[
            "refused: orbits/c.3le:6: bad checksum",
            "passed over: 2 entries are no files of orbits",
        ],
    );

    let one = [
        "catalog",
        "info",
        "orbits",
        "--object",
        "799500123",
        "--json",
    ];
    let (_, out, _) = run(here.path(), &one);
    let told: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(told.as_array().unwrap().len(), 1);
    assert_eq!(
        (&told[0]["regime"], &told[0]["deep"]),
        (&"LEO".into(), &false.into())
    );
    let (code, _, log) = run(
        here.path(),
        &["catalog", "info", "orbits", "--object", "ISS"],
    );
    assert_eq!(code, Some(1));
    has(&log, &["--object ISS: no object called \"ISS\""]);
    let (code, _, log) = run(here.path(), &["catalog", "info", "orbits", "--strict"]);
    assert_eq!(code, Some(1));
    has(&log, &["--strict: 1 record of"]);
}

#[test]
fn convert_writes_every_format_and_tells_what_does_not_fit() {
    let here = tempfile::tempdir().unwrap();
    folder(here.path());
    let files = ["orbits/a.txt", "delta.3le"];
    for format in ["omm-kvn", "omm-xml", "omm-json", "omm-csv"] {
        let out = [
            files[0], files[1], "--to", format, "--out", "there", "--force",
        ];
        let (code, _, log) = run(here.path(), &[&["catalog", "convert"], &out[..]].concat());
        assert_eq!((code, log.as_str()), (Some(0), ""), "{format}");
        let (code, back, _) = run(here.path(), &["catalog", "convert", "there", "--to", "3le"]);
        assert_eq!(code, Some(0));
        let original = format!("0 {VANGUARD}0 {DELTA}");
        assert_eq!(back, original, "{format}");
    }
    let (code, out, log) = run(
        here.path(),
        &["catalog", "convert", "orbits/b.csv", "--to", "3le"],
    );
    assert_eq!((code, out.lines().count()), (Some(0), 3));
    has(&out, &["0 A NAME OF THIRTY CHARACT\n1 A0002U 26101B"]);
    has(
        &log,
        &[
            "NORAD 799500123: a TLE has numbers up to 339999",
            "NORAD 100002: the name 'A NAME OF THIRTY CHARACTERS ...' is cut",
            "1 element set rounded",
        ],
    );
    let strict = [
        "catalog",
        "convert",
        "orbits/b.csv",
        "--to",
        "tle",
        "--out",
        "new",
        "--strict",
    ];
    let (code, _, log) = run(here.path(), &strict);
    assert_eq!((code, here.path().join("new").exists()), (Some(1), false));
    has(&log, &["--strict: 1 record"]);
    let (code, _, _) = run(
        here.path(),
        &["catalog", "convert", "delta.3le", "--to", "oem-kvn"],
    );
    assert_eq!(code, Some(2));
    let oem = super::repository("configs/scenes/rcm-2019-06-15/rcm-2-B.oem");
    let (code, _, log) = run(here.path(), &["catalog", "convert", &oem, "--to", "tle"]);
    assert_eq!(code, Some(1));
    has(
        &log,
        &[
            "has an ephemeris, which no mean elements",
            "no element set to write as tle",
        ],
    );
    let (_, out, _) = run(here.path(), &["catalog", "info", &oem]);
    has(&out, &["with an ephemeris             1", "2019-06-15T"]);
}

#[test]
fn a_scene_takes_folders_and_says_what_it_passed_over() {
    let here = tempfile::tempdir().unwrap();
    folder(here.path());
    let file =
        |name: &str, files: &str| std::fs::write(here.path().join(name), scene(files)).unwrap();
    file("folder.toml", "\"orbits\"");
    let (code, _, log) = run(here.path(), &["plan", "--scene", "folder.toml"]);
    assert_eq!(code, Some(0), "{log}");
    has(
        &log,
        &[
            "refused: orbits/c.3le:6: bad checksum",
            "passed over: 2 entries are no files of orbits (orbits/below, orbits/readme.txt)",
            "1 object has several element sets (NORAD 5 (VANGUARD 1))",
        ],
    );
    for command in ["plan", "loopback", "render", "lightcurve"] {
        let more: &[&str] = match command {
            "render" => &["--out", "o"],
            "lightcurve" => &["--out", "o", "--object", "5"],
            _ => &[],
        };
        let args = [&[command, "--scene", "folder.toml", "--strict"], more].concat();
        let (code, _, log) = run(here.path(), &args);
        assert_eq!(code, Some(1), "{command}: {log}");
        has(
            &log,
            &[
                "--strict: 1 record of orbit files cannot be used",
                "orbits/c.3le:6: bad",
            ],
        );
    }
    let (code, _, log) = run(here.path(), &["run", "--config", "folder.toml", "--strict"]);
    assert_eq!(code, Some(1));
    has(&log, &["--strict: 1 record"]);

    std::fs::create_dir(here.path().join("empty")).unwrap();
    file("empty.toml", "\"empty\"");
    let (code, _, log) = run(here.path(), &["plan", "--scene", "empty.toml"]);
    assert_eq!(code, Some(1));
    has(&log, &["objects.files[0]: empty: no usable object"]);
}
