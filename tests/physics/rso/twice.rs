//! One object in several files: by catalogue number, by designator, and in several entries of a
//! population.

use super::{DELTA, VANGUARD};
use skyloop::config::Config;
use skyloop::load::Folder;
use skyloop::sky::population::Appearance;

/// An ephemeris of an object with this identifier.
fn oem(id: &str) -> String {
    format!(
        "CCSDS_OEM_VERS = 2.0\nMETA_START\nOBJECT_NAME = VANGUARD 1\nOBJECT_ID = {id}\nCENTER_NAME = EARTH\nREF_FRAME = GCRF\n\
         TIME_SYSTEM = UTC\nSTART_TIME = 2000-06-27T00:00:00\nSTOP_TIME = 2000-06-27T00:00:10\nMETA_STOP\n\
         2000-06-27T00:00:00 7000 0 0 0 7.5 0\n2000-06-27T00:00:10 7000 75 0 0 7.5 0\n"
    )
}

/// The scene, in a folder with both element sets and an ephemeris of the object `id`.
fn load(scene: &str, population: &str, id: &str) -> Config {
    let folder = tempfile::tempdir().unwrap();
    for (file, text) in [
        ("both.tle", &format!("{VANGUARD}{DELTA}")),
        ("one.tle", &VANGUARD.to_string()),
        ("active.oem", &oem(id)),
        ("population.toml", &population.to_string()),
    ] {
        std::fs::write(folder.path().join(file), text).unwrap();
    }
    let folder = Folder::Disk(folder.path().to_path_buf());
    Config::parse("scene.toml", scene, &folder).unwrap()
}

fn ids(config: &Config) -> Vec<&str> {
    let ids = config.objects.iter().map(|object| object.id.as_str());
    ids.collect()
}

#[test]
fn an_ephemeris_and_element_sets_of_one_object_are_refused() {
    // International designator, catalogue number, and the id of an element set.
    for id in ["1958-002B", "5", "NORAD 5"] {
        for files in [
            "\"both.tle\", \"active.oem\"",
            "\"active.oem\", \"both.tle\"",
        ] {
            let config = load(&format!("[objects]\nfiles = [{files}]\n"), "", id);
            assert_eq!(ids(&config), ["NORAD 5", "NORAD 6251"]);
            let [refused] = config.rejected.as_slice() else {
                panic!("{id}: {:?}", config.rejected);
            };
            let first = files.split('"').nth(1).unwrap();
            assert!(
                refused.contains(&format!("in {first}: keep one of the two")),
                "{refused}"
            );
        }
    }
    let scene = "[objects]\nfiles = [\"both.tle\", \"active.oem\"]\n";
    let named = load(scene, "", "1958-002B").rejected.remove(0);
    let says = "1958-002B (VANGUARD 1) is NORAD 5 (VANGUARD 1) in both.tle";
    assert!(named.contains(says), "{named}");
    // Another piece of the same launch is another object.
    let config = load(scene, "", "1958-002A");
    assert_eq!(ids(&config), ["NORAD 5", "NORAD 6251", "1958-002A"]);
    assert!(config.rejected.is_empty());
}

#[test]
fn an_entry_excludes_its_object_from_the_catalogue() {
    let population = "[[objects]]\nfiles = [\"both.tle\"]\nsphere = { diameter_m = 1.0 }\n\
                      [[objects]]\nobject = \"active.oem\"\nsphere = { diameter_m = 2.0 }\n";
    let scene = "[objects]\npopulation = \"population.toml\"\nfiles = [\"both.tle\"]\n";
    let config = load(scene, population, "1958-002B");
    assert_eq!(ids(&config), ["NORAD 6251", "NORAD 5"]);
    let Appearance::Sphere(sphere) = &config.looks["NORAD 5"] else {
        panic!("{:?}", config.looks);
    };
    assert_eq!(sphere.diameter_m, 2.0);
    assert!(config.rejected.is_empty() && config.notices.is_empty());
}

#[test]
fn the_first_of_two_entries_applies_with_a_notice() {
    let population = "[[objects]]\nfiles = [\"one.tle\"]\nsphere = { diameter_m = 1.0 }\n\
                      [[objects]]\nfiles = [\"both.tle\"]\nsphere = { diameter_m = 2.0 }\n";
    let scene = "[objects]\npopulation = \"population.toml\"\n";
    let config = load(scene, population, "1958-002B");
    assert_eq!(ids(&config), ["NORAD 5", "NORAD 6251"]);
    let diameter = |id: &str| match &config.looks[id] {
        Appearance::Sphere(sphere) => sphere.diameter_m,
        other => panic!("{other:?}"),
    };
    assert_eq!((diameter("NORAD 5"), diameter("NORAD 6251")), (1.0, 2.0));
    let [notice] = config.notices.as_slice() else {
        panic!("{:?}", config.notices);
    };
    for word in [
        "population.toml: objects[1].files[0]: 1 object is",
        "both.tle",
        "NORAD 5 (VANGUARD 1)",
        "leave the file out",
    ] {
        assert!(notice.contains(word), "{notice}");
    }
}
