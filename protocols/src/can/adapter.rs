//! Emulated adapter of an [slcan](crate::can::slcan) line: answers commands and forwards frames.
//! It replaces a real device at the other end of a pseudo-terminal.

use crate::can::frame::CanFrame;
use crate::can::slcan::{Answer, BIT_RATES, Command, DATA_RATES, Line, encode};

/// An adapter, initially closed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Adapter {
    bit_rate: Option<u8>,
    data_rate: Option<u8>,
    state: State,
    time_stamps: bool,
    /// Status flags; the `F` command reads and clears them.
    pub flags: u8,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum State {
    #[default]
    Closed,
    Open,
    Listening,
}

impl Adapter {
    /// Closed, without a bit rate.
    pub fn new() -> Self {
        Self::default()
    }

    /// Whether the channel is open, for both directions or to listen only.
    pub fn is_open(&self) -> bool {
        self.state != State::Closed
    }

    /// Bit rate, bit/s, once it is set.
    pub fn bit_rate(&self) -> Option<u32> {
        BIT_RATES.get(usize::from(self.bit_rate?)).copied()
    }

    /// FD data bit rate, bit/s, once it is set.
    pub fn data_rate(&self) -> Option<u32> {
        let code = self.data_rate?;
        DATA_RATES
            .iter()
            .find(|(known, _)| *known == code)
            .map(|(_, rate)| *rate)
    }

    /// Processes a line from the host: passes the answer to `put` and returns the frame to send.
    ///
    /// Settings can change only while the channel is closed; frames are sent only while it is open.
    /// An empty line has no answer.
    pub fn take(&mut self, line: &Line, put: &mut impl FnMut(u8)) -> Option<CanFrame> {
        let (answer, frame) = match *line {
            Line::Answer(Answer::Done) => return None,
            Line::Answer(_) => (Answer::Refused, None),
            Line::Command(command) => (self.execute(command).unwrap_or(Answer::Refused), None),
            Line::Frame {
                frame,
                time_ms: None,
            } if self.state == State::Open => (
                Answer::Sent {
                    extended: frame.extended,
                },
                Some(frame),
            ),
            Line::Frame { .. } => (Answer::Refused, None),
        };
        encode(&Line::Answer(answer), put);
        frame
    }

    /// Answers an invalid line.
    pub fn refuse(&self, put: &mut impl FnMut(u8)) {
        encode(&Line::Answer(Answer::Refused), put);
    }

    /// Passes the line of a frame from the bus to `put`, if the channel is open.
    pub fn deliver(&self, frame: &CanFrame, now_ms: u64, put: &mut impl FnMut(u8)) {
        if self.is_open() {
            let time = (now_ms % 60_000) as u16;
            let time_ms = self.time_stamps.then_some(time);
            encode(
                &Line::Frame {
                    frame: *frame,
                    time_ms,
                },
                put,
            );
        }
    }

    fn execute(&mut self, command: Command) -> Option<Answer> {
        let closed = !self.is_open();
        match command {
            Command::Version => return Some(Answer::Version(*b"1013")),
            Command::Serial => return Some(Answer::Serial(*b"SKYL")),
            Command::Status if !closed => {
                return Some(Answer::Status(core::mem::take(&mut self.flags)));
            }
            Command::Close if !closed => self.state = State::Closed,
            Command::BitRate(code) if closed => self.bit_rate = Some(code),
            Command::DataRate(code) if closed => self.data_rate = Some(code),
            Command::TimeStamps(on) if closed => self.time_stamps = on,
            Command::Open if closed && self.bit_rate.is_some() => self.state = State::Open,
            Command::Listen if closed && self.bit_rate.is_some() => self.state = State::Listening,
            _ => return None,
        }
        Some(Answer::Done)
    }
}
