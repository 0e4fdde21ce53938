//! Element sets far from the time of exposure: one warning, by every command with objects.

use crate::{Folder, has, still};

const KEYS: &str = "camera = \"fai-nir\"\n[observer]\norbit = \"my.3le:130001\"\n\
                    [objects]\nfiles = [\"my.3le\"]\n";

/// The warnings about old elements of a command that succeeds.
fn warnings(here: &Folder, words: &str) -> Vec<String> {
    let log = here.run(words).exits(0).log;
    let lines = log.lines().filter(|line| line.contains("old elements"));
    lines.map(str::to_string).collect()
}

#[test]
fn old_elements_of_objects_and_observer_cause_one_warning_each() {
    let here = Folder::new();
    let scene = |epoch: &str, keys: &[(&str, &str)]| {
        here.write(
            "scene.toml",
            KEYS.to_string() + &crate::with_keys(&still(epoch), keys),
        );
    };
    assert!(warnings(&here, "catalog synth --objects 100 --out my.3le").is_empty());
    scene("2026-07-15T00:00:00Z", &[("frames", "2")]);
    // X-Val: by hand: element sets of 31 May 2026, 44 to 45 days before 15 July.
    for (command, count) in [
        ("render --out o", "100 of 100"),
        ("plan", "100 of 100"),
        ("loopback --out o", "100 of 100"),
        ("passes --nadir", "100 of 100"),
        ("lightcurve --object 130002 --out o", "1 of 1"),
    ] {
        let [observer, all] = &warnings(&here, &format!("{command} --scene scene.toml"))[..] else {
            panic!("{command}: not two warnings");
        };
        let says = "the observer, NORAD 130001 (STARLINK-53 130001): old elements: 1 of 1 are";
        has(observer, &[says]);
        has(
            all,
            &[count, "14 days from 2026-07-15T00:00:0", "(median 44."],
        );
    }
    // The second frame is two days after the first, and more than 14 after the sets.
    scene(
        "2026-06-13T12:00:00Z",
        &[("frames", "2"), ("period_s", "172800.0")],
    );
    let [observer, all] = &warnings(&here, "render --scene scene.toml --out o")[..] else {
        panic!("not two warnings");
    };
    has(observer, &["the observer"]);
    has(all, &["frame 1: old elements: 100 of 100"]);
    scene("2026-06-01T00:00:00Z", &[("frames", "2")]);
    assert!(warnings(&here, "render --scene scene.toml --out o").is_empty());
}
