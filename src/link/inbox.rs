//! The inbound queue: bounded, and never blocks the wire. A full queue drops the oldest attitudes,
//! as newer ones replace them; every lost packet is counted.

use super::lock::lock;
use super::tally::{Tally, count};
use bytes::Bytes;
use skyloop_protocols::packet::{apid, identify};
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, TryRecvError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// Capacity of a packet queue. When full, senders wait, and receivers drop and count the oldest.
pub const QUEUE: usize = 256;

/// A packet from a client.
#[derive(Debug, Clone)]
pub struct Inbound {
    /// Number of its exchange: another number is another client.
    pub exchange: u32,
    /// The packet.
    pub packet: Bytes,
    /// Arrival of its last byte.
    pub arrived: Instant,
}

impl Inbound {
    pub(super) fn new(exchange: u32, packet: &[u8], arrived: Instant) -> Inbound {
        let packet = Bytes::copy_from_slice(packet);
        Inbound {
            exchange,
            packet,
            arrived,
        }
    }
}

/// A queue of received packets: the wire's end and the emulator's end.
pub(crate) fn inbox(tally: Arc<Tally>) -> (InboxSender, Inbox) {
    let shared = Arc::new(Shared {
        state: Mutex::new(State {
            waiting: VecDeque::with_capacity(QUEUE),
            senders: 1,
            read: true,
            reader: None,
        }),
        arrived: Condvar::new(),
        tally,
    });
    (
        InboxSender {
            shared: shared.clone(),
        },
        Inbox {
            shared,
            polled_empty: AtomicBool::new(false),
            observers: Vec::new(),
        },
    )
}

/// The wire's end. Several threads may have one.
pub struct InboxSender {
    shared: Arc<Shared>,
}

/// The emulator's end.
pub struct Inbox {
    shared: Arc<Shared>,
    /// Whether the emulator has polled the empty queue since the last packet.
    polled_empty: AtomicBool,
    observers: Vec<Box<dyn Observer>>,
}

/// Observes how the emulator takes packets.
pub trait Observer: Send + Sync {
    /// The emulator takes a packet; `first`: it had polled the empty queue before.
    fn taken(&self, inbound: &Inbound, first: bool);

    /// The emulator polls the empty queue.
    fn empty(&self) {}

    /// The emulator begins or ends the rendering of a frame.
    fn making(&self, _is: bool) {}

    /// Whether, as recorded, the current frame must not end before another packet is taken.
    fn holds_frame(&self) -> bool {
        false
    }
}

/// The emulator has closed its end.
#[derive(Debug)]
pub(crate) struct Gone;

struct Shared {
    state: Mutex<State>,
    arrived: Condvar,
    tally: Arc<Tally>,
}

struct State {
    waiting: VecDeque<Inbound>,
    /// Number of senders.
    senders: usize,
    /// Whether the emulator's end is open.
    read: bool,
    /// The thread to unpark, which waits for several queues.
    reader: Option<Thread>,
}

impl Shared {
    /// Unlocks the queue and wakes the waiting threads.
    fn wake(&self, state: MutexGuard<'_, State>) {
        let reader = state.reader.clone();
        drop(state);
        self.arrived.notify_one();
        if let Some(reader) = reader {
            reader.unpark();
        }
    }
}

impl InboxSender {
    /// Queues a packet without waiting. A full queue drops and counts its oldest attitude, else its
    /// oldest packet.
    pub(crate) fn push(&self, inbound: Inbound) -> Result<(), Gone> {
        let mut state = lock(&self.shared.state);
        if !state.read {
            return Err(Gone);
        }
        if state.waiting.len() >= QUEUE {
            let oldest = state.waiting.iter().position(is_attitude);
            state.waiting.remove(oldest.unwrap_or(0));
            count(&self.shared.tally.dropped);
        }
        state.waiting.push_back(inbound);
        self.shared.wake(state);
        Ok(())
    }

    /// A function that returns whether the emulator's end is open, for threads without a sender.
    pub(crate) fn watch(&self) -> impl Fn() -> bool + Send + use<> {
        let shared = self.shared.clone();
        move || lock(&shared.state).read
    }
}

fn is_attitude(inbound: &Inbound) -> bool {
    identify(&inbound.packet).is_some_and(|(apid, _)| apid == apid::ATTITUDE)
}

impl Clone for InboxSender {
    fn clone(&self) -> InboxSender {
        lock(&self.shared.state).senders += 1;
        InboxSender {
            shared: self.shared.clone(),
        }
    }
}

impl Drop for InboxSender {
    fn drop(&mut self) {
        let mut state = lock(&self.shared.state);
        state.senders -= 1;
        self.shared.wake(state);
    }
}

impl Inbox {
    /// Unparks `reader`, a thread with several queues, at every packet and at the end of the wire.
    pub fn unparks(&self, reader: Thread) {
        lock(&self.shared.state).reader = Some(reader);
    }

    /// Adds an observer.
    pub fn observe(&mut self, observer: Box<dyn Observer>) {
        self.observers.push(observer);
    }

    /// The next packet, if there is one.
    pub fn try_recv(&self) -> Result<Inbound, TryRecvError> {
        let mut state = lock(&self.shared.state);
        let (next, senders) = (state.waiting.pop_front(), state.senders);
        drop(state);
        match next {
            Some(inbound) => Ok(self.observed(inbound)),
            None if senders == 0 => Err(TryRecvError::Disconnected),
            None => {
                self.polled_empty.store(true, Ordering::Relaxed);
                for observer in &self.observers {
                    observer.empty();
                }
                Err(TryRecvError::Empty)
            }
        }
    }

    /// Notes that the emulator begins or ends the rendering of a frame.
    pub fn making(&self, is: bool) {
        for observer in &self.observers {
            observer.making(is);
        }
    }

    /// Whether the current frame must not end before another packet is taken.
    pub fn holds_frame(&self) -> bool {
        self.observers.iter().any(|one| one.holds_frame())
    }

    fn observed(&self, inbound: Inbound) -> Inbound {
        let first = self.polled_empty.swap(false, Ordering::Relaxed);
        for observer in &self.observers {
            observer.taken(&inbound, first);
        }
        inbound
    }

    /// The next packet, waiting `timeout` at most.
    pub fn recv_timeout(&self, timeout: Duration) -> Result<Inbound, RecvTimeoutError> {
        let deadline = Instant::now() + timeout;
        let mut state = lock(&self.shared.state);
        loop {
            if let Some(inbound) = state.waiting.pop_front() {
                drop(state);
                return Ok(self.observed(inbound));
            }
            if state.senders == 0 {
                return Err(RecvTimeoutError::Disconnected);
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(RecvTimeoutError::Timeout);
            }
            let waited = self.shared.arrived.wait_timeout(state, left);
            (state, _) = waited.unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Inbox {
    fn drop(&mut self) {
        let mut state = lock(&self.shared.state);
        state.read = false;
        state.waiting.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::{Attitude, Command, MAX_PACKET, WireTime};

    fn inbound(command: &Command, count: u16) -> Inbound {
        let mut buffer = [0; MAX_PACKET];
        let length = command.encode(count, WireTime(0), &mut buffer).unwrap();
        Inbound {
            exchange: 0,
            packet: Bytes::copy_from_slice(&buffer[..length]),
            arrived: Instant::now(),
        }
    }

    fn attitude(count: u16) -> Inbound {
        let attitude = Attitude {
            sequence: u32::from(count),
            q_icrf_to_body: [0.0, 0.0, 0.0, 1.0],
            rates_rad_s: [0.0; 3],
            state: None,
        };
        inbound(&Command::Attitude(attitude), count)
    }

    /// APIDs and sequence counts of the queued packets.
    fn rest(inbox: &Inbox) -> Vec<(u16, u16)> {
        std::iter::from_fn(|| inbox.try_recv().ok())
            .map(|inbound| identify(&inbound.packet).unwrap())
            .collect()
    }

    #[test]
    fn full_queue_drops_and_counts_its_oldest_attitudes() {
        let tally = Arc::new(Tally::default());
        let (inbox_sender, inbox) = inbox(tally.clone());
        inbox_sender.push(inbound(&Command::Ping, 9)).unwrap();
        // 255 fill the queue, and 1000 more replace as many older ones.
        for count in 0..1255 {
            inbox_sender.push(attitude(count)).unwrap();
        }
        assert_eq!(tally.counters().overflows, 1000);
        let rest = rest(&inbox);
        assert_eq!((rest.len(), rest[0]), (QUEUE, (apid::COMMAND, 9)));
        assert_eq!(rest[1], (apid::ATTITUDE, 1000), "the newest are left");
        assert_eq!(rest[255], (apid::ATTITUDE, 1254));
    }

    #[test]
    fn without_attitudes_the_oldest_packet_is_dropped() {
        let tally = Arc::new(Tally::default());
        let (inbox_sender, inbox) = inbox(tally.clone());
        for count in 0..=QUEUE as u16 {
            inbox_sender.push(inbound(&Command::Ping, count)).unwrap();
        }
        let rest = rest(&inbox);
        assert_eq!(
            (rest[0].1, rest.len(), tally.counters().overflows),
            (1, QUEUE, 1)
        );
    }

    #[test]
    fn each_end_detects_that_the_other_has_closed() {
        let (inbox_sender, inbox) = inbox(Arc::new(Tally::default()));
        let other = inbox_sender.clone();
        assert_eq!(inbox.try_recv().unwrap_err(), TryRecvError::Empty);
        let timeout = inbox.recv_timeout(Duration::from_millis(5)).unwrap_err();
        assert_eq!(timeout, RecvTimeoutError::Timeout);
        other.push(attitude(1)).unwrap();
        drop((inbox_sender, other));
        // Queued packets can still be read.
        assert!(inbox.recv_timeout(Duration::ZERO).is_ok());
        let gone = inbox.recv_timeout(Duration::from_secs(20)).unwrap_err();
        assert_eq!(gone, RecvTimeoutError::Disconnected);
        assert_eq!(inbox.try_recv().unwrap_err(), TryRecvError::Disconnected);
    }

    #[test]
    fn closed_emulator_accepts_nothing() {
        let (inbox_sender, inbox) = inbox(Arc::new(Tally::default()));
        let is_wanted = inbox_sender.watch();
        assert!(is_wanted());
        drop(inbox);
        assert!(!is_wanted() && inbox_sender.push(attitude(1)).is_err());
    }

    #[test]
    fn packet_wakes_the_waiting_thread() {
        let (inbox_sender, inbox) = inbox(Arc::new(Tally::default()));
        let waiting = std::thread::spawn(move || inbox.recv_timeout(Duration::from_secs(20)));
        std::thread::sleep(Duration::from_millis(20));
        inbox_sender.push(attitude(7)).unwrap();
        let inbound = waiting.join().unwrap().unwrap();
        assert_eq!(identify(&inbound.packet), Some((apid::ATTITUDE, 7)));
    }
}
