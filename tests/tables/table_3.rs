//! The paper's Table 3: a short sequence is rendered, written and reported.

#[path = "../../examples/table_3/sequence.rs"]
mod sequence;
#[path = "../../examples/table_3/table.rs"]
mod table;

use crate::refusals::check_refusals;
use clap::Parser;
use serde_json::Value;
use skyloop::orbit::synth::population;
use skyloop::orbit::time::parse_utc;
use skyloop::orbit::{Format, Record, write};
use skyloop_firmware_sim::console::in_one_line;
use std::path::Path;
use table::Args;

/// The printed text for these arguments, or the printed error.
fn table_3(args: &[&str]) -> Result<String, String> {
    let args = Args::try_parse_from([&["table_3"], args].concat()).map_err(|e| e.to_string())?;
    let mut printed = String::new();
    table::print(&args, |text| {
        printed += text;
        Ok(())
    })
    .map_err(|error| in_one_line(error.as_ref()))?;
    Ok(printed)
}

fn labels(folder: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("labels.jsonl")).unwrap();
    text.lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

fn of_kind(label: &Value, kind: &str) -> usize {
    let objects = label["objects"].as_array().unwrap();
    objects.iter().filter(|o| o["kind"] == kind).count()
}

/// The printed rows: name, images, total, time an image.
fn rows(printed: &str) -> Vec<[&str; 4]> {
    let words = printed.lines().map(|line| line.split_whitespace());
    words
        .filter_map(|words| words.collect::<Vec<_>>().try_into().ok())
        .filter(|[_, images, ..]: &[&str; 4]| images.parse::<u32>().is_ok())
        .collect()
}

#[test]
fn a_short_sequence_is_written_and_compared_with_the_published_times() {
    let out = tempfile::tempdir().unwrap();
    let printed = table_3(&["--images", "2", "--out", out.path().to_str().unwrap()]).unwrap();

    let rows = rows(&printed);
    let [name, images, total, each] = rows[0];
    assert_eq!([name, images], ["skyloop", "2"], "{printed}");
    let [total, each] = [total, each].map(|s| s.parse::<f64>().unwrap());
    let is_half = (total / 2.0 - each).abs() < 0.006;
    assert!(total > 0.0 && is_half, "{printed}");
    // The paper's Table 3.
    let published = [
        ["SBOIS", "200", "67", "0.34"],
        ["STK-EOIR", "200", "681", "3.4"],
        ["SBOIS", "1000", "280", "0.28"],
        ["STK-EOIR", "1000", "3322", "3.3"],
    ];
    assert_eq!(rows[1..], published);

    let folder = out.path().join("2-images");
    for name in ["frame_00000", "frame_00001"] {
        // A FITS file has 256 x 256 pixels of 16 bit after its header, in blocks of 2,880 bytes.
        let fits = std::fs::metadata(folder.join(format!("{name}.fits"))).unwrap();
        assert!(fits.len() > 2 * 256 * 256 && fits.len().is_multiple_of(2880));
        assert!(folder.join(format!("{name}.png")).is_file());
    }
    assert!(folder.join("contact_sheet.png").is_file());
    let labels = labels(&folder);
    let [first, second] = &labels[..] else {
        panic!("{} labels", labels.len());
    };
    assert_eq!(first["epoch_mid"], "2019-06-15T23:35:50.000Z");
    assert_eq!(second["epoch_mid"], "2019-06-15T23:35:51.000Z");
    assert_eq!(first["q_icrf_to_body"], second["q_icrf_to_body"]);
    assert_ne!(first["state_gcrf_km"], second["state_gcrf_km"]);
    for label in &labels {
        // The scene alone has labels of some 1,100 stars a frame and three objects (README.md,
        // 'The two commands').
        assert!(of_kind(label, "star") > 1000);
        assert!(of_kind(label, "rso") > 3);
    }
}

#[test]
fn objects_of_a_file_replace_the_synthetic_ones() {
    let out = tempfile::tempdir().unwrap();
    let epoch = parse_utc("2019-06-15T23:35:50Z").unwrap();
    let mut records: Vec<Record> = population(2, 1, epoch)
        .iter()
        .map(|one| one.record())
        .collect();
    // CASSIOPE, which does not see itself.
    records[0].designator = "2013-055A".to_string();
    let written = write(&records, Format::Tle, epoch).unwrap();
    let file = out.path().join("two.tle");
    std::fs::write(&file, written.text).unwrap();
    let file = file.to_str().unwrap();
    // Without --out the images go to a temporary folder.
    let printed = table_3(&["--images", "1", "--tle", file]).unwrap();
    let objects = format!("with 1 object of {file}");
    for part in [&objects, "written into a temporary folder"] {
        assert!(printed.contains(part), "{printed}");
    }
}

#[test]
fn wrong_arguments_are_refused_with_their_remedy() {
    let out = tempfile::tempdir().unwrap();
    let file = out.path().join("a-file");
    std::fs::write(&file, "no orbits").unwrap();
    let file = file.to_str().unwrap();
    check_refusals(REFUSED, |args| {
        let args = args.split(' ').map(|arg| arg.replace("FILE", file));
        let args: Vec<String> = args.collect();
        let args: Vec<&str> = args.iter().map(String::as_str).collect();
        table_3(&args).unwrap_err().replace(file, "FILE")
    });
}

const REFUSED: &str = r#"
--tle no-such.tle | --tle | no-such.tle | check the path
--tle FILE | --tle | FILE
--images 1 --out FILE | FILE | choose another output folder
--images 0 | --images | a whole number from 1 to 10000
--images -3 | --images | a whole number from 1 to 10000
--frames 3 | --frames | --help
three | three | --help
"#;
