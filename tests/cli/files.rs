//! Files that a command reads and writes: too long files, pipes and devices, and files that must
//! not be replaced.
#![cfg(unix)]

use crate::{EPOCH, Folder, Q, camera, render, repository_text, rows, still};
use std::path::{Path, PathBuf};

/// The head of a table of element sets, and a synthetic set.
pub const HEAD: &str = "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,\
                    MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n";
pub const SET: &str = "2026-101A,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270,5,0\n";

/// A scene with these keys before its sequence.
fn scene(here: &Folder, name: &str, keys: &str) {
    here.write(name, format!("{keys}\n{}", still(EPOCH)));
}

/// All files below a folder, with their contents.
fn tree(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files.extend(tree(&path));
        } else {
            files.push((path.clone(), std::fs::read(&path).unwrap()));
        }
    }
    files.sort();
    files
}

/// A command for every option, and every key of a file, that reads a file.
fn readers(here: &Folder, file: &str) -> Vec<String> {
    let psf = camera("fai-nir", &[]);
    let (head, tail) = psf.split_once("[optics.psf]").unwrap();
    let tail = tail.split_once("\n\n").map_or("", |(_, tail)| tail);
    let image = format!(
        "{head}[optics.psf]\nkind = \"image\"\nimages = [{{ file = {file:?} }}]\noversampling = 4.0\n\n{tail}"
    );
    here.write("camera.toml", image);
    let mut readers = vec![
        render(&format!("--camera {file}")),
        render(&format!("--orbit {file}")),
        render(&format!("--rso {file} --state 7000,0,0,0,7.5,0")),
        render("--camera camera.toml"),
    ];
    let commands = [
        "render --out o --scene",
        "run --config",
        "soak --config",
        "loopback --scene",
        "loopback --faults",
        "replay",
        "plan --scene",
        "cost --scene",
        "passes --scene",
        "passes --orbit",
        "lightcurve --object X --out o --scene",
        "catalog check",
        "catalog info",
    ];
    readers.extend(commands.map(|command| format!("{command} {file}")));
    readers.push(format!("replay {file} --config {file}"));
    for (name, keys) in [
        ("of-camera.toml", format!("camera = {file:?}")),
        ("of-objects.toml", format!("[objects]\nfiles = [{file:?}]")),
        (
            "of-population.toml",
            format!("[objects]\npopulation = {file:?}"),
        ),
        ("of-observer.toml", format!("[observer]\norbit = {file:?}")),
    ] {
        scene(here, name, &keys);
        readers.push(format!("render --scene {name} --out o"));
    }
    readers
}

#[test]
fn endless_input_idle_pipes_and_folders_are_refused_everywhere() {
    let here = Folder::new();
    here.pipe("pipe");
    std::fs::create_dir(here.join("empty")).unwrap();
    // A sparse file, longer than any limit.
    let long = std::fs::File::create(here.join("long")).unwrap();
    std::io::Write::write_all(&mut &long, b"(           ").unwrap();
    long.set_len((2 << 30) + 1).unwrap();
    // A folder is valid for orbits (its files) and for a scene (its scene.toml).
    for (file, says) in rows(
        "/dev/zero | a device or a socket
         pipe      | nothing has come through this pipe for 10 s
         long      | longer than | not a text file
         missing   | No such file | cannot be opened | exists
         empty     | folder | directory | no usable | no object | scene.toml | no element set | no files",
    ) {
        // In parallel: those on a pipe only wait.
        std::thread::scope(|scope| {
            for words in readers(&here, file) {
                let (here, says) = (&here, &says);
                scope.spawn(move || {
                    let refused = here.run(&words).exits(1);
                    let text = format!("{}{}", refused.out, refused.log);
                    let is_said = says.iter().any(|part| text.contains(part));
                    assert!(is_said, "{}", refused.all());
                    let last = text.lines().last().unwrap_or_default();
                    assert!(last.len() < 600, "{}", refused.all());
                });
            }
        });
        assert!(!here.join("o").exists(), "{file}");
    }
}

/// `<(...)` of a shell is a pipe.
#[test]
fn a_pipe_with_a_writer_is_read() {
    let here = Folder::new();
    let run = "exec \"$0\" run --frames 1 --timeout 0.2 --config <(printf '[run]\\nlink = \"udp://127.0.0.1:0\"\\n')";
    let mut bash = std::process::Command::new("bash");
    let bash = bash.args(["-c", run, env!("CARGO_BIN_EXE_skyloop")]);
    let ended = crate::Outcome::of(run, bash.current_dir(&here).output().unwrap());
    ended.says(&["listening on udp://127.0.0.1:"]);
}

#[test]
fn a_long_configuration_is_refused_before_it_is_parsed() {
    let numbers = "1, ".repeat((4 << 20) / 3 + 1);
    let here = Folder::with(&[("run.toml", &format!("x = [{numbers}]\n"))]);
    let refused = here.run("run --config run.toml");
    refused
        .exits(1)
        .says(&["run.toml: longer than 4 MiB; check"]);
}

#[test]
fn a_failed_start_does_not_change_earlier_files() {
    let taken = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap();
    let run = format!("[run]\nlink = \"udp://{taken}\"\n");
    let here = Folder::with(&[("file", ""), ("run.toml", &run)]);
    let files = ["run.pcapng", "log.jsonl"];
    for failing in [
        "run --config run.toml",
        "loopback --link pigeon",
        "loopback --out file",
    ] {
        let failing = format!("{failing} --capture run.pcapng --fault-log log.jsonl");
        here.run(&failing).exits(1);
        for file in files {
            assert!(!here.join(file).exists(), "{failing}");
            here.write(file, "earlier");
        }
        here.run(&failing).exits(1);
        for file in files {
            assert_eq!(here.read(file), "earlier", "{failing}");
            std::fs::remove_file(here.join(file)).unwrap();
        }
    }
}

#[test]
fn no_output_replaces_an_input_or_another_output() {
    let orbit = repository_text("configs/scenes/rcm-2019-06-15/cassiope-B.oem");
    // lightcurve/ has a table of element sets with the name of a light curve's table.
    let other = SET.replace("101A", "102A").replace(",5,0", ",6,0");
    let here = Folder::with(&[
        ("orbit.oem", &orbit),
        ("sets.csv", &format!("{HEAD}A,{SET}")),
        ("o/labels.jsonl", &camera("fai-nir", &[])),
        (
            "lightcurve/lightcurve.csv",
            &format!("{HEAD}A,{SET}B,{other}"),
        ),
    ]);
    for (file, link) in [("orbit.oem", "hard.oem"), ("sets.csv", "hard.csv")] {
        std::fs::hard_link(here.join(file), here.join(link)).unwrap();
    }
    let observer = "[observer]\norbit = \"orbit.oem\"\n";
    let run = "[run]\nclock = \"wall\"\nlink = \"udp://127.0.0.1:0\"";
    scene(
        &here,
        "scene.toml",
        &format!("camera = \"o/labels.jsonl\"\n{observer}"),
    );
    scene(&here, "run.toml", &format!("{observer}{run}"));
    let keys = "[observer]\norbit = \"lightcurve.csv:A\"\n[objects]\nfiles = [\"lightcurve.csv\"]";
    scene(&here, "lightcurve/scene.toml", keys);
    let before = tree(&here);
    let run = "run --config run.toml --timeout 0.1";
    for (words, says) in rows(&format!(
        "{run} --capture orbit.oem              | this run reads this file
         {run} --fault-log hard.oem             | this run reads this file
         {run} --ready-file orbit.oem           | this run reads this file
         {run} --ready-file x --capture ./x     | names the same file
         {run} --capture new --fault-log ./new  | names the same file
         loopback --out p --junit x --capture x | names the same file
         loopback --out p --capture p/labels.jsonl    | --out p has a file of this name
         loopback --out p --junit p/frame_00000.fits  | --out p has a file of this name
         loopback --scene scene.toml --out p --junit orbit.oem --force   | this run reads this file
         loopback --scene scene.toml --out p --capture orbit.oem --force | this run reads this file
         soak --config run.toml --minutes 0.01 --json orbit.oem --force  | this run reads this file
         render --scene scene.toml --out o --force                       | this run reads this file
         lightcurve --scene lightcurve/scene.toml --object B --out lightcurve --force
         | this run reads this file"
    )) {
        std::fs::create_dir_all(here.join("p")).unwrap();
        here.run(words).exits(1).says(&says);
        std::fs::remove_dir_all(here.join("p")).unwrap();
        assert_eq!(tree(&here), before, "{words}");
    }
}

#[test]
fn a_foreign_file_in_the_output_folder_is_reported() {
    let here = Folder::new();
    here.run(&render("")).exits(0);
    here.write("o/frame_00007.fits", "mine");
    here.run(&render("")).exits(1).says(&["frame_00007.fits"]);
}

/// Names from files, from paths and from the command line, in tables, logs and errors.
#[test]
fn names_do_not_control_the_terminal() {
    // X-Val: ECMA-48: ESC [ 31 m sets red letters; Unicode Standard Annex 9: U+202E reverses their
    // order.
    let evil = "E\u{1b}[31mVIL\u{9b}2J\u{202e}X";
    let bad = SET.replace(".001", "7").replace(",5,0", ",6,0");
    let here = Folder::with(&[
        ("sets.csv", &format!("{HEAD}{evil},{SET}{evil},{bad}")),
        (&format!("{evil}.toml"), "seed = -1\n"),
        (
            "camera.toml",
            &camera("fai-nir", &[]).replace("\"fai-nir\"", "\"fai\u{202e}rin\""),
        ),
    ]);
    scene(&here, "of.toml", "camera = \"camera.toml\"\n");
    for words in [
        "catalog info sets.csv".to_string(),
        "catalog check sets.csv".to_string(),
        "catalog check sets.csv --json".to_string(),
        "catalog info sets.csv --object NAME".to_string(),
        "run --config NAME.toml".to_string(),
        "run --config NAME".to_string(),
        format!("render --camera NAME --epoch {EPOCH} --attitude {Q} --out o"),
        "render --epoch NAME".to_string(),
        "loopback --link NAME".to_string(),
        "loopback --scene of.toml --frames 1 --out o".to_string(),
        "plan --scene of.toml".to_string(),
    ] {
        let words: Vec<String> = words
            .split(' ')
            .map(|word| word.replace("NAME", evil))
            .collect();
        let ended = here.run_args(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let text = format!("{}{}", ended.out, ended.log);
        let is_raw = text.contains(['\u{1b}', '\u{9b}', '\u{202e}']);
        assert!(!is_raw, "{words:?}: {text:?}");
        // Quoted names have the escapes of JSON or Rust.
        let is_escaped = text.contains("\\u202e") || text.contains("\\u{202e}");
        assert!(is_escaped, "{words:?}: {text}");
    }
    // A line break in a name does not start a new line.
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
        "catalog synth --objects 1 --out NAME.x",
        "replay NAME",
    ] {
        let name = |word: &str| word.replace("NAME", "a\nforged: b");
        let words: Vec<String> = words.split(' ').map(name).collect();
        let ended = here.run_args(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let ended = ended.exits(1);
        assert!(!ended.log.contains("\nforged"), "{words:?}: {}", ended.log);
    }
}
