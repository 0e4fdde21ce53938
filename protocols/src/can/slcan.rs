//! CAN over a serial line: the ASCII lines of LAWICEL's CAN232 and CANUSB adapters, and the FD lines of CANable 2.0.
//!
//! Every line ends with CR; an adapter refuses with a lone BEL. Hexadecimal digits are written in capitals and read in both.
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
//! | `sXRRRTTT` | unasked: state of the controller, receive and transmit error counter (Linux: `drivers/net/can/slcan`) |
//! | `eNXX..` | unasked: N errors on the bus, a letter each |
//! | empty, `z`, `Z` | done; sent, 11- or 29-bit |

pub use crate::can::line::encode;

use crate::can::frame::{CanFrame, MAX_DATA};
use crate::can::line::parse;
use core::fmt;

/// Ends a line.
pub const CR: u8 = b'\r';
/// Refuses one.
pub const BEL: u8 = 7;
/// Most octets of a line, without its CR: `B`, identifier, length code, 64 octets, time stamp.
pub const MAX_LINE: usize = 1 + 8 + 1 + 2 * MAX_DATA + 4;
/// Bit rates by their code, bit/s.
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
    /// To the adapter: send it. From the adapter: received.
    Frame {
        /// The frame.
        frame: CanFrame,
        /// When it was received, ms modulo 60,000, with time stamps on.
        time_ms: Option<u16>,
    },
    /// To the adapter.
    Command(Command),
    /// From the adapter.
    Answer(Answer),
}

/// What an adapter is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Command {
    /// Bit rate: place in [`BIT_RATES`].
    BitRate(u8),
    /// Data bit rate: code in [`DATA_RATES`].
    DataRate(u8),
    /// Takes part in the bus.
    Open,
    /// Listens to the bus.
    Listen,
    /// Leaves the bus.
    Close,
    /// Asks for the status flags.
    Status,
    /// Asks for the version.
    Version,
    /// Asks for the serial number.
    Serial,
    /// Time stamps on received frames.
    TimeStamps(bool),
}

/// What an adapter answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Done,
    /// The frame is on its way.
    Sent {
        /// It has a 29-bit identifier.
        extended: bool,
    },
    /// Not done: unknown, wrong or not allowed now.
    Refused,
    /// Status flags, from bit 0: receive queue full, transmit queue full, error warning, overrun, (none), error passive,
    /// arbitration lost, bus error.
    Status(u8),
    /// Hardware and software version; the first four characters of a longer text.
    Version([u8; 4]),
    /// Serial number, likewise.
    Serial([u8; 4]),
    /// State of the controller, told when it changes.
    State {
        /// The state.
        state: State,
        /// Its receive error counter.
        receive_errors: u16,
        /// Its transmit error counter.
        transmit_errors: u16,
    },
    /// Errors on the bus, 1 to 8, a letter each: `a` acknowledgement, `b` `B` bit 0 or 1, `c` CRC, `f` form, `s` stuffing, `o` `O`
    /// receive or transmit overrun. 0 after the last.
    Errors([u8; 8]),
}

/// How a controller takes part in the bus (ISO 11898-1, fault confinement).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// As it should.
    Active,
    /// An error counter has reached 96.
    Warning,
    /// It signals errors passively.
    Passive,
    /// Not at all: too many errors.
    BusOff,
}

/// Why octets up to a CR are no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineError {
    /// More octets than any line has.
    TooLong,
    /// No line begins so.
    Unknown {
        /// Its first octet.
        first: u8,
    },
    /// A digit, identifier, length or rate that is none, too few octets or too many.
    Malformed {
        /// Its first octet.
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

/// Finds lines in a stream of octets. Whatever garbage came before, it is in step again after the next CR.
#[derive(Debug, Clone)]
pub struct Decoder {
    line: [u8; MAX_LINE],
    length: usize,
    too_long: bool,
}

impl Decoder {
    /// Waits for the first line.
    pub const fn new() -> Self {
        Self {
            line: [0; MAX_LINE],
            length: 0,
            too_long: false,
        }
    }

    /// Takes one octet; at the end of a line, the line or what is wrong with it. Line feeds are passed over.
    pub fn push(&mut self, octet: u8) -> Option<Result<Line, LineError>> {
        match octet {
            CR | BEL => {
                let length = core::mem::take(&mut self.length);
                if core::mem::take(&mut self.too_long) {
                    return Some(Err(LineError::TooLong));
                }
                match self.line.get(..length)? {
                    [] if octet == BEL => Some(Ok(Line::Answer(Answer::Refused))),
                    [first, ..] if octet == BEL => {
                        Some(Err(LineError::Malformed { first: *first }))
                    }
                    line => Some(parse(line)),
                }
            }
            b'\n' => None,
            _ => {
                match self.line.get_mut(self.length) {
                    Some(slot) => {
                        *slot = octet;
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
