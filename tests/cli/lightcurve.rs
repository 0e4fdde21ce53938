//! `skyloop lightcurve`: its output, and refused inputs.

use crate::fixtures::{self, Frames};
use crate::oem::oem_text;
use crate::{Folder, Outcome, repository, repository_text};
use nalgebra::Vector3;
use skyloop::config::Config;
use skyloop::label::ObjectLabel;
use skyloop::orbit::time::parse_utc;

/// The options of a shipped scene.
fn shipped(scene: &str) -> String {
    format!("--scene {}", repository(&format!("configs/scenes/{scene}")))
}

/// The light curve of the shipped tumbling rocket body, with more options, in the folder `o`.
fn rocket(here: &Folder, options: &str) -> Outcome {
    let scene = shipped("tumbling-rocket-body");
    let ended = here.run(&format!(
        "lightcurve {scene} --object 99002 --out o {options}"
    ));
    ended.exits(0)
}

/// The rows of the table in the folder `o`, without its head.
fn table(here: &Folder) -> Vec<Vec<String>> {
    let text = here.read("o/lightcurve.csv");
    let mut lines = text.lines();
    let head = "utc,t_s,mag,band_mag,range_km,phase_deg,illumination,reason";
    assert_eq!(lines.next(), Some(head));
    let cells = lines.map(|line| line.split(',').map(str::to_string).collect());
    cells.collect()
}

#[test]
fn a_table_and_a_picture_are_written_and_nothing_is_removed() {
    let here = Folder::with(&[("o/labels.jsonl", "mine")]);
    let ended = rocket(&here, "--step 0.25");
    let ended = ended.prints(&["NORAD 99002 (ROCKET BODY) seen from NORAD 99001"]);
    ended.prints(&["81 instants"]).quiet();
    let rows = table(&here);
    assert_eq!(rows.len(), 81);
    assert_eq!(rows[0][..2], ["2026-06-01T00:33:00.000Z", "0.000000"]);
    assert_eq!(rows[80][..2], ["2026-06-01T00:33:20.000Z", "20.000000"]);
    // The brightness of a tumbling body varies by more than range and phase explain, in flashes.
    let mags: Vec<f64> = rows.iter().map(|row| row[2].parse().unwrap()).collect();
    let least = mags.iter().copied().fold(f64::MAX, f64::min);
    let span = mags.iter().copied().fold(f64::MIN, f64::max) - least;
    assert!(span > 2.0, "{span}");
    for row in &rows {
        assert!(row[2] == row[3] && row[6] == "1.000000" && row[7].is_empty());
    }
    let curve = points(&here.read("o/lightcurve.svg"));
    assert_eq!(curve.len(), rows.len());
    // Points run from left to right; the brightest row is the highest point (rows may share it).
    assert!(curve.is_sorted_by_key(|at| at[0]), "{curve:?}");
    let highest = curve.iter().map(|at| at[1]).min().unwrap();
    let brightest = (0..mags.len()).min_by(|i, j| mags[*i].total_cmp(&mags[*j]));
    assert_eq!(curve[brightest.unwrap()][1], highest);
    assert_eq!(here.read("o/labels.jsonl"), "mine");
}

/// The points of the curve in a plot, px from the upper left corner.
fn points(plot: &str) -> Vec<[i32; 2]> {
    let is_curve = |line: &&str| line.starts_with("<polyline") && line.contains("#FFC850");
    let curve = plot.lines().find(is_curve).unwrap();
    let (_, points) = curve.split_once("points=\"").unwrap();
    let points = points.split(['"', ' ']).map_while(|point| {
        let (x, y) = point.split_once(',')?;
        Some([x, y].map(|px| px.parse().unwrap()))
    });
    points.collect()
}

/// The plot in `docs/how-to/passes.md` is current, to one pixel for other platforms.
#[test]
fn the_plot_of_the_guide_is_current() {
    let here = Folder::new();
    rocket(&here, "--step 0.05");
    let plots = [
        here.read("o/lightcurve.svg"),
        repository_text("docs/how-to/lightcurve.svg"),
    ];
    let words = |plot: &String| -> Vec<String> {
        let lines = plot.lines().filter(|line| !line.starts_with('<'));
        lines.map(str::to_string).collect()
    };
    assert_eq!(words(&plots[0]), words(&plots[1]));
    let [drawn, shown] = plots.map(|plot| points(&plot));
    assert_eq!(drawn.len(), shown.len());
    let is_near = |(a, b): (&[i32; 2], &[i32; 2])| (0..2).all(|k| (a[k] - b[k]).abs() <= 1);
    assert!(
        drawn.iter().zip(&shown).all(is_near),
        "make docs/how-to/lightcurve.svg anew: skyloop lightcurve --scene \
         configs/scenes/tumbling-rocket-body/scene.toml --object \"ROCKET BODY\" --step 0.05"
    );
}

/// Light curve and labels of the same exposures agree, for a sphere and for a tumbling body.
#[test]
fn light_curves_agree_with_labels() {
    let here = Folder::new();
    here.run("lightcurve --object RCM-2 --out o").exits(0);
    is_labelled(&here, "RCM-2", Config::builtin().unwrap());
    let here = Folder::new();
    rocket(&here, "");
    let scene = fixtures::scene("tumbling-rocket-body/scene.toml");
    is_labelled(&here, "ROCKET BODY", scene);
}

fn is_labelled(here: &Folder, name: &str, config: Config) {
    let rows = table(here);
    let label = Frames::of(config).expose(7).label;
    let is_meant = |object: &&ObjectLabel| object.names.iter().any(|n| n == name);
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
fn hidden_objects_have_a_reason_and_no_received_magnitude() {
    let here = Folder::new();
    let scene = repository("configs/scenes/geo-belt-stare");
    let head = [
        "lightcurve",
        "--object",
        "GEO 4",
        "--out",
        "o",
        "--step",
        "300",
    ];
    let tail = ["--to", "2026-06-01T16:00:00Z", "--scene", &scene];
    let said = here.run_args(&[&head[..], &tail].concat()).exits(0);
    let rows = table(&here);
    let hidden = rows.iter().filter(|row| row[7] == "behind the Earth");
    let hidden: Vec<_> = hidden.collect();
    assert!(!hidden.is_empty() && hidden.len() < rows.len());
    assert!(hidden.iter().all(|row| row[3].is_empty()));
    said.prints(&[&format!(
        "no light at the others: {} behind the Earth",
        hidden.len()
    )]);
}

/// An observer and another object on the same straight path from a position (km, km/s) at noon: the
/// light curve from noon to another time.
fn on_one_path(here: &Folder, position: [f64; 3], velocity: [f64; 3], to: &str) -> Outcome {
    let mid = parse_utc("2026-03-01T12:00:00").unwrap();
    let [position, velocity] = [position, velocity].map(Vector3::from);
    let text = oem_text("EYE", mid, |t| (position + velocity * t, velocity));
    let scene = "[observer]\norbit = \"eye.oem\"\n[objects]\nfiles = [\"twin.oem\"]\n";
    here.write("eye.oem", &text);
    here.write("twin.oem", text.replace("EYE", "TWIN"));
    here.write("scene.toml", scene);
    let times = format!("--from 2026-03-01T12:00:00 --to 2026-03-01T12:00:{to} --step 1");
    here.run(&format!(
        "lightcurve --scene . --object TWIN --exposure 0.1 --out o {times}"
    ))
}

#[test]
fn the_observer_itself_reflects_nothing_to_itself() {
    let here = Folder::new();
    let curve = |to: &str| on_one_path(&here, [7000.0, 0.0, 0.0], [0.0, 7.5, 0.0], to);
    let ended = curve("00").exits(0).prints(&[": 1 instant from"]);
    ended.prints(&["no light of it arrives: 1 at the observer itself"]);
    let rows = table(&here);
    let [mag, band_mag, reason] = [2, 3, 7].map(|column| rows[0][column].as_str());
    assert_eq!([mag, band_mag, reason], ["", "", "at the observer itself"]);

    // The ephemeris ends at 12:00:10, in the middle of the last exposure.
    let refused = curve("10")
        .exits(1)
        .logs(&["error: .: TWIN: ", "outside its ephemeris"]);
    refused.logs(&[
        "half of --exposure 0.1",
        "--to 2026-03-01T12:00:09.000Z works",
    ]);
    curve("09").exits(0);
}

/// An observer that descends by 2 km/s.
#[test]
fn an_observer_below_the_ground_is_refused() {
    let here = Folder::new();
    let refused = on_one_path(&here, [6388.0, 0.0, 0.0], [-2.0, 0.0, 0.0], "08").exits(1);
    // X-Val: WGS84: the equator's radius is 6378.137 km.
    refused.logs(&["EYE", "below the ground", "2026-03-01T12:00:05"]);
    assert!(!here.join("o").exists());
}

/// `TUMBLING` are the options of the rocket body.
#[test]
fn wrong_inputs_are_refused_with_a_remedy() {
    let scene = shipped("tumbling-rocket-body/scene.toml");
    let table = "
        SCENE --object ISS | --object ISS: no object called | NORAD 99002 (ROCKET BODY)
        TUMBLING --step 0 | error: --step 0:  | from 1e-6 to 1e6
        TUMBLING --step nan | --step <S> | a number is wanted
        TUMBLING --exposure -1 | error: --exposure -1:  | 0 to 10000
        TUMBLING --step 1e-6
        | error: --step 0.000001, --from 2026-06-01T00:33:00 | 20000001 points | enlarge --step
        TUMBLING --from 2026-06-02T00:00:00Z | error: --from 2026-06-02T00:00:00
        | --to 2026-06-01T00:33:20.000Z (the scene's) | the end lies before the start
        TUMBLING --from tomorrow | --from | tomorrow
        --scene nowhere.toml --object X | nowhere.toml | check the path
        --object RCM-1 --to 2019-06-16T00:00:00Z | the built-in scene:
        | outside its ephemeris | 23:36:30 | half of --exposure 0.1
        --object CASSIOPE | no object called | RCM-1
        DEEP_SKY --object X | deep-sky.toml | no observer | [observer]
        ANOMALY --object X | south-atlantic-anomaly.toml: has no objects | [objects]";
    let table = table.replace("TUMBLING", "SCENE --object 99002");
    let table = table.replace("SCENE", &scene);
    let table = table.replace("DEEP_SKY", &shipped("deep-sky.toml"));
    let table = table.replace("ANOMALY", &shipped("south-atlantic-anomaly.toml"));
    Folder::new().refuses("lightcurve --out o", &table);
}
