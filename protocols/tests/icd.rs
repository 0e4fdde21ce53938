//! `docs/icd.md` names everything that the code has, at the place where the code has it.

mod common;

use std::collections::BTreeSet;

use common::{golden, hex};
use skyloop_protocols::command::Opcode;
use skyloop_protocols::packet::{CRC_LENGTH, HEADER_LENGTH, MAX_PAYLOAD, VERSION};
use skyloop_protocols::pixels::{LABEL_TEXT_PER_PART, pixels_per_block};
use skyloop_protocols::reply::MAX_DETAIL;
use skyloop_protocols::{Counters, MAX_PACKET, Mode, Packing, Reason, apid, slip};
use skyloop_protocols::{LabelPart, PixelBlock};

const ICD: &str = include_str!("../docs/icd.md");

/// Offset of the first counter of Status: 15 octets before its fields, 90 of these.
const COUNTERS: u32 = 122;

/// The cells of all table rows of a text.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    let tables = text.lines().filter_map(|line| line.strip_prefix('|'));
    tables.map(|row| {
        row.trim_end_matches('|')
            .split('|')
            .map(str::trim)
            .collect()
    })
}

/// Whether some table row begins with these cells.
fn has_row(text: &str, cells: &[&str]) -> bool {
    rows(text).any(|row| row.starts_with(cells))
}

/// The text under the heading of one message.
fn section(message: &str, apid: u16) -> &'static str {
    let heading = format!(" {message} (APID {apid:#05x})\n");
    let (_, text) = ICD
        .split_once(&heading)
        .unwrap_or_else(|| panic!("no heading{heading}"));
    text.split("\n##").next().unwrap_or(text)
}

#[test]
fn every_code_has_its_row() {
    for (apid, name) in apid::ALL {
        assert!(
            has_row(ICD, &[&format!("{apid:#05x}"), name]),
            "APID {apid:#05x} {name}"
        );
        section(name, apid);
    }
    for opcode in Opcode::ALL {
        assert!(
            has_row(
                section("Command", apid::COMMAND),
                &[&opcode.code().to_string(), opcode.name()]
            ),
            "{opcode:?}"
        );
    }
    let nack = section("Nack", apid::NACK);
    for reason in Reason::ALL {
        let mut counters = Counters::default();
        counters.refuse(*reason);
        let (counter, _) = counters
            .iter()
            .find(|(_, value)| *value == 1)
            .expect("counted");
        assert!(
            has_row(nack, &[&reason.code().to_string(), reason.name(), counter]),
            "{reason:?}"
        );
    }
    let status = section("Status", apid::STATUS);
    for (at, name) in (COUNTERS..).step_by(4).zip(Counters::NAMES) {
        assert!(
            has_row(status, &[&at.to_string(), "4", "u32", name]),
            "{name} at {at}"
        );
    }
    for mode in Mode::ALL {
        assert!(
            status.contains(&format!("{} {}", mode.code(), mode.name())),
            "{mode:?}"
        );
    }
}

#[test]
fn no_row_is_left_of_something_the_code_does_not_have() {
    let count = |text, column: &str| {
        let mut table = rows(text)
            .skip_while(|row| row.first() != Some(&column))
            .skip(2);
        std::iter::from_fn(|| {
            table
                .next()
                .filter(|row| row[0].chars().all(|c| c.is_ascii_hexdigit() || c == 'x'))
        })
        .count()
    };
    assert_eq!(count(ICD, "APID"), apid::ALL.len());
    assert_eq!(
        count(section("Command", apid::COMMAND), "opcode"),
        Opcode::ALL.len()
    );
    assert_eq!(
        count(section("Nack", apid::NACK), "reason"),
        Reason::ALL.len()
    );
    let counters = rows(section("Status", apid::STATUS))
        .filter(|row| row[0].parse().is_ok_and(|at: u32| at >= COUNTERS));
    assert_eq!(counters.count(), Counters::NAMES.len());
}

/// In every table fields follow each other without gaps; the first of a section begins behind the header, and a fixed
/// layout ends where its golden packets end.
#[test]
fn offsets_and_sizes_add_up() {
    let vectors = golden();
    for (apid, name) in apid::ALL {
        let tables = section(name, apid).split("| offset |").skip(1);
        for (number, table) in tables.enumerate() {
            let fields = rows(table).skip(1).take_while(|row| row.len() == 7);
            let mut at = (number == 0).then_some(HEADER_LENGTH);
            let mut open = false;
            for row in fields.filter(|row| row[0].parse::<usize>().is_ok()) {
                let offset: usize = row[0].parse().unwrap();
                assert_eq!(offset, at.unwrap_or(offset), "{name}: {row:?}");
                at = Some(offset + row[1].parse().unwrap_or(0));
                open |= row[1].parse::<usize>().is_err();
            }
            let at = at.expect(name);
            if number > 0 {
                continue; // a command's arguments or a record
            }
            let lengths = vectors
                .iter()
                .filter(|v| v.has("message") && v.text("message") == name)
                .map(|v| v.bytes.len());
            let (shortest, longest) = (
                lengths.clone().min().expect(name),
                lengths.max().expect(name),
            );
            if open {
                assert!(at + CRC_LENGTH <= shortest, "{name}");
            } else {
                assert_eq!(at + CRC_LENGTH, longest, "{name}");
            }
        }
    }
}

/// The table of messages gives the length of every golden packet, and no length that none has.
#[test]
fn lengths_are_those_of_the_golden_packets() {
    let vectors = golden();
    for (apid, name) in apid::ALL {
        let code = format!("{apid:#05x}");
        let row = rows(ICD)
            .find(|row| row.starts_with(&[&code, name]))
            .expect(name);
        let said = row[4].replace(" or ", ", ");
        let lengths: BTreeSet<usize> = vectors
            .iter()
            .filter(|v| v.has("message") && v.text("message") == name)
            .map(|v| v.bytes.len())
            .collect();
        if let Some((least, most)) = said.split_once(" to ") {
            let range = least.parse().unwrap()..=most.parse().unwrap();
            assert!(lengths.iter().all(|n| range.contains(n)), "{name}: {said}");
        } else {
            let said: BTreeSet<usize> = said.split(", ").map(|n| n.parse().unwrap()).collect();
            assert_eq!(lengths, said, "{name}");
        }
    }
}

/// Every field that the vectors name stands in the section of its message.
#[test]
fn every_field_has_its_row() {
    // The header's, the opcode's, and what the vectors write of the rest of a packet.
    let elsewhere = [
        "message",
        "sequence_count",
        "time",
        "hex",
        "opcode",
        "pixels",
        "pixel_bits",
        "places",
        "records",
    ];
    for v in golden().iter().filter(|v| v.has("message")) {
        let name = v.text("message");
        let (apid, _) = apid::ALL
            .into_iter()
            .find(|(_, known)| *known == name)
            .expect(name);
        for field in v.keys().filter(|key| !elsewhere.contains(key)) {
            let field = field.trim_start_matches("answers_");
            assert!(
                rows(section(name, apid)).any(|row| {
                    // A single argument of a command stands in its row: type and name.
                    let argument = row.get(2).and_then(|cell| cell.split_once(' '));
                    row.get(3) == Some(&field) || argument.is_some_and(|(_, name)| name == field)
                }),
                "{name}.{field}"
            );
        }
    }
}

#[test]
fn every_limit_is_named() {
    let sentences = [
        format!("format version {VERSION} "),
        format!(
            "At most {MAX_PACKET} octets, at least {}.",
            HEADER_LENGTH + CRC_LENGTH
        ),
        format!("0 to {MAX_PAYLOAD} |"),
        format!(
            "a full block has {} pixels with packing 12",
            pixels_per_block(Packing::Bits12)
        ),
        format!("and {} with packing 16", pixels_per_block(Packing::Bits16)),
        format!("label_bytes divided by {LABEL_TEXT_PER_PART} with label_level 2"),
        format!("1 to {LABEL_TEXT_PER_PART} octets"),
        format!("0 to {MAX_DETAIL} octets"),
        format!("one of more than {} drops", slip::BUFFER),
        format!(
            "| {} | n | | data |",
            HEADER_LENGTH + PixelBlock::FIELDS_LENGTH
        ),
        format!(
            "| {} | n | | text |",
            HEADER_LENGTH + LabelPart::FIELDS_LENGTH
        ),
    ];
    let text = ICD.split_whitespace().collect::<Vec<_>>().join(" ");
    for sentence in sentences {
        assert!(text.contains(&sentence), "{sentence}");
    }
}

#[test]
fn the_worked_example_is_the_golden_vector() {
    let example = ICD.split("```").nth(1).expect("the example's fence");
    let digits: String = example
        .lines()
        .filter_map(|line| line.split_whitespace().nth(1))
        .collect();
    let vectors = golden();
    let vector = vectors
        .iter()
        .find(|v| v.name == "attitude with state")
        .expect("the vector");
    assert_eq!(hex(&digits), vector.bytes);
    let mut at = 0;
    for line in example.lines().filter(|line| !line.is_empty()) {
        let cells: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(cells[0], at.to_string(), "{line}");
        at += cells[1].len() / 2;
    }
}
