//! Packets over buses that fill up, vanish and return: both ends on a bus in memory.

use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::can::carrier::{self, Above, Next, Note};
use skyloop_firmware_sim::can::port::CanPort;
use skyloop_firmware_sim::can::settings::Settings;
use skyloop_firmware_sim::can::{CanBus, Opener, Sending, Trouble};
use skyloop_firmware_sim::port::Port;
use skyloop_protocols::can::{CanFrame, Node, Side};
use skyloop_protocols::{Command, MAX_PACKET, WireTime};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

const LONG: Duration = Duration::from_secs(20);

#[derive(Default)]
struct State {
    queues: [VecDeque<CanFrame>; 2],
    down: bool,
    /// Frames until the bus is full.
    room: Option<usize>,
    refused: usize,
    /// Number of refusals of a second handle still to come.
    no_handle: usize,
    /// Frames that answer the next sent frame at once, while the thread of its sender is paused.
    answers: Vec<CanFrame>,
}

#[derive(Clone)]
struct Memory {
    shared: Arc<(Mutex<State>, Condvar)>,
    end: usize,
}

impl Memory {
    fn pair() -> [Memory; 2] {
        let shared = Arc::default();
        [0, 1].map(|end| Memory {
            shared: Arc::clone(&shared),
            end,
        })
    }

    fn set<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let changed = change(&mut self.shared.0.lock().unwrap());
        self.shared.1.notify_all();
        changed
    }

    /// Reopens the bus once it is up.
    fn opener(&self) -> Opener {
        let bus = self.clone();
        Box::new(move || {
            if !bus.set(|state| state.down) {
                return Ok(Box::new(bus.clone()));
            }
            Err(skyloop_firmware_sim::can::Refusal {
                action: "open it",
                source: ErrorKind::NetworkDown.into(),
                remedy: "wait".into(),
            })
        })
    }
}

impl CanBus for Memory {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        let end = self.end;
        let mut is_answered = false;
        let sent = self.set(|state| {
            if state.down {
                return Err(ErrorKind::NetworkDown.into());
            }
            if state.room == Some(0) {
                state.refused += 1;
                return Ok(Sending::Full);
            }
            state.room = state.room.map(|room| room - 1);
            state.queues[1 - end].push_back(*frame);
            is_answered = !state.answers.is_empty();
            let answers = std::mem::take(&mut state.answers);
            state.queues[end].extend(answers);
            Ok(Sending::Sent)
        });
        if is_answered {
            // Longer than N_Cr, 1 s.
            std::thread::sleep(Duration::from_millis(1500));
        }
        sent
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        let deadline = Instant::now() + timeout;
        let (state, changed) = &*self.shared;
        let mut state = state.lock().unwrap();
        loop {
            if state.down {
                return Err(ErrorKind::NetworkDown.into());
            }
            if let Some(frame) = state.queues[self.end].pop_front() {
                return Ok(Some(frame));
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            state = changed.wait_timeout(state, left).unwrap().0;
        }
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        self.set(|state| {
            if state.no_handle > 0 {
                state.no_handle -= 1;
                return Err(ErrorKind::OutOfMemory.into());
            }
            Ok(Box::new(self.clone()) as Box<dyn CanBus>)
        })
    }
}

/// The emulator's end: packets and notes through channels.
struct End {
    outbound: Receiver<Vec<u8>>,
    inbound: Sender<Vec<u8>>,
    ended: Sender<(Vec<u8>, bool)>,
    notes: Sender<Note>,
}

impl Above for End {
    type Packet = Vec<u8>;

    fn next(&mut self) -> Next<Vec<u8>> {
        match self.outbound.try_recv() {
            Ok(packet) => Next::Packet(packet),
            Err(TryRecvError::Empty) => Next::Nothing,
            Err(TryRecvError::Disconnected) => Next::Closed,
        }
    }

    fn arrived(&mut self, packet: &[u8], _: Instant) -> bool {
        self.inbound.send(packet.to_vec()).is_ok()
    }

    fn is_wanted(&self) -> bool {
        true
    }

    fn ended(&mut self, packet: Vec<u8>, is_sent: bool) {
        let _ = self.ended.send((packet, is_sent));
    }

    fn note(&mut self, note: Note) {
        // The test may have ended.
        let _ = self.notes.send(note);
    }
}

struct Rig {
    client: CanPort,
    bus: Memory,
    send: Sender<Vec<u8>>,
    received: Receiver<Vec<u8>>,
    ended: Receiver<(Vec<u8>, bool)>,
    notes: Receiver<Note>,
    waker: carrier::Waker,
    thread: std::thread::JoinHandle<()>,
}

fn settings(query: &str) -> Settings {
    Settings::of(&Address::parse(&format!("can://memory?{query}")).unwrap()).unwrap()
}

impl Rig {
    fn new(query: &str) -> Rig {
        let settings = settings(query);
        let [ours, theirs] = Memory::pair();
        let (send, outbound) = channel();
        let (inbound, received) = channel();
        let (sent, ended) = channel();
        let (noted, notes) = channel();
        let end = End {
            outbound,
            inbound,
            ended: sent,
            notes: noted,
        };
        let node = Node::new(Side::Emulator, settings.fd);
        let (bus, opener) = (Box::new(ours.clone()), Some(ours.opener()));
        let started = carrier::start("emulator", bus, opener, node, settings.rates, end);
        let (waker, thread) = started.unwrap();
        let opener = Some(theirs.opener());
        let client = CanPort::over("memory", Box::new(theirs), opener, &settings).unwrap();
        Rig {
            client,
            bus: ours,
            send,
            received,
            ended,
            notes,
            waker,
            thread,
        }
    }

    fn reply(&self, byte: u8) {
        self.send.send(long(byte)).unwrap();
        self.waker.wake();
    }

    fn receives(&mut self, byte: u8) {
        assert_eq!(self.client.recv(LONG).unwrap().unwrap(), long(byte));
    }

    /// Takes the bus down, and waits until the emulator's end has noticed.
    fn goes_down(&self) {
        self.bus.set(|state| state.down = true);
        self.note(|note| matches!(note, Note::Gone(_)));
    }

    fn note(&self, fits: impl Fn(&Note) -> bool) {
        while !fits(&self.notes.recv_timeout(LONG).unwrap()) {}
    }

    /// Closes the emulator's end; queued packets are still sent.
    fn close(self) {
        drop(self.send);
        self.waker.wake();
        self.thread.join().unwrap();
    }
}

fn command(command: &Command) -> Vec<u8> {
    let mut buffer = [0; MAX_PACKET];
    let length = command.encode(1, WireTime(0), &mut buffer).unwrap();
    buffer[..length].to_vec()
}

/// As long as a packet, without its structure; carried as one.
fn long(byte: u8) -> Vec<u8> {
    vec![byte; MAX_PACKET]
}

#[test]
fn packets_pass_both_ways_classic_and_fd() {
    for query in ["bitrate=1000000", "bitrate=1000000&fd=8000000"] {
        let mut rig = Rig::new(query);
        for packet in [command(&Command::Ping), long(1)] {
            rig.client.send(&packet).unwrap();
            assert_eq!(rig.received.recv_timeout(LONG).unwrap(), packet, "{query}");
        }
        (2..5).for_each(|byte| rig.reply(byte));
        (2..5).for_each(|byte| rig.receives(byte));
        assert_eq!(rig.client.dropped(), 0);
        rig.close();
    }
}

/// Each packet ends once, sent or dropped: after 1 s without flow control (ISO 15765-2, N_Bs),
/// while others wait for its lane.
#[test]
fn packets_without_flow_control_are_dropped() {
    let mut rig = Rig::new("bitrate=1000000");
    rig.reply(1);
    rig.receives(1);
    drop(rig.client);
    for packet in 2..5 {
        rig.send.send(long(packet)).unwrap();
    }
    rig.waker.wake();
    for packet in 1..5 {
        let ended = rig.ended.recv_timeout(LONG).unwrap();
        assert_eq!(ended, (long(packet), packet == 1));
    }
    drop(rig.send);
    rig.waker.wake();
    rig.thread.join().unwrap();
}

/// Sends a packet at half the load of a bus: minimum time, and measured time, which is no shorter.
fn paced() -> [Duration; 2] {
    let query = "bitrate=100000&load=0.5";
    let rates = settings(query).rates;
    let [frame, packet] = [7, MAX_PACKET].map(|length| rates.packet_duration(length, false));
    // The last frame does not wait until the bus is free; the first few may be sent at once.
    let min = packet.mul_f64(0.95) - frame - Duration::from_millis(1);
    let mut rig = Rig::new(query);
    let begin = Instant::now();
    rig.reply(1);
    rig.receives(1);
    let took = begin.elapsed();
    assert!(took >= min, "{took:?} {min:?}");
    [min, took]
}

#[test]
fn buses_are_used_at_their_rate_or_below() {
    paced();
}

#[test]
#[ignore = "timed: tests/run all runs it alone; cargo test -- --ignored timed_"]
fn timed_buses_are_used_at_their_rate() {
    // At least one of ten takes less than twice the time.
    let is_in_time = |_| {
        let [min, took] = paced();
        took < 2 * min
    };
    assert!((0..10).any(is_in_time));
}

#[test]
fn full_queues_are_retried() {
    let mut rig = Rig::new("bitrate=1000000");
    rig.bus.set(|state| state.room = Some(3));
    rig.reply(1);
    let begin = Instant::now();
    while rig.bus.set(|state| state.refused) < 3 {
        assert!(begin.elapsed() < LONG);
        std::thread::sleep(Duration::from_millis(1));
    }
    rig.bus.set(|state| state.room = None);
    rig.receives(1);
    assert_eq!(rig.client.dropped(), 0);
    rig.close();
}

#[test]
fn lost_buses_are_reopened() {
    let mut rig = Rig::new("bitrate=1000000");
    rig.goes_down();
    rig.reply(1);
    rig.bus.set(|state| state.down = false);
    rig.note(|note| matches!(note, Note::Back));
    // The client's end returns within one retry; a packet started before that is dropped after 1 s.
    rig.reply(2);
    let mut got = Vec::new();
    while got.last() != Some(&long(2)) {
        got.push(rig.client.recv(LONG).unwrap().unwrap());
    }
    rig.client.send(&long(3)).unwrap();
    assert_eq!(rig.received.recv_timeout(LONG).unwrap(), long(3));
    rig.close();
}

#[test]
fn clients_report_a_lost_line_and_do_not_block() {
    let mut rig = Rig::new("bitrate=1000000");
    let (tell, notices) = channel();
    rig.client.on_notice(Box::new(move |text| {
        let _ = tell.send(text.to_string());
    }));
    rig.bus.set(|state| state.down = true);
    let text = notices.recv_timeout(LONG).unwrap();
    for part in [
        "warning: ",
        "the line has gone (",
        "check the adapter's cable",
    ] {
        assert!(text.contains(part), "{text}");
    }
    let begin = Instant::now();
    for _ in 0..100 {
        rig.client.send(&long(1)).unwrap();
    }
    assert!(begin.elapsed() < LONG, "each would take a second");
    assert_eq!(rig.client.dropped(), 100);
    let gone = rig.client.gone().unwrap().to_string();
    assert!(gone.contains("the line has gone ("), "{gone}");
    rig.bus.set(|state| state.down = false);
    let text = notices.recv_timeout(LONG).unwrap();
    assert!(text.ends_with("the line is back"), "{text}");
    assert!(rig.client.gone().is_none());
    rig.client.send(&long(2)).unwrap();
    assert_eq!(rig.received.recv_timeout(LONG).unwrap(), long(2));
    rig.bus.set(|state| state.down = true);
    notices.recv_timeout(LONG).unwrap();
    let begin = Instant::now();
    drop(rig.client);
    assert!(begin.elapsed() < LONG, "it ends at once");
}

#[test]
fn silent_buses_do_not_block_the_client() {
    // A bus without another node: each long message waits a second for its flow control.
    let [bus, _] = Memory::pair();
    let settings = settings("bitrate=1000000");
    let mut client = CanPort::over("can://bus", Box::new(bus), None, &settings).unwrap();
    assert!(client.recv(Duration::from_millis(2100)).unwrap().is_none());
    let begin = Instant::now();
    for _ in 0..40 {
        client.send(&long(1)).unwrap();
    }
    assert!(client.dropped() >= 20, "{}", client.dropped());
    drop(client);
    // X-Val: twenty packets with a wait of a second each would take as long.
    assert!(begin.elapsed() < LONG);
}

#[test]
fn buses_without_a_second_handle_are_retried() {
    let mut rig = Rig::new("bitrate=1000000");
    rig.goes_down();
    let up = |state: &mut State| (state.down, state.no_handle) = (false, 3);
    rig.bus.set(up);
    rig.note(|note| matches!(note, Note::Back));
    // Either end may get the refusals; both return in the end.
    let begin = Instant::now();
    let timeout = Duration::from_millis(100);
    rig.client.send(&command(&Command::Ping)).unwrap();
    while rig.received.recv_timeout(timeout).is_err() {
        assert!(begin.elapsed() < LONG);
        rig.client.send(&command(&Command::Ping)).unwrap();
    }
    assert_eq!(rig.bus.set(|state| state.no_handle), 0);
    rig.close();
}

#[test]
fn bus_errors_are_noted_and_truncated_messages_counted() {
    let rig = Rig::new("bitrate=1000000");
    let mut frame = CanFrame::new(0, false, &[0; 8]).unwrap();
    frame.error = true;
    // X-Val: linux/can/error.h: CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_RESTARTED.
    for (class, expected) in [
        (0x80, Trouble::Error),
        (0x40, Trouble::BusOff),
        (0x100, Trouble::Restarted),
    ] {
        frame.id = class;
        rig.bus.set(|state| state.queues[0].push_back(frame));
        rig.note(|note| matches!(note, Note::Trouble(trouble) if *trouble == expected));
    }
    // X-Val: ISO 15765-2, 9.6.3: a first frame of 20 bytes (0x014), and nothing else.
    let first = CanFrame::new(0x120, false, &[0x10, 20, 1, 2, 3, 4, 5, 6]).unwrap();
    rig.bus.set(|state| state.queues[0].push_back(first));
    rig.note(|note| matches!(note, Note::Incomplete(1)));
    rig.close();
}

#[test]
fn frames_that_arrive_in_time_during_a_pause_are_in_time() {
    let rig = Rig::new("bitrate=1000000");
    let frame = |data: &[u8]| CanFrame::new(0x120, false, data).unwrap();
    // X-Val: ISO 15765-2, 9.6: a first frame of 20 bytes, and two consecutive frames.
    let first = frame(&[0x10, 20, 1, 2, 3, 4, 5, 6]);
    let rest = [
        frame(&[0x21, 7, 8, 9, 10, 11, 12, 13]),
        frame(&[0x22, 14, 15, 16, 17, 18, 19, 20]),
    ];
    rig.bus.set(|state| {
        state.answers.extend(rest);
        state.queues[0].push_back(first);
    });
    let received = rig.received.recv_timeout(LONG).unwrap();
    assert_eq!(received, Vec::from_iter(1..=20));
    rig.close();
}
