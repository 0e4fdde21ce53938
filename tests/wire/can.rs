//! CAN frames on a serial line, letter by letter: what is none is counted, what breaks off too, and a line that goes comes back.

use crate::support::client::moved;
use crate::support::{PATIENCE, Running, await_that, options, scene};
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

    /// Reads until `wanted` has come, and no further.
    fn read(&mut self, wanted: &str) {
        let (started, mut buffer) = (Instant::now(), [0; 4096]);
        let end = loop {
            if let Some(place) = self.text.find(wanted) {
                break place + wanted.len();
            }
            let text = &self.text;
            assert!(started.elapsed() < PATIENCE, "no {wanted:?} in {text:?}");
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
        // An adapter that refuses: its queue is full, or it is off the bus.
        ("z\r\x07", ("bus_errors", 1)),
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
        std::thread::sleep(Duration::from_millis(1500));
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
