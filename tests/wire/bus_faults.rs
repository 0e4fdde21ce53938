//! Faults on a CAN bus that is slow, full or flooded.

use crate::support::always;
use skyloop::link::Tally;
use skyloop::link::fault::{BusFaults, FaultLog, Plan};
use skyloop_firmware_sim::can::{CanBus, Sending};
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::personality::NATIVE;
use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

#[derive(Default)]
struct Control {
    /// Number of receive calls.
    polls: AtomicU32,
    /// Locked to block senders.
    gate: Mutex<()>,
    full: AtomicBool,
}

#[derive(Clone)]
struct Slow {
    to: Sender<CanFrame>,
    from: Arc<Mutex<Receiver<CanFrame>>>,
    control: Arc<Control>,
}

impl CanBus for Slow {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        drop(self.control.gate.lock());
        if self.control.full.load(Ordering::Relaxed) {
            return Ok(Sending::Full);
        }
        self.to.send(*frame).unwrap();
        Ok(Sending::Sent)
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        self.control.polls.fetch_add(1, Ordering::Relaxed);
        Ok(self.from.lock().unwrap().recv_timeout(timeout).ok())
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        Ok(Box::new(self.clone()))
    }
}

/// The emulator's end with faults, and the other end of the bus.
struct Rig {
    ours: Box<dyn CanBus>,
    to: Sender<CanFrame>,
    from: Receiver<CanFrame>,
    control: Arc<Control>,
    tally: Arc<Tally>,
    book: Arc<Mutex<FaultLog>>,
}

impl Rig {
    fn new(plan: &str) -> Rig {
        let ((to, theirs), (ours, from)) = (channel(), channel());
        let control = Arc::<Control>::default();
        let (tally, book) = (Arc::default(), Arc::default());
        let plan = Plan::parse("faults.toml", plan, true).unwrap();
        let faults = BusFaults::new("bus", &tally, &plan, &NATIVE, &book);
        let bus = Slow {
            to: ours,
            from: Arc::new(Mutex::new(theirs)),
            control: control.clone(),
        };
        Rig {
            ours: faults.around(Box::new(bus)),
            to,
            from,
            control,
            tally,
            book,
        }
    }

    /// Sends `n` frames to the emulator's end. Returns the number received.
    fn flood(&mut self, n: u32) -> u32 {
        for i in 0..n {
            self.to.send(frame(i as u8)).unwrap();
        }
        let came = std::iter::from_fn(|| self.ours.recv(SHORT).unwrap());
        came.count() as u32
    }
}

fn frame(i: u8) -> CanFrame {
    CanFrame::new(0x100, false, &[i; 8]).unwrap()
}

const LONG: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(30);

#[test]
fn frames_dropped_by_a_receiver_count_as_overflows() {
    let mut rig = Rig::new(&always("in", "overrun", 0.3));
    let came = rig.flood(200);
    let lost = rig.tally.counters().overflows;
    assert!(lost > 0 && lost == 200 - came, "{lost} {came}");
    assert_eq!(rig.book.lock().unwrap().total(), u64::from(lost));
    // Frames lost in transit do not count.
    let mut rig = Rig::new(&always("in", "drop", 1.0));
    assert_eq!((rig.flood(200), rig.tally.counters().overflows), (0, 0));
    // A delay line of 1024 positions reserves one for a duplicate.
    let mut rig = Rig::new(&always("in", "delay", 50.0));
    assert_eq!(rig.flood(1100), 0);
    assert_eq!(rig.tally.counters().overflows, 1100 - 1023);
}

#[test]
fn blocked_frames_do_not_cause_busy_polling() {
    // Frames due while the controller is bus-off, or behind a frame that the bus does not accept.
    let off = always("out", "delay", 0.02)
        + &always("out", "bus_off", 1.0)
        + "at_s = 0.01\nfor_s = 5.0\n";
    for (plan, full) in [(off, false), (always("out", "delay", 0.02), true)] {
        let mut rig = Rig::new(&plan);
        rig.control.full.store(full, Ordering::Relaxed);
        for i in 0..2 {
            assert_eq!(rig.ours.send(&frame(i)).unwrap(), Sending::Sent);
        }
        while rig.ours.recv(Duration::from_millis(40)).unwrap().is_some() {}
        let polls = || rig.control.polls.load(Ordering::Relaxed);
        let (begin, before) = (Instant::now(), polls());
        assert_eq!(rig.ours.recv(Duration::from_millis(200)).unwrap(), None);
        // A handle polls the other direction every 2 ms; twice that for a coarse clock.
        let max = 20 + begin.elapsed().as_millis();
        assert!(u128::from(polls() - before) < max, "{} {max}", polls());
    }
}

#[test]
fn frames_are_received_during_a_blocked_send() {
    let Rig {
        mut ours,
        to,
        from,
        control,
        ..
    } = Rig::new("");
    let mut reader = ours.share().unwrap();
    let closed = control.gate.lock().unwrap();
    let sending = std::thread::spawn(move || {
        for i in 0..3 {
            assert_eq!(ours.send(&frame(i)).unwrap(), Sending::Sent);
        }
    });
    std::thread::sleep(SHORT);
    to.send(frame(9)).unwrap();
    let (to_test, read) = channel();
    let reading = std::thread::spawn(move || {
        to_test.send(reader.recv(LONG).unwrap()).unwrap();
        // It also sends due frames.
        while reader.recv(SHORT).unwrap().is_some() {}
    });
    // The reader returns before the bus has accepted anything.
    assert_eq!(read.recv_timeout(LONG).unwrap(), Some(frame(9)));
    assert!(from.try_recv().is_err());
    drop(closed);
    sending.join().unwrap();
    reading.join().unwrap();
    let came: Vec<CanFrame> = from.try_iter().collect();
    assert_eq!(came, [0, 1, 2].map(frame));
}
