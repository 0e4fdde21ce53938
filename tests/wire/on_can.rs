//! Faults on a CAN bus, each with its counter in `Status`. The bus is slcan over a pseudo-terminal.
#![cfg(unix)]

use crate::support::client::{Client, moved};
use crate::support::line::MemoryLine;
use crate::support::{Running, await_that, fault, options, scene};
use skyloop::config::Clock;
use skyloop::link::fault::{Book, BusFaults, Plan};
use skyloop::link::{self, BusInstruments};
use skyloop_firmware_sim::can::{CanBus, Sending, Trouble};
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::personality::NATIVE;
use skyloop_protocols::{Command, Direction, FaultKind, Reply};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Frames that come out of nowhere.
type Ghosts = Arc<Mutex<VecDeque<CanFrame>>>;

struct Haunted(Box<dyn CanBus>, Ghosts);

impl CanBus for Haunted {
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
        Ok(Box::new(Haunted(self.0.share()?, self.1.clone())))
    }
}

/// An emulator on a bus with faults and ghosts.
fn on_a_bus() -> (Running, Client<MemoryLine>, Ghosts) {
    let ghosts = Ghosts::default();
    let of_bus = ghosts.clone();
    let book = Arc::new(Mutex::new(Book::default()));
    let mut options = options(5.0);
    options.bus = Some(BusInstruments {
        faults: true,
        at: Arc::new(move |address, tally| {
            let faults = BusFaults::new(address, tally, &Plan::default(), &NATIVE, &book);
            let ghosts = of_bus.clone();
            Box::new(move |bus| faults.around(Box::new(Haunted(bus, ghosts.clone()))))
        }),
    });
    let (wire, port) = link::loopback("slcan", &options).unwrap();
    let emulator = Running::start(scene(), Clock::Stepped, wire);
    (emulator, Client::new(MemoryLine(port)), ghosts)
}

#[test]
fn each_trouble_of_a_bus_moves_its_counter() {
    let (_emulator, mut client, ghosts) = on_a_bus();
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
    ghosts.lock().unwrap().push_back(Trouble::Error.frame());
    moves(&mut client, "bus_errors");
    // The first frame of an attitude whose others never come: given up after 1 s.
    let begin = CanFrame::new(0x100, false, &[0; 8]).unwrap();
    ghosts.lock().unwrap().push_back(begin);
    moves(&mut client, "incomplete");
    // On our identifiers: a frame of another length than the form's, a single frame of no octet (ISO
    // 15765-2, 9.6.2), one that asks.
    let short = CanFrame::new(0x110, false, &[6, 0, 1, 0]).unwrap();
    let nothing = CanFrame::new(0x120, false, &[0; 8]).unwrap();
    let asks = |id| CanFrame {
        remote: true,
        ..CanFrame::new(id, false, &[]).unwrap()
    };
    for frame in [short, nothing, asks(0x100), asks(0x110), asks(0x120)] {
        ghosts.lock().unwrap().push_back(frame);
        moves(&mut client, "bad_framing");
    }
    // A message of 4095 octets is announced.
    let first = CanFrame::new(0x120, false, &[0x1F, 0xFF, 1, 2, 3, 4, 5, 6]).unwrap();
    ghosts.lock().unwrap().push_back(first);
    moves(&mut client, "oversize");
    // Those of others are nobody's loss: other identifiers, our own, and 29 bits.
    let far = CanFrame {
        extended: true,
        ..short
    };
    let others = |id| CanFrame::new(id, false, &[6, 0, 1, 0]).unwrap();
    let before = client.counters();
    let ids = [0x0FF, 0x111, 0x7FF, 0x210, 0x220];
    ghosts.lock().unwrap().extend(ids.map(others));
    ghosts.lock().unwrap().extend([far, asks(0x7FF)]);
    await_that("they are read", || ghosts.lock().unwrap().is_empty());
    assert_eq!(moved(&before, &client.counters()), []);
}

#[test]
fn a_controller_that_leaves_the_bus_is_counted_and_loses_nothing_that_leaves() {
    let (_emulator, mut client, _) = on_a_bus();
    let before = client.counters();
    // Off before the Ack can leave: it waits for the bus.
    client.done(fault(FaultKind::BusOff, Direction::Out, 1.0, 0.3));
    let after = client.counters();
    // Bus-off is an error frame too.
    assert_eq!(moved(&before, &after), [("bus_errors", 1), ("bus_off", 1)]);
}

#[test]
fn faults_are_switched_over_the_bus_that_they_harm() {
    let (_emulator, mut client, ghosts) = on_a_bus();
    let before = client.counters();
    client.done(fault(FaultKind::Drop, Direction::In, 1.0, 0.0));
    for _ in 0..3 {
        client.send(Command::Ping);
    }
    assert!(client.recv(Duration::from_millis(200)).is_none());
    client.done(fault(FaultKind::Drop, Direction::In, 0.0, 0.0));
    // Foreign frames that a receiver throws away: nothing else is missing.
    client.done(fault(FaultKind::Overrun, Direction::In, 1.0, 0.0));
    let stray = CanFrame::new(0x7FF, false, &[0; 8]).unwrap();
    ghosts.lock().unwrap().extend([stray; 5]);
    await_that("they are read", || ghosts.lock().unwrap().is_empty());
    client.done(fault(FaultKind::Overrun, Direction::In, 0.0, 0.0));
    let mut found = moved(&before, &client.counters());
    found.sort_unstable();
    assert_eq!(found, [("overflows", 5), ("sequence_gaps", 3)]);
}

/// Only the Acks of Fault commands leave. A link down in both directions is one reconnect.
#[test]
fn the_acks_of_faults_pass_a_bus_that_loses_everything() {
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

/// Its Ack waits for the bus, and so does that of the command which ends it.
#[test]
fn a_controller_that_is_off_for_good_is_called_back() {
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
