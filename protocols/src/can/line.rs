//! The text of an [slcan](crate::can::slcan) line, read and written.

use crate::can::frame::{CanFrame, LENGTHS, MAX_CLASSIC_DATA, MAX_DATA, dlc};
use crate::can::slcan::{Answer, BEL, CR, Command, DATA_RATES, Line, LineError, State};

/// Reads a line without its CR.
pub(crate) fn parse(line: &[u8]) -> Result<Line, LineError> {
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
    let mut text = [0; 4];
    for (to, from) in text.iter_mut().zip(rest) {
        *to = *from;
    }
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
            let mut told = [0; 8];
            let told_now = told.get_mut(..usize::from(count - b'0'))?;
            if letters.len() != told_now.len() || !letters.iter().all(u8::is_ascii_alphabetic) {
                return None;
            }
            told_now.copy_from_slice(letters);
            Some(Answer::Errors(told))
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
    digits.iter().try_fold(0, |number, octet| {
        let digit = char::from(*octet).to_digit(10)?;
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
    for (octet, digits) in frame.data.iter_mut().zip(data.as_chunks::<2>().0) {
        *octet = number(digits)? as u8;
    }
    let time_ms = match time.len() {
        0 => None,
        4 => Some(number(time)? as u16),
        _ => return None,
    };
    Some(Line::Frame { frame, time_ms })
}

fn digit(octet: u8) -> Option<u8> {
    char::from(octet).to_digit(16).map(|digit| digit as u8)
}

/// Up to eight hexadecimal digits.
fn number(digits: &[u8]) -> Option<u32> {
    digits.iter().try_fold(0, |number, octet| {
        Some(number << 4 | u32::from(digit(*octet)?))
    })
}

/// Hands the octets of a line and its end to `put`. A frame that is not valid, or reports an error, has no line.
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
                for place in [100, 10, 1] {
                    put(b'0' + (counter / place % 10) as u8);
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
    put(if frame.extended {
        kind.to_ascii_uppercase()
    } else {
        kind
    });
    hex(frame.id, if frame.extended { 8 } else { 3 }, put);
    let code = dlc(frame.len.into()).unwrap_or(MAX_CLASSIC_DATA as u8); // valid frames have one
    hex(code.into(), 1, put);
    frame
        .payload()
        .iter()
        .for_each(|octet| hex((*octet).into(), 2, put));
    if let Some(time) = time_ms {
        hex(time.into(), 4, put);
    }
}

fn hex(number: u32, digits: u32, put: &mut impl FnMut(u8)) {
    for place in (0..digits).rev() {
        let digit = (number >> (4 * place)) as u8 & 0xF;
        put(if digit < 10 {
            b'0' + digit
        } else {
            b'A' + digit - 10
        });
    }
}
