//! Everything that a command writes: one rule for all outputs, and a table of them that no new one escapes.
#![cfg(unix)]

use crate::{EPOCH, Q, skyloop};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

/// What a path on the command line is for.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Input,
    Output,
}
use Role::{Input, Output};

/// Every option and argument of every command whose value is a path.
const PATHS: &[(&str, &str, Role)] = &[
    ("loopback", "--scene", Input),
    ("loopback", "--out", Output),
    ("loopback", "--junit", Output),
    ("loopback", "--faults", Input),
    ("loopback", "--fault-log", Output),
    ("loopback", "--capture", Output),
    ("run", "--config", Input),
    ("run", "--ready-file", Output),
    ("run", "--faults", Input),
    ("run", "--fault-log", Output),
    ("run", "--capture", Output),
    ("soak", "--config", Input),
    ("soak", "--junit", Output),
    ("soak", "--json", Output),
    ("render", "--scene", Input),
    ("render", "--camera", Input),
    ("render", "--orbit", Input),
    ("render", "--rso", Input),
    ("render", "--out", Output),
    ("plan", "--scene", Input),
    ("plan", "--camera", Input),
    ("cost", "--scene", Input),
    ("cost", "--out", Output),
    ("passes", "--scene", Input),
    ("passes", "--orbit", Input),
    ("lightcurve", "--scene", Input),
    ("lightcurve", "--out", Output),
    ("catalog check", "<FILE>", Input),
    ("catalog info", "<FILE>", Input),
    ("catalog convert", "<FILE>", Input),
    ("catalog convert", "--out", Output),
    ("catalog synth", "--out", Output),
    ("camera check", "<NAME|FILE>", Input),
    ("camera new", "<FILE>", Output),
    ("pty", "<PATH_A>", Output),
    ("pty", "<PATH_B>", Output),
    ("replay", "<FILE>", Input),
    ("replay", "--config", Input),
    ("replay", "--scene", Input),
    ("man", "[DIR]", Output),
];

/// How a command writes one of its outputs, and the file that it writes.
struct Case {
    of: (&'static str, &'static str),
    words: String,
    file: &'static str,
    /// Whether an earlier file of its own is replaced without --force.
    is_recognised: bool,
}

impl Case {
    /// A folder with its inputs, and the path of its file, which is not there yet.
    fn prepared(&self) -> (tempfile::TempDir, PathBuf) {
        let here = folder();
        let file = here.path().join(self.file);
        std::fs::create_dir_all(file.parent().unwrap()).unwrap();
        (here, file)
    }
}

fn cases() -> Vec<Case> {
    let case = |command, option, words: &str, file, is_recognised| Case {
        of: (command, option),
        words: words.to_string(),
        file,
        is_recognised,
    };
    let loopback = "loopback --frames 1 --out p";
    let run = "run --config run.toml --timeout 0.1";
    let soak = "soak --config soak.toml --minutes 0.005";
    let figures =
        "--size 64x64 --pixel 5 --focal 20deg --aperture f/1.4 --exposure 0.2 --full-well 12000";
    let render = format!("render --epoch {EPOCH} --attitude={Q} --out o");
    vec![
        case(
            "loopback",
            "--out",
            "loopback --frames 1 --out o",
            "o/labels.jsonl",
            true,
        ),
        case(
            "loopback",
            "--junit",
            &format!("{loopback} --junit x"),
            "x",
            true,
        ),
        case(
            "loopback",
            "--fault-log",
            &format!("{loopback} --faults faults.toml --fault-log x"),
            "x",
            true,
        ),
        case(
            "loopback",
            "--capture",
            &format!("{loopback} --capture x"),
            "x",
            true,
        ),
        case(
            "run",
            "--ready-file",
            &format!("{run} --ready-file x"),
            "x",
            true,
        ),
        case(
            "run",
            "--fault-log",
            &format!("{run} --fault-log x"),
            "x",
            true,
        ),
        case("run", "--capture", &format!("{run} --capture x"), "x", true),
        case("soak", "--junit", &format!("{soak} --junit x"), "x", true),
        case("soak", "--json", &format!("{soak} --json x"), "x", true),
        case("render", "--out", &render, "o/frame_00000.fits", true),
        case(
            "cost",
            "--out",
            "cost --frames 1 --rounds 1 --out o",
            "o/cost.csv",
            true,
        ),
        case(
            "lightcurve",
            "--out",
            "lightcurve --object RCM-1 --step 10 --out o",
            "o/lightcurve.png",
            true,
        ),
        case(
            "catalog convert",
            "--out",
            "catalog convert sets.csv --to omm-json --out x",
            "x",
            false,
        ),
        case(
            "catalog synth",
            "--out",
            "catalog synth --objects 20 --out o",
            "o/population.toml",
            true,
        ),
        case(
            "catalog synth",
            "--out",
            "catalog synth --objects 20 --out x.csv",
            "x.csv",
            false,
        ),
        case(
            "camera new",
            "<FILE>",
            &format!("camera new x.toml {figures}"),
            "x.toml",
            false,
        ),
        case("man", "[DIR]", "man o", "o/skyloop-run.1", true),
    ]
}

fn say(at: &Path, words: &str) -> (Option<i32>, String) {
    let output = skyloop(at).args(words.split_whitespace()).output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (output.status.code(), String::from_utf8(text).unwrap())
}

/// A folder with the inputs of the cases, and no output.
fn folder() -> tempfile::TempDir {
    let here = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(here.path().join(name), text).unwrap();
    let run = "[run]\nlink = \"udp://127.0.0.1:0\"\n";
    write("run.toml", run);
    write(
        "soak.toml",
        &format!(
            "camera = \"cots-wide\"\n{run}clock = \"wall\"\noutput = \"labels\"\n[sequence]\nepoch = \"{EPOCH}\"\nframes = 1\nperiod_s = 1.0\n\
             radec = [0.0, 0.0, 0.0]\n"
        ),
    );
    write(
        "faults.toml",
        "[[faults]]\ndirection = \"out\"\nkind = \"delay\"\nvalue = 1\nfor_s = 0.01\n",
    );
    write(
        "sets.csv",
        "OBJECT_NAME,OBJECT_ID,EPOCH,MEAN_MOTION,ECCENTRICITY,INCLINATION,RA_OF_ASC_NODE,ARG_OF_PERICENTER,MEAN_ANOMALY,NORAD_CAT_ID,BSTAR\n\
         A,2026-101A,2026-07-12T03:04:05,15.2,.001,51.6,120,90,270,5,0\n",
    );
    here
}

/// What a command's help lists: its subcommands, and the options and arguments that take a path.
fn listed(at: &Path, command: &str) -> (Vec<String>, Vec<String>) {
    let (_, help) = say(at, &format!("{command} --help"));
    let (mut subcommands, mut paths, mut section) = (Vec::new(), Vec::new(), "");
    for line in help.lines() {
        match line.strip_suffix(':') {
            Some(name) if !line.starts_with(' ') => section = name,
            _ => {}
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        match (section, &words[..]) {
            ("Commands", [name, ..]) if *name != "help" => subcommands.push((*name).to_string()),
            ("Arguments", [name, ..]) if name.starts_with(['<', '[']) => {
                paths.push((*name).to_string())
            }
            ("Options", [option, value, ..]) if option.starts_with("--") => {
                let takes_a_path = ["FILE", "DIR", "FOLDER", "PATH"];
                if takes_a_path.iter().any(|word| value.contains(word)) {
                    paths.push((*option).to_string());
                }
            }
            _ => {}
        }
    }
    (subcommands, paths)
}

#[test]
fn every_path_of_the_command_line_is_in_the_table_and_every_output_has_a_case() {
    let here = tempfile::tempdir().unwrap();
    let (mut found, mut commands) = (BTreeSet::new(), vec![String::new()]);
    while let Some(command) = commands.pop() {
        let (subcommands, paths) = listed(here.path(), &command);
        let below = subcommands
            .iter()
            .map(|name| format!("{command} {name}").trim().to_string());
        commands.extend(below);
        // Arguments that are no paths: a shell, a kind of schema.
        let is_path = |path: &String| !["<SHELL>", "<KIND>", "[COMMAND]"].contains(&path.as_str());
        found.extend(
            paths
                .into_iter()
                .filter(is_path)
                .map(|path| (command.clone(), path.trim_end_matches("...").to_string())),
        );
    }
    let table = PATHS
        .iter()
        .map(|(command, path, _)| ((*command).to_string(), (*path).to_string()));
    assert_eq!(found, table.collect());
    let cases = cases();
    for (command, path, role) in PATHS {
        let has_case = cases.iter().any(|case| case.of == (*command, *path));
        // tests/cli/pty.rs has those of pseudo-terminals: links to devices, no files.
        let is_link = *command == "pty";
        assert_eq!(has_case || is_link, *role == Output, "{command} {path}");
    }
}

#[test]
fn files_of_other_programs_are_replaced_by_force_only() {
    for case in cases() {
        let (here, file) = case.prepared();
        std::fs::write(&file, "mine").unwrap();
        let (code, text) = say(here.path(), &case.words);
        let words = &case.words;
        let says = match case.is_recognised {
            true => "did not make",
            false => "exists already; element sets, camera files and CAN logs",
        };
        assert_eq!(code, Some(1), "{words}: {text}");
        assert!(
            text.contains(says) && text.contains("--force"),
            "{words}: {text}"
        );
        assert_eq!(std::fs::read(&file).unwrap(), b"mine", "{words}");
        let (_, text) = say(here.path(), &format!("{words} --force"));
        assert!(!text.contains("--force"), "{words}: {text}");
        let replaced = std::fs::read(&file);
        // A ready file is removed at the end.
        assert!(replaced.is_err() || replaced.unwrap() != b"mine", "{words}");
        let (_, text) = say(here.path(), words);
        assert_eq!(
            text.contains("--force"),
            !case.is_recognised,
            "{words}: {text}"
        );
    }
}

/// Files that a command writes beside the one that its case names.
#[test]
fn files_beside_the_named_one_are_replaced_by_force_only_too() {
    // Element sets have no room for a mark: those of a population go by its own.
    let is_marked = |name: &str| {
        [".png", ".fits", ".csv", ".jsonl", ".1"]
            .iter()
            .any(|end| name.ends_with(end))
    };
    let mut seen = BTreeSet::new();
    for case in cases().iter().filter(|case| case.file.starts_with("o/")) {
        let (here, words) = (folder(), &case.words);
        let (code, text) = say(here.path(), words);
        assert_eq!(code, Some(0), "{words}: {text}");
        let out = here.path().join("o");
        for name in crate::names(&out)
            .iter()
            .filter(|name| is_marked(name))
            .take(6)
        {
            let earlier = std::fs::read(out.join(name)).unwrap();
            std::fs::write(out.join(name), "mine").unwrap();
            let (code, text) = say(here.path(), words);
            assert!(
                code == Some(1) && text.contains("did not make"),
                "{words}: {name}: {text}"
            );
            assert_eq!(
                std::fs::read(out.join(name)).unwrap(),
                b"mine",
                "{words}: {name}"
            );
            std::fs::write(out.join(name), earlier).unwrap();
            seen.insert(name.clone());
        }
    }
    for name in [
        "frame_00000.png",
        "frame_00000_preview.png",
        "contact_sheet.png",
        "lightcurve.csv",
        "lightcurve.png",
        "cost.png",
    ] {
        assert!(seen.contains(name), "{name} is not among {seen:?}");
    }
}

#[test]
fn pipes_that_nothing_reads_do_not_hold_a_command_up() {
    for case in cases() {
        let (here, file) = case.prepared();
        let made = Command::new("mkfifo").arg(&file).status();
        assert!(made.unwrap().success());
        let (words, begin) = (&case.words, Instant::now());
        let (code, text) = say(here.path(), words);
        assert_eq!(code, Some(1), "{words}: {text}");
        let says = [
            "no program reads this pipe",
            "did not make",
            "no regular file",
            "of no population",
        ];
        assert!(
            says.iter().any(|says| text.contains(says)),
            "{words}: {text}"
        );
        assert!(begin.elapsed() < Duration::from_secs(8), "{words}");
    }
}

#[test]
fn devices_and_standard_output_are_written() {
    let here = folder();
    for words in [
        "loopback --frames 1 --out p --junit /dev/null --capture /dev/null --fault-log /dev/null",
        "catalog convert sets.csv --to omm-csv --out /dev/null",
        "catalog convert sets.csv --to omm-csv --out /dev/stdout",
        "catalog convert sets.csv --to omm-csv --out -",
    ] {
        let (code, text) = say(here.path(), words);
        assert_eq!(code, Some(0), "{words}: {text}");
        let is_printed = text.contains("2026-101A");
        assert_eq!(is_printed, !words.contains("null"), "{words}: {text}");
    }
    let (code, text) = say(here.path(), "loopback --frames 1 --out p --junit -");
    assert!(code == Some(1) && text.contains("/dev/stdout"), "{text}");
    assert!(!here.path().join("-").exists());
}

/// A run that fails before it has measured anything.
#[test]
fn verdicts_of_a_run_that_fails_early_have_its_error_and_the_checks() {
    let here = folder();
    let at = here.path();
    std::fs::write(at.join("bad.toml"), "seed = -1\n").unwrap();
    for (words, file, says) in [
        (
            "loopback --scene bad.toml --max-missed 3 --junit x",
            "x",
            &[
                "seed",
                "<testcase name=\"missed\"",
                "missed: not checked, the run failed",
            ][..],
        ),
        (
            "loopback --link pigeon --max-latency-p99-ms 3 --junit x",
            "x",
            &["pigeon", "<testcase name=\"p99\""],
        ),
        (
            "soak --config bad.toml --max-p99-ms 9 --junit x --json y",
            "x",
            &[
                "seed",
                "<testcase name=\"deadlines\"",
                "<testcase name=\"p99\"",
            ],
        ),
        (
            "soak --config bad.toml --max-p99-ms 9 --junit x --json y",
            "y",
            &["\"error\": ", "seed", "\"passed\": false"],
        ),
    ] {
        let (code, text) = say(at, words);
        assert_eq!(code, Some(1), "{words}: {text}");
        let written = std::fs::read_to_string(at.join(file)).unwrap();
        for part in says {
            assert!(written.contains(part), "{words}: no {part:?} in {written}");
        }
    }
}
