//! Element sets of another time than the exposure's: one warning, from every command that shows objects.

use crate::skyloop;
use std::path::Path;

const SCENE: &str = "camera = \"fai-nir\"\n[observer]\norbit = \"my.3le:130001\"\n[objects]\nfiles = [\"my.3le\"]\n[sequence]\n\
                     epoch = \"2026-07-15T00:00:00Z\"\nframes = 2\nperiod_s = 1.0\nattitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\n";

/// The lines of standard error that tell of it.
fn told(at: &Path, words: &str) -> Vec<String> {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words}: {log}");
    let lines = log.lines().filter(|line| line.contains("old elements"));
    lines.map(str::to_string).collect()
}

#[test]
fn one_warning_tells_of_old_elements_and_one_of_the_observers() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    assert!(told(at, "catalog synth --objects 100 --out my.3le").is_empty());
    std::fs::write(at.join("scene.toml"), SCENE).unwrap();
    // X-Val: by hand: element sets of 31 May 2026, 44 to 45 days before 15 July.
    for (command, all) in [
        ("render --scene scene.toml --out o", "100 of 100"),
        ("plan --scene scene.toml", "100 of 100"),
        ("loopback --scene scene.toml --out o", "100 of 100"),
        ("passes --scene scene.toml --nadir", "100 of 100"),
        (
            "lightcurve --scene scene.toml --object 130002 --out o",
            "1 of 1",
        ),
    ] {
        let [observer, line] = &told(at, command)[..] else {
            panic!("{command}");
        };
        let says = "the observer, NORAD 130001 (STARLINK-53 130001): old elements: 1 of 1 are";
        assert!(observer.contains(says), "{command}: {observer}");
        for word in [all, "14 days from 2026-07-15T00:00:0", "(median 44."] {
            assert!(line.contains(word), "{command}: {line}");
        }
    }
    // The second frame is two days after the first, and more than 14 after the sets.
    let long = SCENE.replace("07-15T00", "06-13T12");
    let long = long.replace("period_s = 1.0", "period_s = 172800.0");
    std::fs::write(at.join("scene.toml"), long).unwrap();
    let [observer, all] = &told(at, "render --scene scene.toml --out o")[..] else {
        panic!("not told twice");
    };
    assert!(
        observer.contains("the observer") && all.contains("frame 1: old elements: 100 of 100"),
        "{all}"
    );
    let fresh = SCENE.replace("07-15", "06-01");
    std::fs::write(at.join("scene.toml"), fresh).unwrap();
    assert!(told(at, "render --scene scene.toml --out o").is_empty());
}
