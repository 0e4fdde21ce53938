//! Faults of a CAN bus, applied to single frames.
//!
//! The link reads with one handle and sends with another. Each handle first sends the due frames,
//! unless the other one is doing so. Frames that the receiver drops, or that do not fit into the
//! delay line, count as overflows. While the bus is off in either direction, nothing arrives,
//! frames to send stay queued, and the link gets an error frame like one of the kernel.

use super::engine::{Damageable, Pushed};
use super::fault_log::FaultLog;
use super::injector::Injector;
use super::outage::Change;
use super::plan::Plan;
use super::stopped::Shape;
use crate::lock::lock;
use crate::tally::{Tally, count};
use skyloop_firmware_sim::can::{CanBus, Sending, Trouble};
use skyloop_protocols::can::form::{ATTITUDE_BEGIN, FROM_EMULATOR, SHORT_ACK, TO_EMULATOR};
use skyloop_protocols::can::isotp::Pdu;
use skyloop_protocols::can::{CanFrame, Node, Side, frame};
use skyloop_protocols::{FaultKind, MAX_PACKET, Personality};
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

/// Interval at which a handle checks for due frames of the other direction.
const TICK: Duration = Duration::from_millis(2);

impl Damageable for CanFrame {
    /// Error frames of the controller are never damaged.
    fn bytes(&self) -> Option<&[u8]> {
        (!self.error).then(|| self.payload())
    }

    /// A truncated frame gets the next shorter valid length.
    fn with_bytes(mut self, bytes: Vec<u8>) -> CanFrame {
        let fits = |length: &&u8| usize::from(**length) <= bytes.len();
        let length = frame::LENGTHS.iter().rev().find(fits).copied().unwrap_or(0);
        self.data = [0; frame::MAX_DATA];
        for (to, from) in self.data.iter_mut().zip(&bytes[..usize::from(length)]) {
            *to = *from;
        }
        self.len = length;
        self
    }

    fn members(&self) -> String {
        format!("\"can_id\":{}", self.id)
    }

    fn packet(&self, bytes: usize) -> Shape {
        let items = match (self.id, self.payload()) {
            // An attitude has a begin frame, 7 numbers (13 with an orbit state), and an end frame.
            (ATTITUDE_BEGIN, [flags, ..]) if flags & 0x10 != 0 => 15,
            (ATTITUDE_BEGIN, _) => 9,
            (TO_EMULATOR | FROM_EMULATOR, payload) => match Pdu::parse(payload) {
                // All frames are as long as the first. One byte of each is the sequence number.
                Some(Pdu::First { length, .. }) => length.div_ceil(bytes.max(2) - 1),
                _ => 1,
            },
            _ => 1,
        };
        Shape {
            items,
            bytes,
            in_order: self.id != ATTITUDE_BEGIN,
        }
    }

    fn longest(&self) -> Shape {
        let bytes = frame::MAX_DATA;
        Shape {
            items: MAX_PACKET.div_ceil(bytes - 1),
            ..Shape::one(bytes)
        }
    }
}

/// The faults of one bus, also after it is reopened.
#[derive(Clone)]
pub struct BusFaults(Arc<Mutex<State>>);

struct State {
    faults: Injector<CanFrame>,
    /// A due frame that the bus has not accepted.
    stopped: Option<CanFrame>,
    /// Whether a handle is sending due frames. Others do not then, to preserve the order.
    sending: bool,
    /// Whether the controller is off the bus.
    is_off: bool,
    /// Error frames of the controller, and commands that switch faults.
    reports: VecDeque<CanFrame>,
    /// Reassembles the client's commands before faults affect them.
    listener: Node,
}

impl BusFaults {
    /// Scheduled faults of `plan` and live faults on the bus at `address`; `tally` counts them.
    pub fn new(
        address: &str,
        tally: &Arc<Tally>,
        plan: &Plan,
        personality: &'static Personality,
        fault_log: &Arc<Mutex<FaultLog>>,
    ) -> BusFaults {
        BusFaults(Arc::new(Mutex::new(State {
            faults: Injector::new(address, tally, plan, personality, fault_log),
            stopped: None,
            sending: false,
            is_off: false,
            reports: VecDeque::new(),
            listener: Node::new(Side::Emulator, false),
        })))
    }

    /// Wraps the faults around an open bus.
    pub fn around(&self, bus: Box<dyn CanBus>) -> Box<dyn CanBus> {
        let faults = self.clone();
        Box::new(FaultyBus { bus, faults })
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        lock(&self.0)
    }
}

impl State {
    /// Records new injections and returns the next frame to send.
    fn next_due(&mut self) -> Option<CanFrame> {
        self.note();
        if self.is_off || self.sending {
            return None;
        }
        self.stopped.take().or_else(|| self.faults.pop_out())
    }

    /// When a reading handle must check again. A blocked frame does not count.
    fn wake_at(&self) -> Option<Duration> {
        let blocked = self.is_off || self.stopped.is_some() || self.sending;
        let out = self.faults.outbound.next_due().filter(|_| !blocked);
        self.faults.inbound.next_due().into_iter().chain(out).min()
    }

    /// Records new injections, and reports when the controller goes off the bus or returns.
    fn note(&mut self) {
        for change in self.faults.note() {
            self.is_off = change == Change::Lost;
            let trouble = match change {
                Change::Lost => Trouble::BusOff,
                Change::Back => Trouble::Restarted,
            };
            self.reports.push_back(trouble.frame());
        }
    }

    /// Whether a frame answers a command that switched a fault.
    fn is_exempt(&mut self, frame: &CanFrame) -> bool {
        match (frame.id, frame.payload()) {
            (SHORT_ACK, [a, b, c, d]) => {
                let [apid, count] = [[*a, *b], [*c, *d]].map(u16::from_be_bytes);
                self.faults.exempt.is_answered(apid, count)
            }
            _ => false,
        }
    }

    /// Handles a frame from the bus. A controller that is off receives nothing.
    fn arrived(&mut self, frame: CanFrame) {
        let now = self.faults.start();
        let us = now.as_micros() as u64;
        let command = self.listener.receive(&frame, us).map(<[u8]>::to_vec);
        while self.listener.next_frame(us).is_some() {}
        if command.is_some_and(|packet| self.faults.switch(&packet, true)) {
            // A command that ends a fault must pass that fault.
            self.reports.push_back(frame);
        } else if self.is_off {
            self.faults.inbound.observe(&frame, now);
        } else {
            match self.faults.inbound.push(frame, now) {
                Pushed::Lost(FaultKind::Overrun) | Pushed::Full => {
                    count(&self.faults.tally.dropped)
                }
                // Other losses are only in the log, like a frame lost on a real bus.
                Pushed::Taken | Pushed::Lost(_) => {}
            }
        }
    }
}

/// One handle to a bus with faults.
struct FaultyBus {
    bus: Box<dyn CanBus>,
    faults: BusFaults,
}

impl FaultyBus {
    /// Sends the due frames. The lock is released meanwhile, so the other handle can read.
    fn send_due(&mut self) -> io::Result<()> {
        let mut state = self.faults.lock();
        while let Some(frame) = state.next_due() {
            state.sending = true;
            drop(state);
            let sent = self.bus.send(&frame);
            state = self.faults.lock();
            state.sending = false;
            if !matches!(sent, Ok(Sending::Sent)) {
                state.stopped = Some(frame);
                return sent.map(drop);
            }
        }
        Ok(())
    }
}

impl CanBus for FaultyBus {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        self.faults.lock().faults.start();
        self.send_due()?;
        let mut state = self.faults.lock();
        let now = state.faults.start();
        if state.is_off {
            state.faults.outbound.observe(frame, now);
        }
        if state.is_off || state.stopped.is_some() || !state.faults.outbound.has_room() {
            return Ok(Sending::Full);
        }
        let pushed = if state.is_exempt(frame) {
            state.faults.outbound.pass(*frame, now)
        } else {
            state.faults.outbound.push(*frame, now)
        };
        if matches!(pushed, Pushed::Full | Pushed::Lost(FaultKind::BusOff)) {
            state.note();
            return Ok(Sending::Full);
        }
        drop(state);
        // The frame is accepted. A lost bus fails again at the next call.
        let _ = self.send_due();
        Ok(Sending::Sent)
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        let deadline = Instant::now() + timeout;
        loop {
            self.send_due()?;
            let mut state = self.faults.lock();
            if let Some(report) = state.reports.pop_front() {
                return Ok(Some(report));
            }
            if let Some(frame) = state.faults.pop_in() {
                return Ok(Some(frame));
            }
            let due = state.wake_at().zip(state.faults.now());
            drop(state);
            let left = deadline.saturating_duration_since(Instant::now());
            let wait = due.map_or(TICK, |(due, now)| due.saturating_sub(now).min(TICK));
            match self.bus.recv(left.min(wait))? {
                Some(frame) => self.faults.lock().arrived(frame),
                None if left.is_zero() => return Ok(None),
                None => {}
            }
        }
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        Ok(self.faults.around(self.bus.share()?))
    }

    fn restart(&mut self) -> io::Result<Sending> {
        self.bus.restart()
    }

    fn garbled(&mut self) -> u32 {
        self.bus.garbled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;
    use std::sync::mpsc::{Receiver, Sender, channel};

    /// One end of a bus of two nodes.
    struct Cable(Sender<CanFrame>, Arc<Mutex<Receiver<CanFrame>>>);

    impl CanBus for Cable {
        fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
            self.0.send(*frame).unwrap();
            Ok(Sending::Sent)
        }

        fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
            Ok(self.1.lock().unwrap().recv_timeout(timeout).ok())
        }

        fn share(&self) -> io::Result<Box<dyn CanBus>> {
            Ok(Box::new(Cable(self.0.clone(), self.1.clone())))
        }
    }

    /// The emulator's end with `plan`, and the client's end.
    fn bus(plan: &str) -> (Box<dyn CanBus>, Cable) {
        let ((a, to_b), (b, to_a)) = (channel(), channel());
        let ours = Cable(a, Arc::new(Mutex::new(to_a)));
        let client = Cable(b, Arc::new(Mutex::new(to_b)));
        let plan = Plan::parse("faults.toml", plan, true).unwrap();
        let faults = BusFaults::new("bus", &Arc::default(), &plan, &NATIVE, &Arc::default());
        (faults.around(Box::new(ours)), client)
    }

    fn always(direction: &str, kind: &str, value: f64) -> String {
        format!("[[faults]]\ndirection = \"{direction}\"\nkind = \"{kind}\"\nvalue = {value:?}\n")
    }

    fn frame(i: u8) -> CanFrame {
        CanFrame::new(0x100, false, &[i; 8]).unwrap()
    }

    const LONG: Duration = Duration::from_secs(20);
    const SHORT: Duration = Duration::from_millis(30);

    #[test]
    fn truncated_frame_is_valid() {
        let (mut ours, mut client) = bus(&always("out", "truncate", 1.0));
        for i in 0..20 {
            assert_eq!(ours.send(&frame(i)).unwrap(), Sending::Sent);
            let cut = client.recv(LONG).unwrap().unwrap();
            assert!(cut.is_valid() && (1..8).contains(&cut.len));
        }
    }

    #[test]
    fn delayed_frames_leave_while_a_handle_reads() {
        let (mut ours, mut client) = bus(&always("out", "delay", 0.05));
        let mut reader = ours.share().unwrap();
        let started = Instant::now();
        ours.send(&frame(1)).unwrap();
        let reading = std::thread::spawn(move || reader.recv(Duration::from_millis(500)));
        assert_eq!(client.recv(LONG).unwrap(), Some(frame(1)));
        let took = started.elapsed();
        assert!(took.as_secs_f64() >= 0.05, "{took:?}");
        assert!(reading.join().unwrap().unwrap().is_none());
    }

    #[test]
    fn bus_off_blocks_both_directions() {
        let plan = always("out", "bus_off", 1.0) + "at_s = 0.5\nfor_s = 2.0\n";
        let (mut ours, mut client) = bus(&plan);
        assert_eq!(ours.send(&frame(1)).unwrap(), Sending::Sent);
        let report = ours.recv(LONG).unwrap().unwrap();
        assert_eq!(Trouble::of(&report), Some(Trouble::BusOff));
        assert_eq!(ours.send(&frame(2)).unwrap(), Sending::Full);
        client.send(&frame(9)).unwrap();
        let report = ours.recv(LONG).unwrap().unwrap();
        assert_eq!(Trouble::of(&report), Some(Trouble::Restarted));
        assert_eq!(ours.send(&frame(2)).unwrap(), Sending::Sent);
        let received: Vec<CanFrame> = std::iter::from_fn(|| client.recv(SHORT).unwrap()).collect();
        assert_eq!(received, [frame(1), frame(2)]);
        assert_eq!(
            ours.recv(SHORT).unwrap(),
            None,
            "frame 9 came while it was off"
        );
    }
}
