//! The faults of both directions of one link, and what they share: the time, the log, the counters.

use super::book::Book;
use super::engine::{Damageable, Faults};
use super::harm::{is_damage, is_loss};
use super::injection::{Injection, What};
use super::outage::{Change, Outage, in_order};
use super::plan::{Plan, impossible};
use super::spared::Spared;
use crate::lock::lock;
use crate::tally::{Tally, count};
use skyloop_protocols::{Command, Direction, FaultKind, Personality};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How often the log is flushed to its file.
const FLUSH: Duration = Duration::from_secs(1);

/// The faults of one link, whose items are of type `I` towards the emulator and `O` from it.
pub(super) struct Injector<I, O = I> {
    /// When the first item of either direction came: times count from it.
    zero: Option<Instant>,
    pub way_in: Faults<I>,
    pub way_out: Faults<O>,
    /// Commands that switched a fault: their answers are not harmed.
    pub spared: Spared,
    bus_off: Outage,
    down: Outage,
    pub personality: &'static Personality,
    book: Arc<Mutex<Book>>,
    pub tally: Arc<Tally>,
    address: String,
    flushed: Instant,
}

impl<I: Damageable, O: Damageable> Injector<I, O> {
    /// Scheduled faults of `plan` and live faults, on the link at `address` that counts in `tally`.
    pub fn new(
        address: &str,
        tally: &Arc<Tally>,
        plan: &Plan,
        personality: &'static Personality,
        book: &Arc<Mutex<Book>>,
    ) -> Injector<I, O> {
        Injector {
            zero: None,
            way_in: Faults::new(Direction::In, &plan.rules),
            way_out: Faults::new(Direction::Out, &plan.rules),
            spared: Spared::default(),
            bus_off: Outage::of(FaultKind::BusOff),
            down: Outage::of(FaultKind::Down),
            personality,
            book: book.clone(),
            tally: tally.clone(),
            address: address.to_string(),
            flushed: Instant::now(),
        }
    }

    /// Time since the first item; none before it.
    pub fn now(&self) -> Option<Duration> {
        self.zero.map(|zero| zero.elapsed())
    }

    /// An item has come: time since the first, which may be this one.
    pub fn start(&mut self) -> Duration {
        if self.zero.is_none() {
            lock(&self.book).start();
        }
        self.zero.get_or_insert_with(Instant::now).elapsed()
    }

    /// The next item towards the emulator that is due.
    pub fn pop_in(&mut self) -> Option<I> {
        let now = self.now()?;
        self.way_in.pop_due(now)
    }

    /// The next item from the emulator that is due.
    pub fn pop_out(&mut self) -> Option<O> {
        let now = self.now()?;
        self.way_out.pop_due(now)
    }

    /// Switches the fault that `packet` commands; false if it commands none. The emulator refuses
    /// faults that only a bus can have.
    pub fn switch(&mut self, packet: &[u8], is_bus: bool) -> bool {
        let decoded = (self.personality.decode_command)(packet);
        let Ok((header, Command::Fault(fault))) = decoded else {
            return false;
        };
        let now = self.start();
        // Before it can be answered.
        self.spared.remember(header.apid, header.sequence_count);
        if is_bus || impossible(fault.kind).is_none() {
            match fault.direction {
                Direction::In => self.way_in.switch(fault, now),
                Direction::Out => self.way_out.switch(fault, now),
            }
        }
        true
    }

    /// Logs and counts new injections of both directions in order of time. Returns when the CAN
    /// controller left the bus or came back.
    pub fn note(&mut self) -> Vec<Change> {
        let Some(now) = self.now() else {
            return Vec::new();
        };
        self.way_in.turn(now);
        self.way_out.turn(now);
        let injected = in_order(self.way_in.injected(), self.way_out.injected());
        self.note_harm(&injected, now);
        let mut book = lock(&self.book);
        book.foresee([self.way_in.outlook(), self.way_out.outlook()]);
        book.note(&self.address, &injected);
        if self.flushed.elapsed() > FLUSH {
            book.flush();
            self.flushed = Instant::now();
        }
        let mut changes = Vec::new();
        for injection in &injected {
            if self.down.see(injection) == Some(Change::Back) {
                count(&self.tally.reconnects);
            }
            changes.extend(self.bus_off.see(injection));
        }
        changes
    }

    /// Notes in the tally what the faults do, so that messages name them.
    fn note_harm(&self, injected: &[Injection], now: Duration) {
        for (direction, due) in [
            (Direction::In, self.way_in.line().next_due()),
            (Direction::Out, self.way_out.line().next_due()),
        ] {
            let is_lost = |one: &&Injection| {
                one.direction == direction
                    && matches!(one.what, What::Item { .. })
                    && (is_loss(one.kind) || is_damage(one.kind))
            };
            let lost = injected.iter().filter(is_lost).count() as u32;
            let is_held_back = due.is_some_and(|due| due > now);
            self.tally.note_harm(direction, is_held_back, lost);
        }
    }
}
