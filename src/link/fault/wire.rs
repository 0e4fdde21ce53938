//! Faults around an open link: one thread per direction, between the link and the emulator.

use super::book::Book;
use super::engine::{Damageable, Pushed};
use super::injector::Injector;
use super::plan::{Plan, impossible};
use crate::error::LinkError;
use crate::inbox::{Inbound, Inbox, Intake, inbox};
use crate::lock::lock;
use crate::outbox::{self, Outbound, Outbox};
use crate::tally::{Tally, count};
use crate::wire::Wire;
use bytes::Bytes;
use skyloop_protocols::{FaultKind, Personality, packet};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a thread waits before it looks whether something has changed.
const TICK: Duration = Duration::from_millis(20);
/// How long it waits for room in the link's queue.
const BREATH: Duration = Duration::from_micros(200);

/// What both directions share.
struct Shared {
    faults: Mutex<Injector<Inbound, Outbound>>,
    tally: Arc<Tally>,
    /// Whether the emulator has dropped its end.
    ended: AtomicBool,
}

impl Shared {
    fn faults(&self) -> MutexGuard<'_, Injector<Inbound, Outbound>> {
        lock(&self.faults)
    }
}

impl Damageable for Inbound {
    fn octets(&self) -> Option<&[u8]> {
        Some(&self.packet)
    }

    fn with_bytes(self, bytes: Vec<u8>) -> Inbound {
        let packet = Bytes::from(bytes);
        Inbound { packet, ..self }
    }

    fn members(&self) -> String {
        members(&self.packet)
    }
}

/// APID and sequence count, as the bytes state them.
fn members(packet: &[u8]) -> String {
    packet::identify(packet).map_or(String::new(), |(apid, count)| {
        format!("\"apid\":{apid},\"sequence_count\":{count}")
    })
}

impl Damageable for Outbound {
    fn octets(&self) -> Option<&[u8]> {
        match self {
            Outbound::Packet { packet, .. } => Some(packet),
            Outbound::Release { .. } => None,
        }
    }

    fn with_bytes(self, bytes: Vec<u8>) -> Outbound {
        match self {
            Outbound::Packet { exchange, .. } => Outbound::Packet {
                exchange,
                packet: Bytes::from(bytes),
            },
            release => release,
        }
    }

    fn members(&self) -> String {
        self.octets().map_or(String::new(), members)
    }
}

/// Puts scheduled faults of `plan` and live faults between `wire` and the emulator. `book` logs
/// them.
pub fn wrap(
    wire: Wire,
    plan: &Plan,
    personality: &'static Personality,
    book: &Arc<Mutex<Book>>,
) -> Result<Wire, LinkError> {
    let faults = Injector::new(&wire.address, &wire.tally, plan, personality, book);
    let shared = Arc::new(Shared {
        faults: Mutex::new(faults),
        tally: wire.tally.clone(),
        ended: AtomicBool::new(false),
    });
    let (intake, inbox) = inbox(wire.tally.clone());
    let (mut outbox, departures) = outbox::queue(&wire.address, &wire.tally);
    outbox.injects = |kind| impossible(kind).map_or(Ok(()), Err);
    let way_in = RxPath {
        from: wire.inbox,
        to: intake,
        shared: shared.clone(),
    };
    let way_out = TxPath {
        from: departures,
        to: wire.outbox,
        sender: wire.sender,
        shared,
        stopped: None,
    };
    let failed = |error| {
        let (action, remedy) = (
            "start the threads of its faults",
            "check the limits of this process",
        );
        LinkError::refused(wire.address.clone(), action, error, remedy)
    };
    let thread = |name: &str| std::thread::Builder::new().name(name.to_string());
    thread("fault-in")
        .spawn(move || way_in.run())
        .map_err(failed)?;
    let sender = thread("fault-out")
        .spawn(move || way_out.run())
        .map_err(failed)?;
    Ok(Wire {
        airtime: wire.airtime,
        sender: Some(sender),
        ..Wire::new(wire.address, inbox, outbox, wire.tally)
    })
}

/// Towards the emulator.
struct RxPath {
    from: Inbox,
    to: Intake,
    shared: Arc<Shared>,
}

impl RxPath {
    /// Carries packets until the link or the emulator has gone.
    fn run(self) {
        let shared = &self.shared;
        let mut gone = false;
        let due = || shared.faults().pop_in();
        while !shared.ended.load(Ordering::Relaxed) && !shared.tally.is_given_up() {
            let wait = {
                let faults = shared.faults();
                pause(faults.way_in.next_due(), faults.now())
            };
            if gone {
                std::thread::sleep(wait);
            } else {
                match self.from.recv_timeout(wait) {
                    Ok(inbound) => self.take(inbound),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => gone = true,
                }
            }
            while let Some(mut inbound) = due() {
                inbound.arrived = Instant::now();
                if self.to.push(inbound).is_err() {
                    return;
                }
            }
            let mut faults = shared.faults();
            faults.note();
            if gone && faults.way_in.line().len() == 0 {
                return;
            }
        }
    }

    fn take(&self, inbound: Inbound) {
        let mut faults = self.shared.faults();
        let now = faults.start();
        if faults.switch(&inbound.packet, false) {
            // A command that ends a fault must get through that fault.
            let _ = self.to.push(inbound);
            return;
        }
        match faults.way_in.push(inbound, now) {
            Pushed::Lost(FaultKind::Overrun) | Pushed::Full => count(&self.shared.tally.dropped),
            Pushed::Taken | Pushed::Lost(_) => {}
        }
    }
}

/// From the emulator.
struct TxPath {
    from: Receiver<Outbound>,
    to: Box<dyn Outbox>,
    sender: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    /// What the link had no room for.
    stopped: Option<Outbound>,
}

impl TxPath {
    /// Carries packets until the emulator has closed and its queue is empty or given up, or the
    /// link ends.
    fn run(mut self) {
        let shared = self.shared.clone();
        while !shared.tally.is_given_up() && matches!(self.turn(), Ok(true)) {}
        // What was injected last.
        shared.faults().note();
        drop(self.to);
        if let Some(sender) = self.sender.filter(|_| !shared.tally.is_given_up()) {
            // Its own message reports a panic.
            let _ = sender.join();
        }
        // Not before: a link without its way in drops what it still has.
        shared.ended.store(true, Ordering::Relaxed);
    }

    /// Hands on what is due, then waits for more; false at the end.
    fn turn(&mut self) -> Result<bool, LinkError> {
        self.hand_on()?;
        let (wait, has_room, waiting) = {
            let mut faults = self.shared.faults();
            faults.note();
            let wait = pause(faults.way_out.next_due(), faults.now());
            (wait, faults.way_out.has_room(), faults.way_out.line().len())
        };
        let wait = if self.stopped.is_some() { BREATH } else { wait };
        if !has_room {
            std::thread::sleep(wait.max(BREATH));
            return Ok(true);
        }
        match self.from.recv_timeout(wait) {
            Ok(what) => self.take(what),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if waiting == 0 && self.stopped.is_none() => {
                return Ok(false);
            }
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(wait),
        }
        Ok(true)
    }

    fn hand_on(&mut self) -> Result<(), LinkError> {
        while let Some(what) = self
            .stopped
            .take()
            .or_else(|| self.shared.faults().pop_out())
        {
            let is_packet = what.octets().is_some();
            let offer = || self.to.offer(what);
            self.stopped = if is_packet {
                let tx_complete = &self.shared.tally.tx_complete;
                tx_complete.hand_on(offer, |kept| matches!(kept, Ok(None)))?
            } else {
                offer()?
            };
            if self.stopped.is_some() {
                break;
            }
        }
        Ok(())
    }

    fn take(&mut self, what: Outbound) {
        let tally = &self.shared.tally;
        let is_packet = what.octets().is_some();
        let faults = &mut *self.shared.faults();
        let now = faults.start();
        let before = faults.way_out.line().len();
        let pushed = if faults.spared.is_spared(faults.personality, what.octets()) {
            faults.way_out.pass(what, now)
        } else {
            faults.way_out.push(what, now)
        };
        match pushed {
            Pushed::Taken => {
                for _ in 1..faults.way_out.line().len() - before {
                    tally.queued();
                }
            }
            // There was room.
            Pushed::Full | Pushed::Lost(FaultKind::Down | FaultKind::BusOff) => {
                count(&tally.lost);
                tally.done();
            }
            // The sender does not learn of it.
            Pushed::Lost(_) if is_packet => tally.done(),
            Pushed::Lost(_) => {}
        }
    }
}

/// How long to wait for something that is due at `due`.
fn pause(due: Option<Duration>, now: Option<Duration>) -> Duration {
    let wait = due.zip(now).map(|(due, now)| due.saturating_sub(now));
    wait.map_or(TICK, |wait| wait.min(TICK))
}
