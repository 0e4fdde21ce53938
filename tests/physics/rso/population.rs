//! Population files: objects and their appearance. Errors name file, key and value.

use super::{DELTA, VANGUARD};
use crate::fixtures::{self, Frames};
use crate::table::check_refusals;
use skyloop::config::Config;
use skyloop::load::Folder;
use skyloop::load::orbits::several_sets;
use skyloop::orbit::time::parse_utc;
use skyloop::sky::population::Appearance;

const PLATE: &str = "{ kind = \"plate\", area_m2 = 2.0, normal = [0, 0, 1] }";

/// Loads `scene` from a folder with both objects' files and the population.
fn load(scene: &str, population: &str) -> Result<Config, String> {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let both = format!("{VANGUARD}{DELTA}");
    for (file, text) in [
        (folder.path().join("both.tle"), both.as_str()),
        (inner.join("both.tle"), &both),
        (inner.join("one.tle"), DELTA),
        (inner.join("population.toml"), population),
    ] {
        std::fs::write(file, text).unwrap();
    }
    let folder = Folder::Disk(folder.path().to_path_buf());
    Config::parse("scene.toml", scene, &folder).map_err(|error| error.to_string())
}

const SCENE: &str = "[objects]\npopulation = \"inner/population.toml\"\n";

fn shaped(parts: &str, entry: &str) -> String {
    format!("[shapes.thing]\nparts = [{parts}]\n[[objects]]\nobject = \"both.tle:5\"\n{entry}\n")
}

const NADIR: &str = "shape = \"thing\"\nattitude = { mode = \"nadir\" }";

/// The refusal of a population: one line that names its file.
fn refusal(population: &str) -> String {
    let message = load(SCENE, population).unwrap_err();
    assert!(
        message.contains("population.toml"),
        "{population}\n{message}"
    );
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

#[test]
fn entries_assign_bodies_to_objects() {
    let population = shaped(PLATE, NADIR)
        + "[[objects]]\nfiles = [\"both.tle\"]\nsphere = { diameter_m = 1.5, reflectance = 0.4, diffuse = 0.25, specular = 0.75 }\n";
    let config = load(SCENE, &population).unwrap();
    let ids: Vec<&str> = config
        .objects
        .iter()
        .map(|object| object.id.as_str())
        .collect();
    // A selected object is not read again with its file. Paths are relative to the population file.
    assert_eq!(ids, ["NORAD 5", "NORAD 6251"]);
    assert!(config.rejected.is_empty());
    assert!(matches!(&config.looks["NORAD 5"], Appearance::Body(_)));
    let Appearance::Sphere(sphere) = &config.looks["NORAD 6251"] else {
        panic!("{:?}", config.looks);
    };
    let light = [sphere.reflectance, sphere.diffuse, sphere.specular];
    assert_eq!((sphere.diameter_m, light), (1.5, [0.4, 0.25, 0.75]));
}

#[test]
fn a_scenes_own_files_add_objects() {
    let scene = format!("{SCENE}files = [\"both.tle\"]\ndiameter_m = 3.0\n");
    let config = load(&scene, &shaped(PLATE, NADIR)).unwrap();
    assert_eq!(config.objects.len(), 2);
    assert!(config.rejected.is_empty(), "{:?}", config.rejected);
    assert_eq!(config.looks.keys().collect::<Vec<_>>(), ["NORAD 5"]);
    assert_eq!(config.sphere.diameter_m, 3.0);
    // An object of two files is one object.
    let twice = "[[objects]]\nfiles = [\"both.tle\", \"one.tle\"]\nsphere = {}\n";
    let config = load(SCENE, twice).unwrap();
    assert_eq!(config.objects.len(), 2);
    assert!(config.rejected.is_empty(), "{:?}", config.rejected);
}

#[test]
fn the_nearest_of_several_element_sets_counts() {
    let later = VANGUARD
        .replace("00179", "00189")
        .replace("  4753", "  4754");
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("all")).unwrap();
    for (file, text) in [
        ("one.tle", VANGUARD),
        ("all/a.tle", &later),
        ("all/b.tle", DELTA),
    ] {
        std::fs::write(folder.path().join(file), text).unwrap();
    }
    let folder = Folder::Disk(folder.path().to_path_buf());
    let load = |files: &str| {
        let scene = format!("[objects]\nfiles = {files}\n");
        Config::parse("scene.toml", &scene, &folder).unwrap()
    };
    let [both, first, last] = ["[\"one.tle\", \"all\"]", "[\"one.tle\"]", "[\"all/\"]"].map(load);
    assert_eq!(both.objects.len(), 2);
    assert!(both.rejected.is_empty() && both.notices.is_empty());
    let several = several_sets(&both.objects).unwrap();
    let expected = "1 object has several element sets (NORAD 5 (VANGUARD 1)):";
    assert!(several.starts_with(expected), "{several}");
    assert_eq!(several_sets(&last.objects), None);
    // Days 179.8 and 189.8 of the year are 27 June and 7 July; 2 July, 18:50 lies between them.
    for (day, nearest, other) in [
        ("06-20", &first, &last),
        ("07-02", &first, &last),
        ("07-03", &last, &first),
        ("07-20", &last, &first),
    ] {
        let t = parse_utc(&format!("2000-{day}T12:00:00")).unwrap();
        let state = |config: &Config| config.objects[0].state(t).unwrap();
        assert_eq!(state(&both), state(nearest), "{day}");
        assert_ne!(state(&both), state(other), "{day}");
    }
}

#[test]
fn every_kind_of_part_and_attitude_loads() {
    for part in [
        PLATE,
        "{ kind = \"plate\", area_m2 = 2, normal = [1, 2, 3], two_sided = true, sun_axis = [0, 1, 0], reflectance = 1.0, diffuse = 0.1, specular = 0.9 }",
        "{ kind = \"box\", size_m = [1, 2, 3], diffuse = 0.2, specular = 0.5, lobe_deg = 0.5 }",
        "{ kind = \"cylinder\", axis = [0, 0, 2], diameter_m = 1, length_m = 3, ends = \"none\" }",
        "{ kind = \"cone\", axis = [0, 0, 2], diameter_m = 1, length_m = 3 }",
        "{ kind = \"cone\", axis = [0, 0, 2], diameter_m = 1, top_diameter_m = 2, length_m = 3, ends = \"top\" }",
        "{ kind = \"sphere\", diameter_m = 1 }",
    ] {
        load(SCENE, &shaped(part, NADIR)).unwrap();
    }
    for attitude in [
        "{ mode = \"inertial\", q = [0, 0, 0, 1] }",
        "{ mode = \"nadir\", q = [0, 0, 1, 0] }",
        "{ mode = \"spin\", q = [0, 0, 0, 1], utc = \"2026-01-01T00:00:00Z\", rates_deg_s = [0, 0, 6] }",
    ] {
        let entry = format!("shape = \"thing\"\nattitude = {attitude}");
        load(SCENE, &shaped(PLATE, &entry)).unwrap();
    }
}

/// Keys of a part of a shape; `plate:` and `face:` are plates of 1 m^2, the latter with a normal.
const PARTS: &str = r#"
kind = "plate", normal = [0, 0, 1], area_m2 = 0.0 | .area_m2 = 0: must be 0.000001 to 1000000 m^2
kind = "plate", normal = [0, 0, 1], area_m2 = -1.0 | .area_m2 = -1: must be 0.000001 to 1000000 m^2
kind = "plate", normal = [0, 0, 1], area_m2 = nan | .area_m2 = NaN: must be 0.000001 to 1000000 m^2
kind = "plate", normal = [0, 0, 1], area_m2 = inf | .area_m2 = inf: must be 0.000001 to 1000000 m^2
kind = "plate", normal = [0, 0, 1] | `area_m2` is missing | area_m2, normal
plate: normal = [0, 0, 0] | .normal = [0.0, 0.0, 0.0] | not zero
plate: normal = [0, nan, 1] | .normal[1] = NaN
plate: normal = [0, 1] | .normal | must have 3 values, not 2
face: sun_axis = [0, 0, 0] | .sun_axis =  | not zero
face: sun_axis = [0, nan, 1] | .sun_axis[1] = NaN
plate: normal = [0.1, 0.2, 0.3], sun_axis = [1, 2, 3] | .sun_axis = [1.0, 2.0, 3.0] | angle to the normal
plate: normal = [-1, -2, -3], sun_axis = [1, 2, 3] | .sun_axis = [1.0, 2.0, 3.0] | leave it out
face: diameter_m = 2 | .diameter_m | means nothing to kind "plate"
kind = "disc", diameter_m = 2 | .kind = "disc" | "plate", "box"
face: areas = 2 | areas
face: diffuse = 0.7, specular = 0.4 | diffuse | specular is above 1 (0.7 + 0.4)
face: specular = 0.1 | parts[0]: diffuse + specular is above 1 (1 + 0.1) | diffuse is 1 where it is not given: give both
face: reflectance = 1.2 | .reflectance = 1.2 | 0 to 1
face: reflectance = nan | .reflectance = NaN
face: lobe_deg = 0.2 | .lobe_deg = 0.2 | must be 0.5 to 90 deg
face: lobe_deg = 5 | .lobe_deg | nothing is mirrored | give specular
kind = "sphere", diameter_m = 1, diffuse = 0.5, specular = 0.5, lobe_deg = 5 | .lobe_deg | nothing to a sphere | leave it out
kind = "box", size_m = [1, 0, 1] | .size_m[1] = 0 | 0.001 to 10000 m
kind = "cylinder", axis = [0, 0, 1], diameter_m = 0, length_m = 1 | .diameter_m = 0
kind = "cone", axis = [0, 0, 0], diameter_m = 1, length_m = 1 | .axis =  | not zero
kind = "cylinder", axis = [0, 0, 1], diameter_m = 1, length_m = 1, ends = "one" | .ends = "one" | "both"
"#;

#[test]
fn invalid_parts_are_refused() {
    check_refusals(PARTS, |keys| {
        let keys = keys.replace("face:", "plate: normal = [0, 0, 1],");
        let keys = keys.replace("plate:", "kind = \"plate\", area_m2 = 1,");
        let message = refusal(&shaped(&format!("{{ {keys} }}"), NADIR));
        assert!(message.contains("shapes.thing.parts[0]"), "{message}");
        message
    });
    let none = refusal(&shaped("", NADIR));
    assert!(
        none.contains("shapes.thing.parts = 0 parts") && none.contains("1 to 200"),
        "{none}"
    );
}

/// Lines of an entry of `[[objects]]`. `one:` is an object of a file, `thing:` one with a shape and
/// an attitude.
const ENTRIES: &str = r#"
files = ["none.tle"]\nsphere = {} | .files[0] | none.tle | check the path
object = "none.oem"\nsphere = {} | .object | none.oem | check the path
object = "both.tle:ISS"\nsphere = {} | no object called "ISS" | NORAD 5
object = "both.tle"\nsphere = {} | 2 usable objects
files = ["both.tle:5"]\nsphere = {} | whole files
sphere = {} | give one of object
files = []\nsphere = {} | give one of object
one: files = ["one.tle"]\nsphere = {} | .files: given with objects[0].object
one: | says nothing of its objects
one: sphere = {}\nshape = "thing"\nattitude = { mode = "nadir" } | objects[0].sphere: given with objects[0].shape
one: shape = "thing" | objects[0].shape: goes with objects[0].attitude
one: attitude = { mode = "nadir" } | objects[0].attitude: goes with objects[0].shape
one: shape = "think"\nattitude = { mode = "nadir" } | .shape = "think" | thing
one: sphere = { diameter_m = 0.0 } | .sphere.diameter_m = 0
one: sphere = { diffuse = 0.6, specular = 0.6 } | .sphere: diffuse | above 1
one: sphere = {}\ncolour = 1 | colour
thing: { mode = "sun" } | .attitude.mode = "sun" | "inertial", "nadir", "spin"
thing: { mode = "inertial" } | .attitude | `q` is missing
thing: { mode = "inertial", q = [0, 0, 0, 2] } | .attitude.q | norm 2
thing: { mode = "inertial", q = [0, 0, 0, nan] } | .attitude.q | not finite
thing: { mode = "nadir", rates_deg_s = [1, 0, 0] } | .attitude.rates_deg_s | means nothing to mode "nadir"
spin: rates_deg_s = [1, 0, 0] } | .attitude | `utc` is missing
spin: utc = "noon", rates_deg_s = [1, 0, 0] } | .attitude.utc: "noon" is no UTC time such as
spin: utc = "2026-01-01T00:00:00Z", rates_deg_s = [1, 0, inf] } | .attitude.rates_deg_s[2] = inf
"#;

/// Whole populations.
const POPULATIONS: &str = r#"
[[objects]]\nobject = "one.tle"\nsphere = {}\n[[objects]]\nobject = "both.tle:6251"\nsphere = {} | objects[1].object | NORAD 6251 | keep one of the two
# none | objects: is missing | docs/how-to/populations.md
objects = []\nobjcts = 1 | objcts
objects = [ | not TOML
shapes = 3\nobjects = [] | shapes: must be a table of keys, not 3
"#;

#[test]
fn invalid_entries_are_refused() {
    check_refusals(ENTRIES, |lines| {
        let lines = lines.replace("spin:", "thing: { mode = \"spin\", q = [0, 0, 0, 1],");
        let lines = lines.replace("thing:", "one: shape = \"thing\"\nattitude =");
        let lines = lines.replace("one:", "object = \"one.tle\"\n");
        let shapes = format!("[shapes.thing]\nparts = [{PLATE}]");
        let message = refusal(&format!("{shapes}\n[[objects]]\n{lines}\n"));
        assert!(message.contains("objects[0]"), "{message}");
        message
    });
    check_refusals(POPULATIONS, refusal);
}

#[test]
fn a_missing_population_is_an_error_of_the_scene() {
    let error = load("[objects]\npopulation = \"missing.toml\"", "objects = []").unwrap_err();
    for word in [": objects.population", "missing.toml", "check the path"] {
        assert!(error.contains(word), "{error}");
    }
}

#[test]
fn the_scenes_with_populations_load() {
    for (scene, objects) in [("tumbling-rocket-body", 1), ("geo-belt-stare", 8)] {
        let config = fixtures::scene(&format!("{scene}/scene.toml"));
        assert_eq!(
            (config.objects.len(), config.looks.len()),
            (objects, objects)
        );
        assert!(config.rejected.is_empty());
    }
}

/// geo-belt-stare as described in docs/explanation/scenes.md, by the labels of its first and last
/// frame.
#[test]
fn satellites_stand_still_and_the_abandoned_one_drifts() {
    let mut frames = Frames::of(fixtures::scene("geo-belt-stare"));
    let last = frames.mission.frames - 1;
    let mut positions = |number: u32| {
        let sources = frames.expose(number).label.objects.sources;
        let rsos = sources.into_iter().filter(|source| source.kind == "rso");
        let named = rsos.map(|rso| (rso.names[0].clone(), [rso.x_px, rso.y_px]));
        named.collect::<std::collections::BTreeMap<_, _>>()
    };
    let (first, last) = (positions(0), positions(last));
    assert_eq!((first.len(), last.len()), (8, 8));
    for (name, [x, y]) in first {
        let moved_px = (last[&name][0] - x).hypot(last[&name][1] - y);
        match name.as_str() {
            "GEO 8" => assert!((7.0..8.0).contains(&moved_px), "{name}: {moved_px} px"),
            _ => assert!(moved_px < 0.3, "{name}: {moved_px} px"),
        }
    }
}
