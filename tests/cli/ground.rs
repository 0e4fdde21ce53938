//! Observers inside the Earth: refused before anything is written.

use crate::{EPOCH, Q, skyloop};

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
        "--state = [6378.0, 0.0, 0.0] km",
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
