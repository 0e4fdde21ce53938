//! `skyloop run`: a process, a client, and the signal that ends it.
#![cfg(unix)]

use crate::support::client::Client;
use crate::support::line::{Line, PtyLine, UdpLine};
use crate::support::{TIMEOUT, await_that};
use crate::{Folder, Outcome, has, repository, rows};
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::thread::JoinHandle;

/// The program while it runs.
pub struct Process {
    child: Child,
    stdout: BufReader<ChildStdout>,
    log: Option<JoinHandle<String>>,
    /// The address where it listens.
    pub address: String,
}

impl Process {
    /// A listening `skyloop` in a folder. `words` are its arguments, separated by blanks.
    pub fn listening(here: &Folder, words: &str) -> Process {
        Process::printing(here, words, "listening on ")
    }

    /// `skyloop` after a printed line that starts with `begin`, followed by its address.
    pub fn printing(here: &Folder, words: &str, begin: &str) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
        let command = command.args(words.split_whitespace());
        Process::spawned(command.current_dir(here), begin)
    }

    /// The repository's run file with these flags.
    fn of_repository(flags: &str) -> Process {
        let mut command = Command::new(env!("CARGO_BIN_EXE_skyloop"));
        command.args(["run", "--config", &repository("configs/run.toml")]);
        Process::spawned(command.args(flags.split_whitespace()), "listening on ")
    }

    /// Likewise on a free UDP port, started by another program.
    fn started_by(program: &[&str]) -> Process {
        let config = repository("configs/run.toml");
        let mut command = Command::new(program[0]);
        let command = command
            .args(&program[1..])
            .arg(env!("CARGO_BIN_EXE_skyloop"));
        command.args(["run", "--config", &config, "--link", "udp://127.0.0.1:0"]);
        Process::spawned(command, "listening on ")
    }

    /// A command that runs `skyloop`, after a printed line that starts with `begin`; at once, if
    /// `begin` is empty.
    pub fn spawned(command: &mut Command, begin: &str) -> Process {
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut stdout = BufReader::new(child.stdout.take().unwrap());
        let mut stderr = child.stderr.take().unwrap();
        let log = std::thread::spawn(move || {
            let mut log = String::new();
            let _ = stderr.read_to_string(&mut log);
            log
        });
        let mut line = String::new();
        while !begin.is_empty() && !line.starts_with(begin) {
            line.clear();
            let length = stdout.read_line(&mut line).unwrap();
            assert!(length > 0, "it ends before it listens");
        }
        let address = line[begin.len()..].split(';').next().unwrap().to_string();
        Process {
            child,
            stdout,
            log: Some(log),
            address,
        }
    }

    /// The process identifier.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    pub fn udp_client(&self) -> Client<UdpLine> {
        Client::new(UdpLine::to(&self.address))
    }

    pub fn signal(&self, name: &str) {
        let id = self.child.id().to_string();
        let sent = Command::new("kill").args([name, &id]).status();
        assert!(sent.unwrap().success());
    }

    /// The next printed line.
    fn line(&mut self) -> String {
        let mut line = String::new();
        self.stdout.read_line(&mut line).unwrap();
        line
    }

    /// Awaits its end and returns its outputs since the start.
    pub fn end(mut self) -> Outcome {
        await_that("the process ends", || {
            std::thread::sleep(std::time::Duration::from_millis(5));
            self.child.try_wait().unwrap().is_some()
        });
        let mut table = Vec::new();
        self.stdout.read_to_end(&mut table).unwrap();
        let output = std::process::Output {
            status: self.child.wait().unwrap(),
            stdout: table,
            stderr: self.log.take().unwrap().join().unwrap().into_bytes(),
        };
        Outcome::of(&self.address, output)
    }

    /// Ends it by a signal.
    pub fn end_by(self, signal: &str) -> Outcome {
        self.signal(signal);
        self.end()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Asserts two frames and a refusal, then after `signal` exit code 0 and the table.
pub fn serves_until(signal: &str, process: Process, line: impl Line) {
    let mut client = Client::new(line);
    client.good_frame(1);
    client.good_frame(2);
    client.line.send(b"not a packet");
    client.nack();
    process.end_by(signal).exits(0).prints(&[
        "frames                       2",
        "render time p50 / p99 / max",
        "stars labelled",
        "RSOs labelled",
        "to the last octet",
        "attitudes 2",
        "frames_delivered 2",
        "runts 1",
    ]);
}

#[test]
fn a_client_over_udp_is_served_until_ctrl_c() {
    let process = Process::of_repository("--link udp://127.0.0.1:0");
    let line = UdpLine::to(&process.address);
    serves_until("-INT", process, line);
}

#[test]
fn a_client_over_a_serial_line_is_served_until_sigterm() {
    let (line, device) = PtyLine::new();
    let process = Process::of_repository(&format!("--link serial://{device}?baud=921600"));
    assert!(process.address.contains(&device));
    serves_until("-TERM", process, line);
}

#[test]
fn each_termination_signal_ends_a_run_without_a_client() {
    for signal in ["-INT", "-TERM", "-HUP"] {
        let process = Process::started_by(&["env", "--default-signal=HUP"]);
        process.end_by(signal).exits(0).prints(&["all 0"]);
    }
}

#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let process = Process::started_by(&["nohup"]);
    let mut client = process.udp_client();
    process.signal("-HUP");
    // The run continues after the signal.
    client.good_frame(1);
    let ended = process.end_by("-TERM");
    ended.exits(0).prints(&["frames_delivered 1"]);
}

#[test]
fn the_last_frame_of_a_limited_run_arrives_whole() {
    let process = Process::of_repository("--link udp://127.0.0.1:0 --frames 2");
    let mut client = process.udp_client();
    client.good_frame(1);
    client.good_frame(2);
    process.end().exits(0);
    assert!(client.line.recv(TIMEOUT / 1000).is_none());
    // A serial client may read late.
    let (line, device) = PtyLine::new();
    let link = format!("serial://{device}?baud=921600");
    let process = Process::of_repository(&format!("--link {link} --frames 1"));
    let mut client = Client::new(line);
    assert_eq!(client.good_frame(1).header.frame, 0);
    process.end().exits(0);
}

#[test]
fn coarsen_without_effect_and_delays_beyond_deadlines_cause_warnings() {
    let here = Folder::new();
    // The frame period of the built-in camera is 1 s.
    for (keys, warnings) in rows(
        "on_overrun = \"coarsen\"
         | run.coarsen: \"fast\" makes nothing coarser | none of `run.coarsen` & wing_e = 1
         on_overrun = \"coarsen\"; coarsen = [\"wing_e = 0.5\", \"wing_e = 0.1\"] | \"wing_e = 0.1\"
         on_overrun = \"coarsen\"; coarsen = [\"wing_e = 0.5\"]
         delay_s = 1.5 | run.delay_s = 1.5 & set run.latency_s
         delay_s = 1.5; latency_s = 1.6
         idle_s = 5.0",
    ) {
        let keys = keys.replace("; ", "\n");
        // No frame fits a link so slow, so the run ends before it awaits a client.
        let run = "[run]\nclock = \"wall\"\nlink = \"udp://127.0.0.1:0?rate_mbit=0.01\"";
        here.write("run.toml", format!("fidelity = \"fast\"\n{run}\n{keys}"));
        let log = here.run("run --config run.toml").logs(&["at most"]).log;
        let warned: Vec<&str> = log.lines().filter(|line| line.contains("WARN")).collect();
        assert_eq!(warned.len(), warnings.len(), "{keys}: {log}");
        for (warned, words) in warned.iter().zip(warnings) {
            has(warned, &words.split(" & ").collect::<Vec<_>>());
        }
    }
}

/// Keys without effect in stepped mode are reported, for further cameras with their name.
#[test]
fn keys_without_effect_in_stepped_mode_cause_warnings() {
    let link = "link = \"udp://127.0.0.1:0\"";
    let text = format!(
        "[run]\n{link}\ndelay_s = 0.1\nlatency_s = 0.2\non_overrun = \"drop\"\n\
         [[heads]]\nname = \"port side\"\ncamera = \"fai-nir\"\nrate_hz = 0.5\n{link}\n"
    );
    let here = Folder::with(&[("run.toml", &text)]);
    let process = Process::listening(&here, "run --config run.toml");
    let log = process.end_by("-INT").exits(0).log;
    let lines: Vec<&str> = log.lines().filter(|line| line.contains("WARN")).collect();
    let [own, of_head] = lines[..] else {
        panic!("two warnings: {log}");
    };
    has(own, &["run.delay_s, run.latency_s, run.on_overrun: "]);
    assert!(!own.contains("head"), "{log}");
    has(of_head, &["head{name=\"port side\"}: rate_hz = 0.5: "]);
}

/// Two cameras in one process: one client points both, each camera sends frames to its own client.
#[test]
fn a_run_with_a_further_camera_serves_and_reports_both() {
    let here = crate::soak::files(
        "link = \"udp://127.0.0.1:0\"\n[[heads]]\nname = \"port side\"\ncamera = \"camera.toml\"\nlink = \"udp://127.0.0.1:0\"",
    );
    let mut process = Process::listening(&here, "run --config run.toml");
    let head = process.line();
    let (text, at) = head.trim_end().rsplit_once(", ").unwrap();
    let is_reported =
        text.starts_with("head port side: ") && text.ends_with(", a frame for each attitude");
    assert!(is_reported, "{head}");
    let mut first = process.udp_client();
    let mut second = Client::new(UdpLine::to(at));
    // A client is known after its first packet.
    second.status();
    for sequence in 1..3 {
        let a = first.good_frame(sequence);
        let b = second.frame();
        let numbers = (b.header.frame, b.header.attitude_sequence);
        assert_eq!(numbers, (sequence - 1, sequence));
        assert_eq!(b.time, a.time);
        assert_ne!(a.header.seed, b.header.seed);
    }
    let table = process.end_by("-INT").exits(0).out;
    let (own, other) = table.split_once("\nhead port side\n").unwrap();
    for one in [own, other] {
        has(
            one,
            &["frames                       2", "frames_delivered 2"],
        );
    }
}

/// The granted processors apply to all threads, even those started to read files.
#[cfg(target_os = "linux")]
#[test]
fn granted_processors_apply_to_all_threads() {
    let own = std::fs::read_to_string("/proc/self/status").unwrap();
    let allowed = |status: &str| {
        let mut lines = status.lines();
        let list = lines.find_map(|line| line.strip_prefix("Cpus_allowed_list:"));
        list.unwrap().trim().to_string()
    };
    let list = allowed(&own);
    let last = list.rsplit([',', '-']).next().unwrap();
    let orbit = repository("configs/scenes/leo-570.tle");
    let text = format!(
        "[observer]\norbit = {orbit:?}\n[run]\nlink = \"udp://127.0.0.1:0\"\ncpus = [{last}]\n"
    );
    let here = Folder::with(&[("run.toml", &text)]);
    let process = Process::listening(&here, "run --config run.toml");
    let threads = std::fs::read_dir(format!("/proc/{}/task", process.id())).unwrap();
    let mut count = 0;
    for thread in threads {
        // A thread that has ended has no status.
        let status = thread.unwrap().path().join("status");
        if let Ok(status) = std::fs::read_to_string(status) {
            assert_eq!(allowed(&status), last, "{status}");
            count += 1;
        }
    }
    assert!(count > 1, "{count} threads");
    process.end_by("-INT").exits(0);
}

/// The examples of `docs/how-to/links.md` and of `--help` with several links.
#[test]
fn examples_with_several_links_have_their_roles() {
    let help = Folder::new().run("run --help").out;
    let guide = crate::repository_text("docs/how-to/links.md");
    let mut examples = 0;
    for line in guide.lines().chain(help.lines()) {
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
