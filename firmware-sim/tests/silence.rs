//! Emulators that do not answer: a line blocked by an earlier client, a silent link, an emulator
//! that ends.

use std::time::{Duration, Instant};

use crate::common::emulator::Emulator;
use crate::common::loops::{computer, on_links, over_memory, run_and_print, within};
use skyloop_firmware_sim::flight_computer::RunError;
use skyloop_firmware_sim::port::{Port, PortError};
use skyloop_firmware_sim::roles::Roles;
use skyloop_protocols::{Command, Direction, Fault, FaultKind};

/// A named line that may stop.
struct Line<P> {
    port: P,
    name: &'static str,
    /// Whether only `Fault` commands pass, as with the emulator's faults; one of value 0 unblocks
    /// it.
    stuck: bool,
    /// Number of packets until the line goes silent.
    packets: usize,
}

impl<P: Port> Port for Line<P> {
    fn send(&mut self, packet: &[u8]) -> Result<(), PortError> {
        if let Ok((_, Command::Fault(fault))) = Command::decode(packet) {
            self.stuck &= fault.value != 0.0;
        } else if self.stuck {
            return Ok(());
        }
        self.port.send(packet)
    }

    fn recv(&mut self, timeout: Duration) -> Result<Option<Vec<u8>>, PortError> {
        if self.packets == 0 {
            std::thread::sleep(timeout);
            return Ok(None);
        }
        let packet = self.port.recv(timeout)?;
        self.packets -= usize::from(packet.is_some());
        Ok(packet)
    }

    fn name(&self) -> &str {
        self.name
    }
}

fn line<P: Port>(port: P, name: &'static str, stuck: bool) -> Line<P> {
    Line {
        port,
        name,
        stuck,
        packets: usize::MAX,
    }
}

#[test]
fn blocked_lines_are_freed_before_the_reset() {
    let off = Fault {
        kind: FaultKind::Stuck,
        direction: Direction::In,
        value: 0.0,
        seconds: 0.0,
    };
    for faults in [vec![off], vec![]] {
        let (port, thread) = over_memory(Emulator::new(|_, _| {}));
        let computer = computer(
            line(port, "udp://A", true),
            within(Duration::from_secs(2), 3),
        );
        let result = run_and_print(computer.with_faults(faults.clone()));
        thread.join().unwrap();
        match result {
            Ok(report) => assert_eq!((report.frames, report.lost, faults.len()), (3, 0, 1)),
            Err(error) => {
                let error = error.to_string();
                assert!(error.starts_with("udp://A: no answer"), "{error}");
                assert!(error.contains("--fault stuck:in:0"), "{error}");
                assert!(faults.is_empty());
            }
        }
    }
}

#[test]
fn the_unanswered_link_is_named() {
    let mut threads = Vec::new();
    let links = [("udp://A", "truth"), ("udp://B", "pixels+labels")].map(|(name, roles)| {
        let (port, thread) = over_memory(Emulator::new(|_, _| {}));
        threads.push(thread);
        let line = line(port, name, name == "udp://B");
        (line, Roles::parse(roles).unwrap())
    });
    let result = run_and_print(on_links(links.into(), within(Duration::from_secs(2), 3)));
    let error = result.unwrap_err().to_string();
    assert!(error.starts_with("udp://B: no answer"), "{error}");
    for thread in threads {
        thread.join().unwrap();
    }
}

#[test]
fn runs_end_when_the_emulator_ends() {
    let (port, thread) = over_memory(Emulator::new(|_, _| {}));
    let line = Line {
        packets: 60,
        ..line(port, "udp://A", false)
    };
    let begin = Instant::now();
    let mission = within(Duration::from_millis(500), 100_000);
    let error = run_and_print(computer(line, mission)).unwrap_err();
    thread.join().unwrap();
    let text = error.to_string();
    assert!(
        text.starts_with("udp://A: nothing received for 1"),
        "{text}"
    );
    assert!(begin.elapsed() < Duration::from_secs(25));
    let RunError::CutShort { report, .. } = error else {
        panic!("it had started: {error}");
    };
    assert!(report.frames >= 2 && report.lost >= 5, "{report}");
}

#[test]
fn runs_without_frames_continue_to_their_end() {
    let mut emulator = Emulator::new(|_, _| {});
    emulator.drops = |_, _| true;
    let (port, thread) = over_memory(emulator);
    // Longer than the permitted silence.
    let mission = within(Duration::from_millis(1500), 8);
    let report = run_and_print(computer(port, mission)).unwrap();
    thread.join().unwrap();
    assert_eq!((report.frames, report.lost), (0, 8));
}
