//! `skyloop catalog`, folders of orbit files and `--strict`.

use crate::{Folder, still};

/// X-Val: Vallado et al. 2006, AIAA 2006-6753, verification sets 00005 and 06251.
pub const VANGUARD: &str = "VANGUARD 1\n\
    1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
    2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
pub const DELTA: &str = "DELTA 1 DEB\n\
    1 06251U 62025E   06176.82412014  .00008885  00000-0  12808-3 0  3985\n\
    2 06251  58.0579  54.0425 0030035 139.1568 221.1854 15.56387291  6774\n";
/// Synthetic objects with a number too large for a TLE, and a name too long for a 3LE.
const NEW: &str = "\
    OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
    MADE UP,2026-101A,2026-07-12T03:04:05.678912,15.20000001,.0010001,97.5001,120.0002,90.0003,270.0004,799500123,.1E-3\n\
    A NAME OF THIRTY CHARACTERS ...,2026-101B,2026-07-12T03:04:05.678912,1.0027,.0001,.5,1,2,3,100002,0\n";

/// A scene with these objects, seen from one of them.
pub fn scene(files: &str) -> String {
    let sequence = still("2006-06-25T20:00:00Z");
    format!("[objects]\nfiles = [{files}]\n[observer]\norbit = \"delta.3le\"\n{sequence}")
}

/// A folder of orbits in three formats, with a text file and a subfolder. One object has a second
/// set, ten days later; one object has a corrupted set.
fn folder() -> Folder {
    let later = VANGUARD
        .replace("00179", "00189")
        .replace("  4753", "  4754");
    let corrupted = DELTA.replace("15.56387291", "15.56387292");
    let here = Folder::with(&[
        ("delta.3le", DELTA),
        ("orbits/a.txt", VANGUARD),
        ("orbits/b.csv", NEW),
        ("orbits/readme.txt", "Nothing that moves.\n"),
        ("orbits/c.3le", &format!("{later}{corrupted}")),
    ]);
    std::fs::create_dir(here.join("orbits/below")).unwrap();
    here
}

#[test]
fn check_reports_content_and_faults_of_files() {
    let here = folder();
    here.run("catalog check orbits").exits(0).prints(&[
        "orbits/a.txt: 3le, 1 record of 1 object, 0 rejected",
        "epochs 2000-06-27T18:50:19.733568Z to",
        "orbits/b.csv: omm-csv, 2 records of 2 objects",
        "numbers beyond 99999: 2",
        "orbits/c.3le:6: bad checksum in line 2",
        "skipped: 2 entries are not orbit files (orbits/below, orbits/readme.txt)",
        "3 files: 4 records of 3 objects; 1 record and 0 files cannot be used",
    ]);
    let strict = here.run("catalog check orbits --strict").exits(1);
    strict.logs(&["--strict: 1 record and 0 files cannot be used"]);

    let report = here.run("catalog check --json orbits").exits(0).json();
    assert_eq!(report["objects"], 3);
    assert_eq!(report["passed_over"][1], "orbits/readme.txt");
    let c = &report["files"][2];
    assert_eq!(c["rejected"][0]["line"], 6);
    assert_eq!((&c["format"], &c["records"]), (&"3le".into(), &1.into()));

    let oem = "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = E\nOBJECT_ID = 2019-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
               TIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T00:00:00\nSTOP_TIME = 2019-06-15T00:10:00\nMETA_STOP\n\
               2019-06-15T00:00:00 7000 0 0 1 0 0\n2019-06-15T00:10:00 7600 0 0 1 0 0\n";
    here.write("mixed", format!("{oem}{VANGUARD}"));
    here.run("catalog check mixed").prints(&[
        "covers 2019-06-15T00:00:00.000Z to 2019-06-15T00:10:00.000Z\n",
        "epochs 2000-06-27T18:50:19.733568Z to 2000-06-27T18:50:19.733568Z\n",
    ]);

    let other = VANGUARD.replace("  .00000023", " -.00000023");
    here.write(
        "twice.3le",
        VANGUARD.to_string() + &other.replace("4753", "4754"),
    );
    here.run("catalog check twice.3le").prints(&[
        "2 records of 1 object",
        "several element sets: 1 object (NORAD 5: 2)",
    ]);

    let none = here.run("catalog check orbits/readme.txt none").exits(1);
    none.prints(&["no orbit found", "cannot read the orbit file none"])
        .logs(&["no object in 2 files"]);
}

/// An element set without its name, number and designator, with new checksums.
fn without_number(set: &str) -> String {
    let line = |line: &str| {
        let line = line.replace("00005", "00000").replace("06251", "00000");
        let line = line.replace("58002B", "      ").replace("62025E", "      ");
        let digit = |c: char| c.to_digit(10).unwrap_or((c == '-').into());
        let sum = line[..68].chars().map(digit).sum::<u32>();
        format!("{}{}\n", &line[..68], sum % 10)
    };
    set.lines().skip(1).map(line).collect()
}

#[test]
fn check_counts_indistinguishable_objects_and_reports_assumptions() {
    let (vanguard, delta) = (without_number(VANGUARD), without_number(DELTA));
    let theory = NEW.replacen("BSTAR\n", "BSTAR,MEAN_ELEMENT_THEORY\n", 1);
    let theory = theory.replace(".1E-3\n", ".1E-3,SGP\n");
    // Two orbits without a number; one of them again in another file, with and without a name.
    let here = Folder::with(&[
        ("one.tle", &format!("{vanguard}{delta}")),
        ("two.tle", &delta),
        ("three.tle", &format!("CUBE\n{vanguard}")),
        ("four.tle", &format!("cube\n{delta}")),
        (
            "old.csv",
            &theory.replace("100002,0\n", "100002,0,SGP4-XP\n"),
        ),
        ("delta.3le", DELTA),
        ("scene.toml", &scene("\"old.csv\"")),
        ("answer.json", r#"{"error":"You must be logged in"}"#),
    ]);
    let check = here.run("catalog check one.tle two.tle").exits(0);
    check.prints(&[
        "one.tle: tle, 2 records of 2 objects",
        "2 files: 3 records of 2 objects",
    ]);
    here.run("catalog info one.tle two.tle")
        .prints(&["  0 #2 ", "  0  "]);
    // A name without a number does not identify an object.
    for (other, objects, shared) in [("three.tle", 2, 1), ("four.tle", 1, 0)] {
        let check = here.run(&format!("catalog check {other} four.tle"));
        let check = check.prints(&[&format!("2 files: 2 records of {objects} object")]);
        let said = "objects of one name without number, designator and OBJECT_ID (CUBE: 2)";
        assert_eq!(check.out.matches(said).count(), shared, "{}", check.out);
    }

    here.run("catalog check old.csv").exits(0).prints(&[
        "old.csv: omm-csv, 1 record of 1 object, 1 rejected",
        "assumed: old.csv:2: MEAN_ELEMENT_THEORY = SGP: propagated by SGP4",
        "old.csv:3: record 2: MEAN_ELEMENT_THEORY 'SGP4-XP': elements of SGP4-XP",
    ]);
    for command in ["catalog info old.csv", "plan --scene scene.toml"] {
        let said = here.run(command);
        said.logs(&["MEAN_ELEMENT_THEORY = SGP: propagated by SGP4"]);
    }
    let says = "answer.json: no orbits, but the answer of a server: \"You must be logged in\"";
    here.run("catalog check answer.json")
        .exits(1)
        .prints(&[says]);
}

#[test]
fn check_reports_sgp4_errors_by_their_reference_code() {
    // The mean orbit lies inside the Earth.
    let low = NEW
        .replace("15.20000001", "17.5")
        .replace("MADE UP", "SUNK");
    let here = Folder::with(&[("low.csv", &low)]);
    here.run("catalog check low.csv").exits(0).prints(&[
        "no state by SGP4 at their own epoch: code 6: 1",
        "low.csv:2: NORAD 799500123: the object has decayed",
    ]);
}

#[test]
fn info_counts_orbit_regimes_and_describes_one_object() {
    let here = folder();
    let info = here.run("catalog info orbits").exits(0);
    let info = info.prints(&["799500123", "A NAME OF THIRTY CHARACTERS ..."]);
    let count = |kind: &str| {
        let rows = info.out.lines().map(|line| line.split_whitespace());
        let row = rows.map(Iterator::collect::<Vec<&str>>);
        let mut row = row.filter(|row| row.first() == Some(&kind));
        row.next().unwrap().iter().rev().nth(2).unwrap().to_string()
    };
    let counts = ["LEO", "MEO", "GEO", "HEO", "several"].map(count);
    assert_eq!(counts, ["1", "1", "1", "0", "1"]);
    info.logs(&[
        "refused: orbits/c.3le:6: bad checksum",
        "skipped: 2 entries are not orbit files",
    ]);

    let object = here.run("catalog info orbits --object 799500123 --json");
    let object = object.json();
    assert_eq!(object.as_array().unwrap().len(), 1);
    let (regime, deep) = (&object[0]["regime"], &object[0]["deep"]);
    assert_eq!((regime, deep), (&"LEO".into(), &false.into()));
    here.runs(
        "catalog info orbits",
        1,
        "--object ISS | --object ISS: no object called \"ISS\"
         --strict     | --strict: 1 record of",
    );
}

#[test]
fn info_reports_the_span_of_an_ephemeris() {
    let here = folder();
    let oem = crate::repository("configs/scenes/rcm-2019-06-15/rcm-2-B.oem");
    let info = here.run(&format!("catalog info {oem}"));
    info.prints(&["with an ephemeris             1", "2019-06-15T"]);
}

#[test]
fn a_scene_reads_folders_and_reports_skipped_files() {
    let here = folder();
    here.write("folder.toml", scene("\"orbits\""));
    here.run("plan --scene folder.toml").exits(0).logs(&[
        "refused: orbits/c.3le:6: bad checksum",
        "skipped: 2 entries are not orbit files (orbits/below, orbits/readme.txt)",
        "1 object has several element sets (NORAD 5 (VANGUARD 1))",
    ]);
    for command in [
        "plan --scene",
        "loopback --scene",
        "render --out o --scene",
        "lightcurve --out o --object 5 --scene",
        "run --config",
    ] {
        let strict = here.run(&format!("{command} folder.toml --strict"));
        let strict = strict.exits(1);
        let strict = strict.logs(&["--strict: 1 record"]);
        if !command.starts_with("run") {
            let of_files = "--strict: 1 record of orbit files cannot be used";
            strict.logs(&[of_files, "orbits/c.3le:6: bad"]);
        }
    }
    std::fs::create_dir(here.join("empty")).unwrap();
    here.write("empty.toml", scene("\"empty\""));
    let empty = here.run("plan --scene empty.toml").exits(1);
    empty.logs(&["objects.files[0]: empty: no usable object"]);
}
