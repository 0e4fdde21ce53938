//! The faults around an open link: a thread each way between the link's own queues and those of the emulator.

use super::book::Book;
use super::engine::{Damageable, Faults, Pushed};
use super::harm::note_harm;
use super::outage::{Change, Outage, in_order};
use super::plan::{Plan, impossible};
use super::spared::Spared;
use crate::link::inbox::inbox;
use crate::link::{Inbound, Inbox, Intake, LinkError, Outbound, Outbox, QUEUE, Tally, Wire, count};
use bytes::Bytes;
use skyloop_protocols::{Command, Direction, FaultKind, Personality, packet};
use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a thread waits before it looks whether something has changed.
const TICK: Duration = Duration::from_millis(20);
/// How long it waits for room in the link's queue.
const BREATH: Duration = Duration::from_micros(200);
/// How often the book reaches its file.
const FLUSH: Duration = Duration::from_secs(1);

/// What both directions share.
struct Shared {
    /// The first packet of either direction.
    zero: OnceLock<Instant>,
    way_in: Mutex<Faults<Inbound>>,
    way_out: Mutex<Faults<Outbound>>,
    /// The answers that suffer nothing.
    spared: Mutex<Spared>,
    /// Whether the link is down, in any direction.
    down: Mutex<Outage>,
    personality: &'static Personality,
    book: Arc<Mutex<Book>>,
    tally: Arc<Tally>,
    address: String,
    /// Whether the emulator has dropped its end.
    ended: AtomicBool,
}

impl Shared {
    /// Time since the first packet; none before it.
    fn now(&self) -> Option<Duration> {
        self.zero.get().map(Instant::elapsed)
    }

    /// A packet has come: time runs from the first.
    fn start(&self) -> Duration {
        let start = || {
            lock(&self.book).start();
            Instant::now()
        };
        self.zero.get_or_init(start).elapsed()
    }

    /// Writes down what has been injected, of both directions together: what happened first comes first.
    fn note(&self) {
        let Some(now) = self.now() else { return };
        let mut down = lock(&self.down);
        let (injected, seen) = {
            let (mut way_in, mut way_out) = (lock(&self.way_in), lock(&self.way_out));
            way_in.turn(now);
            way_out.turn(now);
            let injected = in_order(way_in.injected(), way_out.injected());
            let due = [way_in.line().next_due(), way_out.line().next_due()];
            note_harm(&self.tally, due, &injected, now);
            (injected, [way_in.outlook(), way_out.outlook()])
        };
        lock(&self.book).foresee(seen);
        if injected.is_empty() {
            return;
        }
        lock(&self.book).note(&self.address, &injected);
        for injection in &injected {
            if down.see(injection) == Some(Change::Back) {
                count(&self.tally.reconnects);
            }
        }
    }
}

/// What a thread that panicked leaves behind is data like any other.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Damageable for Inbound {
    fn octets(&self) -> Option<&[u8]> {
        Some(&self.packet)
    }

    fn with_octets(self, octets: Vec<u8>) -> Inbound {
        let packet = Bytes::from(octets);
        Inbound { packet, ..self }
    }

    fn members(&self) -> String {
        members(&self.packet)
    }
}

/// APID and sequence count, as the octets state them.
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

    fn with_octets(self, octets: Vec<u8>) -> Outbound {
        match self {
            Outbound::Packet { exchange, .. } => Outbound::Packet {
                exchange,
                packet: Bytes::from(octets),
            },
            release => release,
        }
    }

    fn members(&self) -> String {
        self.octets().map_or(String::new(), members)
    }
}

/// Puts the faults of `plan`, and those that the client commands, between `wire` and the emulator. What is
/// injected goes into the book.
pub fn wrap(
    wire: Wire,
    plan: &Plan,
    personality: &'static Personality,
    book: &Arc<Mutex<Book>>,
) -> Result<Wire, LinkError> {
    let shared = Arc::new(Shared {
        zero: OnceLock::new(),
        way_in: Mutex::new(Faults::new(Direction::In, &plan.rules)),
        way_out: Mutex::new(Faults::new(Direction::Out, &plan.rules)),
        spared: Mutex::new(Spared::default()),
        down: Mutex::new(Outage::of(FaultKind::Down)),
        personality,
        book: book.clone(),
        tally: wire.tally.clone(),
        address: wire.address.clone(),
        ended: AtomicBool::new(false),
    });
    let (intake, inbox) = inbox(wire.tally.clone());
    let (queue, departures) = sync_channel(QUEUE);
    let way_in = WayIn {
        from: wire.inbox,
        to: intake,
        shared: shared.clone(),
    };
    let way_out = WayOut {
        from: departures,
        to: wire.outbox,
        sender: wire.sender,
        shared: shared.clone(),
        stopped: None,
    };
    let failed = |source| LinkError::Io {
        url: wire.address.clone(),
        action: "start the threads of its faults",
        source,
        remedy: "check the limits of this process",
    };
    let thread = |name: &str| std::thread::Builder::new().name(name.to_string());
    thread("fault-in")
        .spawn(move || way_in.run())
        .map_err(failed)?;
    let sender = thread("fault-out")
        .spawn(move || way_out.run())
        .map_err(failed)?;
    let outbox = FaultyOutbox {
        queue,
        tally: wire.tally.clone(),
        address: wire.address.clone(),
    };
    Ok(Wire {
        address: wire.address,
        inbox,
        outbox: Box::new(outbox),
        tally: wire.tally,
        airtime: wire.airtime,
        sender: Some(sender),
    })
}

/// Towards the emulator.
struct WayIn {
    from: Inbox,
    to: Intake,
    shared: Arc<Shared>,
}

impl WayIn {
    /// Carries packets until the link or the emulator has gone.
    fn run(self) {
        let mut gone = false;
        let mut flushed = Instant::now();
        let shared = self.shared.clone();
        let over = || shared.ended.load(Ordering::Relaxed) || shared.tally.is_given_up();
        while !over() {
            let due = lock(&self.shared.way_in).next_due();
            let wait = pause(due, self.shared.now());
            if gone {
                std::thread::sleep(wait);
            } else {
                match self.from.recv_timeout(wait) {
                    Ok(inbound) => self.take(inbound),
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => gone = true,
                }
            }
            let now = self.shared.now();
            let due = || now.and_then(|now| lock(&self.shared.way_in).pop_due(now));
            while let Some(mut inbound) = due() {
                inbound.arrived = Instant::now();
                if self.to.push(inbound).is_err() {
                    return;
                }
            }
            self.shared.note();
            if gone && lock(&self.shared.way_in).line().len() == 0 {
                return;
            }
            if flushed.elapsed() > FLUSH {
                lock(&self.shared.book).flush();
                flushed = Instant::now();
            }
        }
    }

    fn take(&self, inbound: Inbound) {
        let shared = &self.shared;
        let now = shared.start();
        let decoded = (shared.personality.decode_command)(&inbound.packet);
        if let Ok((header, Command::Fault(fault))) = decoded {
            // Before it can be answered.
            lock(&shared.spared).remember(header.apid, header.sequence_count);
            // The emulator refuses what cannot be injected.
            if impossible(fault.kind).is_none() {
                match fault.direction {
                    Direction::In => lock(&shared.way_in).switch(fault, now),
                    Direction::Out => lock(&shared.way_out).switch(fault, now),
                }
            }
            // Whoever switches a fault off must get through to it.
            let _ = self.to.push(inbound);
            return;
        }
        let pushed = lock(&shared.way_in).push(inbound, now);
        match pushed {
            Pushed::Lost(FaultKind::Overrun) | Pushed::Full(_) => count(&shared.tally.dropped),
            Pushed::Taken | Pushed::Lost(_) => {}
        }
    }
}

/// From the emulator.
struct WayOut {
    from: Receiver<Outbound>,
    to: Box<dyn Outbox>,
    sender: Option<JoinHandle<()>>,
    shared: Arc<Shared>,
    /// What the link had no room for.
    stopped: Option<Outbound>,
}

impl WayOut {
    /// Carries packets until the emulator has dropped its end and all have left or are given up, or the link has gone.
    fn run(mut self) {
        let tally = self.shared.tally.clone();
        while !tally.is_given_up() && matches!(self.turn(), Ok(true)) {}
        // What was injected last.
        self.shared.note();
        drop(self.to);
        if let Some(sender) = self.sender.filter(|_| !tally.is_given_up()) {
            // Its panic has been told; there is nothing to take from it.
            let _ = sender.join();
        }
        // Not before: a link without its way in lets go of what it still has.
        self.shared.ended.store(true, Ordering::Relaxed);
    }

    /// Hands on what is due, then waits for more; false at the end.
    fn turn(&mut self) -> Result<bool, LinkError> {
        self.hand_on()?;
        let (due, has_room, waiting) = {
            self.shared.note();
            let faults = lock(&self.shared.way_out);
            (faults.next_due(), faults.has_room(), faults.line().len())
        };
        let wait = match self.stopped {
            Some(_) => BREATH,
            None => pause(due, self.shared.now()),
        };
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
        loop {
            let next = self.stopped.take();
            let now = self.shared.now();
            let due = || now.and_then(|now| lock(&self.shared.way_out).pop_due(now));
            let next = next.or_else(due);
            let Some(what) = next else { return Ok(()) };
            let departed = &self.shared.tally.departed;
            let is_packet = what.octets().is_some();
            let offer = || self.to.offer(what);
            self.stopped = match is_packet {
                true => departed.hand_on(offer, |kept| matches!(kept, Ok(None)))?,
                false => offer()?,
            };
            if self.stopped.is_some() {
                return Ok(());
            }
        }
    }

    fn take(&mut self, what: Outbound) {
        let tally = &self.shared.tally;
        let is_packet = what.octets().is_some();
        let now = self.shared.start();
        let spared = lock(&self.shared.spared).is_spared(self.shared.personality, what.octets());
        let mut faults = lock(&self.shared.way_out);
        let before = faults.line().len();
        let pushed = if spared {
            faults.pass(what, now)
        } else {
            faults.push(what, now)
        };
        match pushed {
            Pushed::Taken => {
                for _ in 1..faults.line().len() - before {
                    tally.queued();
                }
            }
            // There was room.
            Pushed::Full(_) | Pushed::Lost(FaultKind::Down | FaultKind::BusOff) => {
                count(&tally.lost);
                tally.done();
            }
            // The sender knows nothing of it.
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

/// The emulator's queue to the way out.
struct FaultyOutbox {
    queue: SyncSender<Outbound>,
    tally: Arc<Tally>,
    address: String,
}

impl Outbox for FaultyOutbox {
    fn offer(&mut self, what: Outbound) -> Result<Option<Outbound>, LinkError> {
        let is_packet = what.octets().is_some();
        let try_send = || self.queue.try_send(what);
        let sent = match is_packet {
            true => self.tally.queue(try_send),
            false => try_send(),
        };
        match sent {
            Ok(()) => Ok(None),
            Err(TrySendError::Full(what)) => Ok(Some(what)),
            Err(TrySendError::Disconnected(_)) => Err(LinkError::Closed(self.address.clone())),
        }
    }

    fn injects(&self, kind: FaultKind) -> Result<(), Cow<'static, str>> {
        match impossible(kind) {
            None => Ok(()),
            Some(why) => Err(why.into()),
        }
    }
}
