//! Faults of an open link: one thread per direction between the link and the emulator.

use super::engine::{Damageable, Pushed};
use super::fault_log::FaultLog;
use super::injector::Injector;
use super::plan::{Plan, impossible};
use crate::error::LinkError;
use crate::inbox::{Inbound, Inbox, InboxSender, inbox};
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

/// Maximum wait of a thread before it checks again.
const TICK: Duration = Duration::from_millis(20);
/// Wait for room in the link's queue.
const ROOM_WAIT: Duration = Duration::from_micros(200);

struct Shared {
    faults: Mutex<Injector<Inbound, Outbound>>,
    tally: Arc<Tally>,
    /// Whether the emulator has closed its end.
    ended: AtomicBool,
}

impl Shared {
    fn faults(&self) -> MutexGuard<'_, Injector<Inbound, Outbound>> {
        lock(&self.faults)
    }
}

impl Damageable for Inbound {
    fn bytes(&self) -> Option<&[u8]> {
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

fn members(packet: &[u8]) -> String {
    packet::identify(packet).map_or(String::new(), |(apid, count)| {
        format!("\"apid\":{apid},\"sequence_count\":{count}")
    })
}

impl Damageable for Outbound {
    fn bytes(&self) -> Option<&[u8]> {
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
        self.bytes().map_or(String::new(), members)
    }
}

/// Injects scheduled faults of `plan` and live faults between `wire` and the emulator, and records
/// them in `fault_log`.
pub fn wrap(
    wire: Wire,
    plan: &Plan,
    personality: &'static Personality,
    fault_log: &Arc<Mutex<FaultLog>>,
) -> Result<Wire, LinkError> {
    let faults = Injector::new(&wire.address, &wire.tally, plan, personality, fault_log);
    let shared = Arc::new(Shared {
        faults: Mutex::new(faults),
        tally: wire.tally.clone(),
        ended: AtomicBool::new(false),
    });
    let (inbox_sender, inbox) = inbox(wire.tally.clone());
    let (mut outbox, departures) = outbox::queue(&wire.address, &wire.tally);
    outbox.injects = |kind| impossible(kind).map_or(Ok(()), Err);
    let rx_path = RxPath {
        from: wire.inbox,
        to: inbox_sender,
        shared: shared.clone(),
    };
    let tx_path = TxPath {
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
        .spawn(move || rx_path.run())
        .map_err(failed)?;
    let sender = thread("fault-out")
        .spawn(move || tx_path.run())
        .map_err(failed)?;
    Ok(Wire {
        airtime: wire.airtime,
        sender: Some(sender),
        ..Wire::new(wire.address, inbox, outbox, wire.tally)
    })
}

/// The path of packets from the link to the emulator.
struct RxPath {
    from: Inbox,
    to: InboxSender,
    shared: Arc<Shared>,
}

impl RxPath {
    /// Carries packets until the link or the emulator has closed.
    fn run(self) {
        let shared = &self.shared;
        let mut gone = false;
        let due = || shared.faults().pop_in();
        while !shared.ended.load(Ordering::Relaxed) && !shared.tally.is_given_up() {
            let wait = {
                let faults = shared.faults();
                pause(faults.inbound.next_due(), faults.now())
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
            if gone && faults.inbound.line().len() == 0 {
                return;
            }
        }
    }

    fn take(&self, inbound: Inbound) {
        let mut faults = self.shared.faults();
        let now = faults.start();
        if faults.switch(&inbound.packet, false) {
            // A command that ends a fault must pass that fault.
            let _ = self.to.push(inbound);
            return;
        }
        match faults.inbound.push(inbound, now) {
            Pushed::Lost(FaultKind::Overrun) | Pushed::Full => count(&self.shared.tally.dropped),
            Pushed::Taken | Pushed::Lost(_) => {}
        }
    }
}

/// The path of packets from the emulator to the link.
struct TxPath {
    from: Receiver<Outbound>,
    to: Box<dyn Outbox>,
    sender: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    /// A packet for which the link had no room.
    stopped: Option<Outbound>,
}

impl TxPath {
    /// Carries packets until the emulator has closed and its queue is empty or abandoned, or the
    /// link ends.
    fn run(mut self) {
        let shared = self.shared.clone();
        while !shared.tally.is_given_up() && matches!(self.turn(), Ok(true)) {}
        // Record the last injections.
        shared.faults().note();
        drop(self.to);
        if let Some(sender) = self.sender.filter(|_| !shared.tally.is_given_up()) {
            // A panic reports itself.
            let _ = sender.join();
        }
        // Set only now, since a link without a reader drops its queued packets.
        shared.ended.store(true, Ordering::Relaxed);
    }

    /// Forwards due packets, then waits for more; false at the end.
    fn turn(&mut self) -> Result<bool, LinkError> {
        self.send_due()?;
        let (wait, has_room, waiting) = {
            let mut faults = self.shared.faults();
            faults.note();
            let wait = pause(faults.outbound.next_due(), faults.now());
            (
                wait,
                faults.outbound.has_room(),
                faults.outbound.line().len(),
            )
        };
        let wait = if self.stopped.is_some() {
            ROOM_WAIT
        } else {
            wait
        };
        if !has_room {
            std::thread::sleep(wait.max(ROOM_WAIT));
            return Ok(true);
        }
        match self.from.recv_timeout(wait) {
            Ok(item) => self.take(item),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) if waiting == 0 && self.stopped.is_none() => {
                return Ok(false);
            }
            Err(RecvTimeoutError::Disconnected) => std::thread::sleep(wait),
        }
        Ok(true)
    }

    fn send_due(&mut self) -> Result<(), LinkError> {
        while let Some(item) = self
            .stopped
            .take()
            .or_else(|| self.shared.faults().pop_out())
        {
            let is_packet = item.bytes().is_some();
            let offer = || self.to.offer(item);
            self.stopped = if is_packet {
                let tx_complete = &self.shared.tally.tx_complete;
                tx_complete.forward(offer, |rejected| matches!(rejected, Ok(None)))?
            } else {
                offer()?
            };
            if self.stopped.is_some() {
                break;
            }
        }
        Ok(())
    }

    fn take(&mut self, item: Outbound) {
        let tally = &self.shared.tally;
        let is_packet = item.bytes().is_some();
        let faults = &mut *self.shared.faults();
        let now = faults.start();
        let before = faults.outbound.line().len();
        let pushed = if faults.exempt.is_exempt(faults.personality, item.bytes()) {
            faults.outbound.pass(item, now)
        } else {
            faults.outbound.push(item, now)
        };
        match pushed {
            Pushed::Taken => {
                for _ in 1..faults.outbound.line().len() - before {
                    tally.queued();
                }
            }
            // `Full` cannot occur: room was checked.
            Pushed::Full | Pushed::Lost(FaultKind::Down | FaultKind::BusOff) => {
                count(&tally.lost);
                tally.done();
            }
            // The sender gets no error.
            Pushed::Lost(_) if is_packet => tally.done(),
            Pushed::Lost(_) => {}
        }
    }
}

/// Wait until `due`, at most [`TICK`].
fn pause(due: Option<Duration>, now: Option<Duration>) -> Duration {
    let wait = due.zip(now).map(|(due, now)| due.saturating_sub(now));
    wait.map_or(TICK, |wait| wait.min(TICK))
}
