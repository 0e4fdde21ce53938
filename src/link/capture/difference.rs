//! Two packets that should be one: the first thing in which they differ, in words.

use skyloop_protocols::packet::{HEADER_LENGTH, identify, reseal};
use skyloop_protocols::pixels::unpack;
use skyloop_protocols::{Counters, MAX_PACKET, Nack, Personality, PixelBlock, Reply, Status};

/// What a packet is called.
pub fn called(personality: &Personality, packet: &[u8]) -> String {
    match (personality.decode_reply)(&sealed(packet)) {
        Ok((_, Reply::FrameHeader(header))) => format!("the FrameHeader of frame {}", header.frame),
        Ok((_, Reply::PixelBlock(block))) => {
            format!("PixelBlock {} of frame {}", block.index, block.frame)
        }
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
/// differ in its counters: those of the link depend on the link.
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
        (Ok((_, Reply::Labels(was))), Ok((_, Reply::Labels(is)))) => text(was.text, is.text),
        (Ok((_, Reply::Status(was))), Ok((_, Reply::Status(is)))) => {
            let blind = |status: Status| Status {
                counters: Counters::default(),
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

/// Texts around their first different octet.
fn text(was: &[u8], is: &[u8]) -> Option<String> {
    let at = was.iter().zip(is).position(|(a, b)| a != b)?;
    let around = |text: &[u8]| {
        let (from, to) = (at.saturating_sub(24), (at + 24).min(text.len()));
        String::from_utf8_lossy(&text[from..to]).into_owned()
    };
    Some(format!(
        "text from its octet {at}: recorded ...{}..., replayed ...{}...",
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
            "length: recorded {} octets, replayed {}",
            was.len(),
            is.len()
        ),
    }
}
