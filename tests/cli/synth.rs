//! `skyloop catalog synth`: its files, their use in scenes, and messages for wrong inputs.

use crate::{Folder, has, still};

#[test]
fn a_folder_is_a_population_that_a_scene_can_use() {
    let here = Folder::new();
    let synth = "catalog synth --objects 500 --seed 4";
    let said = here.run(&format!("{synth} --out made")).quiet();
    // X-Val: the table of docs/how-to/populations.md: 20 of a thousand are of OneWeb.
    has(&said, &["ONEWEB                    10\n"]);
    has(&said, &["500 objects\nwrote made\n"]);
    let written = here.names("made");
    for file in ["population.toml", "below-0.1-m.3le"] {
        assert!(written.contains(&file.to_string()), "{written:?}");
    }

    let scene = "camera = \"fai-nir\"\n[observer]\norbit = \"made/below-5-m.3le:130001\"\n[objects]\npopulation = \"made/population.toml\"\n";
    here.write(
        "scene.toml",
        scene.to_string() + &still("2026-06-01T00:00:00Z"),
    );
    here.run("render --scene scene.toml --out frames").quiet();

    // The same options give the same bytes.
    here.run(&format!("{synth} --out again")).exits(0);
    assert_eq!(here.contents("made"), here.contents("again"));
}

#[test]
fn an_older_population_is_replaced_and_nothing_else() {
    let here = Folder::new();
    let synth = |objects: u32| here.run(&format!("catalog synth --objects {objects} --out made"));
    synth(500).exits(0);
    assert!(here.names("made").len() > 6, "{:?}", here.names("made"));
    synth(2).exits(0);
    // X-Val: the first two are of 3.7 m and 0.23 m: two size classes and the population file.
    let few = here.contents("made");
    assert_eq!(few.len(), 3, "{:?}", here.names("made"));
    here.write("made/notes.txt", "mine");
    synth(500)
        .exits(1)
        .logs(&["holds made/notes.txt", "new, empty or"]);
    std::fs::remove_file(here.join("made/notes.txt")).unwrap();
    assert_eq!(here.contents("made"), few);
}

#[test]
fn a_file_has_the_format_of_its_name() {
    let here = Folder::new();
    for name in ["a.tle", "a.3le", "a.kvn", "a.xml", "a.json", "a.csv"] {
        let synth = here.run(&format!("catalog synth --objects 30 --out {name}"));
        let said = synth.exits(0).out;
        assert!(said.ends_with(&format!("wrote {name}\n")), "{said}");
        let loaded = skyloop::orbit::load(&here.join(name)).unwrap();
        let counts = (loaded.objects.len(), loaded.rejected.len());
        assert_eq!(counts, (30, 0), "{name}");
    }
    assert_eq!(here.names("").len(), 6);
    // TLEs cannot have these years, so the folder has CSV files.
    here.run("catalog synth --objects 3 --epoch 2090-01-01T00:00:00Z --out made")
        .exits(0);
    let written = here.names("made");
    let is_csv = |name: &String| name.ends_with(".csv");
    assert!(written.iter().any(is_csv), "{written:?}");
}

#[test]
fn objects_that_do_not_fit_are_refused_and_no_file_is_lost() {
    let here = Folder::new();
    // X-Val: Alpha-5 ends with 339,999; the first number is 130,001. By hand: a record in XML has
    // some 1100 bytes, ten million of them 10 GiB.
    here.refuses(
        "catalog synth",
        "--objects 210000 --out a.tle | 1 of 210000 objects | 340000 | write .csv
         --objects 3 --out a.foo      | a.foo | .tle | .csv
         --objects 0                  | --objects | whole number from 1 to 10000000
         --objects 3 --seed -1        | --seed | whole number from 0 to
         --objects 3 --epoch 9999-12-31T00:00:00Z | --epoch 9999-12-31T | 1900 to 2100
         --objects 10000000 --out a.xml | --out a.xml | GiB as omm-xml | at most 2 GiB | .csv
         --objects 3 --epoch 2026     | --epoch | UTC
         --seed 3                     | --objects",
    );
    assert!(here.names("").is_empty());
}
