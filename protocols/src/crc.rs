//! The two checksums. They run over every pixel byte, so they must be fast.
//!
//! Both are table-driven, sixteen bytes per step ("slicing-by-16"; Kounavis and Berry 2008, IEEE
//! Transactions on Computers 57, 1550). [`crc16`] first folds longer data into one block of 128
//! bytes, without a table.
//!
//! - [`crc16`]: CRC-16/CCITT-FALSE, the packet error control of CCSDS 132.0-B and ECSS-E-ST-70-41:
//!   x^16 + x^12 + x^5 + 1, preset to ones, most significant bit first.
//! - [`Crc32`]: CRC-32 of IEEE 802.3: polynomial 0x04C11DB7, reflected, preset and complemented.

/// Bytes of a step.
const STEP: usize = 16;

/// `TABLE_16[k][b]`: the remainder of byte `b` followed by `k` zero bytes.
static TABLE_16: [[u16; 256]; STEP] = table_16();
/// `TABLE_32[k][b]`: the same for the reflected CRC-32.
static TABLE_32: [[u32; 256]; STEP] = table_32();

const fn table_16() -> [[u16; 256]; STEP] {
    let mut table = [[0; 256]; STEP];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = (byte as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 {
                crc << 1 ^ 0x1021
            } else {
                crc << 1
            };
            bit += 1;
        }
        table[0][byte] = crc;
        byte += 1;
    }
    let mut next = 256;
    while next < STEP * 256 {
        let (k, byte) = (next / 256, next % 256);
        let before = table[k - 1][byte];
        table[k][byte] = before << 8 ^ table[0][(before >> 8) as usize];
        next += 1;
    }
    table
}

const fn table_32() -> [[u32; 256]; STEP] {
    let mut table = [[0; 256]; STEP];
    let mut byte = 0;
    while byte < 256 {
        let mut crc = byte as u32;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 1 != 0 {
                crc >> 1 ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
            bit += 1;
        }
        table[0][byte] = crc;
        byte += 1;
    }
    let mut next = 256;
    while next < STEP * 256 {
        let (k, byte) = (next / 256, next % 256);
        let before = table[k - 1][byte];
        table[k][byte] = before >> 8 ^ table[0][(before & 0xFF) as usize];
        next += 1;
    }
    table
}

/// Bytes of a unit of folding.
const UNIT: usize = 8;
/// Units of a block: the degree of the polynomial.
const UNITS: usize = 16;

/// CRC-16/CCITT-FALSE of `bytes`.
pub fn crc16(bytes: &[u8]) -> u16 {
    let (blocks, rest) = bytes.as_chunks();
    let Some((last, before)) = blocks.split_last() else {
        return carry_on_16(0xFFFF, bytes);
    };
    carry_on_16(carry_on_16(0, &folded(before, last)), rest)
}

/// A block with the same remainder as the concatenation of `before` and `last`, preset to ones.
///
/// Squared six times, x^16 = x^12 + x^5 + 1 (mod 2) is y^16 = y^12 + y^5 + 1 with y = x^64. So a
/// unit of 64 bits can be added to the units four, eleven and sixteen after it without a change of
/// the remainder. The order of the bytes in a unit does not matter.
fn folded(before: &[[u8; UNIT * UNITS]], last: &[u8; UNIT * UNITS]) -> [u8; UNIT * UNITS] {
    // Sum to add to the next block. The preset adds ones to the first bits.
    let mut over = [0; UNITS];
    over[0] = u64::from_ne_bytes([0xFF, 0xFF, 0, 0, 0, 0, 0, 0]);
    let added = |block: &[u8; UNIT * UNITS], over: &[u64; UNITS]| {
        let mut units = *over;
        for (unit, bytes) in units.iter_mut().zip(block.as_chunks().0) {
            *unit ^= u64::from_ne_bytes(*bytes);
        }
        units
    };
    for block in before {
        let mut unit = added(block, &over);
        for i in 4..11 {
            unit[i] ^= unit[i - 4];
        }
        for i in 11..16 {
            unit[i] ^= unit[i - 4] ^ unit[i - 11];
        }
        over = unit;
        for i in 0..11 {
            over[i] ^= unit[i + 5];
        }
        for i in 0..4 {
            over[i] ^= unit[i + 12];
        }
    }
    let mut block = [0; UNIT * UNITS];
    let bytes = block.as_chunks_mut().0;
    for (bytes, unit) in bytes.iter_mut().zip(added(last, &over)) {
        *bytes = unit.to_ne_bytes();
    }
    block
}

/// The remainder continued over `bytes`.
fn carry_on_16(crc: u16, bytes: &[u8]) -> u16 {
    let t = &TABLE_16;
    let (steps, rest) = bytes.as_chunks::<STEP>();
    let crc = steps.iter().fold(crc, |crc, b| {
        let [high, low] = crc.to_be_bytes();
        // All but the first two bytes are independent of the previous step.
        let later = (2..STEP).fold(0, |sum, k| sum ^ t[STEP - 1 - k][usize::from(b[k])]);
        later ^ t[STEP - 1][usize::from(b[0] ^ high)] ^ t[STEP - 2][usize::from(b[1] ^ low)]
    });
    rest.iter().fold(crc, |crc, byte| {
        crc << 8 ^ t[0][usize::from((crc >> 8) as u8 ^ byte)]
    })
}

/// CRC-32 of `bytes`.
pub fn crc32(bytes: &[u8]) -> u32 {
    Crc32::new().update(bytes).finish()
}

/// Incremental CRC-32.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Crc32(u32);

impl Crc32 {
    /// The state before the first byte.
    pub const fn new() -> Self {
        Self(u32::MAX)
    }

    /// The checksum continued over `bytes`.
    #[must_use]
    pub fn update(self, bytes: &[u8]) -> Self {
        let (steps, rest) = bytes.as_chunks::<STEP>();
        let crc = steps.iter().fold(self.0, step_32);
        Self(rest.iter().fold(crc, |crc, byte| {
            crc >> 8 ^ TABLE_32[0][usize::from(crc as u8 ^ byte)]
        }))
    }

    /// The checksum continued over `pixels`, each as a big-endian 16-bit number.
    #[must_use]
    pub fn update_pixels(self, pixels: &[u16]) -> Self {
        let (steps, rest) = pixels.as_chunks::<{ STEP / 2 }>();
        let crc = steps.iter().fold(self.0, |crc, pixels| {
            let mut bytes = [0; STEP];
            for (two, pixel) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(pixels) {
                *two = pixel.to_be_bytes();
            }
            step_32(crc, &bytes)
        });
        rest.iter()
            .fold(Self(crc), |crc, pixel| crc.update(&pixel.to_be_bytes()))
    }

    /// The checksum of all bytes so far.
    pub const fn finish(self) -> u32 {
        !self.0
    }
}

impl Default for Crc32 {
    fn default() -> Self {
        Self::new()
    }
}

fn step_32(crc: u32, b: &[u8; STEP]) -> u32 {
    let t = &TABLE_32;
    let c = crc.to_le_bytes();
    // All but the first four bytes are independent of the previous step.
    let later = (4..STEP).fold(0, |sum, k| sum ^ t[STEP - 1 - k][usize::from(b[k])]);
    (0..4).fold(later, |sum, k| {
        sum ^ t[STEP - 1 - k][usize::from(b[k] ^ c[k])]
    })
}
