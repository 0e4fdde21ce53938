//! CAN frames as text on a serial line: bad lines are counted, and a line that comes back is used.

use crate::support::client::moved;
use crate::support::{Running, TIMEOUT, await_that, options, scene};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use serialport::{SerialPort, TTYPort};
use skyloop::config::Clock;
use skyloop::link;
use std::io::{Read, Write};
use std::path::Path;
use std::time::{Duration, Instant};

/// The other end of an adapter's line.
struct Far {
    line: TTYPort,
    /// What has come behind what was read.
    text: String,
}

impl Far {
    /// A pseudo-terminal that can be opened as `name`.
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

    /// Whether `wanted` comes at once.
    fn finds(&mut self, wanted: &str) -> bool {
        let mut buffer = [0; 4096];
        while let Ok(length) = self.line.read(&mut buffer) {
            let text = String::from_utf8_lossy(&buffer[..length]);
            self.text.push_str(&text);
        }
        self.text.contains(wanted)
    }

    /// Reads until `wanted` has come, and no further.
    fn read(&mut self, wanted: &str) {
        let (started, mut buffer) = (Instant::now(), [0; 4096]);
        let end = loop {
            if let Some(place) = self.text.find(wanted) {
                break place + wanted.len();
            }
            let text = &self.text;
            assert!(started.elapsed() < TIMEOUT, "no {wanted:?} in {text:?}");
            if let Ok(length) = self.line.read(&mut buffer) {
                self.text
                    .push_str(std::str::from_utf8(&buffer[..length]).unwrap());
            }
        };
        self.text.drain(..end);
    }
}

/// An emulator behind an adapter called `name`.
fn emulator(name: &Path) -> Running {
    let url = format!("slcan://{}?bitrate=500000", name.display());
    let wire = link::open(&url, &options(5.0)).unwrap();
    Running::start(scene(), Clock::Stepped, wire)
}

// X-Val: LAWICEL CAN232 manual for the lines; protocols/docs/skyloop.dbc for identifiers and signals: a Ping is 0x110 with
// opcode 6, its Ack 0x210 with the command's APID 0x102 and sequence count.
const PING: &str = "t110706000100000000\r";
const ACK: &str = "t210401020001\r";

#[test]
fn a_terminal_can_talk_to_the_emulator() {
    let here = tempfile::tempdir().unwrap();
    let name = here.path().join("adapter");
    let mut far = Far::at(&name);
    let emulator = emulator(&name);
    far.read("C\rS6\rO\r");
    far.write(PING);
    far.read(ACK);
    // Then comes the Status: a first frame, which waits for flow control (0x30: go on).
    far.read("t22081");
    far.write("t1203300000\r");
    far.read("t220823");
    let counters = emulator.end();
    assert_eq!(moved(&Default::default(), &counters), []);
}

#[test]
fn what_goes_wrong_on_the_line_moves_its_counter() {
    for (lines, expected) in [
        ("t1107\rhello\r", ("bad_framing", 2)),
        // A refusal of nothing that was sent.
        ("z\r\x07", ("bad_framing", 1)),
        // An acknowledgement missed, as Linux's slcan driver reads it.
        ("e1a\r", ("bus_errors", 1)),
        // A first frame of 20 octets (ISO 15765-2, 9.6.3: 0x014), and nothing after it for 1 s.
        ("t12081014010203040506\r", ("incomplete", 1)),
        // One of 2,000.
        ("t120817D0010203040506\r", ("oversize", 1)),
    ] {
        let here = tempfile::tempdir().unwrap();
        let name = here.path().join("adapter");
        let mut far = Far::at(&name);
        let emulator = emulator(&name);
        far.read("O\r");
        far.write(lines);
        if expected.0 == "incomplete" {
            std::thread::sleep(Duration::from_secs(3));
        }
        far.write(PING);
        far.read(ACK);
        let counters = emulator.end();
        // It alone, besides the Ping's Status, which nobody lets go on: one packet is lost.
        let mut counted = moved(&Default::default(), &counters);
        counted.sort_unstable();
        let mut expected = [expected, ("lost_outbound", 1)];
        expected.sort_unstable();
        assert_eq!(counted, expected, "{lines:?}");
    }
}

/// Whatever comes on the line, a Ping that begins on a line of its own is answered.
#[test]
fn no_bytes_on_the_line_make_the_link_deaf() {
    let noise = proptest::collection::vec(proptest::num::u8::ANY, 0..600);
    // Letters that lines begin with, digits and ends: noise that is nearly right.
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
            let here = tempfile::tempdir().unwrap();
            let name = here.path().join("adapter");
            let mut far = Far::at(&name);
            let emulator = emulator(&name);
            far.read("O\r");
            far.line.write_all(&bytes).unwrap();
            let started = Instant::now();
            loop {
                far.write(&format!("\r{PING}"));
                if far.finds("t2104") {
                    break;
                }
                assert!(started.elapsed() < TIMEOUT, "deaf after {bytes:02X?}");
            }
            emulator.end();
        }
    }
}

#[test]
fn an_adapter_that_is_unplugged_and_plugged_in_is_set_up_again() {
    let here = tempfile::tempdir().unwrap();
    let name = here.path().join("adapter");
    let mut far = Far::at(&name);
    let emulator = emulator(&name);
    far.read("O\r");
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
