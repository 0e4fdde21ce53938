//! `skyloop lightcurve`: what it writes, and what it refuses.

use crate::table::check_refusals;
use assert_cmd::Command;
use std::path::Path;

const ROCKET: &str = "configs/scenes/tumbling-rocket-body/scene.toml";

/// Of `lightcurve` with these arguments into a folder: standard output, standard error and the exit
/// code.
fn skyloop(args: &[&str], out: &Path) -> (String, String, i32) {
    let output = Command::new(env!("CARGO_BIN_EXE_skyloop"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .arg("lightcurve")
        .args(args)
        .arg("--out")
        .arg(out)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    (text(output.stdout), text(output.stderr), code)
}

/// The same of an object of a scene, with more arguments.
fn curve(scene: &str, object: &str, more: &str, out: &Path) -> (String, String, i32) {
    let args = ["--scene", scene, "--object", object].into_iter();
    skyloop(
        &args.chain(more.split_whitespace()).collect::<Vec<_>>(),
        out,
    )
}

/// The rows of a table, without its head.
fn table(folder: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(folder.join("lightcurve.csv")).unwrap();
    let mut lines = text.lines();
    let head = "utc,t_s,mag,band_mag,range_km,phase_deg,illumination,reason";
    assert_eq!(lines.next(), Some(head));
    lines
        .map(|line| line.split(',').map(str::to_string).collect())
        .collect()
}

#[test]
fn a_table_and_a_picture_are_written_and_nothing_is_removed() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("labels.jsonl"), "mine").unwrap();
    let (said, warned, code) = curve(ROCKET, "rocket body", "--step 0.25", folder.path());
    assert_eq!((warned.as_str(), code), ("", 0), "{said}");
    for word in [
        "NORAD 99002 (ROCKET BODY) seen from NORAD 99001",
        "81 instants",
    ] {
        assert!(said.contains(word), "{said}");
    }
    let rows = table(folder.path());
    assert_eq!(rows.len(), 81);
    assert_eq!(rows[0][..2], ["2026-06-01T00:33:00.000Z", "0.000000"]);
    assert_eq!(rows[80][..2], ["2026-06-01T00:33:20.000Z", "20.000000"]);
    // It tumbles: brighter and fainter by more than range and phase explain, in flashes.
    let mags: Vec<f64> = rows.iter().map(|row| row[2].parse().unwrap()).collect();
    let [least, most] = [f64::MAX, f64::MIN];
    let least = mags.iter().copied().fold(least, f64::min);
    let span = mags.iter().copied().fold(most, f64::max) - least;
    assert!(span > 2.0, "{span}");
    assert!(
        rows.iter()
            .all(|row| row[2] == row[3] && row[6] == "1.000000" && row[7].is_empty())
    );
    let plot = std::fs::read_to_string(folder.path().join("lightcurve.svg")).unwrap();
    let curve = points(&plot, "#FFC850");
    assert_eq!(curve.len(), rows.len());
    // From left to right, and the brightest row is the highest point (several may share its pixel).
    assert!(curve.is_sorted_by_key(|at| at[0]), "{curve:?}");
    let highest = curve.iter().map(|at| at[1]).min().unwrap();
    let brightest = (0..mags.len()).min_by(|i, j| mags[*i].total_cmp(&mags[*j]));
    assert_eq!(curve[brightest.unwrap()][1], highest);
    assert_eq!(
        std::fs::read_to_string(folder.path().join("labels.jsonl")).unwrap(),
        "mine"
    );
}

/// The points of the curve of a colour in a plot, px from the upper left corner.
fn points(plot: &str, color: &str) -> Vec<[i32; 2]> {
    let is_curve = |line: &&str| line.starts_with("<polyline") && line.contains(color);
    let curve = plot.lines().find(is_curve).unwrap();
    let (_, points) = curve.split_once("points=\"").unwrap();
    let points = points.split(['"', ' ']).map_while(|point| {
        let (x, y) = point.split_once(',')?;
        Some([x, y].map(|px| px.parse().unwrap()))
    });
    points.collect()
}

/// The picture of `docs/how-to/passes.md` is this one; a platform may put a point a pixel beside.
#[test]
fn the_documents_show_what_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let (_, _, code) = curve(ROCKET, "ROCKET BODY", "--step 0.05", folder.path());
    assert_eq!(code, 0);
    let shown = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/how-to/lightcurve.svg");
    let [drawn, shown] = [folder.path().join("lightcurve.svg"), shown]
        .map(|file| std::fs::read_to_string(file).unwrap());
    let words = |plot: &str| -> Vec<String> {
        let lines = plot.lines().filter(|line| !line.starts_with('<'));
        lines.map(str::to_string).collect()
    };
    assert_eq!(words(&drawn), words(&shown));
    let [drawn, shown] = [drawn, shown].map(|plot| points(&plot, "#FFC850"));
    assert_eq!(drawn.len(), shown.len());
    let is_near = |(a, b): (&[i32; 2], &[i32; 2])| (0..2).all(|k| (a[k] - b[k]).abs() <= 1);
    assert!(
        drawn.iter().zip(&shown).all(is_near),
        "make docs/how-to/lightcurve.svg anew: skyloop lightcurve --scene {ROCKET} --object \"ROCKET BODY\" --step 0.05"
    );
}

/// The light curve and the labels of the same exposures are one: of a sphere, and of a body that tumbles.
#[test]
fn it_says_what_labels_say() {
    let builtin = skyloop::config::Config::builtin().unwrap();
    says_what_labels_say(&["--object", "RCM-2"], "RCM-2", builtin);
    let rocket = crate::fixtures::scene("tumbling-rocket-body/scene.toml");
    let args = ["--scene", ROCKET, "--object", "99002"];
    says_what_labels_say(&args, "ROCKET BODY", rocket);
}

fn says_what_labels_say(args: &[&str], name: &str, config: skyloop::config::Config) {
    let folder = tempfile::tempdir().unwrap();
    let (_, said, code) = skyloop(args, folder.path());
    assert_eq!(code, 0, "{said}");
    let rows = table(folder.path());
    let label = crate::fixtures::Frames::of(config).shoot(7).label;
    let is_meant = |object: &&skyloop::label::ObjectLabel| object.names.iter().any(|n| n == name);
    let object = label.objects.iter().find(is_meant).unwrap();
    let rso = object.rso.as_ref().unwrap();
    for (column, wanted, tolerance) in [
        (2, object.mag, 1e-4),
        (3, object.band_mag.unwrap(), 1e-4),
        (4, rso.range_km, 1e-6),
        (5, rso.phase_deg, 1e-6),
        (6, rso.illumination, 1e-6),
    ] {
        let got: f64 = rows[7][column].parse().unwrap();
        let off = (got - wanted).abs();
        assert!(off <= tolerance, "{name}, column {column}: {got} {wanted}");
    }
    assert_eq!(rows[7][0], label.epoch_mid);
}

#[test]
fn what_is_hidden_has_a_reason_and_no_magnitude_that_arrives() {
    let folder = tempfile::tempdir().unwrap();
    let scene = "configs/scenes/geo-belt-stare/scene.toml";
    let to = "--to 2026-06-01T16:00:00Z --step 300";
    let (said, _, code) = curve(scene, "GEO 4", to, folder.path());
    assert_eq!(code, 0, "{said}");
    let rows = table(folder.path());
    let hidden = rows.iter().filter(|row| row[7] == "behind the Earth");
    let hidden: Vec<_> = hidden.collect();
    assert!(!hidden.is_empty() && hidden.len() < rows.len());
    assert!(hidden.iter().all(|row| row[3].is_empty()));
    let cause = format!("at others none: {} behind the Earth", hidden.len());
    assert!(said.contains(&cause), "{said}");
}

/// In a folder: an observer with a straight way from a place (km, km/s) at noon, and another object
/// on it, with the arguments from noon to some other time.
fn on_one_way(place: [f64; 3], way: [f64; 3], to: &str, folder: &Path) -> (String, String, i32) {
    let mid = skyloop::orbit::time::parse_utc("2026-03-01T12:00:00").unwrap();
    let [place, way] = [place, way].map(nalgebra::Vector3::from);
    let text = crate::oem::oem_text("EYE", mid, |t| (place + way * t, way));
    let scene = "[observer]\norbit = \"eye.oem\"\n[objects]\nfiles = [\"twin.oem\"]\n";
    for (name, text) in [
        ("eye.oem", text.as_str()),
        ("twin.oem", &text.replace("EYE", "TWIN")),
        ("scene.toml", scene),
    ] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let times = format!("--from 2026-03-01T12:00:00 --to {to} --step 1 --exposure 0.1");
    curve(
        folder.to_str().unwrap(),
        "TWIN",
        &times,
        &folder.join("out"),
    )
}

#[test]
fn the_observer_itself_reflects_nothing_to_itself() {
    let folder = tempfile::tempdir().unwrap();
    let curve = |to: &str| on_one_way([7000.0, 0.0, 0.0], [0.0, 7.5, 0.0], to, folder.path());
    let (said, log, code) = curve("2026-03-01T12:00:00");
    assert_eq!(code, 0, "{log}");
    let none = "no light of it arrives: 1 at the observer itself";
    assert!(
        said.contains(": 1 instant from") && said.contains(none),
        "{said}"
    );
    let rows = table(&folder.path().join("out"));
    let [mag, band_mag, reason] = [2, 3, 7].map(|column| rows[0][column].as_str());
    assert_eq!([mag, band_mag, reason], ["", "", "at the observer itself"]);

    // The ephemeris ends at 12:00:10, in the middle of the last exposure.
    let (_, log, code) = curve("2026-03-01T12:00:10");
    assert_eq!(code, 1, "{log}");
    let here = folder.path().to_str().unwrap();
    let works = "--to 2026-03-01T12:00:09.000Z works";
    for word in [
        here,
        "outside its ephemeris",
        "half of --exposure 0.1",
        works,
    ] {
        assert!(log.contains(word), "{log} has no {word}");
    }
    assert_eq!(curve("2026-03-01T12:00:09").2, 0);
}

/// Arguments; `TUMBLING` are those of the rocket body, `ROCKET` is its scene.
const REFUSED: &str = r#"
--scene ROCKET --object ISS | error: --object ISS: no object called | NORAD 99002 (ROCKET BODY)
TUMBLING --step 0 | error: --step 0:  | from 1e-6 to 1e6
TUMBLING --step nan | --step <S> | a number is wanted
TUMBLING --exposure -1 | error: --exposure -1:  | 0 to 10000
TUMBLING --step 1e-6 | error: --step 0.000001, --from 2026-06-01T00:33:00 | 20000001 points | enlarge --step
TUMBLING --from 2026-06-02T00:00:00Z | error: --from 2026-06-02T00:00:00 | --to 2026-06-01T00:33:20.000Z (the scene's) | the end lies before the start
TUMBLING --from tomorrow | --from | tomorrow
--scene nowhere.toml --object X | nowhere.toml | check the path
--object RCM-1 --to 2019-06-16T00:00:00Z | the built-in scene:  | outside its ephemeris | 23:36:30 | half of --exposure 0.1
--object CASSIOPE | no object called | RCM-1
--scene configs/scenes/deep-sky.toml --object X | deep-sky.toml | no observer | [observer]
--scene configs/scenes/south-atlantic-anomaly.toml --object X | south-atlantic-anomaly.toml: has no objects | [objects]
"#;

#[test]
fn wrong_input_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    check_refusals(REFUSED, |args| {
        let args = args.replace("TUMBLING", "--scene ROCKET --object 99002");
        let args = args.replace("ROCKET", ROCKET);
        let (_, said, code) = skyloop(&args.split(' ').collect::<Vec<_>>(), &out);
        assert!(code != 0 && !out.exists(), "{args}: {said}");
        said
    });
}

/// Sinking by 2 km a second.
#[test]
fn an_observer_below_the_ground_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let to = "2026-03-01T12:00:08";
    let (_, said, code) = on_one_way([6388.0, 0.0, 0.0], [-2.0, 0.0, 0.0], to, folder.path());
    assert_eq!(code, 1, "{said}");
    // X-Val: WGS84: the equator's radius is 6378.137 km.
    for word in ["EYE", "below the ground", "2026-03-01T12:00:05"] {
        assert!(said.contains(word), "{said} has no {word}");
    }
    assert!(!folder.path().join("out").exists());
}
