//! Packets in the capture format of Wireshark: IETF draft-ietf-opsawg-pcapng, sections 4.1 to 4.3.
//! They are "upper PDUs" (link type 252), which name their dissector: `ccsds`.

use super::{CaptureError, Record};
use bytes::Bytes;
use skyloop_orbit::path_text;
use skyloop_protocols::Direction;
use std::path::Path;
use std::time::Duration;

const SECTION: u32 = 0x0A0D_0D0A;
const INTERFACE: u32 = 1;
const PACKET: u32 = 6;
/// Byte-order magic of the section header.
const MAGIC: u32 = 0x1A2B_3C4D;
/// LINKTYPE_WIRESHARK_UPPER_PDU.
const UPPER_PDU: u16 = 252;
/// Tag "dissector name" (12) with `ccsds`, padded to four bytes, and the end of the tags.
const TAGS: [u8; 16] = *b"\0\x0c\0\x08ccsds\0\0\0\0\0\0\0";
/// Option codes of blocks.
const END: u16 = 0;
const COMMENT: u16 = 1;
const INTERFACE_NAME: u16 = 2;
const RESOLUTION: u16 = 9;
const FLAGS: u16 = 2;
const QUEUE: u16 = 6;
const PROGRAM: u16 = 4;
/// Time is counted in units of ten to the minus this many seconds.
const NANOSECONDS: u8 = 9;
/// Comment of packets preceded by a poll of the empty queue.
const FIRST: &[u8] = b"first of a batch";
/// Comment with the number of frames rendered before a packet.
const MADE: &str = "frames made before: ";
/// Direction in the flags.
const INBOUND: u32 = 1;
const OUTBOUND: u32 = 2;
/// Maximum length of a block.
const MAX_BLOCK: usize = 1 << 20;

/// The start of a file: the section with its comments, and an interface per link.
pub(crate) fn head(links: &[String], comments: &[String]) -> Vec<u8> {
    let mut section = Vec::new();
    section.extend(MAGIC.to_le_bytes());
    // Version 1.0; unknown length of the section.
    section.extend([1, 0, 0, 0]);
    section.extend((-1_i64).to_le_bytes());
    let program = concat!("skyloop ", env!("CARGO_PKG_VERSION"));
    option(&mut section, PROGRAM, program.as_bytes());
    for comment in comments {
        option(&mut section, COMMENT, comment.as_bytes());
    }
    option(&mut section, END, b"");
    let mut head = framed(SECTION, &section);
    for link in links {
        let mut interface = Vec::new();
        interface.extend(UPPER_PDU.to_le_bytes());
        // Reserved; no limit of packet length.
        interface.extend([0; 6]);
        option(&mut interface, INTERFACE_NAME, link.as_bytes());
        option(&mut interface, RESOLUTION, &[NANOSECONDS]);
        option(&mut interface, END, b"");
        head.extend(framed(INTERFACE, &interface));
    }
    head
}

/// One packet as a block. The option for the queue (`epb_queue`) has the number of its exchange.
pub fn block(record: &Record<Bytes>) -> Vec<u8> {
    let ns = record.at.as_nanos() as u64;
    let length = (TAGS.len() + record.item.len()) as u32;
    let flags = match record.direction {
        Direction::In => INBOUND,
        Direction::Out => OUTBOUND,
    };
    let mut body = Vec::with_capacity(64 + record.item.len());
    for field in [record.link, (ns >> 32) as u32, ns as u32, length, length] {
        body.extend(field.to_le_bytes());
    }
    body.extend(TAGS);
    body.extend(&record.item[..]);
    pad(&mut body);
    option(&mut body, FLAGS, &flags.to_le_bytes());
    option(&mut body, QUEUE, &record.exchange.to_le_bytes());
    if record.first {
        option(&mut body, COMMENT, FIRST);
    }
    if let Some(made) = record.made {
        option(&mut body, COMMENT, format!("{MADE}{made}").as_bytes());
    }
    option(&mut body, END, b"");
    framed(PACKET, &body)
}

fn option(to: &mut Vec<u8>, code: u16, value: &[u8]) {
    to.extend(code.to_le_bytes());
    to.extend((value.len() as u16).to_le_bytes());
    to.extend(value);
    pad(to);
}

/// Blocks and their parts are multiples of four bytes.
fn pad(to: &mut Vec<u8>) {
    to.resize(to.len().next_multiple_of(4), 0);
}

fn framed(kind: u32, body: &[u8]) -> Vec<u8> {
    let length = (body.len() + 12) as u32;
    let mut block = Vec::with_capacity(body.len() + 12);
    block.extend(kind.to_le_bytes());
    block.extend(length.to_le_bytes());
    block.extend(body);
    block.extend(length.to_le_bytes());
    block
}

/// Whether `bytes` start like a file of this format.
pub(crate) fn is_pcapng(bytes: &[u8]) -> bool {
    bytes.starts_with(&SECTION.to_le_bytes())
}

/// Contents of a file.
#[derive(Debug, PartialEq)]
pub struct Packets {
    /// Comments of the section.
    pub comments: Vec<String>,
    /// The links, by index.
    pub links: Vec<String>,
    /// The packets.
    pub records: Vec<Record<Bytes>>,
}

/// Reads a file written by skyloop; other blocks are skipped. An incomplete last block (the run was
/// killed) is skipped with a log message.
pub fn read(file: &Path, bytes: &Bytes) -> Result<Packets, CaptureError> {
    let wrong = |at: usize, problem: &str| CaptureError::Format {
        file: path_text(file),
        reason: format!("byte {at}: {problem}"),
    };
    let (mut comments, mut links, mut records) = (Vec::new(), Vec::new(), Vec::new());
    let mut at = 0;
    while at < bytes.len() {
        let block = &bytes[at..];
        let (Some(kind), Some(length)) = (word(block, 0), word(block, 4)) else {
            break;
        };
        let length = length as usize;
        if !(12..=MAX_BLOCK).contains(&length) || !length.is_multiple_of(4) {
            return Err(wrong(
                at,
                "impossible length of a block: the file is damaged",
            ));
        }
        let Some(body) = block.get(8..length - 4) else {
            break;
        };
        match kind {
            SECTION if word(body, 0) != Some(MAGIC) => {
                return Err(wrong(at, "not the order of bytes that skyloop writes"));
            }
            SECTION => {
                let texts = values(body, 16, COMMENT);
                comments.extend(texts.map(|text| String::from_utf8_lossy(text).into_owned()));
            }
            INTERFACE => {
                let link = word(body, 0).map(|word| word as u16);
                if link != Some(UPPER_PDU) || value(body, 8, RESOLUTION) != Some(&[NANOSECONDS]) {
                    return Err(wrong(
                        at,
                        "an interface of another kind: only recordings of skyloop itself can be replayed",
                    ));
                }
                let name = value(body, 8, INTERFACE_NAME).unwrap_or_default();
                links.push(String::from_utf8_lossy(name).into_owned());
            }
            PACKET => {
                let record = packet(bytes, body).ok_or_else(|| {
                    wrong(
                        at,
                        "a packet without skyloop's tags: only its own recordings can be replayed",
                    )
                })?;
                records.push(record);
            }
            _ => {}
        }
        at += length;
    }
    if at < bytes.len() {
        tracing::warn!(
            "{}: the last {} bytes are an incomplete block and skipped",
            path_text(file),
            bytes.len() - at
        );
    }
    Ok(Packets {
        comments,
        links,
        records,
    })
}

/// Parses the body of a packet block, a slice of `bytes`.
fn packet(bytes: &Bytes, body: &[u8]) -> Option<Record<Bytes>> {
    let ns = u64::from(word(body, 4)?) << 32 | u64::from(word(body, 8)?);
    let length = word(body, 12)? as usize;
    let data = body.get(20..20 + length)?;
    let options = 20 + length.next_multiple_of(4);
    let number = |code| word(value(body, options, code)?, 0);
    Some(Record {
        at: Duration::from_nanos(ns),
        direction: match number(FLAGS)? & 3 {
            INBOUND => Direction::In,
            OUTBOUND => Direction::Out,
            _ => return None,
        },
        link: word(body, 0)?,
        exchange: number(QUEUE).unwrap_or(0),
        first: values(body, options, COMMENT).any(|comment| comment == FIRST),
        made: values(body, options, COMMENT).find_map(frames_made),
        item: bytes.slice_ref(data.strip_prefix(&TAGS)?),
    })
}

fn frames_made(comment: &[u8]) -> Option<u32> {
    let comment = std::str::from_utf8(comment).ok()?;
    comment.strip_prefix(MADE)?.parse().ok()
}

/// The first value of option `code` in the options from `at`.
fn value(body: &[u8], at: usize, code: u16) -> Option<&[u8]> {
    values(body, at, code).next()
}

/// All values of option `code` in the options from `at`.
fn values(body: &[u8], mut at: usize, code: u16) -> impl Iterator<Item = &[u8]> {
    let options = std::iter::from_fn(move || {
        let head = word(body, at)?;
        let (found, length) = (head as u16, (head >> 16) as usize);
        let value = body.get(at + 4..at + 4 + length)?;
        at += 4 + length.next_multiple_of(4);
        (found != END).then_some((found, value))
    });
    options.filter_map(move |(found, value)| (found == code).then_some(value))
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_le_bytes(*bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn records() -> Vec<Record<Bytes>> {
        let record = |i: u32| Record {
            at: Duration::new(1_561_592_150, 123_456_789 + i),
            direction: [Direction::In, Direction::Out][i as usize % 2],
            link: i % 2,
            exchange: i / 3,
            first: i.is_multiple_of(4),
            made: (i % 3 < 2).then_some(i * 1000),
            item: Bytes::from(vec![i as u8; i as usize]),
        };
        (0..9).map(record).collect()
    }

    fn links() -> Vec<String> {
        ["udp://127.0.0.1:4810", "memory"]
            .map(str::to_string)
            .to_vec()
    }

    fn file() -> Vec<u8> {
        let mut file = head(&links(), &["one".to_string(), "a longer one".to_string()]);
        for record in records() {
            file.extend(block(&record));
        }
        file
    }

    #[test]
    fn written_packets_read_back() {
        let file = file();
        let length = file.len();
        assert!(is_pcapng(&file) && file.len().is_multiple_of(4));
        let packets = read(Path::new("x"), &Bytes::from(file.clone())).unwrap();
        assert_eq!(packets.comments, ["one", "a longer one"]);
        assert_eq!((packets.links, packets.records), (links(), records()));
        // Killed while writing: the last packet is skipped.
        let cut = Bytes::from(file).slice(..length - 5);
        let cut = read(Path::new("x"), &cut).unwrap();
        assert_eq!(cut.records, records()[..8]);
    }

    #[test]
    fn damaged_files_are_refused_without_a_panic() {
        let file = file();
        let section = file[4] as usize;
        let refusal = |bytes: &[u8]| {
            let bytes = Bytes::copy_from_slice(bytes);
            read(Path::new("x.pcapng"), &bytes).unwrap_err().to_string()
        };
        let mut big_endian = file.clone();
        big_endian[8..12].reverse();
        assert!(refusal(&big_endian).contains("byte 0: not the order"));
        let mut ethernet = file.clone();
        ethernet[section + 8] = 1;
        assert!(
            refusal(&ethernet).contains("another kind"),
            "{}",
            refusal(&ethernet)
        );
        let mut endless = file.clone();
        endless[section + 4..section + 8].fill(0);
        assert!(refusal(&endless).contains("impossible length"));
        for at in 0..file.len() {
            for byte in [0, 0x7f, 0xff] {
                let mut corrupted = file.clone();
                corrupted[at] = byte;
                let _ = read(Path::new("x"), &Bytes::from(corrupted));
            }
        }
    }
}
