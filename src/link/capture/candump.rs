//! CAN frames in the log format of `candump -l` (can-utils): `(1436509052.249713) can0
//! 123#DEADBEEF`, with `##` and a digit of flags for FD frames. The direction follows from the
//! identifier: the emulator sends 0x200 to 0x2FF.

use super::{CaptureError, Record};
use bytes::Bytes;
use skyloop_orbit::path_text;
use skyloop_protocols::Direction;
use skyloop_protocols::can::{CanFrame, Node, Side, frame};
use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

/// Interface name in the log: the format does not allow the names of all links.
const INTERFACE: &str = "can0";
/// Flags of an FD frame: bit rate switch, FD format.
const BRS: u8 = 1;
const FDF: u8 = 4;
/// Error frame bit of the kernel, in the identifier.
const ERROR: u32 = 0x2000_0000;

/// One line of a log.
pub fn line(record: &Record<CanFrame>) -> String {
    let CanFrame {
        id,
        extended,
        fd,
        brs,
        remote,
        error,
        len,
        ..
    } = record.item;
    let (s, us) = (record.at.as_secs(), record.at.subsec_micros());
    let mut line = format!("({s:010}.{us:06}) {INTERFACE} ");
    // Writing to a string cannot fail.
    let _ = match (error, extended) {
        (true, _) => write!(line, "{:08X}#", id | ERROR),
        (false, true) => write!(line, "{id:08X}#"),
        (false, false) => write!(line, "{id:03X}#"),
    };
    if fd {
        let _ = write!(line, "#{:X}", FDF | if brs { BRS } else { 0 });
    }
    if remote {
        let _ = write!(line, "R{len:X}");
    }
    for byte in record.item.payload() {
        let _ = write!(line, "{byte:02X}");
    }
    line.push('\n');
    line
}

/// Reads a candump log. Newer versions may end a line with the direction (R, T). An incomplete last
/// line is skipped.
pub fn read(file: &Path, text: &str) -> Result<Vec<Record<CanFrame>>, CaptureError> {
    let (whole, rest) = text.split_at(text.rfind('\n').map_or(0, |end| end + 1));
    let text = if parse(rest).is_some() || whole.is_empty() {
        text
    } else {
        whole
    };
    let lines = text.lines().enumerate();
    let lines = lines.filter(|(_, line)| !line.trim().is_empty());
    lines
        .map(|(number, line)| {
            parse(line).ok_or_else(|| CaptureError::Format {
                file: path_text(file),
                reason: format!(
                    "line {}: {:?} is not a line of a candump log, such as (1436509052.249713) can0 123#DEADBEEF R",
                    number + 1,
                    line.chars().take(60).collect::<String>()
                ),
            })
        })
        .collect()
}

fn parse(line: &str) -> Option<Record<CanFrame>> {
    let mut words = line.split_whitespace();
    let time = words.next()?.strip_prefix('(')?.strip_suffix(')')?;
    let _interface = words.next()?;
    let item = frame_of(words.next()?)?;
    let direction = match words.next() {
        Some("R") => Direction::In,
        Some("T") => Direction::Out,
        Some(_) => return None,
        None if !item.extended && !item.error && item.id & 0x700 == 0x200 => Direction::Out,
        None => Direction::In,
    };
    let (s, us) = time.split_once('.')?;
    let us = (us.len() == 6).then(|| us.parse::<u32>().ok())??;
    let at = Duration::from_secs(s.parse().ok()?).checked_add(Duration::from_micros(us.into()))?;
    Some(Record::plain(at, direction, item))
}

/// The frame of `123#DEADBEEF`, `123##5DEADBEEF` or `123#R8`.
fn frame_of(text: &str) -> Option<CanFrame> {
    let (id, data) = text.split_once('#')?;
    let number = u32::from_str_radix(id, 16).ok()?;
    let (fd, flags, data) = match data.strip_prefix('#') {
        Some(rest) => {
            let (flags, data) = rest.split_at_checked(1)?;
            (true, u8::from_str_radix(flags, 16).ok()?, data)
        }
        None => (false, 0, data),
    };
    let error = id.len() == 8 && number & ERROR != 0;
    let mut frame = CanFrame {
        id: number & !ERROR,
        extended: id.len() == 8 && !error,
        fd,
        brs: flags & BRS != 0,
        remote: data.starts_with('R'),
        error,
        len: 0,
        data: [0; frame::MAX_DATA],
    };
    if frame.remote {
        frame.len = u8::from_str_radix(data.get(1..)?, 16).unwrap_or(0);
    } else {
        for (index, pair) in data.as_bytes().chunks(2).enumerate() {
            let pair = std::str::from_utf8(pair)
                .ok()
                .filter(|pair| pair.len() == 2)?;
            *frame.data.get_mut(index)? = u8::from_str_radix(pair, 16).ok()?;
            frame.len += 1;
        }
    }
    (matches!(id.len(), 3 | 8) && frame.is_valid()).then_some(frame)
}

/// Reassembles the packets of CAN frames, each with the time of its last frame.
pub(crate) fn packets(frames: &[Record<CanFrame>]) -> Vec<Record<Bytes>> {
    let fd = frames.iter().any(|frame| frame.item.fd);
    // One receiver for each end.
    let mut ends = [Node::new(Side::Emulator, fd), Node::new(Side::Client, fd)];
    let mut packets = Vec::new();
    for frame in frames {
        let us = frame.at.as_micros() as u64;
        let end = &mut ends[usize::from(frame.direction == Direction::Out)];
        if let Some(packet) = end.receive(&frame.item, us) {
            let packet = Bytes::copy_from_slice(packet);
            packets.push(Record::plain(frame.at, frame.direction, packet));
        }
        // Discard the answers of this receiver: the recording has those of the recorded end.
        while end.next_frame(us).is_some() {}
    }
    packets
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(item: CanFrame, direction: Direction) -> Record<CanFrame> {
        let at = Duration::new(1_436_509_052, 249_713_000);
        Record::plain(at, direction, item)
    }

    #[test]
    fn lines_match_candump_and_read_back() {
        let classic = CanFrame::new(0x123, false, &[0xDE, 0xAD, 0xBE, 0xEF]).unwrap();
        let fd = CanFrame::new(0x220, true, &[7; 12]).unwrap();
        let extended = CanFrame {
            id: 0x1234_5678,
            extended: true,
            ..classic
        };
        let remote = CanFrame {
            remote: true,
            data: [0; frame::MAX_DATA],
            ..classic
        };
        let error = CanFrame {
            id: 4,
            error: true,
            ..classic
        };
        // X-Val: the examples in the help and the manual page of can-utils' candump and cansend.
        for (frame, direction, text) in [
            (classic, Direction::In, "123#DEADBEEF"),
            (fd, Direction::Out, "220##5070707070707070707070707"),
            (extended, Direction::In, "12345678#DEADBEEF"),
            (remote, Direction::In, "123#R4"),
            (error, Direction::In, "20000004#DEADBEEF"),
        ] {
            let written = line(&record(frame, direction));
            assert_eq!(written, format!("(1436509052.249713) can0 {text}\n"));
            let read = read(Path::new("x"), &written).unwrap();
            assert_eq!(read, [record(frame, direction)]);
        }
        // A stated direction takes precedence over the identifier.
        let plain = "(1436509052.249713) vcan0 110#0102 T\n\n(1436509052.249714) vcan0 210#05 R\n";
        let read = read(Path::new("x"), plain).unwrap();
        assert_eq!(
            [read[0].direction, read[1].direction],
            [Direction::Out, Direction::In]
        );
    }

    #[test]
    fn invalid_lines_are_refused_with_their_number() {
        for bad in [
            "hello",
            "(1.000000) can0",
            "(1.0) can0 123#00",
            "(1.000000) can0 123#0",
            "(1.000000) can0 12#00",
            "(1.000000) can0 123#000000000000000000",
            "(1.000000) can0 123##",
            "(1.000000) can0 123#zz",
            "(1.000000) can0 123#00 X",
            "(99999999999999999999.000000) can0 123#00",
            "(1.000000) can0 123#\u{e9}",
        ] {
            let text = format!("(1.000000) can0 123#00 R\n{bad}\n");
            let error = read(Path::new("x.log"), &text).unwrap_err().to_string();
            assert!(error.contains("x.log: line 2"), "{error}");
            // Without a line feed it may be incomplete.
            let broken = read(Path::new("x.log"), text.trim_end()).unwrap();
            assert_eq!(broken.len(), 1, "{bad:?}");
        }
    }
}
