//! CAN frames as text on a serial line: bad lines are counted, and a returning line is used again.

use crate::support::client::moved;
use crate::support::{Running, TIMEOUT, await_that, options, scene};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use serialport::{SerialPort, TTYPort};
use skyloop::config::Clock;
use skyloop::link;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The other end of an adapter's line.
struct Far {
    line: TTYPort,
    /// Received text after the part already read.
    text: String,
}

impl Far {
    /// A pseudo-terminal linked as `name`.
    fn at(name: &Path) -> Far {
        let (mut near, far) = TTYPort::pair().unwrap();
        near.set_timeout(Duration::from_millis(20)).unwrap();
        let _ = std::fs::remove_file(name);
        std::os::unix::fs::symlink(far.name().unwrap(), name).unwrap();
        Far {
            line: near,
            text: String::new(),
        }
    }

    fn write(&mut self, lines: &str) {
        self.line.write_all(lines.as_bytes()).unwrap();
    }

    /// Whether `expected` has been received by now.
    fn finds(&mut self, expected: &str) -> bool {
        let mut buffer = [0; 4096];
        while let Ok(length) = self.line.read(&mut buffer) {
            let text = String::from_utf8_lossy(&buffer[..length]);
            self.text.push_str(&text);
        }
        self.text.contains(expected)
    }

    /// Reads up to the end of `expected`.
    fn read(&mut self, expected: &str) {
        let (started, mut buffer) = (Instant::now(), [0; 4096]);
        let end = loop {
            if let Some(start) = self.text.find(expected) {
                break start + expected.len();
            }
            let text = &self.text;
            assert!(started.elapsed() < TIMEOUT, "no {expected:?} in {text:?}");
            if let Ok(length) = self.line.read(&mut buffer) {
                self.text
                    .push_str(std::str::from_utf8(&buffer[..length]).unwrap());
            }
        };
        self.text.drain(..end);
    }
}

/// An emulator behind an adapter that it has set up, and the path of the adapter.
fn emulator() -> (TempDir, PathBuf, Far, Running) {
    let folder = tempfile::tempdir().unwrap();
    let name = folder.path().join("adapter");
    let mut far = Far::at(&name);
    let url = format!("slcan://{}?bitrate=500000", name.display());
    let wire = link::open(&url, &options(5.0)).unwrap();
    let emulator = Running::start(scene(), Clock::Stepped, wire);
    far.read("C\rS6\rO\r");
    (folder, name, far, emulator)
}

// X-Val: LAWICEL CAN232 manual for the lines; protocols/docs/skyloop.dbc for identifiers and
// signals: a Ping is 0x110 with opcode 6, its Ack 0x210 with the command's APID 0x102 and sequence
// count.
const PING: &str = "t110706000100000000\r";
const ACK: &str = "t210401020001\r";

#[test]
fn commands_can_be_typed_at_a_terminal() {
    let (_folder, _, mut far, emulator) = emulator();
    far.write(PING);
    far.read(ACK);
    // The Status follows: a first frame, which waits for flow control (0x30: continue).
    far.read("t22081");
    far.write("t1203300000\r");
    far.read("t220823");
    let counters = emulator.end();
    assert_eq!(moved(&Default::default(), &counters), []);
}

#[test]
fn each_line_error_has_its_counter() {
    for (lines, expected) in [
        ("t1107\rhello\r", ("bad_framing", 2)),
        // A refusal without a sent frame.
        ("z\r\x07", ("bad_framing", 1)),
        // A missed acknowledgement, as Linux's slcan driver reads it.
        ("e1a\r", ("bus_errors", 1)),
        // A first frame of 20 bytes (ISO 15765-2, 9.6.3: 0x014), and nothing else for 1 s.
        ("t12081014010203040506\r", ("incomplete", 1)),
        // A first frame of 2,000 bytes.
        ("t120817D0010203040506\r", ("oversize", 1)),
    ] {
        let (_folder, _, mut far, emulator) = emulator();
        far.write(lines);
        if expected.0 == "incomplete" {
            std::thread::sleep(Duration::from_secs(3));
        }
        far.write(PING);
        far.read(ACK);
        let counters = emulator.end();
        // Also lost: the Ping's Status, which gets no flow control.
        let mut counted = moved(&Default::default(), &counters);
        counted.sort_unstable();
        let mut expected = [expected, ("lost_outbound", 1)];
        expected.sort_unstable();
        assert_eq!(counted, expected, "{lines:?}");
    }
}

/// After any bytes on the line, a Ping at the start of a line is answered.
#[test]
fn any_noise_on_the_line_is_tolerated() {
    let noise = proptest::collection::vec(proptest::num::u8::ANY, 0..600);
    // Noise close to valid lines: their letters, digits and ends.
    let lines = proptest::string::string_regex(
        "([tTrRdDbBsSeEzZVNFCOLY][0-9A-Fa-f]{0,12}[\r\x07]{0,3}){0,60}",
    );
    let lines = lines.unwrap().prop_map(String::into_bytes);
    let worst = Just(Vec::from([7; 300]));
    let bus_off = Just(b"sb000256\r".repeat(3));
    let mut runner = TestRunner::deterministic();
    for strategy in [noise.boxed(), lines.boxed(), worst.boxed(), bus_off.boxed()] {
        for _ in 0..3 {
            let bytes = strategy.new_tree(&mut runner).unwrap().current();
            let (_folder, _, mut far, emulator) = emulator();
            far.line.write_all(&bytes).unwrap();
            let started = Instant::now();
            loop {
                far.write(&format!("\r{PING}"));
                if far.finds("t2104") {
                    break;
                }
                assert!(started.elapsed() < TIMEOUT, "no reply after {bytes:02X?}");
            }
            emulator.end();
        }
    }
}

#[test]
fn replugged_adapters_are_set_up_again() {
    let (_folder, name, far, emulator) = emulator();
    drop(far);
    std::fs::remove_file(&name).unwrap();
    std::thread::sleep(Duration::from_millis(500));
    let mut far = Far::at(&name);
    far.read("C\rS6\rO\r");
    far.write(PING);
    far.read(ACK);
    await_that("no frame", || emulator.shots.try_recv().is_err());
    assert_eq!(emulator.end().reconnects, 1);
}
