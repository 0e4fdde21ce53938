//! Packets on a bus: one thread reads frames, another runs the [`Node`], sends, and keeps the pace.
//!
//! The reader only reads, so that the kernel's buffer never fills up while a frame waits for the
//! bus. A bus that vanishes (interface down, adapter unplugged) is reopened until it is back.

use super::pacing::{Pace, Rates};
use super::{CanBus, Opener, Sending, Trouble};
use skyloop_protocols::can::{CanFrame, Counts, Lane, Node};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TryRecvError, sync_channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The owner of a carrier: its packets, and its book-keeping.
pub trait Above: Send + 'static {
    /// A packet to send.
    type Packet: AsRef<[u8]> + Send;

    /// The next packet to send.
    fn next(&mut self) -> Next<Self::Packet>;

    /// A packet has arrived; `at`: its last frame. False: packets are no longer wanted.
    fn arrived(&mut self, packet: &[u8], at: Instant) -> bool;

    /// Whether packets are still wanted: if not, the carrier ends at once.
    fn is_wanted(&self) -> bool;

    /// A packet has left, or has been given up: that is an `Unsent` too.
    fn ended(&mut self, _: Self::Packet, _is_sent: bool) {}

    /// Something to book or to report.
    fn note(&mut self, note: Note);
}

/// Whether there is something to send.
pub enum Next<P> {
    /// This packet.
    Packet(P),
    /// Nothing now.
    Nothing,
    /// Nothing any more: what is under way leaves, and the carrier ends.
    Closed,
}

/// What happens on the bus.
#[derive(Debug)]
pub enum Note {
    /// A frame with so many data octets has left.
    Moved(usize),
    /// Packets that did not get through.
    Unsent(u32),
    /// Messages that began to arrive and were never whole.
    Incomplete(u32),
    /// What came and was no frame, or one on our identifiers that cannot be right.
    Garbled(u32),
    /// Messages longer than any packet.
    Oversize(u32),
    /// The controller reports an error, or has left the bus, or is back.
    Trouble(Trouble),
    /// The bus has gone, and is waited for.
    Gone(io::Error),
    /// The bus is back.
    Back,
    /// The bus has gone, and nobody can open it again: this is the end.
    Ended(io::Error),
}

/// How long the reader waits before it looks whether it is still wanted.
const READ_TIMEOUT: Duration = Duration::from_millis(50);
/// How long the carrier sleeps at most.
const NAP: Duration = Duration::from_millis(100);
/// Until a full queue is tried again, at least: a few frames of a bus at 1 Mbit/s.
const FULL: Duration = Duration::from_micros(500);
/// Between two attempts to open a bus that has gone.
const RETRY: Duration = Duration::from_millis(200);
/// Frames that may wait for the carrier.
const QUEUE: usize = 1024;

enum Event {
    Frame(CanFrame, Instant),
    /// There may be a packet to send.
    Wake,
    Garbled(u32),
    Gone(io::Error),
}

/// Tells the carrier that there is something to send.
#[derive(Clone)]
pub struct Waker(SyncSender<Event>);

impl Waker {
    /// Wakes it. With a full queue it is awake.
    pub fn wake(&self) {
        let _ = self.0.try_send(Event::Wake);
    }
}

/// Starts the two threads, called `name`. The returned one ends when `above` is closed and all has
/// left, or when packets are no longer wanted.
///
/// # Errors
/// The system gives no thread or no second handle to the bus.
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

/// The thread that reads.
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
        // It ends within its time-out, or with the carrier if the queue is full.
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// The thread that sends.
struct Carrier<A: Above> {
    name: String,
    /// None while it has gone.
    bus: Option<Box<dyn CanBus>>,
    reader: Option<Reader>,
    opener: Option<Opener>,
    wake: SyncSender<Event>,
    events: Receiver<Event>,
    node: Node,
    /// What the node had counted when it was last asked.
    counts: Counts,
    pace: Pace,
    above: A,
    /// A packet whose lane is busy.
    waiting: Option<A::Packet>,
    /// The packet of ours that is under way in each lane.
    in_flight: [Option<A::Packet>; 2],
    /// Of the packets that have ended, those that did not get through.
    unsent: u32,
    /// A frame that the bus did not take yet.
    frame: Option<CanFrame>,
    /// When a controller that has left the bus is put back on it.
    restart: Option<Instant>,
    closed: bool,
    start: Instant,
}

impl<A: Above> Carrier<A> {
    /// Sends what may leave, then waits for events and handles them. False: the carrier ends.
    fn turn(&mut self) -> bool {
        self.feed();
        let due = match self.restart().and_then(|()| self.push()) {
            Ok(due) => due,
            Err(error) => return self.recover(error),
        };
        self.book();
        // Packets just given up leave their lane here, so that they are not counted again at the
        // end.
        self.finish();
        if self.closed && self.is_idle() || !self.above.is_wanted() {
            return false;
        }
        let mut event = match self.events.recv_timeout(self.until(due)) {
            Ok(event) => event,
            Err(RecvTimeoutError::Timeout) => return true,
            Err(RecvTimeoutError::Disconnected) => return false,
        };
        // Bounded, so that a flood does not keep us from sending.
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

    /// How long there is nothing to do: `due` is when the bus takes a frame that waits.
    fn until(&self, due: Option<Instant>) -> Duration {
        let now = Instant::now();
        let due = due.map(|due| due.saturating_duration_since(now));
        // A frame that is due waits for the bus; the node's next timer is one more reason to wake.
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

    /// Gives packets to the node while its lanes take them.
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
            // The one before was given up just now, or its lane would be busy.
            if let Some(before) = self.in_flight[lane as usize].replace(packet) {
                self.unsent = self.unsent.wrapping_add(1);
                self.above.ended(before, false);
            }
            self.finish();
        }
    }

    /// Books the packets that have left their lane.
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

    /// Puts frames on the bus while its pace and its queue allow it; when to go on, if one waits.
    fn push(&mut self) -> io::Result<Option<Instant>> {
        loop {
            let now = Instant::now();
            if self.frame.is_none() {
                // Due is a frame, or the end of a timer: then there is none.
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
            self.feed();
        }
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
        let now = self.now_us(Instant::now());
        match self.node.receive(frame, now) {
            Some(packet) => self.above.arrived(packet, at),
            None => true,
        }
    }

    /// Passes on what the node has counted since.
    fn book(&mut self) {
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

    /// Ends the reader of a bus that is gone. Its remaining frames and errors belong to that bus,
    /// not to the next one.
    fn dismiss_reader(&mut self) {
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

    /// Waits for a bus that has gone. The packet under way is not lost yet: the node's timers tell.
    fn recover(&mut self, error: io::Error) -> bool {
        if self.opener.is_none() {
            self.reader = None;
            self.above.note(Note::Ended(error));
            return false;
        }
        self.above.note(Note::Gone(error));
        self.dismiss_reader();
        // A serial port is open once: this end of it is closed before it is opened again.
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
            // Without a second handle or thread it is retried like a bus that is not there.
            if let Ok(reader) = reader {
                (self.bus, self.reader) = (Some(bus), Some(reader));
                self.above.note(Note::Back);
                return true;
            }
        }
    }
}
