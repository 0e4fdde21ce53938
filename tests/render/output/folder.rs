//! The folder of a run: names, labels, removed and retained files of earlier runs, errors.

use super::synthetic::{Numbers, camera, frame, label};
use skyloop::attitude::Attitude;
use skyloop::output::{OutputError, Writer};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

fn run(dir: &Path, frames: u32, electrons: bool) -> Result<(), OutputError> {
    let camera = camera("fai-nir");
    let mut numbers = Numbers(3);
    let mut writer = Writer::create(dir, frames)?;
    for i in 0..frames {
        let label = label(&camera, i, &Attitude::identity());
        let mut frame = frame(&camera, &label, &mut numbers);
        if !electrons {
            frame.expected_e = None;
        }
        writer.write_frame(&camera, &label, &label.to_json(), &frame)?;
    }
    writer.finish()
}

fn names(dir: &Path) -> BTreeSet<String> {
    let entries = fs::read_dir(dir).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name());
    names.map(|name| name.into_string().unwrap()).collect()
}

fn set(names: &[&str]) -> BTreeSet<String> {
    names.iter().map(|name| name.to_string()).collect()
}

#[test]
fn a_run_replaces_the_files_of_an_earlier_one_and_nothing_else() {
    let temp = tempfile::tempdir().unwrap();
    // Intermediate folders are created too.
    let dir = temp.path().join("a/b");
    run(&dir, 3, true).unwrap();
    let foreign = [
        "notes.txt",
        "frame_1.fits",
        "frame_00001.fits.bak",
        "frame_00002.jpg",
    ];
    for name in foreign {
        fs::write(dir.join(name), name).unwrap();
    }

    run(&dir, 1, false).unwrap();
    let ours = [
        "frame_00000.fits",
        "frame_00000.png",
        "frame_00000_preview.png",
        "labels.jsonl",
        "contact_sheet.png",
    ];
    assert_eq!(names(&dir), set(&[&ours[..], &foreign[..]].concat()));
    for name in foreign {
        assert_eq!(fs::read_to_string(dir.join(name)).unwrap(), name);
    }
}

/// Files with names of a run that the run did not write: after its last frame, or electrons that it
/// did not store. A killed run leaves a frame without a label.
#[test]
fn files_that_the_run_did_not_write_stop_the_next_one() {
    let dir = tempfile::tempdir().unwrap();
    for (name, may) in [
        ("frame_00001.png", false),
        ("frame_00001.fits", false),
        ("frame_00000_electrons.fits", false),
        ("frame_00007.fits", false),
        ("frame_00000.fits", true),
    ] {
        run(dir.path(), 1, false).unwrap();
        let file = dir.path().join(name);
        if !may {
            fs::write(&file, "mine").unwrap();
        }
        let contents = fs::read(&file).unwrap();
        assert_eq!(run(dir.path(), 1, false).is_ok(), may, "{name}");
        assert_eq!(fs::read(&file).unwrap(), contents, "{name}");
        if !may {
            fs::remove_file(&file).unwrap();
        }
    }
    run(dir.path(), 2, false).unwrap();
    let labels = fs::read_to_string(dir.path().join("labels.jsonl")).unwrap();
    let first = labels.lines().next().unwrap();
    fs::write(dir.path().join("labels.jsonl"), format!("{first}\n")).unwrap();
    run(dir.path(), 1, false).unwrap();
    assert!(!dir.path().join("frame_00001.png").exists());
}

#[test]
fn a_run_without_frames_leaves_no_sheet_and_no_labels() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), 2, false).unwrap();
    run(dir.path(), 0, false).unwrap();
    assert_eq!(names(dir.path()), set(&["labels.jsonl"]));
    assert_eq!(fs::read(dir.path().join("labels.jsonl")).unwrap(), b"");
}

#[test]
fn label_lines_are_complete_after_each_frame() {
    let dir = tempfile::tempdir().unwrap();
    let camera = camera("fai-nir");
    let mut writer = Writer::create(dir.path(), 2).unwrap();
    let mut lines = String::new();
    for i in 0..2 {
        let label = label(&camera, i, &Attitude::identity());
        let mut frame = frame(&camera, &label, &mut Numbers(4));
        let mut files = vec![
            format!("frame_0000{i}.fits"),
            format!("frame_0000{i}.png"),
            format!("frame_0000{i}_preview.png"),
        ];
        match i {
            0 => files.push("frame_00000_electrons.fits".to_string()),
            _ => frame.expected_e = None,
        }
        let json = label.to_json();
        writer.write_frame(&camera, &label, &json, &frame).unwrap();
        let members = json.strip_suffix('}').unwrap();
        lines += &format!("{members},\"files\":{}}}\n", serde_json::json!(files));
        let written = fs::read_to_string(dir.path().join("labels.jsonl")).unwrap();
        assert_eq!(written, lines);
        assert!(files.iter().all(|file| dir.path().join(file).is_file()));
    }
}

#[test]
fn a_folder_in_place_of_a_file_is_reported_and_retained() {
    let dir = tempfile::tempdir().unwrap();
    fs::create_dir(dir.path().join("frame_00000.png")).unwrap();
    let message = run(dir.path(), 1, false).unwrap_err().to_string();
    for part in ["frame_00000.png", "folder"] {
        assert!(message.contains(part), "{message}");
    }
    assert!(dir.path().join("frame_00000.png").is_dir());
}

/// Data that fit a buffer fail only when it is flushed: `/dev/full` accepts nothing.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_and_leaves_no_part_of_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let camera = camera("fai-nir");
    let label = label(&camera, 0, &Attitude::identity());
    let frame = frame(&camera, &label, &mut Numbers(5));
    for end in [".fits", ".png", "_preview.png", "_electrons.fits"] {
        let name = &format!("frame_00000{end}");
        let mut writer = Writer::create(dir.path(), 1).unwrap();
        std::os::unix::fs::symlink("/dev/full", dir.path().join(name)).unwrap();
        let written = writer.write_frame(&camera, &label, "{}", &frame);
        let error = written.unwrap_err();
        assert_eq!(error.source.kind(), std::io::ErrorKind::StorageFull);
        assert!(error.path.ends_with(name) && error.to_string().contains("free some space"));
        assert!(!names(dir.path()).contains(name));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported_for_the_sheet_too() {
    let dir = tempfile::tempdir().unwrap();
    let camera = camera("fai-nir");
    let label = label(&camera, 0, &Attitude::identity());
    let frame = frame(&camera, &label, &mut Numbers(6));
    let mut writer = Writer::create(dir.path(), 1).unwrap();
    writer.write_frame(&camera, &label, "{}", &frame).unwrap();
    std::os::unix::fs::symlink("/dev/full", dir.path().join("contact_sheet.png")).unwrap();
    let error = writer.finish().unwrap_err();
    assert!(error.path.ends_with("contact_sheet.png"));
}
