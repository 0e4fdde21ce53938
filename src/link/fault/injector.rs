//! The faults of both directions of one link with their common time, log and counters.

use super::engine::{Damageable, Faults};
use super::exempt_answers::ExemptAnswers;
use super::fault_log::FaultLog;
use super::injection::{Event, Injection};
use super::item_state::{is_damage, is_loss};
use super::outage::{Change, Outage, in_order};
use super::plan::{Plan, impossible};
use crate::lock::lock;
use crate::tally::{Tally, count};
use skyloop_protocols::{Command, Direction, FaultKind, Personality};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Interval of flushes of the log to its file.
const FLUSH: Duration = Duration::from_secs(1);

/// The faults of one link, with items of type `I` towards the emulator and `O` from it.
pub(super) struct Injector<I, O = I> {
    /// Arrival of the first item of either direction; all times count from it.
    zero: Option<Instant>,
    pub inbound: Faults<I>,
    pub outbound: Faults<O>,
    /// Commands that switched a fault: no fault affects their answers.
    pub exempt: ExemptAnswers,
    bus_off: Outage,
    down: Outage,
    pub personality: &'static Personality,
    fault_log: Arc<Mutex<FaultLog>>,
    pub tally: Arc<Tally>,
    address: String,
    flushed: Instant,
}

impl<I: Damageable, O: Damageable> Injector<I, O> {
    /// Scheduled faults of `plan` and live faults on the link at `address`; `tally` counts them.
    pub fn new(
        address: &str,
        tally: &Arc<Tally>,
        plan: &Plan,
        personality: &'static Personality,
        fault_log: &Arc<Mutex<FaultLog>>,
    ) -> Injector<I, O> {
        Injector {
            zero: None,
            inbound: Faults::new(Direction::In, &plan.rules),
            outbound: Faults::new(Direction::Out, &plan.rules),
            exempt: ExemptAnswers::default(),
            bus_off: Outage::of(FaultKind::BusOff),
            down: Outage::of(FaultKind::Down),
            personality,
            fault_log: fault_log.clone(),
            tally: tally.clone(),
            address: address.to_string(),
            flushed: Instant::now(),
        }
    }

    /// Time since the first item; `None` before it.
    pub fn now(&self) -> Option<Duration> {
        self.zero.map(|zero| zero.elapsed())
    }

    /// Notes the arrival of an item; returns the time since the first one.
    pub fn start(&mut self) -> Duration {
        if self.zero.is_none() {
            lock(&self.fault_log).start();
        }
        self.zero.get_or_insert_with(Instant::now).elapsed()
    }

    /// The next due item towards the emulator.
    pub fn pop_in(&mut self) -> Option<I> {
        let now = self.now()?;
        self.inbound.pop_due(now)
    }

    /// The next due item from the emulator.
    pub fn pop_out(&mut self) -> Option<O> {
        let now = self.now()?;
        self.outbound.pop_due(now)
    }

    /// Switches the fault that `packet` commands; false if it commands none. Only a bus can go off:
    /// on other links the emulator refuses that command.
    pub fn switch(&mut self, packet: &[u8], is_bus: bool) -> bool {
        let decoded = (self.personality.decode_command)(packet);
        let Ok((header, Command::Fault(fault))) = decoded else {
            return false;
        };
        let now = self.start();
        // Stored before the command is passed on, so before its answer.
        self.exempt.add(header.apid, header.sequence_count);
        if is_bus || impossible(fault.kind).is_none() {
            match fault.direction {
                Direction::In => self.inbound.switch(fault, now),
                Direction::Out => self.outbound.switch(fault, now),
            }
        }
        true
    }

    /// Logs and counts new injections of both directions in order of time. Returns the changes of
    /// the CAN controller between on and off the bus.
    pub fn note(&mut self) -> Vec<Change> {
        let Some(now) = self.now() else {
            return Vec::new();
        };
        self.inbound.turn(now);
        self.outbound.turn(now);
        let injected = in_order(self.inbound.injected(), self.outbound.injected());
        self.note_faults(&injected, now);
        let mut fault_log = lock(&self.fault_log);
        fault_log.add_lasting([self.inbound.lasting(), self.outbound.lasting()]);
        fault_log.note(&self.address, &injected);
        if self.flushed.elapsed() > FLUSH {
            fault_log.flush();
            self.flushed = Instant::now();
        }
        let mut changes = Vec::new();
        for injection in &injected {
            if self.down.observe(injection) == Some(Change::Back) {
                count(&self.tally.reconnects);
            }
            changes.extend(self.bus_off.observe(injection));
        }
        changes
    }

    /// Records the effects in the tally, so that messages name them.
    fn note_faults(&self, injected: &[Injection], now: Duration) {
        for (direction, due) in [
            (Direction::In, self.inbound.line().next_due()),
            (Direction::Out, self.outbound.line().next_due()),
        ] {
            let is_lost = |one: &&Injection| {
                one.direction == direction
                    && matches!(one.event, Event::Item { .. })
                    && (is_loss(one.kind) || is_damage(one.kind))
            };
            let lost = injected.iter().filter(is_lost).count() as u32;
            let is_held_back = due.is_some_and(|due| due > now);
            self.tally.note_faults(direction, is_held_back, lost);
        }
    }
}
