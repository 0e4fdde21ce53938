//! Two packets that should be one: the first thing in which they differ, in words.

use skyloop_protocols::packet::{HEADER_LENGTH, identify, reseal};
use skyloop_protocols::pixels::{OBJECTS_PER_PART, unpack};
use skyloop_protocols::reply::Window;
use skyloop_protocols::{
    Counters, MAX_PACKET, Nack, ObjectPart, Personality, PixelBlock, Reply, Status, Timing,
    WindowBlock, WireTime, Withheld,
};

/// What a packet is called.
pub fn called(personality: &Personality, packet: &[u8]) -> String {
    match (personality.decode_reply)(&sealed(packet)) {
        Ok((_, Reply::FrameHeader(header))) => format!("the FrameHeader of frame {}", header.frame),
        Ok((_, Reply::FrameEnd(end))) => format!("the FrameEnd of frame {}", end.frame),
        Ok((_, Reply::PixelBlock(block))) => {
            format!("PixelBlock {} of frame {}", block.index, block.frame)
        }
        Ok((_, Reply::Compressed(block))) => {
            format!("Compressed {} of frame {}", block.index, block.frame)
        }
        Ok((_, Reply::Windows(block))) => {
            format!("Windows {} of frame {}", block.index, block.frame)
        }
        Ok((_, Reply::Objects(part))) => format!("Objects {} of frame {}", part.part, part.frame),
        Ok((_, Reply::Labels(part))) => format!("Labels {} of frame {}", part.part, part.frame),
        Ok((_, Reply::Nack(nack))) => format!("a Nack ({:?}: {})", nack.reason, nack.detail),
        Ok((_, reply)) => {
            let name = format!("{reply:?}");
            let end = name.find(['(', ' ']).unwrap_or(name.len());
            format!("a packet {}", &name[..end])
        }
        Err(_) => match identify(packet) {
            Some((apid, count)) => format!("packet {count} of APID {apid:#05x}"),
            None => "a runt".to_string(),
        },
    }
}

/// The first difference of a replayed packet from the recorded one; none if there is none that counts. A Status may
/// differ in its counters, those of the link depend on the link, and in its times.
pub fn first(
    personality: &Personality,
    width: u16,
    recorded: &[u8],
    replayed: &[u8],
) -> Option<String> {
    if recorded == replayed {
        return None;
    }
    // What was altered in the recording by hand may have lost its CRC.
    let (was, is) = (sealed(recorded), sealed(replayed));
    let decode = personality.decode_reply;
    let words = match (decode(&was), decode(&is)) {
        (Ok((_, Reply::PixelBlock(was))), Ok((_, Reply::PixelBlock(is)))) => {
            pixel(width, &was, &is)
        }
        (Ok((_, Reply::Windows(was))), Ok((_, Reply::Windows(is)))) => window(&was, &is),
        (Ok((_, Reply::Objects(was))), Ok((_, Reply::Objects(is)))) => object(&was, &is),
        // What follows the pixel that differs is coded otherwise too: the octet tells where.
        (Ok((_, Reply::Compressed(was))), Ok((_, Reply::Compressed(is))))
            if was.count == is.count =>
        {
            None
        }
        (Ok((_, Reply::Labels(was))), Ok((_, Reply::Labels(is)))) => text(was.text, is.text),
        (Ok((_, Reply::Status(was))), Ok((_, Reply::Status(is)))) => {
            let blind = |status: Status| Status {
                counters: Counters::default(),
                exposure_start: WireTime::default(),
                exposure_end: WireTime::default(),
                timing: Timing::default(),
                latency_p50_s: 0.0,
                latency_p99_s: 0.0,
                latency_max_s: 0.0,
                withheld: Withheld::None,
                ..status
            };
            if blind(was) == blind(is) {
                return None;
            }
            line(&blind(was), &blind(is))
        }
        (Ok((was_header, Reply::Nack(was))), Ok((is_header, Reply::Nack(is)))) => {
            // Each run's links have addresses of their own.
            let (was_text, is_text) = (without_addresses(was.detail), without_addresses(is.detail));
            let (was, is) = (
                Nack {
                    detail: &was_text,
                    ..was
                },
                Nack {
                    detail: &is_text,
                    ..is
                },
            );
            if (was_header, was) == (is_header, is) {
                return None;
            }
            line(&was, &is).or_else(|| line(&was_header, &is_header))
        }
        (Ok((_, was)), Ok((_, is))) => {
            if std::mem::discriminant(&was) == std::mem::discriminant(&is) {
                line(&was, &is)
            } else {
                Some(format!("{} comes", called(personality, replayed)))
            }
        }
        _ => None,
    };
    Some(words.unwrap_or_else(|| octet(recorded, replayed)))
}

/// The packet with the CRC that fits it.
pub fn sealed(packet: &[u8]) -> Vec<u8> {
    let mut packet = packet.to_vec();
    reseal(&mut packet);
    packet
}

/// A text whose words that are links' addresses all read the same.
fn without_addresses(text: &str) -> String {
    let words = text.split(' ');
    let words = words.map(|word| if word.contains("://") { "://" } else { word });
    words.collect::<Vec<_>>().join(" ")
}

fn pixel(width: u16, was: &PixelBlock<'_>, is: &PixelBlock<'_>) -> Option<String> {
    let place = |block: &PixelBlock<'_>| (block.first_pixel, block.count, block.packing);
    if place(was) != place(is) {
        return None;
    }
    let digits = |block: &PixelBlock<'_>| {
        let mut pixels = [0; MAX_PACKET];
        let found = unpack(block.packing, block.data, &mut pixels);
        pixels[..found.min(block.count.into())].to_vec()
    };
    let (was_digits, is_digits) = (digits(was), digits(is));
    let at = was_digits
        .iter()
        .zip(&is_digits)
        .position(|(a, b)| a != b)?;
    let pixel = was.first_pixel + at as u32;
    let width = u32::from(width.max(1));
    Some(format!(
        "pixel (column {}, row {}): recorded {}, replayed {}",
        pixel % width,
        pixel / width,
        was_digits[at],
        is_digits[at]
    ))
}

/// The first pixel of the first window that differs; none if it is not a pixel.
fn window(was: &WindowBlock<'_>, is: &WindowBlock<'_>) -> Option<String> {
    if (was.packing, was.size) != (is.packing, is.size) {
        return line(was, is);
    }
    let mut pairs = (was.first..).zip(was.windows().zip(is.windows()));
    let (number, (was_window, is_window)) = pairs.find(|(_, (was, is))| was != is)?;
    let place = |window: &Window<'_>| (window.column, window.row);
    if place(&was_window) != place(&is_window) {
        return Some(format!(
            "window {number}: recorded at (column, row) {:?}, replayed at {:?}",
            place(&was_window),
            place(&is_window)
        ));
    }
    let size = usize::from(was.size);
    let digits = |window: &Window<'_>| {
        let mut pixels = vec![0; size * size];
        unpack(was.packing, window.data, &mut pixels);
        pixels
    };
    let (was_digits, is_digits) = (digits(&was_window), digits(&is_window));
    let at = was_digits
        .iter()
        .zip(&is_digits)
        .position(|(a, b)| a != b)?;
    Some(format!(
        "window {number}, pixel (column {}, row {}): recorded {}, replayed {}",
        usize::from(was_window.column) + at % size,
        usize::from(was_window.row) + at / size,
        was_digits[at],
        is_digits[at]
    ))
}

/// The first field of the first object that differs.
fn object(was: &ObjectPart<'_>, is: &ObjectPart<'_>) -> Option<String> {
    let first = usize::from(was.part) * OBJECTS_PER_PART;
    let mut pairs = (first..).zip(was.objects().zip(is.objects()));
    let (number, (was, is)) = pairs.find(|(_, (was, is))| was.to_octets() != is.to_octets())?;
    Some(format!("object {number}: {}", line(&was, &is)?))
}

/// Texts around their first different octet.
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

/// The first field in which two messages differ.
fn line(was: &impl std::fmt::Debug, is: &impl std::fmt::Debug) -> Option<String> {
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

fn octet(was: &[u8], is: &[u8]) -> String {
    match was.iter().zip(is).position(|(a, b)| a != b) {
        Some(at) => {
            let place = if at < HEADER_LENGTH {
                "header octet"
            } else {
                "octet"
            };
            format!(
                "{place} {at}: recorded {:#04x}, replayed {:#04x}",
                was[at], is[at]
            )
        }
        None => format!(
            "length: recorded {} bytes, replayed {}",
            was.len(),
            is.len()
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::personality::NATIVE;
    use skyloop_protocols::{CompressedBlock, ObjectRecord, Packing, WireTime};

    /// What is said of a packet of which bit 0 of an octet of its fields is another.
    fn altered(reply: &Reply<'_>, octet: usize) -> String {
        let mut buffer = [0; MAX_PACKET];
        let length = (NATIVE.encode_reply)(reply, 7, WireTime(0), &mut buffer).unwrap();
        let replayed = &buffer[..length];
        assert_eq!(first(&NATIVE, 256, replayed, replayed), None);
        let mut recorded = replayed.to_vec();
        recorded[HEADER_LENGTH + octet] ^= 1;
        let words = first(&NATIVE, 256, &recorded, replayed).unwrap();
        format!("{}: {words}", called(&NATIVE, replayed))
    }

    #[test]
    fn the_place_in_a_window_an_object_and_a_code_is_named() {
        // Two windows of 3 x 3 pixels of 16 bits: each has its place and 18 octets of pixels.
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
        // Of the second window the fourth pixel: the first of its second row.
        let said = altered(&windows, WindowBlock::FIELDS_LENGTH + 26 + 7);
        assert_eq!(
            said,
            "Windows 0 of frame 4: window 1, pixel (column 100, row 51): recorded 1, replayed 0"
        );
        let said = altered(&windows, WindowBlock::FIELDS_LENGTH + 25);
        assert!(
            said.contains("window 1: recorded at (column, row) (100, 51), replayed at (100, 50)"),
            "{said}"
        );

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
        let data = [object.to_octets(); 2].concat();
        let objects = Reply::Objects(ObjectPart {
            frame: 4,
            part: 0,
            parts: 1,
            data: &data,
        });
        let said = altered(
            &objects,
            ObjectPart::FIELDS_LENGTH + ObjectRecord::FIELDS_LENGTH + 1,
        );
        assert!(
            said.starts_with("Objects 0 of frame 4: object 1: "),
            "{said}"
        );

        let code = Reply::Compressed(CompressedBlock {
            frame: 4,
            index: 2,
            first_pixel: 700,
            count: 16,
            data: &[1, 2, 3],
        });
        let said = altered(&code, CompressedBlock::FIELDS_LENGTH);
        assert!(
            said.starts_with("Compressed 2 of frame 4: octet 29: recorded 0x00"),
            "{said}"
        );
    }
}
