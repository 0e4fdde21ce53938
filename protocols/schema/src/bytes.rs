//! The two checksums, bit by bit, and octets as text: nothing here is shared with the codecs.

use crate::text::each;

/// CRC-16/CCITT-FALSE.
pub fn crc16(octets: &[u8]) -> u16 {
    octets.iter().fold(0xFFFF, |crc, octet| {
        (0..8).fold(crc ^ u16::from(*octet) << 8, |crc, _| match crc & 0x8000 {
            0 => crc << 1,
            _ => crc << 1 ^ 0x1021,
        })
    })
}

/// CRC-32 of IEEE 802.3.
pub fn crc32(octets: &[u8]) -> u32 {
    !octets.iter().fold(!0, |crc, octet| {
        (0..8).fold(crc ^ u32::from(*octet), |crc, _| match crc & 1 {
            0 => crc >> 1,
            _ => crc >> 1 ^ 0xEDB8_8320,
        })
    })
}

/// Hexadecimal digits.
pub fn hex(octets: &[u8]) -> String {
    each(octets, |octet| format!("{octet:02x}"))
}

/// Octets from hexadecimal digits; blanks are decoration.
///
/// # Errors
/// Anything else.
pub fn from_hex(text: &str) -> Result<Vec<u8>, String> {
    let digits: String = text.split_whitespace().collect();
    let wrong = || format!("{text:?} is not hexadecimal octets");
    let octet = |at| {
        let pair = digits.get(at..at + 2).ok_or_else(wrong)?;
        u8::from_str_radix(pair, 16).map_err(|_| wrong())
    };
    (0..digits.len()).step_by(2).map(octet).collect()
}

/// Bits put one after the other, the most significant first.
#[derive(Debug, Default)]
pub struct Bits {
    octets: Vec<u8>,
    used: usize,
}

impl Bits {
    /// Appends the last `bits` bits of a number.
    pub fn put(&mut self, value: u64, bits: usize) {
        for bit in (0..bits).rev() {
            if self.used.is_multiple_of(8) {
                self.octets.push(0);
            }
            let set = bit < 64 && value >> bit & 1 == 1;
            if let (true, Some(last)) = (set, self.octets.last_mut()) {
                *last |= 0x80 >> (self.used % 8);
            }
            self.used += 1;
        }
    }

    /// All of them; zeros fill the last octet.
    pub fn octets(self) -> Vec<u8> {
        self.octets
    }
}

#[cfg(test)]
mod tests {
    use super::{crc16, crc32};

    // X-Val: check values of the catalogue of parametrised CRC algorithms (CRC-16/IBM-3740, CRC-32/ISO-HDLC).
    #[test]
    fn published_check_values() {
        assert_eq!(crc16(b"123456789"), 0x29B1);
        assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    }
}
