//! Faults on a CAN bus with their counters in `Status`. The bus is slcan over a pseudo-terminal.
#![cfg(unix)]

use crate::support::client::{Client, moved};
use crate::support::line::MemoryLine;
use crate::support::{Running, await_that, fault, options, scene};
use skyloop::config::Clock;
use skyloop::link::fault::{BusFaults, FaultLog, Plan};
use skyloop::link::{self, BusInstruments};
use skyloop_firmware_sim::can::{CanBus, Sending, Trouble};
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Direction, FaultKind, Reply};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Queue of frames that appear on the bus without a sender.
type Injected = Arc<Mutex<VecDeque<CanFrame>>>;

struct InjectingBus(Box<dyn CanBus>, Injected);

impl CanBus for InjectingBus {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        self.0.send(frame)
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        match self.1.lock().unwrap().pop_front() {
            Some(frame) => Ok(Some(frame)),
            None => self.0.recv(timeout),
        }
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        Ok(Box::new(InjectingBus(self.0.share()?, self.1.clone())))
    }
}

/// An emulator on a bus with faults and injected frames.
fn on_a_bus() -> (Running, Client<MemoryLine>, Injected) {
    let injected = Injected::default();
    let of_bus = injected.clone();
    let book = Arc::new(Mutex::new(FaultLog::default()));
    let mut options = options(5.0);
    options.bus = Some(BusInstruments {
        faults: true,
        at: Arc::new(move |address, tally| {
            let faults = BusFaults::new(address, tally, &Plan::default(), &NATIVE, &book);
            let injected = of_bus.clone();
            Box::new(move |bus| faults.around(Box::new(InjectingBus(bus, injected.clone()))))
        }),
    });
    let (wire, port) = link::loopback("slcan", &options).unwrap();
    let emulator = Running::start(scene(), Clock::Stepped, wire);
    (emulator, Client::new(MemoryLine(port)), injected)
}

#[test]
fn each_bus_error_has_its_counter() {
    let (_emulator, mut client, injected) = on_a_bus();
    let mut before = client.counters();
    let mut moves = |client: &mut Client<MemoryLine>, name| {
        let mut found = Vec::new();
        await_that("the counter moves", || {
            let after = client.counters();
            found = moved(&before, &after);
            before = after;
            !found.is_empty()
        });
        assert_eq!(found, [(name, 1)]);
    };
    // An error frame: a bit error, seen by the controller.
    injected.lock().unwrap().push_back(Trouble::Error.frame());
    moves(&mut client, "bus_errors");
    // The first frame of an attitude without the others: dropped after 1 s.
    let begin = CanFrame::new(0x100, false, &[0; 8]).unwrap();
    injected.lock().unwrap().push_back(begin);
    moves(&mut client, "incomplete");
    // On our identifiers: a frame of the wrong length, a single frame without data (ISO 15765-2,
    // 9.6.2), remote frames.
    let short = CanFrame::new(0x110, false, &[6, 0, 1, 0]).unwrap();
    let nothing = CanFrame::new(0x120, false, &[0; 8]).unwrap();
    let remote = |id| CanFrame {
        remote: true,
        ..CanFrame::new(id, false, &[]).unwrap()
    };
    for frame in [short, nothing, remote(0x100), remote(0x110), remote(0x120)] {
        injected.lock().unwrap().push_back(frame);
        moves(&mut client, "bad_framing");
    }
    // A message of 4095 bytes is announced.
    let first = CanFrame::new(0x120, false, &[0x1F, 0xFF, 1, 2, 3, 4, 5, 6]).unwrap();
    injected.lock().unwrap().push_back(first);
    moves(&mut client, "oversize");
    // Other frames do not count: other identifiers, our own, and 29 bits.
    let far = CanFrame {
        extended: true,
        ..short
    };
    let others = |id| CanFrame::new(id, false, &[6, 0, 1, 0]).unwrap();
    let before = client.counters();
    let ids = [0x0FF, 0x111, 0x7FF, 0x210, 0x220];
    injected.lock().unwrap().extend(ids.map(others));
    injected.lock().unwrap().extend([far, remote(0x7FF)]);
    await_that("the frames are read", || {
        injected.lock().unwrap().is_empty()
    });
    assert_eq!(moved(&before, &client.counters()), []);
}

#[test]
fn bus_off_is_counted_and_loses_no_outbound_packets() {
    let (_emulator, mut client, _) = on_a_bus();
    let before = client.counters();
    // Bus-off before the Ack is sent: it waits for the bus.
    client.done(fault(FaultKind::BusOff, Direction::Out, 1.0, 0.3));
    let after = client.counters();
    // Bus-off is an error frame too.
    assert_eq!(moved(&before, &after), [("bus_errors", 1), ("bus_off", 1)]);
}

#[test]
fn faults_are_switched_over_the_affected_bus() {
    let (_emulator, mut client, injected) = on_a_bus();
    let before = client.counters();
    client.done(fault(FaultKind::Drop, Direction::In, 1.0, 0.0));
    for _ in 0..3 {
        client.send(Command::Ping);
    }
    assert!(client.recv(Duration::from_millis(200)).is_none());
    client.done(fault(FaultKind::Drop, Direction::In, 0.0, 0.0));
    // Foreign frames dropped by a receiver: no other loss.
    client.done(fault(FaultKind::Overrun, Direction::In, 1.0, 0.0));
    let stray = CanFrame::new(0x7FF, false, &[0; 8]).unwrap();
    injected.lock().unwrap().extend([stray; 5]);
    await_that("the frames are read", || {
        injected.lock().unwrap().is_empty()
    });
    client.done(fault(FaultKind::Overrun, Direction::In, 0.0, 0.0));
    let mut found = moved(&before, &client.counters());
    found.sort_unstable();
    assert_eq!(found, [("overflows", 5), ("sequence_gaps", 3)]);
}

/// Only the Acks of Fault commands pass. A link down in both directions is one reconnect.
#[test]
fn acks_of_fault_commands_pass_a_blocked_bus() {
    let (_emulator, mut client, _) = on_a_bus();
    let before = client.counters();
    for kind in [FaultKind::Drop, FaultKind::Stuck, FaultKind::BitFlips] {
        client.done(fault(kind, Direction::Out, 1.0, 0.0));
        client.done(fault(kind, Direction::Out, 0.0, 0.0));
    }
    client.done(fault(FaultKind::Down, Direction::Out, 1.0, 1.0));
    client.done(fault(FaultKind::Down, Direction::In, 1.0, 1.0));
    client.send(Command::Ping);
    assert!(client.recv(Duration::from_millis(1200)).is_none());
    assert_eq!(
        moved(&before, &client.counters()),
        [("sequence_gaps", 1), ("reconnects", 1)]
    );
}

/// The Acks of both commands wait for the bus.
#[test]
fn a_command_ends_a_permanent_bus_off() {
    let (_emulator, mut client, _) = on_a_bus();
    let off = client.send(fault(FaultKind::BusOff, Direction::In, 1.0, 0.0));
    assert!(client.recv(Duration::from_millis(300)).is_none());
    let on = client.send(fault(FaultKind::BusOff, Direction::In, 0.0, 0.0));
    let acks = [client.next(false), client.next(false)].map(|packet| {
        match Reply::decode(&packet).unwrap().1 {
            Reply::Ack(ack) => ack.sequence_count,
            other => panic!("{other:?}"),
        }
    });
    assert_eq!(acks, [off, on]);
}
