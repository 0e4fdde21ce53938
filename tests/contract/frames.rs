//! Frames, labels and FITS headers of every shipped scene.

use super::{assert_unchanged, output_of, repository};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Frames of each scene.
const FRAMES: u32 = 2;
/// Scenes whose FITS headers are compared card by card: gnomonic, with distortion, and a fisheye.
const HEADERS: [&str; 3] = ["bright-star", "fast-slew", "all-sky"];

/// The shipped scenes, in order.
fn scenes() -> Vec<PathBuf> {
    let folder = std::fs::read_dir(repository("configs/scenes")).unwrap();
    let scenes = folder.map(|entry| entry.unwrap().path());
    let mut scenes: Vec<_> = scenes
        .filter(|path| path.is_dir() || path.extension().is_some_and(|end| end == "toml"))
        .collect();
    scenes.sort();
    scenes
}

/// Cards and data of a FITS file of 16-bit or 32-bit pixels.
fn fits(path: &Path) -> (Vec<String>, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let cards = bytes
        .chunks(80)
        .map(|card| String::from_utf8_lossy(card).into_owned());
    let cards: Vec<_> = cards.take_while(|card| card.trim() != "END").collect();
    let value = |key: &str| -> usize {
        let card = cards.iter().find(|card| card.starts_with(key)).unwrap();
        let number = card[10..30].trim();
        number.trim_start_matches('-').parse().unwrap()
    };
    let length = value("BITPIX  ") / 8 * value("NAXIS1  ") * value("NAXIS2  ");
    let begin = (cards.len() + 1).div_ceil(36) * 2880;
    (cards, bytes[begin..begin + length].to_vec())
}

/// A card without its comment: keyword, value and unit.
fn without_comment(card: &str) -> Option<String> {
    if card.starts_with("COMMENT") {
        return None;
    }
    let (value, comment) = card.split_once(" / ").unwrap_or((card, ""));
    let unit = comment.split_once(']').filter(|_| comment.starts_with('['));
    let unit = unit.map_or(String::new(), |(unit, _)| format!(" {unit}]"));
    Some(format!("{}{unit}", value.trim_end()))
}

/// CRC-32 of a label without the reasons of effects.
fn label_crc(line: &str) -> u32 {
    let mut label: Value = serde_json::from_str(line).unwrap();
    for effect in label["effects"].as_array_mut().unwrap() {
        let effect = effect.as_object_mut().unwrap();
        assert!(effect.remove("why").is_some(), "{effect:?}");
    }
    crc32fast::hash(label.to_string().as_bytes())
}

#[test]
fn pixels_labels_and_headers_of_shipped_scenes_are_unchanged() {
    let (mut frames, mut headers) = (String::new(), String::new());
    let here = tempfile::tempdir().unwrap();
    for scene in scenes() {
        let name = scene.file_stem().unwrap().to_str().unwrap().to_string();
        let noise = if name == "bright-star" {
            "--no-noise"
        } else {
            ""
        };
        let of = format!("--scene {} --frames {FRAMES}", scene.display());
        output_of(here.path(), &format!("render {of} --out {name} {noise}"));
        let out = here.path().join(&name);
        let labels = std::fs::read_to_string(out.join("labels.jsonl")).unwrap();
        for (number, label) in labels.lines().enumerate() {
            let file = |end: &str| out.join(format!("frame_{number:05}{end}"));
            let (cards, data) = fits(&file(".fits"));
            let dn = data.chunks(2).map(|pair| [pair[0] ^ 0x80, pair[1]]);
            let dn: Vec<u8> = dn.flatten().collect();
            let image = image::open(file(".png")).unwrap().into_luma16();
            let image: Vec<u8> = image.iter().flat_map(|dn| dn.to_be_bytes()).collect();
            assert!(image == dn, "{name}, frame {number}: PNG and FITS differ");
            let preview = image::open(file("_preview.png")).unwrap().into_luma8();
            let preview = crc32fast::hash(&preview);
            let (dn, label) = (crc32fast::hash(&dn), label_crc(label));
            write!(frames, "{name} {number} pixels {dn:08x} label {label:08x}").unwrap();
            writeln!(frames, " preview {preview:08x}").unwrap();
            let cards: Vec<_> = cards
                .iter()
                .filter_map(|card| without_comment(card))
                .collect();
            let crc = crc32fast::hash(cards.join("\n").as_bytes());
            writeln!(headers, "{name} {number} {crc:08x}").unwrap();
            if number == 0 && HEADERS.contains(&name.as_str()) {
                cards
                    .iter()
                    .for_each(|card| writeln!(headers, "  {card}").unwrap());
            }
            if let Ok(true) = file("_electrons.fits").try_exists() {
                let (cards, data) = fits(&file("_electrons.fits"));
                let crc = crc32fast::hash(&data);
                writeln!(frames, "{name} {number} electrons {crc:08x}").unwrap();
                writeln!(headers, "{name} {number} electrons").unwrap();
                let cards = cards.iter().filter_map(|card| without_comment(card));
                cards.for_each(|card| writeln!(headers, "  {card}").unwrap());
            }
        }
        assert!(out.join("contact_sheet.png").exists(), "{name}");
    }
    if cfg!(all(
        target_arch = "x86_64",
        target_os = "linux",
        target_env = "gnu"
    )) {
        assert_unchanged("frames", &frames);
        assert_unchanged("fits_headers", &headers);
    } else {
        println!("not compared: the checksums are those of x86_64-unknown-linux-gnu");
    }
}
