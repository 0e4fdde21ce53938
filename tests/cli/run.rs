//! `skyloop run`: a process of its own, a client, and the signal that ends it.
#![cfg(unix)]

use crate::support::client::Client;
use crate::support::line::{Line, PtyLine, UdpLine};
use crate::support::{PATIENCE, await_that};
use crate::{repository, skyloop};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};

/// The emulator as a process, listening.
pub struct Process {
    child: Child,
    stdout: BufReader<ChildStdout>,
    /// Where it listens.
    pub address: String,
}

impl Process {
    fn start(flags: &[&str]) -> Process {
        let config = repository("configs/run.toml");
        let run = ["run", "--config", &config];
        Process::of(&[&run, flags].concat(), "listening on ")
    }

    /// Listening on a free UDP port, started by another program.
    fn started_by(program: &[&str]) -> Process {
        let config = repository("configs/run.toml");
        let mut command = Command::new(program[0]);
        command
            .args(&program[1..])
            .arg(env!("CARGO_BIN_EXE_skyloop"));
        command.args(["run", "--config", &config, "--link", "udp://127.0.0.1:0"]);
        Process::spawned(&mut command, "listening on ")
    }

    /// `skyloop` once it has printed a line that begins so; behind that stands its address.
    pub fn of(flags: &[&str], begin: &str) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
        Process::spawned(command.args(flags), begin)
    }

    /// Likewise of a command that runs it.
    pub fn spawned(command: &mut Command, begin: &str) -> Process {
        let mut child = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        while !line.starts_with(begin) {
            line.clear();
            assert!(
                stdout.read_line(&mut line).unwrap() > 0,
                "it ends before it listens"
            );
        }
        let address = line[begin.len()..].split(';').next().unwrap().to_string();
        Process {
            child,
            stdout,
            address,
        }
    }

    /// Its number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        assert!(
            Command::new("kill")
                .args([name, &id])
                .status()
                .unwrap()
                .success()
        );
    }

    /// The next line that it prints.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        line
    }

    /// Likewise, and what it logged, where that is kept.
    pub fn end_with_log(mut self) -> (Option<i32>, String, String) {
        let mut stderr = self.child.stderr.take().unwrap();
        let (code, table) = self.end();
        let mut log = String::new();
        stderr.read_to_string(&mut log).unwrap();
        (code, table, log)
    }

    /// Exit code and the rest of what it printed.
    pub fn end(mut self) -> (Option<i32>, String) {
        await_that("the process ends", || {
            std::thread::sleep(std::time::Duration::from_millis(5));
            self.child.try_wait().unwrap().is_some()
        });
        let mut table = String::new();
        self.stdout.read_to_string(&mut table).unwrap();
        (self.child.wait().unwrap().code(), table)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Two frames and a refusal, then `signal`: exit code 0 and the table.
pub fn serves_until(signal: &str, process: Process, line: impl Line) {
    let mut client = Client::new(line);
    client.good_frame(1);
    client.good_frame(2);
    client.line.send(b"not a packet");
    client.nack();
    process.signal(signal);
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    for row in [
        "frames                       2",
        "render time p50 / p99 / max",
        "stars labelled",
        "RSOs labelled",
        "to the last octet",
        "attitudes 2",
        "frames_delivered 2",
        "runts 1",
    ] {
        assert!(table.contains(row), "no {row:?} in\n{table}");
    }
}

#[test]
fn a_client_over_udp_is_served_until_ctrl_c() {
    let process = Process::start(&["--link", "udp://127.0.0.1:0"]);
    let line = UdpLine::to(&process.address);
    serves_until("-INT", process, line);
}

#[test]
fn a_client_over_a_serial_line_is_served_until_it_is_told_to_end() {
    let (line, device) = PtyLine::new();
    let process = Process::start(&["--link", &format!("serial://{device}?baud=921600")]);
    assert!(process.address.contains(&device));
    serves_until("-TERM", process, line);
}

#[test]
fn each_signal_to_end_ends_a_run_that_never_had_a_client() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let process = Process::started_by(&["env", "--default-signal=HUP"]);
        process.signal(signal);
        let (code, table) = process.end();
        assert_eq!(code, Some(0), "{signal}: {table}");
        assert!(table.contains("all 0"), "{signal}: {table}");
    }
}

#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let process = Process::started_by(&["nohup"]);
    let mut client = Client::new(UdpLine::to(&process.address));
    process.signal("-HUP");
    // It still serves after the signal.
    client.good_frame(1);
    process.signal("-TERM");
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    assert!(table.contains("frames_delivered 1"), "{table}");
}

#[test]
fn the_last_frame_of_a_limited_run_arrives_whole() {
    let process = Process::start(&["--link", "udp://127.0.0.1:0", "--frames", "2"]);
    let mut client = Client::new(UdpLine::to(&process.address));
    client.good_frame(1);
    client.good_frame(2);
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    assert!(client.line.recv(PATIENCE / 1000).is_none());
}

#[test]
fn a_serial_client_that_reads_late_still_gets_the_last_frame() {
    let (line, device) = PtyLine::new();
    let link = format!("serial://{device}?baud=921600");
    let process = Process::start(&["--link", &link, "--frames", "1"]);
    let mut client = Client::new(line);
    assert_eq!(client.good_frame(1).header.frame, 0);
    assert_eq!(process.end().0, Some(0));
}

#[test]
fn steps_that_make_nothing_coarser_and_delays_that_no_deadline_allows_are_warned_of() {
    let here = tempfile::tempdir().unwrap();
    // Nothing fits a link so slow: the run ends before it waits for a client.
    let warned = |keys: &str| {
        let text = format!(
            "fidelity = \"fast\"\n[run]\nclock = \"wall\"\nlink = \"udp://127.0.0.1:0?rate_mbit=0.01\"\n{keys}"
        );
        std::fs::write(here.path().join("run.toml"), text).unwrap();
        let run = ["run", "--config", "run.toml"];
        let output = skyloop(here.path()).args(run).output().unwrap();
        let log = String::from_utf8(output.stderr).unwrap();
        assert!(log.contains("at most"), "{log}");
        let lines = log.lines().filter(|line| line.contains("WARN"));
        let warned: Vec<String> = lines.map(str::to_string).collect();
        warned
    };
    let coarsen = |steps: &str| warned(&format!("on_overrun = \"coarsen\"\n{steps}"));
    let [passed, late] = &coarsen("")[..] else {
        panic!("two warnings");
    };
    assert!(
        passed.contains("run.coarsen: \"fast\" makes nothing coarser"),
        "{passed}"
    );
    assert!(
        late.contains("none of `run.coarsen`") && late.contains("wing_e = 1"),
        "{late}"
    );
    let [passed] = &coarsen("coarsen = [\"wing_e = 0.5\", \"wing_e = 0.1\"]")[..] else {
        panic!("one warning");
    };
    assert!(passed.contains("\"wing_e = 0.1\""), "{passed}");
    assert!(coarsen("coarsen = [\"wing_e = 0.5\"]").is_empty());
    // X-Val: the built-in camera has 1 s from frame to frame (configs/cameras/fai-nir.toml).
    let [delayed] = &warned("delay_s = 1.5")[..] else {
        panic!("one warning");
    };
    assert!(
        delayed.contains("run.delay_s = 1.5") && delayed.contains("set run.latency_s"),
        "{delayed}"
    );
    assert!(warned("delay_s = 1.5\nlatency_s = 1.6").is_empty());
    assert!(
        warned("").is_empty(),
        "frames come late, and nobody asked for more"
    );
}

/// What has no meaning in step is told of, of a further camera with its name.
#[test]
fn what_the_stepped_clock_makes_nothing_of_is_warned_of() {
    let here = tempfile::tempdir().unwrap();
    let link = "link = \"udp://127.0.0.1:0\"";
    let text = format!(
        "[run]\n{link}\ndelay_s = 0.1\nlatency_s = 0.2\non_overrun = \"drop\"\n\
         [[heads]]\nname = \"port side\"\ncamera = \"fai-nir\"\nrate_hz = 0.5\n{link}\n"
    );
    std::fs::write(here.path().join("run.toml"), text).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
    let command = command.current_dir(here.path()).stderr(Stdio::piped());
    let command = command.args(["run", "--config", "run.toml"]);
    let process = Process::spawned(command, "listening on ");
    process.signal("-INT");
    let (code, _, log) = process.end_with_log();
    assert_eq!(code, Some(0), "{log}");
    let lines: Vec<&str> = log.lines().filter(|line| line.contains("WARN")).collect();
    let [own, of_head] = lines[..] else {
        panic!("two warnings: {log}");
    };
    let named = "run.delay_s, run.latency_s, run.on_overrun: ";
    assert!(own.contains(named) && !own.contains("head"), "{log}");
    let named = "head{name=\"port side\"}: rate_hz = 0.5: ";
    assert!(of_head.contains(named), "{log}");
}

/// Two cameras in one process: one client points both, each brings its frames to its own.
#[test]
fn a_run_with_a_further_camera_serves_both_and_tells_of_both() {
    let here = tempfile::tempdir().unwrap();
    crate::soak::files(
        here.path(),
        "link = \"udp://127.0.0.1:0\"\n[[heads]]\nname = \"port side\"\ncamera = \"camera.toml\"\nlink = \"udp://127.0.0.1:0\"",
    );
    let config = here.path().join("run.toml").display().to_string();
    let mut process = Process::of(&["run", "--config", &config], "listening on ");
    let head = process.line();
    let (told, at) = head.trim_end().rsplit_once(", ").unwrap();
    assert!(
        told.starts_with("head port side: ") && told.ends_with(", a frame for each attitude"),
        "{head}"
    );
    let mut first = Client::new(UdpLine::to(&process.address));
    let mut second = Client::new(UdpLine::to(at));
    // A client is there when it has said something.
    second.status();
    for sequence in 1..3 {
        let a = first.good_frame(sequence);
        let b = second.frame();
        assert_eq!(
            (b.header.frame, b.header.attitude_sequence, b.time),
            (sequence - 1, sequence, a.time)
        );
        assert_ne!(a.header.seed, b.header.seed);
    }
    process.signal("-INT");
    let (code, table) = process.end();
    assert_eq!(code, Some(0), "{table}");
    let (own, other) = table.split_once("\nhead port side\n").unwrap();
    for one in [own, other] {
        assert!(one.contains("frames                       2"), "{table}");
        assert!(one.contains("frames_delivered 2"), "{table}");
    }
}

/// Help that is granted is that of the threads that render, whatever was read with them before.
#[cfg(target_os = "linux")]
#[test]
fn processors_that_are_granted_are_those_of_all_threads() {
    let own = std::fs::read_to_string("/proc/self/status").unwrap();
    let allowed = |status: &str| {
        let line = status
            .lines()
            .find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
        line.unwrap().trim().to_string()
    };
    let list = allowed(&own);
    let last = list.rsplit([',', '-']).next().unwrap();
    let here = tempfile::tempdir().unwrap();
    let orbit = concat!(env!("CARGO_MANIFEST_DIR"), "/configs/scenes/leo-570.tle");
    let config = here.path().join("run.toml");
    let text = format!(
        "[observer]\norbit = {orbit:?}\n[run]\nlink = \"udp://127.0.0.1:0\"\ncpus = [{last}]\n"
    );
    std::fs::write(&config, text).unwrap();
    let process = Process::of(
        &["run", "--config", &config.display().to_string()],
        "listening on ",
    );
    let threads = std::fs::read_dir(format!("/proc/{}/task", process.id())).unwrap();
    let mut count = 0;
    for thread in threads {
        let folder = thread.unwrap().path();
        // One that ends meanwhile is none.
        let Ok(status) = std::fs::read_to_string(folder.join("status")) else {
            continue;
        };
        assert_eq!(allowed(&status), last, "{status}");
        count += 1;
    }
    assert!(count > 1, "{count} threads");
    process.signal("-INT");
    assert_eq!(process.end().0, Some(0));
}

/// The examples of README.md and of `--help` with several links.
#[test]
fn examples_with_several_links_have_their_roles() {
    let here = tempfile::tempdir().unwrap();
    let help = skyloop(here.path()).args(["run", "--help"]).output();
    let help = String::from_utf8(help.unwrap().stdout).unwrap();
    let readme = std::fs::read_to_string(crate::repository("README.md")).unwrap();
    let mut examples = 0;
    for line in readme.lines().chain(help.lines()) {
        let urls = line.split("--link '").skip(1);
        let urls = urls.filter_map(|rest| Some(rest.split_once('\'')?.0.to_string()));
        let urls: Vec<String> = urls.collect();
        if urls.len() > 1 {
            examples += 1;
            let checked = skyloop::link::check_all(&urls);
            assert!(checked.is_ok(), "{line}: {}", checked.unwrap_err());
        }
    }
    assert_eq!(examples, 2);
}
