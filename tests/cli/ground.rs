//! Observers inside the Earth or the Moon are refused before anything is written. Earth-fixed axes
//! turn by UT1.

use crate::{EPOCH, Folder, Q, render, still, with_keys};
use hifitime::{Epoch, Unit};
use nalgebra::Vector3;
use skyloop::orbit::time::{parse_utc, utc_text};
use skyloop::sky::bodies::Bodies;

/// An ephemeris of 21 s from `start`, a state each second; `state` gives km and km/s at a time (s).
fn oem(meta: &str, start: Epoch, state: impl Fn(i32) -> (Vector3<f64>, Vector3<f64>)) -> String {
    let utc = |s: i32| {
        let text = utc_text(start + Unit::Second * f64::from(s));
        text.trim_end_matches('Z').to_string()
    };
    let mut text = format!(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\n{meta}\n\
         OBJECT_ID = 2026-001A\nCENTER_NAME = EARTH\nTIME_SYSTEM = UTC\nSTART_TIME = {}\nSTOP_TIME = {}\nMETA_STOP\n\n",
        utc(0),
        utc(20)
    );
    for s in 0..=20 {
        let (r, v) = state(s);
        text += &format!(
            "{} {} {} {} {} {} {}\n",
            utc(s),
            r.x,
            r.y,
            r.z,
            v.x,
            v.y,
            v.z
        );
    }
    text
}

const DIVER: &str =
    "OBJECT_NAME = DIVER\nREF_FRAME = GCRF\nINTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 5";

/// Renders a scene of so many frames, 1 s apart, seen from `diver.oem`.
fn scene(here: &Folder, epoch: &str, frames: &str) -> crate::Outcome {
    let sequence = with_keys(&still(epoch), &[("frames", frames)]);
    here.write(
        "scene.toml",
        format!("[observer]\norbit = \"diver.oem\"\n{sequence}"),
    );
    here.run("render --scene scene.toml --out p")
}

/// An observer inside the Earth: by a state, and by an orbit that enters it in a later exposure.
#[test]
fn an_observer_below_the_ground() {
    // X-Val: WGS84: the equator's radius is 6378.137 km, the pole's 6356.752 km.
    let here = Folder::new();
    let refused = here.run(&render("--state 6378.0,0,0,0,7.5,0")).exits(1);
    refused.logs(&[
        "(--state) = [6378.0, 0.0, 0.0] km",
        "below the ground",
        "6378.0 km",
    ]);
    // Descends by 2 km/s from 6388 km: below the ground after 5 s.
    let start = parse_utc("2019-06-15T23:35:00Z").unwrap();
    let falling = |s: i32| {
        let x = 6388.0 - 2.0 * f64::from(s);
        (Vector3::new(x, 0.0, 0.0), Vector3::new(-2.0, 0.0, 0.0))
    };
    here.write("diver.oem", oem(DIVER, start, falling));
    scene(&here, "2019-06-15T23:35:02Z", "10").exits(1).logs(&[
        "scene.toml",
        "observer.orbit = ",
        "DIVER",
        "below the ground",
        "2019-06-15T23:35:05",
        "[6378.0, 0.0, 0.0]",
    ]);
    scene(&here, "2019-06-15T23:35:02Z", "2").exits(0);
}

/// An observer inside the Moon: by a state, and by an orbit that enters it in a later exposure.
#[test]
fn an_observer_inside_the_moon() {
    // X-Val: IAU WGCCRE 2015: the Moon's mean radius is 1737.4 km.
    let here = Folder::new();
    let start = parse_utc(EPOCH).unwrap();
    let moon_km = |s: i32| {
        let epoch = start + Unit::Second * f64::from(s);
        Bodies::at(epoch).unwrap().moon_geocentric_m * 1e-3
    };
    let at = |height_km: f64| {
        let at = moon_km(0) + Vector3::new(0.0, 0.0, height_km);
        here.run(&render(&format!(
            "--state {},{},{},0,0,0",
            at.x, at.y, at.z
        )))
    };
    at(1737.39).exits(1).logs(&[
        "(--state) = ",
        "1737.4 km from the Moon's centre",
        "2019-06-15T23:35:50",
        "above its ground",
    ]);
    assert!(!here.join("o").exists());
    at(1742.0).exits(0);

    // Descends by 2 km/s from 1747 km: inside the Moon after 5 s.
    let falling = |s: i32| {
        let above = Vector3::new(0.0, 0.0, 1747.0 - 2.0 * f64::from(s));
        let by = moon_km(s + 1) - moon_km(s) - Vector3::new(0.0, 0.0, 2.0);
        (moon_km(s) + above, by)
    };
    here.write("diver.oem", oem(DIVER, start, falling));
    scene(&here, EPOCH, "10").exits(1).logs(&[
        "scene.toml",
        "observer.orbit = ",
        "DIVER",
        "1737.0 km from the Moon's centre",
        "2019-06-15T23:35:55",
    ]);
    assert!(!here.join("p").exists());
}

/// UT1 - UTC turns Earth-fixed states. The option and the file's comment have the same effect.
#[test]
fn ut1_utc_comes_from_the_option_or_the_file() {
    let here = Folder::new();
    let message_at = |minute: &str, comment: &str| {
        let meta =
            format!("{comment}OBJECT_NAME = FLYER\nREF_FRAME = ITRF2014\nINTERPOLATION = LINEAR");
        let start = parse_utc(&format!("{minute}:00Z")).unwrap();
        oem(&meta, start, |s| {
            let moved = Vector3::new(7000.0, 7.5 * f64::from(s), 0.0);
            (moved, Vector3::new(0.0, 7.5, 0.0))
        })
    };
    let message = |comment: &str| message_at("2019-06-15T23:35", comment);
    here.write("plain.oem", message(""));
    here.write("given.oem", message("COMMENT UT1-UTC = -0.1634\n"));
    let render = |orbit: &str, option: &str| {
        let place = format!("--epoch 2019-06-15T23:35:10Z --attitude {Q} --out o");
        let done = here
            .run(&format!("render {place} --orbit {orbit} {option}"))
            .exits(0);
        let warns = done.log.contains("UT1 is taken as UTC");
        let state = &here.labels("o")[0]["state_gcrf_km"];
        let km = [0, 1, 2].map(|axis| state[axis].as_f64().unwrap());
        (Vector3::from(km), warns)
    };
    let (unknown, warns) = render("plain.oem", "");
    assert!(warns);
    let (by_option, warns) = render("plain.oem", "--ut1-utc -0.1634");
    assert!(!warns);
    assert_eq!(by_option, render("given.oem", "--ut1-utc 0.5").0);
    // X-Val: the Earth turns by 7.292115e-5 rad/s (IERS Conventions 2010, table 1.2); 7000.4 km is
    // the distance from its axis to 0.2 %.
    let moved_km = (by_option - unknown).norm();
    let expected_km = 7.292115e-5 * 0.1634 * 7000.4;
    assert!((moved_km / expected_km - 1.0).abs() < 2e-3, "{moved_km}");
    // The option holds at the file's first START_TIME: after a leap second (2016-12-31) UT1 - UTC
    // is 1 s more.
    let earlier = message_at("2016-12-31T23:00", "").replace("2026-001A", "2016-001A");
    let later = render("plain.oem", "--ut1-utc 0").0;
    let set = crate::catalog::VANGUARD;
    for (between, option, expected) in [
        ("", "--ut1-utc -1", later),
        (set, "--ut1-utc -1", later),
        (set, "", unknown),
    ] {
        here.write("both.oem", format!("{earlier}{between}{}", message("")));
        let both = render("both.oem:2026-001A", option).0;
        let off = (both - expected).norm();
        assert!(off < 1e-9, "{between} {option}: {both} {expected}");
    }
    // A file or a segment without UT1 does not use the option.
    let inertial = earlier.replace("ITRF2014", "GCRF");
    here.write("both.oem", format!("{inertial}{}", message("")));
    let both = render("both.oem:2026-001A", "--ut1-utc 0.5").0;
    assert_eq!(both, render("plain.oem", "--ut1-utc 0.5").0);
    // 0.5 s at the first START_TIME would be 1.5 s here, out of the range of UT1 - UTC.
    here.write("both.oem", format!("{earlier}{}", message("")));
    let says = "UT1 - UTC would be 1.5 s here, outside -1 to 1 s; give COMMENT UT1-UTC";
    here.run("catalog check both.oem --ut1-utc 0.5")
        .says(&[says]);
    let refused = here.run("plan --ut1-utc 37");
    assert_ne!(refused.code, Some(0));
    refused.logs(&["--ut1-utc 37: must be -1 to 1 s"]);
}
