//! All outputs of commands follow one rule, and the table of them is complete.
#![cfg(unix)]

use crate::support::always;
use crate::{EPOCH, Folder, has};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};

/// Every option and argument with a path: command, inputs, outputs.
const PATHS: &str = "
    loopback        | --scene --faults                 | --out --junit --fault-log --capture
    run             | --config --faults                | --ready-file --fault-log --capture
    soak            | --config                         | --junit --json
    render          | --scene --camera --orbit --rso   | --out
    plan            | --scene --camera                 |
    cost            | --scene                          | --out
    passes          | --scene --orbit                  |
    lightcurve      | --scene                          | --out
    catalog check   | <FILE>                           |
    catalog info    | <FILE>                           |
    catalog synth   |                                  | --out
    camera check    | <NAME|FILE>                      |
    camera new      |                                  | <FILE>
    pty             |                                  | <PATH_A> <PATH_B>
    replay          | <FILE> --config --scene          |
    man             |                                  | [DIR]";

/// Each command with its inputs and outputs.
fn paths() -> impl Iterator<Item = (&'static str, [Vec<&'static str>; 2])> {
    let lines = PATHS.lines().filter(|line| !line.is_empty());
    lines.map(|line| {
        let columns: Vec<&str> = line.splitn(3, " |").collect();
        let [command, inputs, outputs] = columns[..] else {
            panic!("three columns: {line}");
        };
        let paths = [inputs, outputs].map(|paths| paths.split_whitespace().collect());
        (command.trim(), paths)
    })
}

/// A command that writes one of its outputs, and the file of the output.
struct Case {
    command: String,
    option: String,
    words: String,
    file: String,
    /// Whether an earlier file of skyloop is replaced without --force.
    is_recognised: bool,
}

impl Case {
    /// A folder with its inputs, and a folder for its file, which does not exist yet.
    fn folder(&self) -> Folder {
        let here = folder();
        std::fs::create_dir_all(here.join(&self.file).parent().unwrap()).unwrap();
        here
    }
}

fn cases() -> Vec<Case> {
    let loopback = "loopback --frames 1 --out p";
    let run = "run --config run.toml --timeout 0.1";
    let soak = "soak --config soak.toml --minutes 0.005";
    let figures =
        "--size 64x64 --pixel 5 --focal 20deg --aperture f/1.4 --exposure 0.2 --full-well 12000";
    let render = crate::render("");
    let table = format!(
        "loopback        | --out        | o/labels.jsonl     | loopback --frames 1 --out o
         loopback        | --junit      | x                  | {loopback} --junit x
         loopback        | --fault-log  | x  | {loopback} --faults faults.toml --fault-log x
         loopback        | --capture    | x                  | {loopback} --capture x
         run             | --ready-file | x                  | {run} --ready-file x
         run             | --fault-log  | x                  | {run} --fault-log x
         run             | --capture    | x                  | {run} --capture x
         soak            | --junit      | x                  | {soak} --junit x
         soak            | --json       | x                  | {soak} --json x
         render          | --out        | o/frame_00000.fits | {render}
         cost            | --out        | o/cost.csv         | cost --frames 1 --rounds 1 --out o
         lightcurve      | --out | o/lightcurve.svg | lightcurve --object RCM-1 --step 10 --out o
         catalog synth   | --out        | o/population.toml  | catalog synth --objects 20 --out o
         catalog synth   | --out        | x.csv          | catalog synth --objects 20 --out x.csv
         camera new      | <FILE>       | x.toml             | camera new x.toml {figures}
         man             | [DIR]        | o/skyloop-run.1    | man o"
    );
    let case = |(command, columns): (&str, Vec<&str>)| {
        let [option, file, words] = [0, 1, 2].map(|column: usize| columns[column].to_string());
        Case {
            command: command.to_string(),
            is_recognised: !["x.csv", "x.toml", "x.json"].contains(&file.as_str()),
            option,
            words,
            file,
        }
    };
    crate::rows(&table).into_iter().map(case).collect()
}

/// A folder with the inputs of the cases, and no output.
fn folder() -> Folder {
    let run = "[run]\nlink = \"udp://127.0.0.1:0\"\n";
    let soak = format!(
        "camera = \"cots-wide\"\n{run}clock = \"wall\"\noutput = \"labels\"\n[sequence]\nepoch = \"{EPOCH}\"\nframes = 1\nperiod_s = 1.0\n\
         radec = [0.0, 0.0, 0.0]\n"
    );
    let sets = format!("{}A,{}", crate::files::HEAD, crate::files::SET);
    let faults = always("out", "delay", 1.0) + "for_s = 0.01\n";
    Folder::with(&[
        ("run.toml", run),
        ("soak.toml", &soak),
        ("faults.toml", &faults),
        ("sets.csv", &sets),
    ])
}

/// From a command's help: its subcommands, and its options and arguments with a path.
fn listed(here: &Folder, command: &str) -> (Vec<String>, Vec<String>) {
    let help = here.run(&format!("{command} --help")).out;
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
                paths.push(name.trim_end_matches("...").to_string());
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
    // Arguments without a path: a shell, a kind of schema.
    paths.retain(|path| !["<SHELL>", "<KIND>", "[COMMAND]"].contains(&path.as_str()));
    (subcommands, paths)
}

#[test]
fn every_path_of_the_command_line_is_in_the_table_and_every_output_has_a_case() {
    let here = Folder::new();
    let (mut found, mut commands) = (BTreeSet::new(), vec![String::new()]);
    while let Some(command) = commands.pop() {
        let (subcommands, paths) = listed(&here, &command);
        let below = subcommands.iter().map(|name| format!("{command} {name}"));
        commands.extend(below.map(|command| command.trim().to_string()));
        found.extend(paths.into_iter().map(|path| (command.clone(), path)));
    }
    let owned = |command: &str, path: &str| (command.to_string(), path.to_string());
    let table = paths().flat_map(|(command, paths)| {
        let paths = paths.concat().into_iter();
        paths.map(move |path| owned(command, path))
    });
    assert_eq!(found, table.collect());
    let cases = cases().into_iter();
    let of_cases: BTreeSet<_> = cases.map(|case| (case.command, case.option)).collect();
    // tests/cli/pty.rs tests pseudo-terminals, which are links to devices.
    let written = paths().filter(|(command, _)| *command != "pty");
    let outputs = written.flat_map(|(command, [_, outputs])| {
        let outputs = outputs.into_iter();
        outputs.map(move |path| owned(command, path))
    });
    assert_eq!(of_cases, outputs.collect());
}

#[test]
fn foreign_files_are_replaced_only_with_force() {
    for case in cases() {
        let (here, words) = (case.folder(), &case.words);
        here.write(&case.file, "mine");
        let says = if case.is_recognised {
            "did not make"
        } else {
            "exists already: name another file"
        };
        here.run(words).exits(1).says(&[says, "--force"]);
        assert_eq!(here.read(&case.file), "mine", "{words}");
        let is_alone = !case.file.starts_with("o/") || here.names("o").len() == 1;
        assert!(is_alone, "{words}: others are written");
        here.run(&format!("{words} --force")).lacks("--force");
        let replaced = std::fs::read(here.join(&case.file));
        // A ready file is removed at the end of the run.
        assert!(replaced.is_err() || replaced.unwrap() != b"mine", "{words}");
        let again = here.run(words).all();
        let is_refused = again.replace(words, "").contains("--force");
        assert_eq!(is_refused, !case.is_recognised, "{again}");
    }
}

/// Further files that a command writes in the folder of the named one.
#[test]
fn further_output_files_are_replaced_only_with_force() {
    // Element sets have no room for a mark; the mark of their population applies.
    let is_marked = |name: &&String| {
        let marked = [".png", ".svg", ".fits", ".csv", ".jsonl", ".1"];
        marked.iter().any(|end| name.ends_with(end))
    };
    let mut seen = BTreeSet::new();
    for case in cases().iter().filter(|case| case.file.starts_with("o/")) {
        let (here, words) = (folder(), &case.words);
        here.run(words).exits(0);
        for name in here.names("o").iter().filter(is_marked).take(6) {
            let file = format!("o/{name}");
            let earlier = std::fs::read(here.join(&file)).unwrap();
            here.write(&file, "mine");
            here.run(words).exits(1).says(&["did not make"]);
            assert_eq!(here.read(&file), "mine", "{words}: {name}");
            here.write(&file, earlier);
            seen.insert(name.clone());
        }
    }
    let frames = [
        "frame_00000.png",
        "frame_00000_preview.png",
        "contact_sheet.png",
    ];
    for name in [
        &frames[..],
        &["lightcurve.csv", "lightcurve.svg", "cost.svg"],
    ]
    .concat()
    {
        assert!(seen.contains(name), "{name} is not among {seen:?}");
    }
}

#[test]
fn unread_pipes_do_not_block_a_command() {
    for case in cases() {
        let here = case.folder();
        here.pipe(&case.file);
        let begin = Instant::now();
        let refused = here.run(&case.words).exits(1);
        let says = [
            "no program reads this pipe",
            "did not make",
            "no regular file",
            "of no population",
        ];
        let all = refused.all();
        assert!(says.iter().any(|says| all.contains(says)), "{all}");
        assert!(begin.elapsed() < Duration::from_secs(8), "{all}");
    }
}

#[test]
fn devices_and_standard_output_are_written() {
    let here = folder();
    for words in [
        "loopback --frames 1 --out p --junit /dev/null --capture /dev/null --fault-log /dev/null",
        "soak --config soak.toml --minutes 0.05 --max-miss-rate 1 --json /dev/stdout",
        "camera new - --size 64x64 --pixel 5 --focal 20deg --aperture f/1.4 --exposure 0.2 --full-well 12000",
    ] {
        let ended = here.run(words).exits(0);
        let is_printed =
            ended.out.contains("\"first_frame_s\"") || ended.out.contains("width_px = 64");
        assert_eq!(is_printed, !words.contains("null"), "{}", ended.all());
    }
    let refused = here.run("loopback --frames 1 --out p --junit -");
    refused.exits(1).says(&["/dev/stdout"]);
    assert!(!here.join("-").exists());
}

/// A run that fails before its first measurement: its file `x`, and the texts of the file.
#[test]
fn verdicts_of_an_early_failure_have_the_error_and_the_checks() {
    for (words, says) in crate::rows(
        "loopback --scene bad.toml --max-missed 3 --junit x
         | seed | <testcase name=\"missed\" | missed: not checked, the run failed
         loopback --link pigeon --max-latency-p99-ms 3 --junit x
         | pigeon | <testcase name=\"p99\"
         soak --config bad.toml --max-p99-ms 9 --junit x
         | seed | <testcase name=\"deadlines\" | <testcase name=\"p99\"
         soak --config bad.toml --max-p99-ms 9 --json x
         | \"error\": | seed | \"passed\": false",
    ) {
        let here = folder();
        here.write("bad.toml", "seed = -1\n");
        here.run(words).exits(1);
        has(&here.read("x"), &says);
    }
}
