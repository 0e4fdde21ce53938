//! `skyloop catalog synth`: what it writes, that scenes can use it, and what it says of wrong inputs.

use crate::{contents, names, skyloop};
use std::path::Path;

/// Whether it went well, and what it wrote to both outputs.
fn synth(at: &Path, flags: &[&str]) -> (bool, String, String) {
    let command = skyloop(at).args(["catalog", "synth"]).args(flags).output();
    let output = command.unwrap();
    let text = |octets| String::from_utf8(octets).unwrap();
    (
        output.status.success(),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn a_folder_is_a_population_that_a_scene_can_use() {
    let here = tempfile::tempdir().unwrap();
    let flags = ["--objects", "500", "--seed", "4", "--out", "made"];
    let (fine, said, log) = synth(here.path(), &flags);
    assert!(fine && log.is_empty(), "{log}");
    // X-Val: the table of README.md: 20 of a thousand are of OneWeb.
    assert!(said.contains("ONEWEB                    10\n"), "{said}");
    assert!(said.contains("500 objects\nwrote made\n"), "{said}");
    let written = names(&here.path().join("made"));
    assert!(written.contains(&"population.toml".to_string()));
    assert!(
        written.contains(&"below-0.1-m.3le".to_string()),
        "{written:?}"
    );

    let scene = "camera = \"fai-nir\"\n[observer]\norbit = \"made/below-5-m.3le:130001\"\n[objects]\npopulation = \"made/population.toml\"\n\
                 [sequence]\nepoch = \"2026-06-01T00:00:00Z\"\nframes = 1\nperiod_s = 1.0\nattitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\n";
    std::fs::write(here.path().join("scene.toml"), scene).unwrap();
    let render = ["render", "--scene", "scene.toml", "--out", "frames"];
    let output = skyloop(here.path()).args(render).output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && log.is_empty(), "{log}");

    // The same again, to the last octet.
    let again = ["--objects", "500", "--seed", "4", "--out", "again"];
    assert!(synth(here.path(), &again).0);
    assert_eq!(
        contents(&here.path().join("made")),
        contents(&here.path().join("again"))
    );
}

#[test]
fn an_older_population_is_replaced_and_nothing_else() {
    let here = tempfile::tempdir().unwrap();
    let made = here.path().join("made");
    let write = |objects: &str| synth(here.path(), &["--objects", objects, "--out", "made"]);
    assert!(write("500").0);
    assert!(names(&made).len() > 6, "{:?}", names(&made));
    assert!(write("2").0);
    // X-Val: the first two are of 3.7 m and 0.23 m: two size classes and the population file.
    let few = names(&made);
    assert_eq!(few.len(), 3, "{few:?}");
    let before = contents(&made);
    std::fs::write(made.join("notes.txt"), "mine").unwrap();
    let (fine, _, log) = write("500");
    assert!(
        !fine && log.contains("holds made/notes.txt") && log.contains("new, empty or"),
        "{log}"
    );
    std::fs::remove_file(made.join("notes.txt")).unwrap();
    assert_eq!(contents(&made), before);
}

#[test]
fn a_folder_of_years_that_no_tle_has_is_one_of_csv() {
    let here = tempfile::tempdir().unwrap();
    let late = [
        "--objects",
        "3",
        "--epoch",
        "2090-01-01T00:00:00Z",
        "--out",
        "made",
    ];
    let (fine, _, log) = synth(here.path(), &late);
    assert!(fine, "{log}");
    let written = names(&here.path().join("made"));
    assert!(
        written.iter().any(|name| name.ends_with(".csv")),
        "{written:?}"
    );
}

#[test]
fn a_file_has_the_format_of_its_name() {
    let here = tempfile::tempdir().unwrap();
    for name in ["a.tle", "a.3le", "a.kvn", "a.xml", "a.json", "a.csv"] {
        let flags = ["--objects", "30", "--out", name];
        let (fine, said, log) = synth(here.path(), &flags);
        assert!(fine && said.ends_with(&format!("wrote {name}\n")), "{log}");
        let loaded = skyloop::orbit::load(&here.path().join(name)).unwrap();
        assert_eq!(
            (loaded.objects.len(), loaded.rejected.len()),
            (30, 0),
            "{name}"
        );
    }
    assert_eq!(names(here.path()).len(), 6);
}

#[test]
fn what_does_not_fit_is_refused_and_nothing_is_lost() {
    let here = tempfile::tempdir().unwrap();
    let refused = |flags: &[&str], words: &[&str]| {
        let (fine, _, log) = synth(here.path(), flags);
        assert!(
            !fine && words.iter().all(|word| log.contains(word)),
            "{log}"
        );
    };
    // X-Val: Alpha-5 ends with 339,999; the first number is 130,001.
    let many = ["--objects", "210000", "--out", "a.tle"];
    refused(&many, &["1 of 210000 objects", "340000", "write .csv"]);
    refused(
        &["--objects", "3", "--out", "a.foo"],
        &["a.foo", ".tle", ".csv"],
    );
    refused(
        &["--objects", "0"],
        &["--objects", "whole number from 1 to 10000000"],
    );
    let signed = ["--objects", "3", "--seed", "-1"];
    refused(&signed, &["--seed", "whole number from 0 to"]);
    let late = ["--objects", "3", "--epoch", "9999-12-31T00:00:00Z"];
    refused(&late, &["--epoch 9999-12-31T", "1900 to 2100"]);
    // X-Val: by hand: a record in XML has some 1100 octets, ten million of them 10 GiB.
    let long = ["--objects", "10000000", "--out", "a.xml"];
    refused(
        &long,
        &["--out a.xml", "GiB as omm-xml", "at most 2 GiB", ".csv"],
    );
    refused(&["--objects", "3", "--epoch", "2026"], &["--epoch", "UTC"]);
    refused(&["--seed", "3"], &["--objects"]);
    assert!(names(here.path()).is_empty());
}
