//! Option names, exit codes and the metrics of a live run.

use super::{assert_unchanged, output_of, repository, skyloop};
use std::collections::BTreeSet;
use std::fmt::Write;
use std::io::{Read, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};

/// The script of completions has a block for each command with its options and subcommands.
#[test]
fn names_of_options_and_commands_are_unchanged() {
    let here = tempfile::tempdir().unwrap();
    let script = output_of(here.path(), "completions bash");
    let mut all = String::new();
    let mut lines = script.lines().map(str::trim);
    while let Some(line) = lines.next() {
        let Some(command) = line
            .strip_suffix(')')
            .filter(|name| name.starts_with("skyloop"))
        else {
            continue;
        };
        let next = lines.next().unwrap_or_default();
        let Some(options) = next.strip_prefix("opts=\"") else {
            continue;
        };
        let command = command.replace("__subcmd__", " ");
        // `catalog convert` was removed.
        if command
            .split(' ')
            .any(|word| word == "help" || word == "convert")
        {
            continue;
        }
        let mut options: Vec<&str> = options.trim_end_matches('"').split(' ').collect();
        options.retain(|option| *option != "convert");
        options.sort_unstable();
        writeln!(all, "{command}: {}", options.join(" ")).unwrap();
    }
    assert_unchanged("options", &all);
}

/// A scene of one small frame, without an observer.
const SCENE: &str = r#"camera = "fai-nir"
[sequence]
epoch = "2026-06-01T00:00:00Z"
frames = 1
period_s = 1.0
attitudes = [{ q = [0.0, 0.0, 0.0, 1.0] }]
"#;

fn inputs(at: &Path) {
    let write = |name: &str, text: &str| std::fs::write(at.join(name), text).unwrap();
    let orbits = std::fs::read_to_string(repository("configs/scenes/leo-570.tle")).unwrap();
    write("leo.tle", &orbits);
    write("damaged.tle", &orbits.replacen("99001", "99002", 1));
    write("empty.tle", "");
    write("scene.toml", SCENE);
    write("unknown-key.toml", &SCENE.replace("camera", "kamera"));
    write("no-toml.toml", "camera = [");
    write("no-sequence.toml", "camera = \"fai-nir\"\n");
    write(
        "run.toml",
        "camera = \"fai-nir\"\n[run]\nlink = \"udp://127.0.0.1:0\"\n",
    );
    write(
        "stepped.toml",
        &format!("{SCENE}[run]\nlink = \"udp://127.0.0.1:0\"\n"),
    );
    let period = "[run]\nclock = \"wall\"\n";
    write(
        "soak.toml",
        &format!("{}{period}", SCENE.replace("1.0\n", "0.1\n")),
    );
    write("notes.txt", "not skyloop's\n");
    write("recording.pcapng", "no recording");
}

/// Each line of `exit_codes.txt` has an exit code and arguments. A line uses the files of the lines
/// before it.
#[test]
fn exit_codes_are_unchanged() {
    let here = tempfile::tempdir().unwrap();
    inputs(here.path());
    let table = std::fs::read_to_string(repository("tests/contract/exit_codes.txt")).unwrap();
    let table = table.replace("REPOSITORY", repository("").to_str().unwrap());
    let mut wrong = String::new();
    for row in table.lines().filter(|row| !row.starts_with('#')) {
        let (code, arguments) = row.split_once(' ').unwrap();
        let output = skyloop(here.path())
            .args(arguments.split_whitespace())
            .output()
            .unwrap();
        let ended = output.status.code().unwrap();
        let log = String::from_utf8_lossy(&output.stderr);
        // Errors are printed on standard error.
        if ended.to_string() != code || (ended != 0 && log.trim().is_empty()) {
            writeln!(
                wrong,
                "{code} expected, {ended}: skyloop {arguments}\n{log}"
            )
            .unwrap();
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// A process that is killed at the end of the test.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The page of metrics, or `None` before the port is open.
fn page(address: SocketAddr) -> Option<String> {
    let mut stream = TcpStream::connect(address).ok()?;
    let request = b"GET /metrics HTTP/1.1\r\nHost: here\r\n\r\n";
    stream.write_all(request).ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    let (head, page) = answer.split_once("\r\n\r\n")?;
    head.starts_with("HTTP/1.1 200").then(|| page.to_string())
}

/// Names and types of metrics, and each sample's labels, without the values of addresses and
/// versions. Withheld frames depend on the machine: `tests/wire/withheld.rs` tests their metric.
fn described(page: &str, found: &mut BTreeSet<String>) {
    for line in page.lines().filter(|line| !line.contains("withheld")) {
        if let Some(kind) = line.strip_prefix("# TYPE ") {
            found.insert(format!("type {kind}"));
        } else if !line.starts_with('#') {
            let (sample, _) = line.rsplit_once(' ').unwrap();
            let (name, labels) = sample.split_once('{').unwrap_or((sample, "}"));
            let labels = labels.trim_end_matches('}').split(',');
            let labels = labels.map(|label| match label.split_once('=') {
                Some((key @ ("link" | "version"), _)) => format!("{key}=..."),
                _ => label.to_string(),
            });
            found.insert(format!("{name} {}", labels.collect::<Vec<_>>().join(" ")));
        }
    }
}

/// Runs `skyloop` until its page of metrics has a sample.
fn metrics(at: &Path, arguments: &str, sample: &str, found: &mut BTreeSet<String>) {
    let free = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = free.local_addr().unwrap();
    drop(free);
    let mut command = skyloop(at);
    command.args(arguments.split_whitespace());
    command.args(["--metrics", &address.to_string()]);
    command.stdout(std::process::Stdio::null());
    let _running = Ended(command.spawn().unwrap());
    let begun = Instant::now();
    loop {
        let page = page(address).filter(|page| page.contains(sample));
        if let Some(page) = page {
            return described(&page, found);
        }
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "skyloop {arguments}: no {sample}"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

#[test]
fn names_types_and_labels_of_metrics_are_unchanged() {
    let here = tempfile::tempdir().unwrap();
    inputs(here.path());
    let mut found = BTreeSet::new();
    let soak = "soak --config soak.toml --minutes 1 --max-miss-rate 1";
    metrics(
        here.path(),
        soak,
        "skyloop_deadline_spare_seconds",
        &mut found,
    );
    let first = "--link udp://127.0.0.1:0";
    let run = format!("run --config stepped.toml {first} {first}?roles=pixels");
    metrics(here.path(), &run, "link=\"", &mut found);
    let all: String = found.iter().map(|line| format!("{line}\n")).collect();
    assert_unchanged("metrics", &all);
}
