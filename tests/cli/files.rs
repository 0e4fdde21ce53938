//! Files that a command reads and writes: what is too long, has no end or no writer, and what must not be replaced.
#![cfg(unix)]

use crate::{EPOCH, Q, repository, skyloop};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The head of a table of element sets, and a made-up set.
const HEAD: &str = "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,\
                    MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n";
const SET: &str = "2026-101A,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270,5,0\n";

/// Exit code and all that a command printed.
fn say(at: &Path, words: &str) -> (Option<i32>, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

fn scene(at: &Path, name: &str, keys: &str) {
    let sequence = "[sequence]\nepoch = \"2019-06-15T23:35:50Z\"\nframes = 1\nperiod_s = 1.0\n\
                    attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]\n";
    std::fs::write(at.join(name), format!("{keys}\n{sequence}")).unwrap();
}

/// All files below a folder, with their contents.
fn tree(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => files.extend(tree(&path)),
            false => files.push((path.clone(), std::fs::read(&path).unwrap())),
        }
    }
    files.sort();
    files
}

/// Every option, and every key of a file, that takes a file: with FILE in its place.
fn readers(at: &Path, file: &str) -> Vec<String> {
    let key = |name: &str, keys: &str| {
        scene(at, name, &keys.replace("FILE", file));
        format!("render --scene {name} --out o")
    };
    let psf = std::fs::read_to_string(repository("configs/cameras/fai-nir.toml")).unwrap();
    let (head, tail) = psf.split_once("[optics.psf]").unwrap();
    let tail = tail.split_once("\n\n").map_or("", |(_, tail)| tail);
    let image = format!(
        "{head}[optics.psf]\nkind = \"image\"\nimages = [{{ file = {file:?} }}]\noversampling = 4.0\n\n{tail}"
    );
    std::fs::write(at.join("camera.toml"), image).unwrap();
    let render = format!("render --epoch {EPOCH} --attitude={Q} --out o");
    vec![
        format!("{render} --camera {file}"),
        format!("{render} --orbit {file}"),
        format!("{render} --rso {file} --state 7000,0,0,0,7.5,0"),
        format!("{render} --camera camera.toml"),
        format!("render --scene {file} --out o"),
        format!("run --config {file}"),
        format!("soak --config {file}"),
        format!("loopback --scene {file}"),
        format!("loopback --faults {file}"),
        format!("replay {file}"),
        format!("replay {file} --config {file}"),
        format!("plan --scene {file}"),
        format!("cost --scene {file}"),
        format!("passes --scene {file}"),
        format!("passes --orbit {file}"),
        format!("lightcurve --object X --out o --scene {file}"),
        format!("catalog check {file}"),
        format!("catalog info {file}"),
        format!("catalog convert {file} --to tle"),
        key("of-camera.toml", "camera = \"FILE\""),
        key("of-objects.toml", "[objects]\nfiles = [\"FILE\"]"),
        key("of-population.toml", "[objects]\npopulation = \"FILE\""),
        key("of-observer.toml", "[observer]\norbit = \"FILE\""),
    ]
}

#[test]
fn what_has_no_end_or_no_writer_or_is_no_file_is_refused_everywhere() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let made = Command::new("mkfifo").arg(at.join("pipe")).status();
    assert!(made.unwrap().success());
    std::fs::create_dir(at.join("empty")).unwrap();
    // A hole that takes no room, longer than anything that is read.
    let long = std::fs::File::create(at.join("long")).unwrap();
    std::io::Write::write_all(&mut &long, b"(           ").unwrap();
    long.set_len((2 << 30) + 1).unwrap();
    for (file, says) in [
        ("/dev/zero", &["a device or a socket"][..]),
        ("pipe", &["nothing has come through this pipe for 10 s"]),
        ("long", &["longer than", "not a text file"]),
        ("missing", &["No such file", "cannot be opened", "exists"]),
        // A folder stands for its files where files of orbits are read, and for its scene.toml where a scene is.
        (
            "empty",
            &[
                "folder",
                "directory",
                "no usable",
                "no object",
                "scene.toml",
                "no element set",
                "no files",
            ],
        ),
    ] {
        // Side by side: those that wait for a pipe only wait.
        std::thread::scope(|scope| {
            for (number, words) in readers(at, file).into_iter().enumerate() {
                scope.spawn(move || {
                    let (code, text) = say(at, &words);
                    assert_eq!(code, Some(1), "{number}: {words}: {text}");
                    let last: &str = text.lines().last().unwrap_or_default();
                    assert!(
                        says.iter().any(|part| text.contains(part)),
                        "{words}: {text}"
                    );
                    assert!(last.len() < 600, "{words}: {text}");
                });
            }
        });
        assert!(!at.join("o").exists(), "{file}");
    }
}

/// `<(...)` of a shell is a pipe.
#[test]
fn a_pipe_with_a_writer_is_read() {
    let here = tempfile::tempdir().unwrap();
    let run = "exec \"$0\" run --frames 1 --timeout 0.2 --config <(printf '[run]\\nlink = \"udp://127.0.0.1:0\"\\n')";
    let output = Command::new("bash")
        .args(["-c", run, env!("CARGO_BIN_EXE_skyloop")])
        .current_dir(here.path())
        .output()
        .unwrap();
    let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    assert!(text.contains("listening on udp://127.0.0.1:"), "{text}");
}

#[test]
fn a_long_configuration_is_refused_before_it_is_parsed() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let numbers = "1, ".repeat((4 << 20) / 3 + 1);
    std::fs::write(at.join("run.toml"), format!("x = [{numbers}]\n")).unwrap();
    let (code, text) = say(at, "run --config run.toml");
    assert_eq!(code, Some(1));
    assert!(
        text.contains("run.toml: longer than 4 MiB; check"),
        "{text}"
    );
}

#[test]
fn a_start_that_fails_leaves_earlier_files_alone() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let files = ["run.pcapng", "log.jsonl"];
    let instruments = "--capture run.pcapng --fault-log log.jsonl";
    std::fs::write(at.join("file"), "").unwrap();
    let taken = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap();
    std::fs::write(
        at.join("run.toml"),
        format!("[run]\nlink = \"udp://{taken}\"\n"),
    )
    .unwrap();
    for failing in [
        format!("run --config run.toml {instruments}"),
        format!("loopback --link pigeon {instruments}"),
        format!("loopback --out file {instruments}"),
    ] {
        let (code, text) = say(at, &failing);
        assert_eq!(code, Some(1), "{failing}: {text}");
        assert!(
            files.iter().all(|file| !at.join(file).exists()),
            "{failing}"
        );
        files
            .iter()
            .for_each(|file| std::fs::write(at.join(file), "earlier").unwrap());
        assert_eq!(say(at, &failing).0, Some(1));
        for file in files {
            assert_eq!(
                std::fs::read(at.join(file)).unwrap(),
                b"earlier",
                "{failing}"
            );
            std::fs::remove_file(at.join(file)).unwrap();
        }
    }
}

#[test]
fn no_output_replaces_what_the_run_reads_or_writes_already() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let orbit = repository("configs/scenes/rcm-2019-06-15/cassiope-B.oem");
    std::fs::copy(&orbit, at.join("orbit.oem")).unwrap();
    std::fs::hard_link(at.join("orbit.oem"), at.join("hard.oem")).unwrap();
    std::fs::write(at.join("sets.csv"), format!("{HEAD}A,{SET}")).unwrap();
    std::fs::hard_link(at.join("sets.csv"), at.join("hard.csv")).unwrap();
    let camera = repository("configs/cameras/fai-nir.toml");
    std::fs::create_dir(at.join("o")).unwrap();
    std::fs::copy(camera, at.join("o/labels.jsonl")).unwrap();
    scene(
        at,
        "scene.toml",
        "camera = \"o/labels.jsonl\"\n[observer]\norbit = \"orbit.oem\"\n",
    );
    let run = "[run]\nclock = \"wall\"\nlink = \"udp://127.0.0.1:0\"";
    scene(
        at,
        "run.toml",
        &format!("[observer]\norbit = \"orbit.oem\"\n{run}"),
    );
    // A table of element sets with the name of a light curve's table.
    std::fs::create_dir(at.join("lightcurve")).unwrap();
    let sets = format!(
        "{HEAD}A,{SET}B,{}",
        SET.replace("101A", "102A").replace(",5,0", ",6,0")
    );
    std::fs::write(at.join("lightcurve/lightcurve.csv"), sets).unwrap();
    let keys = "[observer]\norbit = \"lightcurve.csv:A\"\n[objects]\nfiles = [\"lightcurve.csv\"]";
    scene(at, "lightcurve/scene.toml", keys);
    let kept = tree(at);
    let run = "run --config run.toml --timeout 0.1";
    for (words, says) in [
        (
            format!("{run} --capture orbit.oem"),
            "this run reads this file",
        ),
        (
            format!("{run} --fault-log hard.oem"),
            "this run reads this file",
        ),
        (
            format!("{run} --ready-file orbit.oem"),
            "this run reads this file",
        ),
        (
            format!("{run} --ready-file x --capture ./x"),
            "names the same file",
        ),
        (
            format!("{run} --capture new --fault-log ./new"),
            "names the same file",
        ),
        (
            "loopback --scene scene.toml --out p --junit orbit.oem --force".to_string(),
            "this run reads this file",
        ),
        (
            "loopback --out p --junit x --capture x".to_string(),
            "names the same file",
        ),
        (
            "loopback --out p --capture p/labels.jsonl".to_string(),
            "--out p has a file of this name",
        ),
        (
            "loopback --out p --junit p/frame_00000.fits".to_string(),
            "--out p has a file of this name",
        ),
        (
            "soak --config run.toml --minutes 0.01 --json orbit.oem --force".to_string(),
            "this run reads this file",
        ),
        (
            "render --scene scene.toml --out o --force".to_string(),
            "this run reads this file",
        ),
        (
            "catalog convert sets.csv --to omm-json --out hard.csv --force".to_string(),
            "this run reads this file",
        ),
        (
            "lightcurve --scene lightcurve/scene.toml --object B --out lightcurve --force"
                .to_string(),
            "this run reads this file",
        ),
        (
            "loopback --scene scene.toml --out p --capture orbit.oem --force".to_string(),
            "this run reads this file",
        ),
    ] {
        std::fs::create_dir_all(at.join("p")).unwrap();
        let (code, text) = say(at, &words);
        assert_eq!(code, Some(1), "{words}: {text}");
        assert!(text.contains(says), "{words}: no {says:?} in {text}");
        std::fs::remove_dir_all(at.join("p")).unwrap();
        assert_eq!(tree(at), kept, "{words}");
    }
}

#[test]
fn files_that_skyloop_did_not_make_are_replaced_by_force_only() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    let render = format!("render --epoch {EPOCH} --attitude={Q} --out");
    let curve = "lightcurve --object RCM-1 --step 10 --out";
    for (command, folder, foreign) in [
        (render.as_str(), "a", "frame_00000.png"),
        (&render, "b", "labels.jsonl"),
        (&render, "c", "contact_sheet.png"),
        (curve, "d", "lightcurve.png"),
        (curve, "e", "lightcurve.csv"),
    ] {
        std::fs::create_dir(at.join(folder)).unwrap();
        let foreign = at.join(folder).join(foreign);
        std::fs::write(&foreign, "mine").unwrap();
        let (code, text) = say(at, &format!("{command} {folder}"));
        assert_eq!(code, Some(1), "{text}");
        assert!(
            text.contains("did not make") && text.contains("--force"),
            "{text}"
        );
        assert_eq!(crate::names(&at.join(folder)).len(), 1);
        assert_eq!(std::fs::read(&foreign).unwrap(), b"mine");
        let (code, text) = say(at, &format!("{command} {folder} --force"));
        assert_eq!(code, Some(0), "{text}");
        // Its own are replaced without.
        let (code, text) = say(at, &format!("{command} {folder}"));
        assert_eq!(code, Some(0), "{text}");
    }
    // One more beside those of a run.
    std::fs::write(at.join("a/frame_00007.fits"), "mine").unwrap();
    let (code, text) = say(at, &format!("{render} a"));
    assert!(
        code == Some(1) && text.contains("frame_00007.fits"),
        "{text}"
    );
}

/// Names from files, from paths and from the command line, in tables, logs and errors.
#[test]
fn names_do_not_steer_the_terminal() {
    let here = tempfile::tempdir().unwrap();
    let at = here.path();
    // X-Val: ECMA-48: ESC [ 31 m turns letters red; Unicode Standard Annex 9: U+202E turns their order.
    let evil = "E\u{1b}[31mVIL\u{9b}2J\u{202e}X";
    let bad = SET.replace(".001", "7").replace(",5,0", ",6,0");
    let text = format!("{HEAD}{evil},{SET}{evil},{bad}");
    std::fs::write(at.join("sets.csv"), text).unwrap();
    std::fs::write(at.join(format!("{evil}.toml")), "seed = -1\n").unwrap();
    let camera = std::fs::read_to_string(repository("configs/cameras/fai-nir.toml")).unwrap();
    let camera = camera.replace("\"fai-nir\"", "\"fai\u{202e}rin\"");
    std::fs::write(at.join("camera.toml"), camera).unwrap();
    scene(at, "of.toml", "camera = \"camera.toml\"\n");
    let evil_file = format!("{evil}.toml");
    for words in [
        vec!["catalog", "info", "sets.csv"],
        vec!["catalog", "check", "sets.csv"],
        vec!["catalog", "check", "sets.csv", "--json"],
        vec!["catalog", "info", "sets.csv", "--object", evil],
        vec!["run", "--config", &evil_file],
        vec!["run", "--config", evil],
        vec![
            "render",
            "--camera",
            evil,
            "--epoch",
            EPOCH,
            "--attitude",
            Q,
            "--out",
            "o",
        ],
        vec!["render", "--epoch", evil],
        vec!["loopback", "--link", evil],
        vec![
            "loopback", "--scene", "of.toml", "--frames", "1", "--out", "o",
        ],
        vec!["plan", "--scene", "of.toml"],
    ] {
        let output = skyloop(at).args(&words).output().unwrap();
        let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        let raw = text.chars().filter(|c| "\u{1b}\u{9b}\u{202e}".contains(*c));
        assert_eq!(raw.count(), 0, "{words:?}: {text:?}");
        // Quoted names have the escapes of Rust.
        let told = text.contains("\\u202e") || text.contains("\\u{202e}");
        assert!(told, "{words:?}: {text}");
    }
    // The end of a line in a name makes no line of its own.
    for words in [
        "camera check NAME",
        "camera new no/NAME --size 1x1",
        "run --config NAME",
        "run --config of.toml --link NAME",
        "run --config of.toml --capture no/NAME",
        "run --config of.toml --ready-file no/NAME",
        "soak --config NAME",
        "plan --scene NAME",
        "plan --camera NAME",
        "plan --look-at NAME",
        "passes --orbit NAME",
        "cost --scene NAME",
        "lightcurve --object NAME --out o",
        "loopback --scene NAME",
        "loopback --faults NAME",
        "loopback --link NAME",
        "loopback --fault-log no/NAME",
        "loopback --junit no/NAME",
        "catalog check NAME",
        "catalog info NAME",
        "catalog convert NAME --to tle",
        "catalog synth --objects 1 --out NAME.x",
        "replay NAME",
    ] {
        let words = words
            .split(' ')
            .map(|word| word.replace("NAME", "a\nforged: b"));
        let output = skyloop(at).args(words.clone()).output().unwrap();
        let text = String::from_utf8(output.stderr).unwrap();
        let words: Vec<String> = words.collect();
        assert_eq!(output.status.code(), Some(1), "{words:?}: {text}");
        assert!(!text.contains("\nforged"), "{words:?}: {text}");
    }
    // Data are data: what is converted keeps its names.
    let (_, text) = say(at, "catalog convert sets.csv --to omm-csv");
    assert!(text.contains('\u{202e}'), "{text:?}");
}
