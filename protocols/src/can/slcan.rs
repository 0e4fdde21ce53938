//! CAN over a serial line: the ASCII lines of LAWICEL's CAN232 and CANUSB adapters, and the FD
//! lines of CANable 2.0.
//!
//! Every line ends with CR; an adapter refuses with a single BEL. Hexadecimal digits are written in
//! capitals and read in either case.
//!
//! | line | meaning |
//! |---|---|
//! | `tIIILDD..` `TIIIIIIIILDD..` | data frame, 11- or 29-bit identifier I, length code L, data D |
//! | `rIIIL` `RIIIIIIIIL` | remote frame |
//! | `dIIILDD..` `DIIIIIIIILDD..`, `b..` `B..` | FD frame, without and with bit rate switch |
//! | frame and `TTTT` | received at T, ms, modulo 60,000 |
//! | `S0` to `S8`, `Y0` `Y1` `Y2` `Y4` `Y5` `Y8` | bit rate; data bit rate |
//! | `O`, `L`, `C` | open, open to listen only, close |
//! | `F`, `V`, `N` | status flags, version, serial number: answered by `FXX`, `VXXXX`, `NXXXX` |
//! | `Z0`, `Z1` | time stamps off, on |
//! | `sXRRRTTT` | unsolicited: state of the controller, receive and transmit error counter (Linux: `drivers/net/can/slcan`) |
//! | `eNXX..` | unsolicited: N errors on the bus, a letter each |
//! | empty, `z`, `Z` | done; sent, 11- or 29-bit |

use crate::can::frame::{CanFrame, LENGTHS, MAX_CLASSIC_DATA, MAX_DATA, dlc};
use core::fmt;

/// Ends a line.
pub const CR: u8 = b'\r';
/// Answer of an adapter that refuses a line.
pub const BEL: u8 = 7;
/// Longest line without its CR: `B`, identifier, length code, 64 data bytes, time stamp.
pub const MAX_LINE: usize = 1 + 8 + 1 + 2 * MAX_DATA + 4;
/// Bit rates by code, bit/s.
pub const BIT_RATES: [u32; 9] = [
    10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
];
/// FD data bit rates: code and bit/s.
pub const DATA_RATES: [(u8, u32); 6] = [
    (0, 500_000),
    (1, 1_000_000),
    (2, 2_000_000),
    (4, 4_000_000),
    (5, 5_000_000),
    (8, 8_000_000),
];

/// One line, in either direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// To the adapter: a frame to send. From the adapter: a received frame.
    Frame {
        /// The frame.
        frame: CanFrame,
        /// Time of reception, ms modulo 60,000; `None` without time stamps.
        time_ms: Option<u16>,
    },
    /// To the adapter.
    Command(Command),
    /// From the adapter.
    Answer(Answer),
}

/// A command to an adapter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Bit rate: index in [`BIT_RATES`].
    BitRate(u8),
    /// Data bit rate: code in [`DATA_RATES`].
    DataRate(u8),
    /// Opens the channel.
    Open,
    /// Opens the channel to listen only.
    Listen,
    /// Closes the channel.
    Close,
    /// Requests the status flags.
    Status,
    /// Requests the version.
    Version,
    /// Requests the serial number.
    Serial,
    /// Switches time stamps of received frames.
    TimeStamps(bool),
}

/// An answer of an adapter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Done,
    /// The frame was accepted for transmission.
    Sent {
        /// The frame has a 29-bit identifier.
        extended: bool,
    },
    /// Unknown, invalid or not allowed in this state.
    Refused,
    /// Status flags, from bit 0: receive queue full, transmit queue full, error warning, overrun,
    /// (none), error passive, arbitration lost, bus error.
    Status(u8),
    /// Hardware and software version; the first four characters of a longer text.
    Version([u8; 4]),
    /// Serial number; the first four characters of a longer text.
    Serial([u8; 4]),
    /// State of the controller, sent when it changes.
    State {
        /// The state.
        state: State,
        /// Receive error counter.
        receive_errors: u16,
        /// Transmit error counter.
        transmit_errors: u16,
    },
    /// Errors on the bus, 1 to 8, a letter each, then zeros: `a` acknowledgement, `b` `B` bit 0 or
    /// 1, `c` CRC, `f` form, `s` stuffing, `o` `O` receive or transmit overrun.
    Errors([u8; 8]),
}

/// Error state of a controller (ISO 11898-1, fault confinement).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Error active: normal operation.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// Error passive: it sends passive error flags.
    Passive,
    /// Disconnected from the bus after too many errors.
    BusOff,
}

/// Error of the bytes up to a CR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineError {
    /// Longer than any line.
    TooLong,
    /// The first byte begins no line.
    Unknown {
        /// First byte.
        first: u8,
    },
    /// Invalid digit, identifier, length or rate, too few bytes or too many.
    Malformed {
        /// First byte.
        first: u8,
    },
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooLong => write!(f, "slcan line without a CR within {MAX_LINE} octets"),
            Self::Unknown { first } => write!(
                f,
                "slcan line begins with {first:#04x}, which no line does: is it such an adapter, at this baud rate?"
            ),
            Self::Malformed { first } => write!(
                f,
                "slcan line {:?} has a digit or a length that does not belong there: damaged on the line",
                char::from(first)
            ),
        }
    }
}

impl core::error::Error for LineError {}

/// Finds lines in a stream of bytes. After garbage it is synchronised again at the next CR.
#[derive(Debug, Clone)]
pub struct Decoder {
    line: [u8; MAX_LINE],
    length: usize,
    too_long: bool,
}

impl Decoder {
    /// A decoder at the start of a line.
    pub const fn new() -> Self {
        Self {
            line: [0; MAX_LINE],
            length: 0,
            too_long: false,
        }
    }

    /// Processes one byte; returns a line or its error at the end of the line. Ignores line feeds.
    pub fn push(&mut self, byte: u8) -> Option<Result<Line, LineError>> {
        match byte {
            CR | BEL => {
                let length = core::mem::take(&mut self.length);
                if core::mem::take(&mut self.too_long) {
                    return Some(Err(LineError::TooLong));
                }
                match self.line.get(..length)? {
                    [] if byte == BEL => Some(Ok(Line::Answer(Answer::Refused))),
                    [first, ..] if byte == BEL => Some(Err(LineError::Malformed { first: *first })),
                    line => Some(parse(line)),
                }
            }
            b'\n' => None,
            _ => {
                match self.line.get_mut(self.length) {
                    Some(slot) => {
                        *slot = byte;
                        self.length += 1;
                    }
                    None => self.too_long = true,
                }
                None
            }
        }
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

fn parse(line: &[u8]) -> Result<Line, LineError> {
    let Some((first, rest)) = line.split_first() else {
        return Ok(Line::Answer(Answer::Done));
    };
    let parsed = match first {
        b't' | b'T' | b'r' | b'R' | b'd' | b'D' | b'b' | b'B' => parse_frame(*first, rest),
        b'S' | b'Y' | b'O' | b'L' | b'C' | b'F' | b'V' | b'N' | b'Z' | b'z' | b's' | b'e' => {
            parse_other(*first, rest)
        }
        _ => return Err(LineError::Unknown { first: *first }),
    };
    parsed.ok_or(LineError::Malformed { first: *first })
}

fn parse_other(first: u8, rest: &[u8]) -> Option<Line> {
    let command = match (first, rest) {
        (b'S', [code @ b'0'..=b'8']) => Command::BitRate(code - b'0'),
        (b'Y', [code]) => {
            let code = digit(*code)?;
            DATA_RATES.iter().find(|(known, _)| *known == code)?;
            Command::DataRate(code)
        }
        (b'O', []) => Command::Open,
        (b'L', []) => Command::Listen,
        (b'C', []) => Command::Close,
        (b'F', []) => Command::Status,
        (b'V', []) => Command::Version,
        (b'N', []) => Command::Serial,
        (b'Z', [on @ b'0'..=b'1']) => Command::TimeStamps(*on == b'1'),
        _ => return parse_answer(first, rest).map(Line::Answer),
    };
    Some(Line::Command(command))
}

fn parse_answer(first: u8, rest: &[u8]) -> Option<Answer> {
    let text = core::array::from_fn(|at| rest.get(at).copied().unwrap_or(0));
    match (first, rest) {
        (b'z', []) => Some(Answer::Sent { extended: false }),
        (b'Z', []) => Some(Answer::Sent { extended: true }),
        (b'F', [_, _]) => Some(Answer::Status(number(rest)? as u8)),
        (b'V', [_, ..]) => Some(Answer::Version(text)),
        (b'N', [_, ..]) => Some(Answer::Serial(text)),
        (b's', [letter, counters @ ..]) => {
            let (receive, transmit) = counters.split_at_checked(3)?;
            let (state, _) = STATES.iter().find(|(_, known)| known == letter)?;
            Some(Answer::State {
                state: *state,
                receive_errors: decimal(receive)?,
                transmit_errors: decimal(transmit)?,
            })
        }
        (b'e', [count @ b'1'..=b'8', letters @ ..]) => {
            let is_whole = letters.len() == usize::from(count - b'0');
            let are_letters = letters.iter().all(u8::is_ascii_alphabetic);
            let errors = core::array::from_fn(|at| letters.get(at).copied().unwrap_or(0));
            (is_whole && are_letters).then_some(Answer::Errors(errors))
        }
        _ => None,
    }
}

/// States of a controller and their letters.
const STATES: [(State, u8); 4] = [
    (State::Active, b'a'),
    (State::Warning, b'w'),
    (State::Passive, b'p'),
    (State::BusOff, b'b'),
];

/// Three decimal digits.
fn decimal(digits: &[u8]) -> Option<u16> {
    let [_, _, _] = digits else { return None };
    digits.iter().try_fold(0, |number, byte| {
        let digit = char::from(*byte).to_digit(10)?;
        Some(number * 10 + digit as u16)
    })
}

fn parse_frame(first: u8, rest: &[u8]) -> Option<Line> {
    let extended = first.is_ascii_uppercase();
    let (id, rest) = rest.split_at_checked(if extended { 8 } else { 3 })?;
    let (code, rest) = rest.split_first()?;
    let kind = first.to_ascii_lowercase();
    let mut frame = CanFrame {
        id: number(id)?,
        extended,
        fd: matches!(kind, b'd' | b'b'),
        brs: kind == b'b',
        remote: kind == b'r',
        error: false,
        len: *LENGTHS.get(usize::from(digit(*code)?))?,
        data: [0; MAX_DATA],
    };
    if !frame.is_valid() {
        return None;
    }
    let (data, time) = rest.split_at_checked(2 * frame.payload().len())?;
    for (byte, digits) in frame.data.iter_mut().zip(data.as_chunks::<2>().0) {
        *byte = number(digits)? as u8;
    }
    let time_ms = match time.len() {
        0 => None,
        4 => Some(number(time)? as u16),
        _ => return None,
    };
    Some(Line::Frame { frame, time_ms })
}

fn digit(byte: u8) -> Option<u8> {
    char::from(byte).to_digit(16).map(|digit| digit as u8)
}

/// Up to eight hexadecimal digits.
fn number(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |number, byte| {
        Some(number << 4 | u32::from(digit(*byte)?))
    })
}

/// Passes the bytes of a line and its end to `put`. Invalid frames and error frames have no line.
pub fn encode(line: &Line, put: &mut impl FnMut(u8)) {
    match *line {
        Line::Frame { frame, time_ms } if frame.is_valid() && !frame.error => {
            encode_frame(&frame, time_ms, put)
        }
        Line::Frame { .. } => return,
        Line::Answer(Answer::Refused) => return put(BEL),
        Line::Answer(answer) => encode_answer(answer, put),
        Line::Command(command) => {
            let (first, code) = match command {
                Command::BitRate(code) => (b'S', Some(code)),
                Command::DataRate(code) => (b'Y', Some(code)),
                Command::Open => (b'O', None),
                Command::Listen => (b'L', None),
                Command::Close => (b'C', None),
                Command::Status => (b'F', None),
                Command::Version => (b'V', None),
                Command::Serial => (b'N', None),
                Command::TimeStamps(on) => (b'Z', Some(on.into())),
            };
            put(first);
            if let Some(code) = code {
                hex(code.into(), 1, put);
            }
        }
    }
    put(CR);
}

fn encode_answer(answer: Answer, put: &mut impl FnMut(u8)) {
    match answer {
        Answer::Done | Answer::Refused => {}
        Answer::Sent { extended } => put(if extended { b'Z' } else { b'z' }),
        Answer::Status(flags) => {
            put(b'F');
            hex(flags.into(), 2, put);
        }
        Answer::Version(text) => [b'V'].into_iter().chain(text).for_each(put),
        Answer::Serial(text) => [b'N'].into_iter().chain(text).for_each(put),
        Answer::State {
            state,
            receive_errors,
            transmit_errors,
        } => {
            put(b's');
            let known = STATES.iter().filter(|(known, _)| *known == state);
            known.for_each(|(_, letter)| put(*letter));
            for counter in [receive_errors, transmit_errors] {
                for unit in [100, 10, 1] {
                    put(b'0' + (counter / unit % 10) as u8);
                }
            }
        }
        Answer::Errors(letters) => {
            put(b'e');
            let letters = letters.iter().filter(|letter| **letter != 0);
            put(b'0' + letters.clone().count() as u8);
            letters.for_each(|letter| put(*letter));
        }
    }
}

fn encode_frame(frame: &CanFrame, time_ms: Option<u16>, put: &mut impl FnMut(u8)) {
    let kind = match (frame.fd, frame.brs, frame.remote) {
        (true, true, _) => b'b',
        (true, false, _) => b'd',
        (false, _, true) => b'r',
        (false, _, false) => b't',
    };
    let (kind, digits) = if frame.extended {
        (kind.to_ascii_uppercase(), 8)
    } else {
        (kind, 3)
    };
    put(kind);
    hex(frame.id, digits, put);
    let code = dlc(frame.len.into()).unwrap_or(MAX_CLASSIC_DATA as u8); // valid frames have one
    hex(code.into(), 1, put);
    for byte in frame.payload() {
        hex((*byte).into(), 2, put);
    }
    if let Some(time) = time_ms {
        hex(time.into(), 4, put);
    }
}

fn hex(number: u32, digits: u32, put: &mut impl FnMut(u8)) {
    for position in (0..digits).rev() {
        let digit = (number >> (4 * position)) as u8 & 0xF;
        put(if digit < 10 { b'0' } else { b'A' - 10 } + digit);
    }
}
