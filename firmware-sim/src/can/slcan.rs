//! A bus through a LAWICEL-style adapter on a serial port or a pseudo-terminal, in ASCII lines.
//!
//! The other end of a pseudo-terminal may be an adapter or another host. Both are served: neither
//! side waits for answers, and commands from the other end are ignored.

use super::settings::Settings;
use super::{CanBus, Refusal, Sending, Trouble};
use crate::address::Address;
use serialport::SerialPort;
use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::slcan::{
    Answer, BIT_RATES, Command, DATA_RATES, Decoder, Line, MAX_LINE, State, encode,
};
use std::collections::VecDeque;
use std::io::{self, ErrorKind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::time::Duration;

/// Time-out of a write to a blocked line.
const WRITE_TIMEOUT: Duration = Duration::from_millis(20);
/// Default baud rate of the line. USB adapters ignore it.
pub(crate) const BAUD: u32 = 115_200;

/// Consecutive refused frames after which the adapter counts as bus-off.
const REFUSED: u32 = 64;

/// A bus behind an adapter, or behind a line to another host.
pub(crate) struct SlcanBus {
    line: Box<dyn SerialPort>,
    /// Set-up commands, encoded.
    set_up: Vec<u8>,
    /// Bytes not written yet: a frame, or the set-up commands.
    pending: VecDeque<u8>,
    /// Whether `pending` holds the set-up commands.
    is_set_up: bool,
    decoder: Decoder,
    received: VecDeque<CanFrame>,
    garbled: u32,
    unanswered: Arc<Unanswered>,
    refused: u32,
}

/// Number of answers that the adapter may still send. The sending thread increments, the receiving
/// thread decrements.
#[derive(Default)]
struct Unanswered {
    commands: AtomicU32,
    frames: AtomicU32,
}

/// Decrements a count; false if it is 0.
fn decrement(count: &AtomicU32) -> bool {
    count
        .fetch_update(Relaxed, Relaxed, |count| count.checked_sub(1))
        .is_ok()
}

/// Settings of the bus behind the adapter of an address.
///
/// # Errors
/// The reason, if the address is wrong or adapters lack its bit rates.
pub fn settings(address: &Address) -> Result<Settings, String> {
    let mut settings = Settings::of(address)?;
    settings.baud.get_or_insert(BAUD);
    commands(&settings)?;
    Ok(settings)
}

/// The adapter's commands for the bit rates of `settings`.
pub fn commands(settings: &Settings) -> Result<Vec<Command>, String> {
    let code = |key: &str, rate: u32, known: &[u32]| {
        let code = known.iter().position(|known| *known == rate);
        code.ok_or_else(|| {
            let known: Vec<String> = known.iter().map(u32::to_string).collect();
            format!("{key} = {rate}: adapters have {}", known.join(", "))
        })
    };
    let rates = settings.rates;
    let bit_rate = code("bitrate", rates.bitrate, &BIT_RATES)?;
    let mut commands = vec![Command::Close, Command::BitRate(bit_rate as u8)];
    if settings.fd {
        let data_rates = DATA_RATES.map(|(_, rate)| rate);
        let data_rate = code("fd", rates.data_bitrate, &data_rates)?;
        commands.push(Command::DataRate(DATA_RATES[data_rate].0));
    }
    commands.push(Command::Open);
    Ok(commands)
}

/// Opens the adapter of `settings`.
///
/// # Errors
/// There is no such device, or it cannot be opened.
pub fn open(settings: &Settings) -> Result<Box<dyn CanBus>, Refusal> {
    let line = serialport::new(&settings.place, settings.baud.unwrap_or(BAUD)).open();
    let line = line.map_err(|error| Refusal::of_serial_port(&settings.place, error))?;
    over(line, settings)
}

/// Opens the bus behind an open serial port.
///
/// # Errors
/// The line accepts no bytes.
pub fn over(
    mut line: Box<dyn SerialPort>,
    settings: &Settings,
) -> Result<Box<dyn CanBus>, Refusal> {
    let failed = |source| Refusal {
        action: "set up the adapter",
        source,
        remedy: "check its cable, and that it is a LAWICEL-style adapter".to_string(),
    };
    let commands = commands(settings)
        .map_err(|reason| failed(io::Error::new(ErrorKind::InvalidInput, reason)))?;
    // An empty line first ends a partial line in the adapter's buffer.
    let mut set_up = vec![b'\r'];
    for command in &commands {
        encode(&Line::Command(*command), &mut |byte| set_up.push(byte));
    }
    line.set_timeout(Duration::from_secs(1))
        .map_err(|error| failed(error.into()))?;
    line.write_all(&set_up).map_err(failed)?;
    let unanswered = Unanswered::default();
    unanswered.commands.store(commands.len() as u32, Relaxed);
    Ok(Box::new(SlcanBus::new(line, set_up, unanswered.into())))
}

impl SlcanBus {
    fn new(line: Box<dyn SerialPort>, set_up: Vec<u8>, unanswered: Arc<Unanswered>) -> Self {
        Self {
            line,
            set_up,
            pending: VecDeque::with_capacity(MAX_LINE + 1),
            is_set_up: false,
            decoder: Decoder::new(),
            received: VecDeque::new(),
            garbled: 0,
            unanswered,
            refused: 0,
        }
    }

    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            match self.decoder.push(*byte) {
                None | Some(Ok(Line::Command(_))) => {}
                Some(Ok(Line::Frame { frame, .. })) => self.received.push_back(frame),
                Some(Ok(Line::Answer(answer))) => self.handle_answer(answer),
                Some(Err(_)) => self.garbled += 1,
            }
        }
    }

    /// A refused frame means a full transmit queue or bus-off. The close command may be refused, if
    /// the adapter is closed already. A refusal without a command or frame is noise.
    fn handle_answer(&mut self, answer: Answer) {
        let unanswered = &self.unanswered;
        let trouble = match answer {
            // Some adapters answer the empty line in front.
            Answer::Done => {
                self.refused = 0;
                return;
            }
            Answer::Sent { .. } => {
                unanswered.commands.store(0, Relaxed);
                decrement(&unanswered.frames);
                self.refused = 0;
                return;
            }
            Answer::Refused if decrement(&unanswered.commands) => return,
            Answer::Refused if !decrement(&unanswered.frames) => {
                self.garbled += 1;
                return;
            }
            Answer::Refused => {
                self.refused = (self.refused + 1) % REFUSED;
                match self.refused {
                    0 => Trouble::BusOff.frame(),
                    _ => overflow(),
                }
            }
            Answer::State { state, .. } => match state {
                State::BusOff => Trouble::BusOff.frame(),
                State::Active => return,
                _ => Trouble::Error.frame(),
            },
            Answer::Errors(_) => Trouble::Error.frame(),
            Answer::Status(_) | Answer::Version(_) | Answer::Serial(_) => return,
        };
        self.received.push_back(trouble);
    }

    /// Writes pending bytes; `Full` if some remain.
    fn write_pending(&mut self) -> io::Result<Sending> {
        self.line.set_timeout(WRITE_TIMEOUT)?;
        while !self.pending.is_empty() {
            match self.line.write(self.pending.make_contiguous()) {
                Ok(0) => return Err(ErrorKind::WriteZero.into()),
                Ok(length) => drop(self.pending.drain(..length)),
                Err(error) if is_temporary(&error) => return Ok(Sending::Full),
                Err(error) => return Err(error),
            }
        }
        self.is_set_up = false;
        Ok(Sending::Sent)
    }
}

/// Error frame for a transmit overflow (Linux: `can/error.h`, `CAN_ERR_CRTL`, and in byte 1
/// `CAN_ERR_CRTL_TX_OVERFLOW`).
fn overflow() -> CanFrame {
    let mut frame = CanFrame {
        id: 0x04,
        ..Trouble::Error.frame()
    };
    frame.data[1] = 0x02;
    frame
}

fn is_temporary(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
    )
}

impl CanBus for SlcanBus {
    fn send(&mut self, frame: &CanFrame) -> io::Result<Sending> {
        if self.is_set_up && self.write_pending()? == Sending::Full {
            return Ok(Sending::Full);
        }
        // After `Full` the caller offers the same frame again: `pending` holds its remaining bytes.
        if self.pending.is_empty() {
            let line = Line::Frame {
                frame: *frame,
                time_ms: None,
            };
            encode(&line, &mut |byte| self.pending.push_back(byte));
        }
        let sending = self.write_pending()?;
        if sending == Sending::Sent {
            let frames = &self.unanswered.frames;
            let _ = frames.fetch_update(Relaxed, Relaxed, |frames| frames.checked_add(1));
        }
        Ok(sending)
    }

    fn recv(&mut self, timeout: Duration) -> io::Result<Option<CanFrame>> {
        if let Some(frame) = self.received.pop_front() {
            return Ok(Some(frame));
        }
        self.line.set_timeout(timeout)?;
        let mut bytes = [0; 4096];
        match self.line.read(&mut bytes) {
            Ok(0) => Err(ErrorKind::BrokenPipe.into()),
            Ok(length) => {
                self.take(&bytes[..length]);
                Ok(self.received.pop_front())
            }
            Err(error) if is_temporary(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    fn share(&self) -> io::Result<Box<dyn CanBus>> {
        let (line, unanswered) = (self.line.try_clone()?, Arc::clone(&self.unanswered));
        Ok(Box::new(SlcanBus::new(
            line,
            self.set_up.clone(),
            unanswered,
        )))
    }

    fn restart(&mut self) -> io::Result<Sending> {
        if !self.is_set_up {
            self.pending = self.set_up.iter().copied().collect();
            self.is_set_up = true;
            // The empty line in front is no command.
            let commands = self.set_up.iter().filter(|byte| **byte == b'\r').count() - 1;
            self.unanswered.commands.store(commands as u32, Relaxed);
            self.unanswered.frames.store(0, Relaxed);
        }
        self.write_pending()
    }

    fn garbled(&mut self) -> u32 {
        std::mem::take(&mut self.garbled)
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use serialport::TTYPort;
    use skyloop_protocols::can::adapter::Adapter;
    use std::io::{Read, Write};

    fn settings(query: &str) -> Settings {
        Settings::of(&Address::parse(&format!("slcan://pty?{query}")).unwrap()).unwrap()
    }

    /// A bus and the other end of its line.
    fn line(query: &str) -> (Box<dyn CanBus>, TTYPort) {
        let (mut other, ours) = TTYPort::pair().unwrap();
        SerialPort::set_timeout(&mut other, Duration::from_secs(5)).unwrap();
        (over(Box::new(ours), &settings(query)).unwrap(), other)
    }

    fn read(line: &mut TTYPort, bytes: usize) -> String {
        let mut buffer = vec![0; bytes];
        line.read_exact(&mut buffer).unwrap();
        String::from_utf8(buffer).unwrap()
    }

    #[test]
    fn adapters_are_set_up_and_carry_frames() {
        let (mut bus, mut other) = line("bitrate=250000&fd=2000000");
        // X-Val: LAWICEL CAN232 manual: C, Sn, O, tiiildd..; Yn and biiildd.. are CANable 2.0's.
        assert_eq!(read(&mut other, 11), "\rC\rS5\rY2\rO\r");
        let frame = CanFrame::new(0x123, false, &[0x11, 0xAB]).unwrap();
        assert_eq!(bus.send(&frame).unwrap(), Sending::Sent);
        assert_eq!(read(&mut other, 10), "t123211AB\r");
        other
            .write_all(b"\x07\r\r\rz\rt123211AB\rb7FF01\r")
            .unwrap();
        let received = bus.recv(Duration::from_secs(5)).unwrap();
        assert_eq!(received, Some(frame));
        assert_eq!(bus.garbled(), 1, "too many digits");
        assert_eq!(bus.recv(Duration::from_millis(5)).unwrap(), None);
        assert_eq!(bus.send(&frame).unwrap(), Sending::Sent);
        other.write_all(b"\x07").unwrap();
        let refused = bus.recv(Duration::from_secs(5)).unwrap().unwrap();
        assert!(refused.error, "an error of the bus");
    }

    fn trouble(bus: &mut Box<dyn CanBus>) -> Option<Trouble> {
        let frame = bus.recv(Duration::from_secs(5)).unwrap();
        frame.as_ref().and_then(Trouble::of)
    }

    const SET_UP: &str = "\rC\rS5\rO\r";

    #[test]
    fn bus_off_adapters_are_reopened() {
        // X-Val: lines of Linux's slcan driver: an acknowledgement missed, error passive, bus-off.
        let (mut bus, mut other) = line("bitrate=250000");
        assert_eq!(read(&mut other, SET_UP.len()), SET_UP);
        other.write_all(b"e1a\rsp000128\rsb000256\r").unwrap();
        let all = [(); 3].map(|()| trouble(&mut bus).unwrap());
        assert_eq!(all, [Trouble::Error, Trouble::Error, Trouble::BusOff]);
        assert_eq!(bus.restart().unwrap(), Sending::Sent);
        assert_eq!(read(&mut other, SET_UP.len()), SET_UP);
        assert_eq!(bus.garbled(), 0);
    }

    /// Bus-off follows [`REFUSED`] consecutive refusals of sent frames; other refusals are noise.
    #[test]
    fn refusals_count_against_frames_that_were_sent() {
        let frame = CanFrame::new(0x123, false, &[]).unwrap();
        let max = REFUSED as usize;
        // The first three refusals may belong to C, S and O.
        let taken_after = |before, after| [&vec![7; before][..], b"z\r", &vec![7; after]].concat();
        // Frames sent, answers of the adapter, whether bus-off is reported, bytes of noise.
        for (sent, answers, is_off, noise) in [
            (0, vec![7; max + 3], false, max),
            (0, vec![7; 1000], false, 997),
            (max - 1, vec![7; max + 3], false, 1),
            (max, vec![7; max + 3], true, 0),
            (max, vec![7; max + 2], false, 0),
            (2 * max, taken_after(66, 63), false, 0),
            (2 * max, taken_after(66, 64), true, 0),
        ] {
            let (mut bus, mut other) = line("bitrate=250000");
            read(&mut other, SET_UP.len());
            for _ in 0..sent {
                assert_eq!(bus.send(&frame).unwrap(), Sending::Sent);
                read(&mut other, "t1230\r".len());
            }
            let mut reader = bus.share().unwrap();
            other
                .write_all(&[&answers[..], b"t3210\r"].concat())
                .unwrap();
            let mut all = Vec::new();
            let came = loop {
                let next = reader.recv(Duration::from_secs(5)).unwrap().unwrap();
                match Trouble::of(&next) {
                    Some(trouble) => all.push(trouble),
                    None => break next,
                }
            };
            let case = format!("{sent} sent, {} bytes", answers.len());
            assert_eq!(came.id, 0x321, "{case}");
            assert_eq!(all.contains(&Trouble::BusOff), is_off, "{case}");
            assert_eq!(reader.garbled() as usize, noise, "{case}");
        }
    }

    #[test]
    fn our_adapter_takes_our_commands() {
        let mut adapter = Adapter::new();
        let commands = commands(&settings("bitrate=1000000&fd=8000000")).unwrap();
        for command in &commands {
            adapter.take(&Line::Command(*command), &mut |_| {});
        }
        assert!(adapter.is_open());
        assert_eq!(adapter.bit_rate(), Some(1_000_000));
        assert_eq!(adapter.data_rate(), Some(8_000_000));
    }

    #[test]
    fn unread_lines_block_and_continue_without_loss() {
        let (mut bus, mut other) = line("bitrate=1000000");
        let frame = CanFrame::new(0x7FF, false, &[0x55; 8]).unwrap();
        let mut sent = 0;
        while sent < 100_000 && bus.send(&frame).unwrap() == Sending::Sent {
            sent += 1;
        }
        assert!(sent < 100_000);
        read(&mut other, 8);
        let reading = std::thread::spawn(move || {
            let lines = (0..=sent).map(|_| read(&mut other, 22)).collect::<Vec<_>>();
            lines.iter().all(|line| line == "t7FF85555555555555555\r")
        });
        let mut tries = 0;
        while bus.send(&frame).unwrap() == Sending::Full {
            tries += 1;
            assert!(tries < 1000);
        }
        assert!(reading.join().unwrap(), "no frame is broken");
    }

    #[test]
    fn rates_that_no_adapter_has_are_refused() {
        for (query, parts) in [
            ("bitrate=33333", ["bitrate = 33333", "125000"]),
            ("bitrate=500000&fd=3000000", ["fd = 3000000", "8000000"]),
        ] {
            let error = commands(&settings(query)).unwrap_err();
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
        let error = open(&Settings::new("/dev/there-is-no-such-port")).err();
        let error = error.unwrap().to_string();
        assert!(error.contains("check that the device exists"), "{error}");
    }
}
