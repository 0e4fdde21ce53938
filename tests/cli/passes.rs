//! `skyloop passes`: the table, CSV and JSON of the built-in scene, and what it says of wrong inputs.

use crate::{STATE, repository, skyloop};
use serde_json::Value;
use skyloop::orbit::time::parse_utc;
use std::path::Path;

/// Its code and both outputs.
fn passes(at: &Path, flags: &[&str]) -> (i32, String, String) {
    let output = skyloop(at).arg("passes").args(flags).output().unwrap();
    let text = |octets| String::from_utf8(octets).unwrap();
    (
        output.status.code().unwrap(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn the_three_satellites_of_the_built_in_scene_are_in_the_field_all_the_time() {
    let here = tempfile::tempdir().unwrap();
    let (code, table, log) = passes(here.path(), &[]);
    assert_eq!((code, log.as_str()), (0, ""));
    let last = "3 passes of 3 objects from 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:14.500Z\n";
    assert!(table.ends_with(last), "{table}");
    // X-Val: the CSV's columns `nearest_utc` and `leaves_utc`.
    assert!(table.contains(" 23:36:04.274 23:36:14.500 "), "{table}");

    let (_, text, _) = passes(here.path(), &["--json"]);
    let json: Value = serde_json::from_str(&text).unwrap();
    let rows = json["passes"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    // The first exposure's label has the object where the pass begins.
    let render = [
        "render",
        "--scene",
        &repository("configs/scenes/rcm-2019-06-15/scene.toml"),
    ];
    let render = skyloop(here.path())
        .args(render)
        .args(["--frames", "1", "--out", "frames"])
        .output()
        .unwrap();
    assert!(render.status.success());
    let labels = std::fs::read_to_string(here.path().join("frames/labels.jsonl")).unwrap();
    let label: Value = serde_json::from_str(labels.lines().next().unwrap()).unwrap();
    let seen = label["objects"].as_array().unwrap();
    for row in rows {
        assert_eq!(row["in_field_at_start"], true);
        let object = seen.iter().find(|one| one["id"] == row["id"]).unwrap();
        for axis in [0, 1] {
            let place = row["enters"]["place_px"][axis].as_f64().unwrap();
            let x = object[["x_px", "y_px"][axis]].as_f64().unwrap();
            assert!((place - x).abs() < 0.01, "{place} {x}");
        }
        let mag = row["enters"]["band_mag"].as_f64().unwrap();
        assert!((mag - object["band_mag"].as_f64().unwrap()).abs() < 1e-3);
    }

    let (_, csv, _) = passes(here.path(), &["--csv", "--object", "RCM-2"]);
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 2, "{csv}");
    assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
    assert!(lines[1].contains(",RCM-2,"));
}

#[test]
fn a_limit_of_magnitude_leaves_out_and_says_how_many() {
    let here = tempfile::tempdir().unwrap();
    let (code, said, _) = passes(here.path(), &["--mag-limit", "0"]);
    let expected = "0 passes of 3 objects from 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:14.500Z, 3 more stay fainter than --mag-limit\n";
    assert_eq!((code, said.as_str()), (0, expected));
    let (_, text, _) = passes(here.path(), &["--mag-limit", "0", "--json"]);
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&json["objects"], &json["fainter"]), (&3.into(), &3.into()));
    let (_, csv, log) = passes(here.path(), &["--mag-limit", "0", "--csv"]);
    assert_eq!((csv.lines().count(), log.as_str()), (1, expected));
}

#[test]
fn wrong_inputs_are_named_with_what_helps() {
    let here = tempfile::tempdir().unwrap();
    let bare = here.path().join("bare.toml");
    std::fs::write(&bare, "seed = 1\n").unwrap();
    let refused = |flags: &[&str], words: &[&str]| {
        let (code, _, log) = passes(here.path(), flags);
        assert!(code != 0, "{flags:?}");
        assert!(words.iter().all(|word| log.contains(word)), "{log}");
        assert_eq!(
            log.lines().filter(|line| line.starts_with("error")).count(),
            1,
            "{log}"
        );
    };
    let late = ["--to", "2019-06-16T00:00:00Z"];
    refused(&late, &["no attitude", "23:36:15", "--from and --to"]);
    let early = ["--from", "2019-06-15T23:35:40Z"];
    refused(
        &early,
        &["no attitude", "23:35:50", "--attitude", "--nadir"],
    );
    let away = ["--nadir", "--to", "2019-06-16T00:00:00Z"];
    refused(&away, &["or give the observer's --orbit or --state"]);
    let up = ["--nadir", "--state", "7000,0,0,7,0,0"];
    refused(
        &up,
        &["span no orbital plane", "give --attitude or --radec"],
    );
    let turned = ["--to", "2019-06-15T23:35:50Z"];
    refused(&turned, &["the end must lie after the start"]);
    refused(&["--to", "2029-06-15T23:35:50Z"], &["days", "31"]);
    refused(&["--shortest", "0"], &["--shortest 0", "0.001 to 10"]);
    refused(&["--object", "HUBBLE"], &["--object HUBBLE", "RCM-1"]);
    refused(&["--rates", "0,0,0"], &["--attitude"]);
    refused(&["--scene", "bare.toml"], &["bare.toml", "--from UTC"]);
    let times = [
        "--from",
        "2026-01-01T00:00:00Z",
        "--to",
        "2026-01-01T00:01:00Z",
    ];
    let with = |more: &[&'static str]| [&["--scene", "bare.toml"], &times[..], more].concat();
    refused(&with(&[]), &["no observer", "--orbit", "--state"]);
    refused(&with(&["--state", STATE]), &["no attitude", "--nadir"]);
    refused(
        &with(&["--state", STATE, "--nadir"]),
        &["no objects", "population"],
    );
    made_up(here.path(), "20");
    let mirror = ["--scene", "scene.toml", "--nadir", "--object", "130001"];
    refused(
        &[&mirror[..], &times].concat(),
        &["--object NORAD 130001", "the observer itself"],
    );
}

/// A made-up catalogue of so many objects, and a scene of it, seen from its first.
fn made_up(at: &Path, objects: &str) {
    let synth = ["catalog", "synth", "--out", "my.3le", "--objects", objects];
    assert!(skyloop(at).args(synth).output().unwrap().status.success());
    let scene = "camera = \"fai-nir\"\n[observer]\norbit = \"my.3le:130001\"\n[objects]\nfiles = [\"my.3le\"]\n";
    std::fs::write(at.join("scene.toml"), scene).unwrap();
}

#[test]
fn who_is_in_the_field_and_where_is_what_frames_have() {
    let here = tempfile::tempdir().unwrap();
    made_up(here.path(), "2000");
    let looks = ["--radec", "90,0,0"];
    let ends = ["2026-06-01T00:00:00Z", "2026-06-01T00:01:00Z"];
    let flags = [
        &[
            "--scene",
            "scene.toml",
            "--from",
            ends[0],
            "--to",
            ends[1],
            "--json",
        ][..],
        &looks,
    ]
    .concat();
    let (code, text, log) = passes(here.path(), &flags);
    assert_eq!(code, 0, "{log}");
    let json: Value = serde_json::from_str(&text).unwrap();
    let rows = json["passes"].as_array().unwrap();
    let of_scene = "--orbit my.3le:130001 --rso my.3le --label-snr 0 --out o --epoch";
    for (utc, key, there) in [
        (ends[0], "enters", "in_field_at_start"),
        (ends[1], "leaves", "in_field_at_end"),
    ] {
        let render = skyloop(here.path())
            .arg("render")
            .args(of_scene.split_whitespace())
            .arg(utc)
            .args(looks)
            .output()
            .unwrap();
        assert!(render.status.success());
        let labels = std::fs::read_to_string(here.path().join("o/labels.jsonl")).unwrap();
        let label: Value = serde_json::from_str(&labels).unwrap();
        let objects = label["objects"].as_array().unwrap();
        let lit = |one: &&Value| one["kind"] == "rso" && !one["band_mag"].is_null();
        let seen = objects.iter().filter(lit);
        let mut seen: Vec<&Value> = seen.filter(|one| one["in_frame"] == true).collect();
        for row in rows.iter().filter(|row| row[there] == true) {
            let Some(place) = seen.iter().position(|one| one["id"] == row["id"]) else {
                assert!(row[key]["band_mag"].is_null(), "{row}");
                continue;
            };
            let object = seen.swap_remove(place);
            for axis in [0, 1] {
                let passes = row[key]["place_px"][axis].as_f64().unwrap();
                let frames = object[["x_px", "y_px"][axis]].as_f64().unwrap();
                assert!((passes - frames).abs() < 0.01, "{utc}: {row} {object}");
            }
            let mag = |value: &Value| value["band_mag"].as_f64().unwrap();
            assert!(
                (mag(&row[key]) - mag(object)).abs() < 1e-3,
                "{row} {object}"
            );
        }
        assert!(seen.is_empty(), "{utc}: not among the passes: {seen:?}");
        let found = rows.iter().filter(|row| row[there] == true);
        assert!(found.count() > 5);
    }
}

#[test]
fn the_table_has_the_day_where_a_stay_has_several_and_no_name_twice() {
    let here = tempfile::tempdir().unwrap();
    made_up(here.path(), "300");
    let table = |from: &str, to: &str| {
        let looks = [
            "--scene",
            "scene.toml",
            "--radec",
            "90,0,0",
            "--from",
            from,
            "--to",
            to,
        ];
        let (code, said, log) = passes(here.path(), &looks);
        assert_eq!(code, 0, "{log}");
        said
    };
    let several = table("2026-05-31T23:59:30Z", "2026-06-01T00:00:30Z");
    assert!(several.contains(" 2026-06-01T00:00:30.000Z  "), "{several}");
    let one = table("2026-06-01T00:00:00Z", "2026-06-01T00:00:30Z");
    assert!(
        one.contains(" 00:00:30.000 ") && !one.contains("00:00:30.000Z  "),
        "{one}"
    );
    let head = several.lines().next().unwrap().split("  ").map(str::trim);
    let mut names: Vec<&str> = head.filter(|name| !name.is_empty()).collect();
    let all = names.len();
    names.sort_unstable();
    names.dedup();
    assert_eq!((all, names.len()), (15, 15), "{names:?}");
}

/// An ephemeris of a circle above the equator, a state every 10 s for ten minutes from noon of 15 June 2019 on.
fn circle() -> String {
    let mut text = "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = ROUND\nOBJECT_ID = UNKNOWN\nCENTER_NAME = EARTH\n\
                    REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T12:00:00\nSTOP_TIME = 2019-06-15T12:09:50\nMETA_STOP\n"
        .to_string();
    let (radius, speed) = (7000.0, 7.546);
    for step in 0..60 {
        let (sin, cos) = (f64::from(step) * 10.0 * speed / radius).sin_cos();
        let place = format!("{} {} 0", radius * cos, radius * sin);
        let moves = format!("{} {} 0", -speed * sin, speed * cos);
        let (minute, second) = (step / 6, step % 6 * 10);
        text += &format!("2019-06-15T12:{minute:02}:{second:02} {place} {moves}\n");
    }
    text
}

#[test]
fn days_without_states_are_said_to_have_none() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("round.oem"), circle()).unwrap();
    // X-Val: Vallado et al. 2006, verification set 06251, with so much drag that it has decayed within days.
    let sunk = crate::catalog::DELTA
        .replace("12808-3 0  3985", "12808-0 0  3982")
        .replace("DELTA 1 DEB", "SUNK");
    std::fs::write(here.path().join("sunk.3le"), sunk).unwrap();
    for (file, day, stays) in [
        ("round.oem", "2024-01-01", 0),
        ("sunk.3le", "2019-06-15", 0),
        // Within these 30 days it has states for ten minutes.
        ("round.oem", "2019-06-01", 1),
    ] {
        let scene = format!("[objects]\nfiles = [\"{file}\"]\n");
        std::fs::write(here.path().join("scene.toml"), scene).unwrap();
        let (from, to) = (
            format!("{day}T00:00:00Z"),
            format!("{}-30T00:00:00Z", &day[..7]),
        );
        let flags = [
            "--scene",
            "scene.toml",
            "--from",
            &from,
            "--to",
            &to,
            "--nadir",
        ];
        // From the geostationary belt all of its way is in the field.
        let state = ["--state", "42164,0,0,0,3.0747,0"];
        let (code, said, log) = passes(here.path(), &[&flags[..], &state].concat());
        assert_eq!(code, 0, "{log}");
        assert!(said.contains(&format!("{stays} pass")), "{said}");
        if stays == 0 {
            assert!(
                log.contains("no object has states through all of the search"),
                "{log}"
            );
            assert!(
                log.contains(": no state at") || log.contains("is outside its ephemeris"),
                "{log}"
            );
        }
    }
}

#[test]
fn durations_over_a_leap_second_are_si_seconds() {
    let here = tempfile::tempdir().unwrap();
    let mut oem = circle().replace("2019-06-15T12:00:00", "2016-12-31T23:59:50");
    oem = oem.replace(
        "STOP_TIME = 2019-06-15T12:09:50",
        "STOP_TIME = 2017-01-01T00:00:30",
    );
    let (head, states) = oem.split_once("META_STOP\n").unwrap();
    // X-Val: IERS Bulletin C 52: 2016-12-31T23:59:60 is a second, so states whose digits differ by 9 s are 10 s apart.
    let times = [
        "2016-12-31T23:59:50",
        "2016-12-31T23:59:60",
        "2017-01-01T00:00:09",
        "2017-01-01T00:00:19",
        "2017-01-01T00:00:29",
    ];
    let states = times.iter().zip(states.lines());
    let states: Vec<String> = states
        .map(|(time, line)| format!("{time} {}\n", line.split_once(' ').unwrap().1))
        .collect();
    std::fs::write(
        here.path().join("leap.oem"),
        format!("{head}META_STOP\n{}", states.concat()),
    )
    .unwrap();
    std::fs::write(
        here.path().join("scene.toml"),
        "[objects]\nfiles = [\"leap.oem\"]\n",
    )
    .unwrap();
    let flags = "--scene scene.toml --from 2016-12-31T23:59:55Z --to 2017-01-01T00:00:25Z --nadir --state 42164,0,0,0,3.0747,0";
    let flags: Vec<&str> = flags.split_whitespace().collect();
    let (code, said, log) = passes(here.path(), &flags);
    assert_eq!(code, 0, "{log}");
    assert!(said.contains(" >31.0 "), "{said}");
    assert!(
        said.contains("with a leap second in between: durations are SI seconds"),
        "{said}"
    );
    let (_, text, _) = passes(here.path(), &[&flags[..], &["--json"]].concat());
    let json: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(json["leap_seconds"], 1);
    assert_eq!(json["passes"][0]["duration_s"], 31.0);
}

/// A scene's state holds at its first exposure and not at --from, and the option's at --from.
#[test]
fn a_state_holds_where_the_readme_says() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("round.oem"), circle()).unwrap();
    const GEO: &str = "42164,0,0,0,3.0747,0";
    let scene = format!(
        "[objects]\nfiles = [\"round.oem\"]\n[observer]\nstate = [{GEO}]\n\
         [sequence]\nepoch = \"2019-06-15T12:00:00Z\"\nframes = 2\nperiod_s = 1.0\nnadir = true\n"
    );
    std::fs::write(here.path().join("scene.toml"), scene).unwrap();
    let last_px = |from: &str, more: &[&str]| -> [f64; 2] {
        let to = "2019-06-15T12:05:00Z";
        let flags = [
            "--scene",
            "scene.toml",
            "--json",
            "--from",
            from,
            "--to",
            to,
        ];
        let (code, text, log) = passes(here.path(), &[&flags[..], more].concat());
        assert_eq!(code, 0, "{log}");
        let json: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(json["passes"][0]["in_field_at_end"], true, "{text}");
        [0, 1].map(|axis| {
            json["passes"][0]["leaves"]["place_px"][axis]
                .as_f64()
                .unwrap()
        })
    };
    let apart = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    let (first, later) = ("2019-06-15T12:00:00Z", "2019-06-15T12:03:00Z");
    let whole = last_px(first, &[]);
    assert!(apart(whole, last_px(later, &[])) < 0.01);
    assert!(apart(whole, last_px(first, &["--state", GEO])) < 0.01);
    assert!(apart(whole, last_px(later, &["--state", GEO])) > 1.0);
}

/// Where the object of --look-at has no states nothing is searched, which one line says.
#[test]
fn a_search_goes_on_where_the_target_has_states() {
    let here = tempfile::tempdir().unwrap();
    std::fs::write(here.path().join("round.oem"), circle()).unwrap();
    // Another object, so that there are states all through the search.
    let synth = "catalog synth --out my.3le --objects 1 --epoch 2019-06-15T00:00:00Z";
    assert!(
        skyloop(here.path())
            .args(synth.split(' '))
            .output()
            .unwrap()
            .status
            .success()
    );
    std::fs::write(
        here.path().join("scene.toml"),
        "[objects]\nfiles = [\"round.oem\", \"my.3le\"]\n",
    )
    .unwrap();
    let flags = "--scene scene.toml --from 2019-06-15T11:59:00Z --to 2019-06-15T12:12:00Z --look-at ROUND --state 42164,0,0,0,3.0747,0 --json";
    let flags: Vec<&str> = flags.split_whitespace().collect();
    let (code, text, log) = passes(here.path(), &flags);
    assert_eq!(code, 0, "{log}");
    let warned = "not searched, since the pointing has no direction: 2019-06-15T11:59:00.000Z to 2019-06-15T12:00:0";
    assert!(
        log.contains(warned) && log.contains("to 2019-06-15T12:12:00.000Z"),
        "{log}"
    );
    let json: Value = serde_json::from_str(&text).unwrap();
    let mut rows = json["passes"].as_array().unwrap().iter();
    let row = rows.find(|row| row["id"] == "UNKNOWN ROUND");
    let row = row.unwrap_or_else(|| panic!("{text}"));
    // 12:00:00 to 12:09:50, less a light time at the beginning.
    let duration_s = row["duration_s"].as_f64().unwrap();
    assert!((589.0..590.0).contains(&duration_s), "{duration_s}");

    // Two segments with a gap between them. The search has a step at 12:05:00.444444444, and the light that arrives then left 0.1185548 s before.
    let flags = flags
        .join(" ")
        .replace("11:59:00", "12:00:01")
        .replace("12:12:00", "12:09:00");
    let flags: Vec<&str> = flags.split(' ').collect();
    for [stop, start, last] in [
        ["03", "05", "05."],
        ["00.434444444", "00.454444444", "00.57"],
        ["00.443944444", "00.444944444", "00.56"],
        ["00.444444394", "00.444444494", "00.56"],
        ["00.320889444", "00.330889444", "00.4"],
        ["00.325389444", "00.326389444", "00.44"],
    ] {
        let stop = format!("2019-06-15T12:05:{stop}");
        let useable = |key, at: &str| format!("STOP_TIME = 2019-06-15T12:09:50\n{key} = {at}");
        let first = circle().replace(
            "STOP_TIME = 2019-06-15T12:09:50",
            &useable("USEABLE_STOP_TIME", &stop),
        );
        let second = circle().replace(
            "STOP_TIME = 2019-06-15T12:09:50",
            &useable("USEABLE_START_TIME", &format!("2019-06-15T12:05:{start}")),
        );
        let (_, second) = second.split_once('\n').unwrap();
        std::fs::write(here.path().join("round.oem"), first + second).unwrap();
        let (code, text, log) = passes(here.path(), &flags);
        assert_eq!(code, 0, "{stop}: {log}");
        let json: Value = serde_json::from_str(&text).unwrap();
        let gaps = json["not_searched"].as_array().unwrap();
        assert_eq!(gaps.len(), 1, "{stop}: {text}");
        // It ends a light time after that of the states.
        let ends = [0, 1].map(|end| parse_utc(gaps[0][end].as_str().unwrap()).unwrap());
        let off_s = (parse_utc(&stop).unwrap() - ends[0]).to_seconds();
        assert!((0.0..2e-3).contains(&off_s), "{stop}: {gaps:?}");
        let last = format!("2019-06-15T12:05:{last}");
        assert!(
            gaps[0][1].as_str().unwrap().starts_with(&last),
            "{stop}: {gaps:?}"
        );
    }

    // 4 s between two gaps, less than a step.
    const STOP: &str = "STOP_TIME = 2019-06-15T12:09:50";
    let part = |[start, stop]: [&str; 2]| {
        let day = "2019-06-15T12";
        let useable =
            format!("USEABLE_START_TIME = {day}:{start}\nUSEABLE_STOP_TIME = {day}:{stop}");
        circle().replace(STOP, &format!("{STOP}\n{useable}"))
    };
    let parts = [["00:00", "05:01"], ["05:03", "05:07"], ["05:09", "09:50"]].map(part);
    std::fs::write(here.path().join("round.oem"), parts.concat()).unwrap();
    let (code, text, log) = passes(here.path(), &flags);
    assert_eq!(code, 0, "{log}");
    let json: Value = serde_json::from_str(&text).unwrap();
    let gaps = json["not_searched"].as_array().unwrap();
    let starts = gaps.iter().map(|gap| gap[0].as_str().unwrap());
    let starts: Vec<&str> = starts.map(|start| &start[14..19]).collect();
    assert_eq!(
        starts,
        ["05:00", "05:06"],
        "within 2 ms of the states: {text}"
    );
}
