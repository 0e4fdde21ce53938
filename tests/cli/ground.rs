//! Where observers are: inside the Earth they are refused before anything is written, and Earth-fixed axes turn by UT1.

use crate::{EPOCH, Q, skyloop};
use hifitime::Unit;
use nalgebra::Vector3;
use skyloop::orbit::time::{parse_utc, utc_text};
use skyloop::sky::bodies::Bodies;

/// An observer inside the Earth: by a state, and by an orbit that goes there in a later exposure of a scene.
#[test]
fn an_observer_below_the_ground() {
    // X-Val: WGS84: the equator's radius is 6378.137 km, the pole's 6356.752 km.
    let here = tempfile::tempdir().unwrap();
    let args = [
        "render",
        "--epoch",
        EPOCH,
        "--attitude",
        Q,
        "--out",
        "o",
        "--state",
    ];
    let refused = skyloop(here.path())
        .args(args)
        .arg("6378.0,0,0,0,7.5,0")
        .assert()
        .failure();
    let message = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    for word in [
        "(--state) = [6378.0, 0.0, 0.0] km",
        "below the ground",
        "6378.0 km",
    ] {
        assert!(message.contains(word), "{message} has no {word}");
    }
    let write = |name: &str, text: &str| std::fs::write(here.path().join(name), text).unwrap();
    let mut oem = String::from(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\nOBJECT_NAME = DIVER\n\
         OBJECT_ID = 2026-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = 2019-06-15T23:35:00\n\
         STOP_TIME = 2019-06-15T23:35:20\nINTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 5\nMETA_STOP\n\n",
    );
    // 2 km a second downwards, from 6388 km: in the ground after 5 s.
    for s in 0..=20 {
        oem += &format!(
            "2019-06-15T23:35:{s:02} {:.1} 0 0 -2 0 0\n",
            6388.0 - 2.0 * f64::from(s)
        );
    }
    write("diver.oem", &oem);
    let scene = |frames: u32| {
        write(
            "scene.toml",
            &format!(
                "[observer]\norbit = \"diver.oem\"\n[sequence]\nepoch = \"2019-06-15T23:35:02Z\"\nframes = {frames}\nperiod_s = 1.0\n\
                 attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n"
            ),
        );
        let args = ["render", "--scene", "scene.toml", "--out", "o"];
        skyloop(here.path()).args(args).assert()
    };
    let refused = scene(10).failure();
    let message = String::from_utf8(refused.get_output().stderr.clone()).unwrap();
    for word in [
        "scene.toml",
        "observer.orbit = ",
        "DIVER",
        "below the ground",
        "2019-06-15T23:35:05",
        "[6378.0, 0.0, 0.0]",
    ] {
        assert!(message.contains(word), "{message} has no {word}");
    }
    scene(2).success();
}

/// On the Moon, by a state; and in it, by an orbit that falls there in a later exposure of a scene. Nothing is written.
#[test]
fn an_observer_inside_the_moon() {
    // X-Val: IAU WGCCRE 2015: the Moon's mean radius is 1737.4 km.
    let here = tempfile::tempdir().unwrap();
    let start = parse_utc(EPOCH).unwrap();
    let moon_km = |s: i32| {
        let epoch = start + Unit::Second * f64::from(s);
        Bodies::at(epoch).unwrap().moon_geocentric_m * 1e-3
    };
    let render = |height_km: f64| {
        let at = moon_km(0) + Vector3::new(0.0, 0.0, height_km);
        let state = format!("{},{},{},0,0,0", at.x, at.y, at.z);
        let args = ["render", "--epoch", EPOCH, "--attitude", Q, "--out", "o"];
        let mut command = skyloop(here.path());
        command.args(args).args(["--state", &state]).assert()
    };
    let message = |refused: assert_cmd::assert::Assert| {
        String::from_utf8(refused.get_output().stderr.clone()).unwrap()
    };
    let said = message(render(1737.39).failure());
    for word in [
        "(--state) = ",
        "1737.4 km from the Moon's centre",
        "2019-06-15T23:35:50",
        "above its ground",
    ] {
        assert!(said.contains(word), "{said} has no {word}");
    }
    assert!(!here.path().join("o").exists());
    render(1742.0).success();

    let write = |name: &str, text: &str| std::fs::write(here.path().join(name), text).unwrap();
    let mut oem = format!(
        "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\nOBJECT_NAME = DIVER\n\
         OBJECT_ID = 2026-001A\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\nTIME_SYSTEM = UTC\nSTART_TIME = {}\nSTOP_TIME = {}\n\
         INTERPOLATION = LAGRANGE\nINTERPOLATION_DEGREE = 5\nMETA_STOP\n\n",
        utc_text(start).trim_end_matches('Z'),
        utc_text(start + Unit::Second * 20.0).trim_end_matches('Z'),
    );
    // Falling by 2 km a second from 1747 km: in the Moon after 5 s.
    for s in 0..=20 {
        let at = moon_km(s) + Vector3::new(0.0, 0.0, 1747.0 - 2.0 * f64::from(s));
        let epoch = utc_text(start + Unit::Second * f64::from(s));
        let epoch = epoch.trim_end_matches('Z');
        let by = moon_km(s + 1) - moon_km(s) - Vector3::new(0.0, 0.0, 2.0);
        oem += &format!(
            "{epoch} {} {} {} {} {} {}\n",
            at.x, at.y, at.z, by.x, by.y, by.z
        );
    }
    write("diver.oem", &oem);
    write(
        "scene.toml",
        &format!(
            "[observer]\norbit = \"diver.oem\"\n[sequence]\nepoch = \"{EPOCH}\"\nframes = 10\nperiod_s = 1.0\n\
             attitudes = [{{ q = [0.0, 0.0, 0.0, 1.0] }}]\n"
        ),
    );
    let args = ["render", "--scene", "scene.toml", "--out", "p"];
    let said = message(skyloop(here.path()).args(args).assert().failure());
    for word in [
        "scene.toml",
        "observer.orbit = ",
        "DIVER",
        "1737.0 km from the Moon's centre",
        "2019-06-15T23:35:55",
    ] {
        assert!(said.contains(word), "{said} has no {word}");
    }
    assert!(!here.path().join("p").exists());
}

/// UT1 - UTC turns Earth-fixed states; the option and the file's comment give it alike.
#[test]
fn ut1_utc_comes_from_the_option_or_the_file() {
    let here = tempfile::tempdir().unwrap();
    let message_at = |minute: &str, comment: &str| {
        let mut oem = format!(
            "CCSDS_OEM_VERS = 2.0\nCREATION_DATE = 2026-01-01T00:00:00\nORIGINATOR = TEST\n\nMETA_START\n{comment}OBJECT_NAME = FLYER\n\
             OBJECT_ID = 2026-001A\nCENTER_NAME = EARTH\nREF_FRAME = ITRF2014\nTIME_SYSTEM = UTC\nSTART_TIME = {minute}:00\n\
             STOP_TIME = {minute}:20\nINTERPOLATION = LINEAR\nMETA_STOP\n\n"
        );
        for s in 0..=20 {
            oem += &format!("{minute}:{s:02} 7000 {:.1} 0 0 7.5 0\n", 7.5 * f64::from(s));
        }
        oem
    };
    let message = |comment: &str| message_at("2019-06-15T23:35", comment);
    let write = |name: &str, text: String| std::fs::write(here.path().join(name), text).unwrap();
    write("plain.oem", message(""));
    write("given.oem", message("COMMENT UT1-UTC = -0.1634\n"));
    let render = |orbit: &str, option: &[&str]| {
        let place = ["render", "--epoch", "2019-06-15T23:35:10Z", "--attitude", Q];
        let mut command = skyloop(here.path());
        command.args(place).args(["--out", "o", "--orbit", orbit]);
        let done = command.args(option).assert();
        let log = String::from_utf8(done.get_output().stderr.clone()).unwrap();
        let warns = log.contains("UT1 is taken as UTC");
        done.success();
        let labels = std::fs::read_to_string(here.path().join("o/labels.jsonl")).unwrap();
        let label: serde_json::Value = serde_json::from_str(&labels).unwrap();
        let km = [0, 1, 2].map(|axis| label["state_gcrf_km"][axis].as_f64().unwrap());
        (Vector3::from(km), warns)
    };
    let (unknown, warns) = render("plain.oem", &[]);
    assert!(warns);
    let (by_option, warns) = render("plain.oem", &["--ut1-utc", "-0.1634"]);
    assert!(!warns);
    assert_eq!(by_option, render("given.oem", &["--ut1-utc", "0.5"]).0);
    // X-Val: the Earth turns by 7.292115e-5 rad a second (IERS Conventions 2010, table 1.2); the axis of 7000.4 km is its own to 0.2 %.
    let moved_km = (by_option - unknown).norm();
    assert!(
        (moved_km / (7.292115e-5 * 0.1634 * 7000.4) - 1.0).abs() < 2e-3,
        "{moved_km}"
    );
    // The option is of the file's first START_TIME, whatever lies between: a leap second later (2016-12-31) UT1 - UTC is 1 s more.
    let earlier = message_at("2016-12-31T23:00", "").replace("2026-001A", "2016-001A");
    // X-Val: Vallado et al. 2006, AIAA 2006-6753, verification set 00005.
    let set = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753\n\
               2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667\n";
    let later = render("plain.oem", &["--ut1-utc", "0"]).0;
    for (between, option, expected) in [
        ("", &["--ut1-utc", "-1"][..], later),
        (set, &["--ut1-utc", "-1"], later),
        (set, &[], unknown),
    ] {
        write("both.oem", format!("{earlier}{between}{}", message("")));
        let both = render("both.oem:2026-001A", option).0;
        assert!(
            (both - expected).norm() < 1e-9,
            "{between} {option:?}: {both} {expected}"
        );
    }
    // A file or a segment that does not use UT1 has no use for it.
    let inertial = earlier.replace("ITRF2014", "GCRF");
    write("both.oem", format!("{inertial}{}", message("")));
    let option = ["--ut1-utc", "0.5"];
    let both = render("both.oem:2026-001A", &option).0;
    assert_eq!(both, render("plain.oem", &option).0);
    // 0.5 s there would be 1.5 s here, which UT1 - UTC never is.
    write("both.oem", format!("{earlier}{}", message("")));
    let refused = skyloop(here.path())
        .args(["catalog", "check", "both.oem", "--ut1-utc", "0.5"])
        .assert();
    let out = refused.get_output();
    let text = String::from_utf8([&out.stdout[..], &out.stderr].concat()).unwrap();
    let says =
        "with the leap seconds since it is 1.5 s here, beyond -1 to 1 s; give COMMENT UT1-UTC";
    assert!(text.contains(says), "{text}");
    let refused = skyloop(here.path())
        .args(["plan", "--ut1-utc", "37"])
        .assert();
    let log = String::from_utf8(refused.failure().get_output().stderr.clone()).unwrap();
    assert!(log.contains("--ut1-utc 37: must be -1 to 1 s"), "{log}");
}
