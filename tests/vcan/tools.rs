//! Tools of the guest: can-utils, `ip` and `tc`, with a test of ISO-TP between two of them.

use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

pub fn run(line: &str) -> String {
    let mut words = line.split_whitespace();
    let done = Command::new(words.next().unwrap())
        .args(words)
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{line}: {error}");
    String::from_utf8(done.stdout).unwrap()
}

pub fn cansend(interface: &str, frame: &str) {
    run(&format!("cansend {interface} {frame}"));
}

/// Sends frames in one process, because those of an attitude must not take a second.
pub fn canplayer(interface: &str, frames: &[&str]) {
    let lines = frames
        .iter()
        .map(|frame| format!("(0.000000) {interface} {frame}\n"));
    std::fs::write("frames.log", lines.collect::<String>()).unwrap();
    run("canplayer -t -I frames.log");
}

/// A tool that prints lines until it is dropped.
pub struct Listening {
    child: Child,
    lines: Receiver<String>,
}

impl Listening {
    pub fn start(line: &str) -> Listening {
        let mut words = line.split_whitespace();
        let mut child = Command::new(words.next().unwrap())
            .args(words)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        let (to_test, lines) = channel();
        std::thread::spawn(move || {
            output
                .lines()
                .map_while(Result::ok)
                .all(|line| to_test.send(line).is_ok())
        });
        // Until the tool is ready.
        std::thread::sleep(Duration::from_millis(500));
        Listening { child, lines }
    }

    /// `candump` in the format of its log files: time, interface, frame. Ready once it has received
    /// a frame.
    pub fn candump(interface: &str) -> Listening {
        let listening = Listening::start(&format!("candump -L {interface}"));
        for _ in 0..50 {
            cansend(interface, "7FF#");
            let seen = listening.lines.recv_timeout(Duration::from_millis(500));
            if seen.is_ok() {
                return listening;
            }
        }
        panic!("candump sees nothing on {interface}");
    }

    /// The next matching line.
    pub fn line(&self, fits: impl Fn(&str) -> bool) -> String {
        let mut others = Vec::new();
        while let Ok(line) = self.lines.recv_timeout(Duration::from_secs(10)) {
            if fits(&line) {
                return line.trim().to_string();
            }
            others.push(line);
        }
        others.truncate(40);
        panic!("only other lines are printed: {others:#?}");
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }
}

pub fn isotpsend(options: &str, message: &[u8]) {
    let mut sender = Command::new("isotpsend")
        .args(options.split_whitespace())
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = sender.stdin.take().unwrap();
    input.write_all(hex(message).as_bytes()).unwrap();
    drop(input);
    assert!(sender.wait().unwrap().success());
}

pub fn hex(bytes: &[u8]) -> String {
    let bytes: Vec<String> = bytes.iter().map(|byte| format!("{byte:02X}")).collect();
    bytes.join(" ")
}

#[test]
#[ignore = "needs vcan: run tests/vcan/run"]
fn the_kernel_segments_messages() {
    let receiver = Listening::start("isotprecv -s 220 -d 120 vcan0");
    let message: Vec<u8> = (0..100).collect();
    isotpsend("-s 120 -d 220 vcan0", &message);
    assert_eq!(receiver.line(|_| true), hex(&message));
}
