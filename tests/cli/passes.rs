//! `skyloop passes`: the table, CSV and JSON of the built-in scene, and messages for wrong inputs.

use crate::{Folder, STATE, has, repository};
use serde_json::Value;
use skyloop::orbit::time::parse_utc;

/// The passes of a search that succeeds, as JSON.
fn passes(here: &Folder, flags: &str) -> Value {
    let ended = here.run(&format!("passes --json {flags}"));
    ended.exits(0).json()
}

fn listed(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn mag(value: &Value) -> f64 {
    value["band_mag"].as_f64().unwrap()
}

/// Asserts that position and magnitude of a pass's end are those of the label's object.
fn is_labelled(end: &Value, object: &Value) {
    for (axis, key) in [(0, "x_px"), (1, "y_px")] {
        let off = end["place_px"][axis].as_f64().unwrap() - object[key].as_f64().unwrap();
        assert!(off.abs() < 0.01, "{end} {object}");
    }
    assert!((mag(end) - mag(object)).abs() < 1e-3, "{end} {object}");
}

#[test]
fn the_three_satellites_of_the_built_in_scene_are_in_the_field_all_the_time() {
    let here = Folder::new();
    let table = here.run("passes").quiet();
    let last = "3 passes of 3 objects from 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:14.500Z\n";
    assert!(table.ends_with(last), "{table}");
    // X-Val: the CSV's columns `nearest_utc` and `leaves_utc`.
    assert!(table.contains(" 23:36:04.274 23:36:14.500 "), "{table}");

    let json = passes(&here, "");
    let rows = listed(&json["passes"]);
    assert_eq!(rows.len(), 3);
    // The label of the first exposure has the object's position at the start of the pass.
    let scene = repository("configs/scenes/rcm-2019-06-15/scene.toml");
    here.run(&format!("render --scene {scene} --frames 1 --out frames"))
        .exits(0);
    let label = &here.labels("frames")[0];
    for row in rows {
        assert_eq!(row["in_field_at_start"], true);
        let mut objects = listed(&label["objects"]).iter();
        is_labelled(
            &row["enters"],
            objects.find(|one| one["id"] == row["id"]).unwrap(),
        );
    }

    let csv = here.run("passes --csv --object RCM-2").out;
    let lines: Vec<&str> = csv.lines().collect();
    assert_eq!(lines.len(), 2, "{csv}");
    assert_eq!(lines[0].split(',').count(), lines[1].split(',').count());
    assert!(lines[1].contains(",RCM-2,"));
}

#[test]
fn a_magnitude_limit_excludes_objects_and_reports_their_number() {
    let here = Folder::new();
    let expected = "0 passes of 3 objects from 2019-06-15T23:35:50.000Z to 2019-06-15T23:36:14.500Z, 3 more stay fainter than --mag-limit\n";
    assert_eq!(here.run("passes --mag-limit 0").exits(0).out, expected);
    let json = passes(&here, "--mag-limit 0");
    assert_eq!((&json["objects"], &json["fainter"]), (&3.into(), &3.into()));
    let csv = here.run("passes --mag-limit 0 --csv");
    assert_eq!((csv.out.lines().count(), csv.log.as_str()), (1, expected));
}

#[test]
fn wrong_inputs_are_refused_with_a_remedy() {
    let here = made_up(20);
    here.write("bare.toml", "seed = 1\n");
    let times = "--from 2026-01-01T00:00:00Z --to 2026-01-01T00:01:00Z";
    let bare = format!("--scene bare.toml {times}");
    here.refuses(
        "passes",
        &format!(
            "--to 2019-06-16T00:00:00Z         | no attitude | 23:36:15 | --from and --to
             --from 2019-06-15T23:35:40Z       | no attitude | 23:35:50 | --attitude | --nadir
             --nadir --to 2019-06-16T00:00:00Z | or give the observer's --orbit or --state
             --nadir --state 7000,0,0,7,0,0    | span no orbital plane | give --attitude or --radec
             --to 2019-06-15T23:35:50Z         | the end must lie after the start
             --to 2029-06-15T23:35:50Z         | days | 31
             --shortest 0                      | --shortest 0 | 0.001 to 10
             --object HUBBLE                   | --object HUBBLE | RCM-1
             --rates 0,0,0                     | --attitude
             --scene bare.toml                 | bare.toml | --from UTC
             {bare}                            | no observer | --orbit | --state
             {bare} --state {STATE}            | no attitude | --nadir
             {bare} --state {STATE} --nadir    | no objects | population
             --scene scene.toml --nadir --object 130001 {times}
             | --object NORAD 130001 | the observer itself"
        ),
    );
}

/// A synthetic catalogue of so many objects, and a scene of it, seen from the first object.
fn made_up(objects: u32) -> Folder {
    let scene = "camera = \"fai-nir\"\n[observer]\norbit = \"my.3le:130001\"\n[objects]\nfiles = [\"my.3le\"]\n";
    let here = Folder::with(&[("scene.toml", scene)]);
    here.run(&format!("catalog synth --out my.3le --objects {objects}"))
        .exits(0);
    here
}

#[test]
fn passes_agree_with_the_labels_of_frames() {
    let here = made_up(2000);
    let ends = ["2026-06-01T00:00:00Z", "2026-06-01T00:01:00Z"];
    let times = format!("--from {} --to {}", ends[0], ends[1]);
    let json = passes(&here, &format!("--scene scene.toml --radec 90,0,0 {times}"));
    for (utc, key, there) in [
        (ends[0], "enters", "in_field_at_start"),
        (ends[1], "leaves", "in_field_at_end"),
    ] {
        let scene = "--orbit my.3le:130001 --rso my.3le --label-snr 0 --out o";
        here.run(&format!("render {scene} --epoch {utc} --radec 90,0,0"))
            .exits(0);
        let label = &here.labels("o")[0];
        let is_seen = |one: &&Value| {
            one["kind"] == "rso" && !one["band_mag"].is_null() && one["in_frame"] == true
        };
        let mut seen: Vec<_> = listed(&label["objects"]).iter().filter(is_seen).collect();
        let rows = listed(&json["passes"])
            .iter()
            .filter(|row| row[there] == true);
        assert!(rows.clone().count() > 5);
        for row in rows {
            match seen.iter().position(|one| one["id"] == row["id"]) {
                Some(index) => is_labelled(&row[key], seen.swap_remove(index)),
                None => assert!(row[key]["band_mag"].is_null(), "{row}"),
            }
        }
        assert!(seen.is_empty(), "{utc}: not among the passes: {seen:?}");
    }
}

#[test]
fn the_table_has_dates_only_over_several_days_and_unique_columns() {
    let here = made_up(300);
    let table = |times: &str| {
        let flags = format!("passes --scene scene.toml --radec 90,0,0 {times}");
        here.run(&flags).exits(0).out
    };
    let several = table("--from 2026-05-31T23:59:30Z --to 2026-06-01T00:00:30Z");
    assert!(several.contains(" 2026-06-01T00:00:30.000Z  "), "{several}");
    let one = table("--from 2026-06-01T00:00:00Z --to 2026-06-01T00:00:30Z");
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

const STOP: &str = "STOP_TIME = 2019-06-15T12:09:50";

/// An ephemeris of a circular equatorial orbit, a state every 10 s for ten minutes from noon of
/// 15 June 2019.
fn circle() -> String {
    let mut text = format!(
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = ROUND\nOBJECT_ID = UNKNOWN\nCENTER_NAME = EARTH\n\
         REF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T12:00:00\n{STOP}\nMETA_STOP\n"
    );
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

/// A folder with that ephemeris and a scene of it.
fn round() -> Folder {
    Folder::with(&[
        ("round.oem", &circle()),
        ("round.toml", "[objects]\nfiles = [\"round.oem\"]\n"),
    ])
}

/// An observer in the geostationary belt, with the whole circle in the field.
const GEO: &str = "42164,0,0,0,3.0747,0";

#[test]
fn searches_without_states_are_reported() {
    let here = round();
    // X-Val: Vallado et al. 2006, verification set 06251, with so much drag that it decays within
    // days.
    let sunk = crate::catalog::DELTA.replace("12808-3 0  3985", "12808-0 0  3982");
    here.write("sunk.3le", sunk.replace("DELTA 1 DEB", "SUNK"));
    here.write("sunk.toml", "[objects]\nfiles = [\"sunk.3le\"]\n");
    // In June 2019 the object of round.toml has states for ten minutes.
    for (scene, from, to, stays) in [
        ("round.toml", "2024-01-01", "2024-01-30", 0),
        ("sunk.toml", "2019-06-15", "2019-06-30", 0),
        ("round.toml", "2019-06-01", "2019-06-30", 1),
    ] {
        let times = format!("--from {from}T00:00:00Z --to {to}T00:00:00Z");
        let found = here.run(&format!(
            "passes --scene {scene} {times} --nadir --state {GEO}"
        ));
        let found = found.exits(0).prints(&[&format!("{stays} pass")]);
        if stays == 0 {
            let log = &found.log;
            has(log, &["no object has states through all of the search"]);
            let why = [": no state at", "is outside its ephemeris"];
            assert!(why.iter().any(|why| log.contains(why)), "{log}");
        }
    }
}

#[test]
fn durations_over_a_leap_second_are_si_seconds() {
    let here = round();
    let oem = circle().replace("2019-06-15T12:00:00", "2016-12-31T23:59:50");
    let oem = oem.replace(STOP, "STOP_TIME = 2017-01-01T00:00:30");
    let (head, states) = oem.split_once("META_STOP\n").unwrap();
    // X-Val: IERS Bulletin C 52: 2016-12-31T23:59:60 is a second, so states with UTC times 9 s
    // apart are 10 s apart.
    let times = [
        "2016-12-31T23:59:50",
        "2016-12-31T23:59:60",
        "2017-01-01T00:00:09",
        "2017-01-01T00:00:19",
        "2017-01-01T00:00:29",
    ];
    let state =
        |(time, line): (&&str, &str)| format!("{time} {}\n", line.split_once(' ').unwrap().1);
    let states: String = times.iter().zip(states.lines()).map(state).collect();
    here.write("round.oem", format!("{head}META_STOP\n{states}"));
    let times = "--from 2016-12-31T23:59:55Z --to 2017-01-01T00:00:25Z";
    let flags = format!("--scene round.toml {times} --nadir --state {GEO}");
    let found = here.run(&format!("passes {flags}")).exits(0);
    found.prints(&[
        " >31.0 ",
        "with a leap second in between: durations are SI seconds",
    ]);
    let json = passes(&here, &flags);
    assert_eq!(json["leap_seconds"], 1);
    assert_eq!(json["passes"][0]["duration_s"], 31.0);
}

/// The epoch of a scene's state is its first exposure; the epoch of the option's state is --from.
#[test]
fn states_have_their_documented_epoch() {
    let here = round();
    let scene = format!(
        "[objects]\nfiles = [\"round.oem\"]\n[observer]\nstate = [{GEO}]\n\
         [sequence]\nepoch = \"2019-06-15T12:00:00Z\"\nframes = 2\nperiod_s = 1.0\nnadir = true\n"
    );
    here.write("scene.toml", scene);
    let last_px = |from: &str, more: &str| -> [f64; 2] {
        let times = format!("--from 2019-06-15T{from}Z --to 2019-06-15T12:05:00Z");
        let json = passes(&here, &format!("--scene scene.toml {times} {more}"));
        assert_eq!(json["passes"][0]["in_field_at_end"], true, "{json}");
        let position = &json["passes"][0]["leaves"]["place_px"];
        [0, 1].map(|axis| position[axis].as_f64().unwrap())
    };
    let whole = last_px("12:00:00", "");
    let off = |other: [f64; 2]| (whole[0] - other[0]).hypot(whole[1] - other[1]);
    let state = format!("--state {GEO}");
    assert!(off(last_px("12:03:00", "")) < 0.01);
    assert!(off(last_px("12:00:00", &state)) < 0.01);
    assert!(off(last_px("12:03:00", &state)) > 1.0);
}

/// A folder with ROUND as the target, and another object with states during the whole search.
fn followed() -> (Folder, impl Fn(&str) -> String) {
    let here = round();
    here.run("catalog synth --out my.3le --objects 1 --epoch 2019-06-15T00:00:00Z")
        .exits(0);
    here.write(
        "round.toml",
        "[objects]\nfiles = [\"round.oem\", \"my.3le\"]\n",
    );
    let flags = |times: &str| {
        format!("passes --scene round.toml {times} --look-at ROUND --state {GEO} --json")
    };
    (here, flags)
}

/// Times without states of the --look-at object are not searched and reported in one line.
#[test]
fn a_search_covers_the_times_with_states_of_the_target() {
    let (here, flags) = followed();
    let times = "--from 2019-06-15T11:59:00Z --to 2019-06-15T12:12:00Z";
    let warned = "not searched, since the pointing has no direction: 2019-06-15T11:59:00.000Z to 2019-06-15T12:00:0";
    let found = here
        .run(&flags(times))
        .exits(0)
        .logs(&[warned, "to 2019-06-15T12:12:00.000Z"]);
    let json = found.json();
    let row = listed(&json["passes"])
        .iter()
        .find(|row| row["id"] == "UNKNOWN ROUND");
    // 12:00:00 to 12:09:50, less a light time at the start.
    let duration_s = row.unwrap()["duration_s"].as_f64().unwrap();
    assert!((589.0..590.0).contains(&duration_s), "{duration_s}");
}

/// Two segments with a gap between them. The search has a step at 12:05:00.444444444; the light
/// time is 0.1185548 s. The gap in the search ends a light time later.
#[test]
fn a_gap_between_segments_is_found_to_2_ms() {
    let (here, flags) = followed();
    let flags = flags("--from 2019-06-15T12:00:01Z --to 2019-06-15T12:09:00Z");
    for [stop, start, last] in [
        ["03", "05", "05."],
        ["00.434444444", "00.454444444", "00.57"],
        ["00.443944444", "00.444944444", "00.56"],
        ["00.444444394", "00.444444494", "00.56"],
        ["00.320889444", "00.330889444", "00.4"],
        ["00.325389444", "00.326389444", "00.44"],
    ] {
        let part = |key: &str, second: &str| {
            circle().replace(STOP, &format!("{STOP}\n{key} = 2019-06-15T12:05:{second}"))
        };
        let first = part("USEABLE_STOP_TIME", stop);
        let second = part("USEABLE_START_TIME", start);
        let (_, second) = second.split_once('\n').unwrap();
        here.write("round.oem", first + second);
        let json = here.run(&flags).exits(0).json();
        let gaps = listed(&json["not_searched"]);
        assert_eq!(gaps.len(), 1, "{stop}: {json}");
        let utc = |text: &str| parse_utc(text).unwrap();
        let states_end = utc(&format!("2019-06-15T12:05:{stop}"));
        let off_s = (states_end - utc(gaps[0][0].as_str().unwrap())).to_seconds();
        assert!((0.0..2e-3).contains(&off_s), "{stop}: {gaps:?}");
        let end = gaps[0][1].as_str().unwrap();
        assert!(
            end.starts_with(&format!("2019-06-15T12:05:{last}")),
            "{stop}: {end}"
        );
    }

    // 4 s between two gaps, less than a step.
    let part = |[start, stop]: [&str; 2]| {
        let day = "2019-06-15T12";
        let useable =
            format!("USEABLE_START_TIME = {day}:{start}\nUSEABLE_STOP_TIME = {day}:{stop}");
        circle().replace(STOP, &format!("{STOP}\n{useable}"))
    };
    let parts = [["00:00", "05:01"], ["05:03", "05:07"], ["05:09", "09:50"]].map(part);
    here.write("round.oem", parts.concat());
    let json = here.run(&flags).exits(0).json();
    let gaps = listed(&json["not_searched"]).iter();
    let starts: Vec<&str> = gaps.map(|gap| &gap[0].as_str().unwrap()[14..19]).collect();
    assert_eq!(
        starts,
        ["05:00", "05:06"],
        "within 2 ms of the states: {json}"
    );
}
