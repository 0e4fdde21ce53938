//! The hand-written text of `docs/icd.md` has the limits of the code; its tables are generated.

use skyloop_protocols::packet::{CRC_LENGTH, HEADER_LENGTH, MAX_PAYLOAD, VERSION};
use skyloop_protocols::pixels::{LABEL_TEXT_PER_PART, pixels_per_block};
use skyloop_protocols::reply::MAX_DETAIL;
use skyloop_protocols::{LabelPart, MAX_PACKET, Packing, PixelBlock, slip};

#[test]
fn every_limit_is_in_the_text() {
    let min = HEADER_LENGTH + CRC_LENGTH;
    let [bits12, bits16] = [Packing::Bits12, Packing::Bits16].map(pixels_per_block);
    let data = HEADER_LENGTH + PixelBlock::FIELDS_LENGTH;
    let text = HEADER_LENGTH + LabelPart::FIELDS_LENGTH;
    let sentences = [
        format!("format version {VERSION} "),
        format!("At most {MAX_PACKET} octets, at least {min}."),
        format!("0 to {MAX_PAYLOAD} |"),
        format!("a full block has {bits12} pixels with packing 12"),
        format!("and {bits16} with packing 16"),
        format!("label_bytes divided by {LABEL_TEXT_PER_PART} with label_level 2"),
        format!("1 to {LABEL_TEXT_PER_PART} octets"),
        format!("0 to {MAX_DETAIL} octets"),
        format!("one of more than {} drops", slip::BUFFER),
        format!("| {data} | n | | data |"),
        format!("| {text} | n | | text |"),
    ];
    let icd = include_str!("../docs/icd.md").split_whitespace();
    let icd = icd.collect::<Vec<_>>().join(" ");
    for sentence in sentences {
        assert!(icd.contains(&sentence), "{sentence}");
    }
}
