//! Describes the first difference between a recorded and a replayed packet.

use super::place::{Position, sealed};
use skyloop_protocols::packet::{HEADER_LENGTH, identify};
use skyloop_protocols::pixels::{OBJECTS_PER_PART, unpack};
use skyloop_protocols::reply::Window;
use skyloop_protocols::{
    Counters, Nack, ObjectPart, Packing, Personality, PixelBlock, Reply, Status, Timing,
    WindowBlock, WireTime, Withheld,
};
use std::fmt::Debug;

/// Describes a packet in messages.
pub(crate) fn describe(personality: &Personality, packet: &[u8]) -> String {
    let sealed = sealed(packet);
    let Ok((_, reply)) = (personality.decode_reply)(&sealed) else {
        return match identify(packet) {
            Some((apid, count)) => format!("packet {count} of APID {apid:#05x}"),
            None => "a runt".to_string(),
        };
    };
    if let Reply::Nack(nack) = &reply {
        return format!("a Nack ({:?}: {})", nack.reason, nack.detail);
    }
    let text = format!("{reply:?}");
    let name = text.split(['(', ' ']).next().unwrap_or_default();
    match Position::of(&reply, packet) {
        Some(Position { frame, number, .. }) => match number {
            Some(number) => format!("{name} {number} of frame {frame}"),
            None => format!("the {name} of frame {frame}"),
        },
        None => format!("a packet {name}"),
    }
}

/// Describes the first relevant difference of a replayed packet from the recorded one. Counters and
/// times of a Status are not compared.
pub(crate) fn first(
    personality: &Personality,
    width: u16,
    recorded: &[u8],
    replayed: &[u8],
) -> Option<String> {
    if recorded == replayed {
        return None;
    }
    let (was, is) = (sealed(recorded), sealed(replayed));
    let decode = personality.decode_reply;
    let text = match (decode(&was), decode(&is)) {
        (Ok((was_header, was)), Ok((is_header, is))) => match (was, is) {
            (Reply::PixelBlock(was), Reply::PixelBlock(is)) => pixel(width, &was, &is),
            (Reply::Windows(was), Reply::Windows(is)) => window(&was, &is),
            (Reply::Objects(was), Reply::Objects(is)) => object(&was, &is),
            // The code of later pixels differs too, so only the first different byte is reported.
            (Reply::Compressed(was), Reply::Compressed(is)) if was.count == is.count => None,
            (Reply::Labels(was), Reply::Labels(is)) => text(was.text, is.text),
            (Reply::Status(was), Reply::Status(is)) => {
                let (was, is) = (settings(was), settings(is));
                if was == is {
                    return None;
                }
                line(&was, &is)
            }
            (Reply::Nack(was), Reply::Nack(is)) => {
                // Link addresses differ from run to run.
                let [was_text, is_text] = [was, is].map(|nack| without_addresses(nack.detail));
                let detail = &was_text;
                let was = Nack { detail, ..was };
                let detail = &is_text;
                let is = Nack { detail, ..is };
                if (was_header, was) == (is_header, is) {
                    return None;
                }
                line(&was, &is).or_else(|| line(&was_header, &is_header))
            }
            (was, is) if std::mem::discriminant(&was) == std::mem::discriminant(&is) => {
                line(&was, &is)
            }
            _ => Some(format!("{} comes", describe(personality, replayed))),
        },
        _ => None,
    };
    Some(text.unwrap_or_else(|| byte(recorded, replayed)))
}

/// A Status without its counters and times.
fn settings(status: Status) -> Status {
    Status {
        counters: Counters::default(),
        exposure_start: WireTime::default(),
        exposure_end: WireTime::default(),
        timing: Timing::default(),
        latency_p50_s: 0.0,
        latency_p99_s: 0.0,
        latency_max_s: 0.0,
        withheld: Withheld::None,
        ..status
    }
}

/// Replaces link addresses in a text by a fixed word.
fn without_addresses(text: &str) -> String {
    let words = text.split(' ');
    let words = words.map(|word| if word.contains("://") { "://" } else { word });
    words.collect::<Vec<_>>().join(" ")
}

fn pixel(width: u16, was: &PixelBlock<'_>, is: &PixelBlock<'_>) -> Option<String> {
    let layout = |block: &PixelBlock<'_>| (block.first_pixel, block.count, block.packing);
    if layout(was) != layout(is) {
        return None;
    }
    let (first, width) = (was.first_pixel as usize, usize::from(width.max(1)));
    let place = |at: usize| [(first + at) % width, (first + at) / width];
    first_pixel(was.packing, was.count.into(), [was.data, is.data], place)
}

/// The first different pixel of the first different window; `None` if no pixel differs.
fn window(was: &WindowBlock<'_>, is: &WindowBlock<'_>) -> Option<String> {
    if (was.packing, was.size) != (is.packing, is.size) {
        return line(was, is);
    }
    let (packing, size) = (was.packing, usize::from(was.size));
    let mut pairs = (was.first..).zip(was.windows().zip(is.windows()));
    let (number, (was, is)) = pairs.find(|(_, (was, is))| was != is)?;
    let corner = |window: &Window<'_>| (window.column, window.row);
    if corner(&was) != corner(&is) {
        return Some(format!(
            "window {number}: recorded at (column, row) {:?}, replayed at {:?}",
            corner(&was),
            corner(&is)
        ));
    }
    let (column, row) = (usize::from(was.column), usize::from(was.row));
    let place = |at| [column + at % size, row + at / size];
    let text = first_pixel(packing, size * size, [was.data, is.data], place)?;
    Some(format!("window {number}, {text}"))
}

/// The first different pixel of `count` packed ones; `place` gives its column and row.
fn first_pixel(
    packing: Packing,
    count: usize,
    data: [&[u8]; 2],
    place: impl Fn(usize) -> [usize; 2],
) -> Option<String> {
    let [was, is] = data.map(|data| {
        let mut pixels = vec![0; count];
        unpack(packing, data, &mut pixels);
        pixels
    });
    let at = was.iter().zip(&is).position(|(a, b)| a != b)?;
    let [column, row] = place(at);
    Some(format!(
        "pixel (column {column}, row {row}): recorded {}, replayed {}",
        was[at], is[at]
    ))
}

/// The first different field of the first different object.
fn object(was: &ObjectPart<'_>, is: &ObjectPart<'_>) -> Option<String> {
    let first = usize::from(was.part) * OBJECTS_PER_PART;
    let mut pairs = (first..).zip(was.objects().zip(is.objects()));
    let (number, (was, is)) = pairs.find(|(_, (was, is))| was.to_bytes() != is.to_bytes())?;
    Some(format!("object {number}: {}", line(&was, &is)?))
}

/// The texts around their first different byte.
fn text(was: &[u8], is: &[u8]) -> Option<String> {
    let at = was.iter().zip(is).position(|(a, b)| a != b)?;
    let around = |text: &[u8]| {
        let (from, to) = (at.saturating_sub(24), (at + 24).min(text.len()));
        String::from_utf8_lossy(&text[from..to]).into_owned()
    };
    Some(format!(
        "text from its byte {at}: recorded ...{}..., replayed ...{}...",
        around(was),
        around(is)
    ))
}

fn line(was: &impl Debug, is: &impl Debug) -> Option<String> {
    let (was, is) = (format!("{was:#?}"), format!("{is:#?}"));
    let (was, is) = was.lines().zip(is.lines()).find(|(a, b)| a != b)?;
    let clean = |line: &str| line.trim().trim_end_matches(',').to_string();
    let (was, is) = (clean(was), clean(is));
    Some(match (was.split_once(": "), is.split_once(": ")) {
        (Some((field, was)), Some((_, is))) => {
            format!("{field}: recorded {was}, replayed {is}")
        }
        _ => format!("recorded {was}, replayed {is}"),
    })
}

fn byte(was: &[u8], is: &[u8]) -> String {
    let Some(at) = was.iter().zip(is).position(|(a, b)| a != b) else {
        return format!(
            "length: recorded {} bytes, replayed {}",
            was.len(),
            is.len()
        );
    };
    let part = if at < HEADER_LENGTH { "header " } else { "" };
    let (was, is) = (was[at], is[at]);
    format!("{part}octet {at}: recorded {was:#04x}, replayed {is:#04x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::{
        CompressedBlock, LabelLevel, MAX_PACKET, Mode, ObjectRecord, Output, PixelLevel, SyncState,
    };

    /// The reported difference if bit 0 of one byte of the fields was recorded inverted.
    fn difference_at(reply: &Reply<'_>, byte: usize) -> String {
        let mut buffer = [0; MAX_PACKET];
        let length = (NATIVE.encode_reply)(reply, 7, WireTime(0), &mut buffer).unwrap();
        let replayed = &buffer[..length];
        assert_eq!(first(&NATIVE, 256, replayed, replayed), None);
        let mut recorded = replayed.to_vec();
        recorded[HEADER_LENGTH + byte] ^= 1;
        let text = first(&NATIVE, 256, &recorded, replayed).unwrap();
        format!("{}: {text}", describe(&NATIVE, replayed))
    }

    #[test]
    fn statuses_are_compared_without_values_that_depend_on_the_run() {
        let status = Status {
            mode: Mode::Stepped,
            width: 64,
            height: 64,
            bits: 12,
            packing: Packing::Bits12,
            output: Output {
                pixels: PixelLevel::Frame,
                labels: LabelLevel::Text,
                window_size: 1,
                windows: 0,
                objects: 0,
            },
            exposure_s: 0.1,
            gain_e_per_dn: 4.0,
            frame_rate_hz: 2.0,
            next_frame: 3,
            packets_sent: 30,
            sync: SyncState::Free,
            clock_offset_s: 0.0,
            exposure_start: WireTime::default(),
            exposure_end: WireTime::default(),
            timing: Timing::default(),
            latency_p50_s: 0.0,
            latency_p99_s: 0.0,
            latency_max_s: 0.0,
            withheld: Withheld::None,
            counters: Counters::default(),
        };
        let encoded = |status| {
            let mut buffer = [0; MAX_PACKET];
            let reply = Reply::Status(status);
            let length = (NATIVE.encode_reply)(&reply, 7, WireTime(0), &mut buffer).unwrap();
            buffer[..length].to_vec()
        };
        let recorded = encoded(status);
        let check = |change: fn(&mut Status), expected: Option<&str>| {
            let mut replayed = status;
            change(&mut replayed);
            let found = first(&NATIVE, 64, &recorded, &encoded(replayed));
            assert_eq!(found.as_deref(), expected, "{replayed:?}");
        };
        check(|s| s.withheld = Withheld::Lost, None);
        check(|s| s.exposure_start = WireTime(5), None);
        check(|s| s.exposure_end = WireTime(6), None);
        check(|s| s.timing.last_pixel_s = 0.1, None);
        check(|s| s.latency_p50_s = 0.1, None);
        check(|s| s.latency_p99_s = 0.2, None);
        check(|s| s.latency_max_s = 0.3, None);
        check(|s| s.counters.attitudes = 3, None);
        let text = "exposure_s: recorded 0.1, replayed 0.2";
        check(|s| s.exposure_s = 0.2, Some(text));
    }

    #[test]
    fn differences_in_windows_objects_and_codes_are_located() {
        // Two windows of 3 x 3 pixels of 16 bits: each has its position and 18 bytes of pixels.
        let mut data = vec![0; 44];
        data[22..26].copy_from_slice(&[0, 100, 0, 50]);
        let windows = Reply::Windows(WindowBlock {
            frame: 4,
            index: 0,
            first: 0,
            count: 2,
            size: 3,
            packing: Packing::Bits16,
            data: &data,
        });
        let object = ObjectRecord {
            is_rso: false,
            in_frame: true,
            visible: true,
            id: [0; 16],
            x_px: 1.0,
            y_px: 2.0,
            dx_px: 0.0,
            dy_px: 0.0,
            mag: 3.0,
            snr: 4.0,
            electrons: 5.0,
        };
        let records = [object.to_bytes(); 2].concat();
        let objects = Reply::Objects(ObjectPart {
            frame: 4,
            part: 0,
            parts: 1,
            data: &records,
        });
        let code = Reply::Compressed(CompressedBlock {
            frame: 4,
            index: 2,
            first_pixel: 700,
            count: 16,
            data: &[1, 2, 3],
        });
        for (reply, byte, expected) in [
            (
                // Second window, fourth pixel: the first of its second row.
                &windows,
                WindowBlock::FIELDS_LENGTH + 26 + 7,
                "Windows 0 of frame 4: window 1, pixel (column 100, row 51): recorded 1, replayed 0",
            ),
            (
                &windows,
                WindowBlock::FIELDS_LENGTH + 25,
                "Windows 0 of frame 4: window 1: recorded at (column, row) (100, 51), \
                 replayed at (100, 50)",
            ),
            (
                &objects,
                ObjectPart::FIELDS_LENGTH + ObjectRecord::FIELDS_LENGTH + 1,
                "Objects 0 of frame 4: object 1: ",
            ),
            (
                &code,
                CompressedBlock::FIELDS_LENGTH,
                "Compressed 2 of frame 4: octet 29: recorded 0x00",
            ),
        ] {
            let text = difference_at(reply, byte);
            assert!(text.starts_with(expected), "{text}");
        }
    }
}
