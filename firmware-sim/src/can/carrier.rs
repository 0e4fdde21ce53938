//! Packets on a bus: one thread reads frames; another runs the [`Node`], sends, and paces.
//!
//! The reader does nothing else, so that the kernel's buffer does not overflow while a frame waits
//! for the bus. A bus that vanishes (interface down, adapter unplugged) is reopened.

use super::pacing::{Pace, Rates};
use super::{CanBus, Opener, Sending, Trouble};
use skyloop_protocols::can::{CanFrame, Counts, Lane, Node};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Owner of a carrier: source and sink of its packets, and its counters.
pub trait Above: Send + 'static {
    /// A packet to send.
    type Packet: AsRef<[u8]> + Send;

    /// The next packet to send.
    fn next(&mut self) -> Next<Self::Packet>;

    /// Handles a packet; `at` is the time of its last frame. False: stop receiving.
    fn arrived(&mut self, packet: &[u8], at: Instant) -> bool;

    /// Whether the carrier should go on. If not, it ends at once.
    fn is_wanted(&self) -> bool;

    /// A packet was sent or dropped. A dropped one is also noted as `Unsent`.
    fn ended(&mut self, _: Self::Packet, _is_sent: bool) {}

    /// Counts or reports an event.
    fn note(&mut self, note: Note);
}

/// Result of [`Above::next`].
pub enum Next<P> {
    /// Send this packet.
    Packet(P),
    /// No packet now.
    Nothing,
    /// No more packets. The carrier sends what is queued and ends.
    Closed,
}

/// An event on the bus.
#[derive(Debug)]
pub enum Note {
    /// A frame with this many data bytes was sent.
    Moved(usize),
    /// Number of packets not delivered.
    Unsent(u32),
    /// Number of messages received in part.
    Incomplete(u32),
    /// Number of invalid frames and bytes, or frames on our identifiers with invalid content.
    Garbled(u32),
    /// Number of messages longer than any packet.
    Oversize(u32),
    /// The controller reports an error, bus-off, or a restart.
    Trouble(Trouble),
    /// The bus is gone; the carrier tries to reopen it.
    Gone(io::Error),
    /// The bus is back.
    Back,
    /// The bus is gone and cannot be reopened; the carrier ends.
    Ended(io::Error),
}

/// Time between the reader's checks of its stop flag.
const READ_TIMEOUT: Duration = Duration::from_millis(50);
/// Longest sleep of the carrier.
const NAP: Duration = Duration::from_millis(100);
/// Shortest wait before a full queue is tried again: a few frames at 1 Mbit/s.
const FULL: Duration = Duration::from_micros(500);
const RETRY: Duration = Duration::from_millis(200);
const QUEUE: usize = 1024;

enum Event {
    Frame(CanFrame, Instant),
    /// There may be a packet to send.
    Wake,
    Garbled(u32),
    Gone(io::Error),
}

/// Wakes the carrier when there is a packet to send.
#[derive(Clone)]
pub struct Waker(SyncSender<Event>);

impl Waker {
    /// Wakes the carrier. With a full queue it is already awake.
    pub fn wake(&self) {
        let _ = self.0.try_send(Event::Wake);
    }
}

/// Starts the two threads, called `name`. The returned one ends when `above` is closed and the
/// queue is empty, or when `above` is no longer wanted.
///
/// # Errors
/// The system gives no thread, or no second handle to the bus.
pub fn start<A: Above>(
    name: &str,
    bus: Box<dyn CanBus>,
    opener: Option<Opener>,
    node: Node,
    rates: Rates,
    above: A,
) -> io::Result<(Waker, JoinHandle<()>)> {
    let (wake, events) = sync_channel(QUEUE);
    let reader = Reader::start(name, bus.share()?, wake.clone())?;
    let mut carrier = Carrier {
        name: name.to_string(),
        bus: Some(bus),
        reader: Some(reader),
        opener,
        wake: wake.clone(),
        events,
        node,
        counts: Counts::default(),
        pace: Pace::new(rates),
        above,
        waiting: None,
        in_flight: [None, None],
        unsent: 0,
        frame: None,
        restart: None,
        closed: false,
        start: Instant::now(),
    };
    let thread = std::thread::Builder::new()
        .name(format!("{name}-send"))
        .spawn(move || while carrier.turn() {})?;
    Ok((Waker(wake), thread))
}

struct Reader {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Reader {
    fn start(
        name: &str,
        mut bus: Box<dyn CanBus>,
        events: SyncSender<Event>,
    ) -> io::Result<Reader> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let thread = std::thread::Builder::new()
            .name(format!("{name}-read"))
            .spawn(move || {
                while !stopped.load(Ordering::Relaxed) {
                    let (event, gone) = match bus.recv(READ_TIMEOUT) {
                        Ok(None) => (None, false),
                        Ok(Some(frame)) => (Some(Event::Frame(frame, Instant::now())), false),
                        Err(error) => (Some(Event::Gone(error)), true),
                    };
                    let garbled = Some(bus.garbled()).filter(|more| *more > 0);
                    let mut events_now = garbled.map(Event::Garbled).into_iter().chain(event);
                    if events_now.any(|event| events.send(event).is_err()) || gone {
                        return;
                    }
                }
            })?;
        Ok(Reader { stop, thread })
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        // The thread ends within its time-out, or with the carrier if the queue is full.
        self.stop.store(true, Ordering::Relaxed);
    }
}

struct Carrier<A: Above> {
    name: String,
    /// None while the bus is gone.
    bus: Option<Box<dyn CanBus>>,
    reader: Option<Reader>,
    opener: Option<Opener>,
    wake: SyncSender<Event>,
    events: Receiver<Event>,
    node: Node,
    /// Counts of the node at the last report.
    counts: Counts,
    pace: Pace,
    above: A,
    /// A packet whose lane is busy.
    waiting: Option<A::Packet>,
    /// Our packet in transmission, by lane.
    in_flight: [Option<A::Packet>; 2],
    unsent: u32,
    /// A frame that the bus has not accepted yet.
    frame: Option<CanFrame>,
    /// When to restart a controller that is bus-off.
    restart: Option<Instant>,
    closed: bool,
    start: Instant,
}

impl<A: Above> Carrier<A> {
    /// Sends a due frame, then waits for events and handles them. False: the carrier ends.
    fn turn(&mut self) -> bool {
        self.feed();
        let due = match self.restart().and_then(|()| self.push()) {
            Ok(due) => due,
            Err(error) => return self.recover(error),
        };
        self.report_counts();
        // Packets just dropped leave their lane here, so that they are not counted twice.
        self.finish();
        if self.closed && self.is_idle() || !self.above.is_wanted() {
            return false;
        }
        let mut event = match self.events.recv_timeout(self.until(due)) {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        };
        // Bounded, so that a flood of events does not stop sending.
        for _ in 0..QUEUE {
            match event {
                Event::Wake => {}
                Event::Gone(error) => return self.recover(error),
                Event::Garbled(more) => self.above.note(Note::Garbled(more)),
                Event::Frame(frame, at) => {
                    if !self.receive(&frame, at) {
                        return false;
                    }
                }
            }
            event = match self.events.try_recv() {
                Ok(event) => event,
                Err(TryRecvError::Empty) => return true,
                Err(TryRecvError::Disconnected) => return false,
            };
        }
        true
    }

    fn now_us(&self, at: Instant) -> u64 {
        let since = at.saturating_duration_since(self.start);
        u64::try_from(since.as_micros()).unwrap_or(u64::MAX)
    }

    /// Time until the next action; `due` is when the bus accepts a waiting frame.
    fn until(&self, due: Option<Instant>) -> Duration {
        let now = Instant::now();
        let due = due.map(|due| due.saturating_duration_since(now));
        // A due frame waits for the bus alone; otherwise the node's next timer counts.
        let node = self.node.wake_at().filter(|_| due.is_none());
        let node = node.map(|at| Duration::from_micros(at.saturating_sub(self.now_us(now))));
        let restart = self.restart.map(|at| at.saturating_duration_since(now));
        let waits = [due, restart, node].into_iter().flatten();
        waits.fold(NAP, Duration::min)
    }

    fn is_idle(&self) -> bool {
        let lanes = [Lane::Plain, Lane::Long];
        self.frame.is_none()
            && self.waiting.is_none()
            && lanes.iter().all(|lane| self.node.is_idle(*lane))
    }

    /// Gives packets to the node while its lanes are free.
    fn feed(&mut self) {
        self.finish();
        loop {
            let packet = match self.waiting.take() {
                Some(packet) => packet,
                None if self.closed => return,
                None => match self.above.next() {
                    Next::Packet(packet) => packet,
                    Next::Nothing => return,
                    Next::Closed => {
                        self.closed = true;
                        return;
                    }
                },
            };
            let now = self.now_us(Instant::now());
            let lane = self.node.lane(packet.as_ref());
            if self.node.send(packet.as_ref(), now).is_err() {
                self.waiting = Some(packet);
                return;
            }
            // The previous packet was just dropped; otherwise its lane would be busy.
            if let Some(before) = self.in_flight[lane as usize].replace(packet) {
                self.unsent = self.unsent.wrapping_add(1);
                self.above.ended(before, false);
            }
            self.finish();
        }
    }

    fn finish(&mut self) {
        for lane in [Lane::Plain, Lane::Long] {
            if !self.node.is_idle(lane) {
                continue;
            }
            if let Some(packet) = self.in_flight[lane as usize].take() {
                let unsent = self.node.counts().unsent;
                let is_sent = lane == Lane::Plain || unsent == self.unsent;
                if !is_sent {
                    self.unsent = unsent;
                }
                self.above.ended(packet, is_sent);
            }
        }
    }

    /// Sends a due frame within pace and queue. Returns when to go on, if a frame waits or another
    /// may be due. Frames that arrived while the bus blocked come before any time-out.
    fn push(&mut self) -> io::Result<Option<Instant>> {
        let now = Instant::now();
        if self.frame.is_none() {
            // Either a frame or a timer is due; for a timer, `next_frame` returns none.
            if self.node.wake_at().is_none_or(|at| at > self.now_us(now)) {
                return Ok(None);
            }
            if let Some(free) = self.pace.until(now) {
                return Ok(Some(free));
            }
            self.frame = self.node.next_frame(self.now_us(now));
        }
        let (Some(frame), Some(bus)) = (self.frame, &mut self.bus) else {
            return Ok(None);
        };
        if bus.send(&frame)? == Sending::Full {
            return Ok(Some(now + self.pace.rates.duration(&frame).max(FULL)));
        }
        self.frame = None;
        self.pace.sent(&frame, now);
        self.above.note(Note::Moved(frame.len.into()));
        Ok(Some(now))
    }

    fn restart(&mut self) -> io::Result<()> {
        if self.restart.is_some_and(|at| at <= Instant::now())
            && let Some(bus) = &mut self.bus
        {
            let is_sent = bus.restart()? == Sending::Sent;
            self.restart = (!is_sent).then(|| Instant::now() + RETRY);
        }
        Ok(())
    }

    fn receive(&mut self, frame: &CanFrame, at: Instant) -> bool {
        if let Some(trouble) = Trouble::of(frame) {
            if trouble == Trouble::BusOff {
                self.restart.get_or_insert(at + RETRY);
            }
            self.above.note(Note::Trouble(trouble));
            return true;
        }
        // A frame that arrived in time is in time, however late this thread is.
        match self.node.receive(frame, self.now_us(at)) {
            Some(packet) => self.above.arrived(packet, at),
            None => true,
        }
    }

    fn report_counts(&mut self) {
        let (now, before) = (self.node.counts(), self.counts);
        self.counts = now;
        type Counted = fn(u32) -> Note;
        let notes: [(Counted, u32, u32); 4] = [
            (Note::Unsent, now.unsent, before.unsent),
            (Note::Incomplete, now.incomplete, before.incomplete),
            (Note::Oversize, now.oversize, before.oversize),
            (Note::Garbled, now.malformed, before.malformed),
        ];
        for (note, now, before) in notes.into_iter().filter(|(_, now, before)| now != before) {
            self.above.note(note(now.wrapping_sub(before)));
        }
    }

    /// Ends the reader of a bus that is gone. Its remaining events do not belong to the next bus.
    fn end_reader(&mut self) {
        let Some(reader) = self.reader.take() else {
            return;
        };
        reader.stop.store(true, Ordering::Relaxed);
        let begin = Instant::now();
        let mut ended = false;
        while !ended && begin.elapsed() < 4 * READ_TIMEOUT {
            ended = reader.thread.is_finished();
            while let Ok(event) = self.events.try_recv() {
                if let Event::Garbled(more) = event {
                    self.above.note(Note::Garbled(more));
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Reopens a bus that is gone. The packet in transmission may survive, as the node's timers
    /// decide.
    fn recover(&mut self, error: io::Error) -> bool {
        if self.opener.is_none() {
            self.reader = None;
            self.above.note(Note::Ended(error));
            return false;
        }
        self.above.note(Note::Gone(error));
        self.end_reader();
        // A serial port opens once: the old handle closes first.
        (self.bus, self.restart) = (None, None);
        loop {
            std::thread::sleep(RETRY);
            if !self.above.is_wanted() {
                return false;
            }
            let Some(Ok(bus)) = self.opener.as_mut().map(|open| open()) else {
                continue;
            };
            let shared = bus.share();
            let reader = shared.and_then(|bus| Reader::start(&self.name, bus, self.wake.clone()));
            // Without a second handle or thread, retry as for a missing bus.
            if let Ok(reader) = reader {
                (self.bus, self.reader) = (Some(bus), Some(reader));
                self.above.note(Note::Back);
                return true;
            }
        }
    }
}
