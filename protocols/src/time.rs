//! The time field: CCSDS 301.0-B unsegmented time code (CUC), level 1.
//!
//! 4 bytes of seconds and 4 bytes of fraction since 1958-01-01T00:00:00 TAI, big-endian, with the
//! P-field implicit. One unit is 2^-32 s (0.23 ns), so whole nanoseconds survive the round trip.

const NANOSECONDS: u64 = 1_000_000_000;

/// Seconds from 1900-01-01T00:00:00 TAI to the epoch of [`WireTime`], 1958-01-01T00:00:00 TAI:
/// 58 years with 14 leap days, 21,184 days.
pub const TAI_1900_TO_1958_S: u64 = 21_184 * 86_400;

/// A TAI instant in units of 2^-32 s since 1958-01-01T00:00:00 TAI; ends in February 2094.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct WireTime(pub u64);

impl WireTime {
    /// The instant `ns` nanoseconds after 1958-01-01 TAI, rounded to the nearest 2^-32 s;
    /// `None` beyond the 2^32 seconds of the field.
    pub const fn from_tai_nanoseconds(ns: u64) -> Option<Self> {
        let (seconds, rest) = (ns / NANOSECONDS, ns % NANOSECONDS);
        if seconds > u32::MAX as u64 {
            return None;
        }
        // rest < 10^9 leaves the rounded fraction below 2^32 - 4: it never carries.
        let fraction = ((rest << 32) + NANOSECONDS / 2) / NANOSECONDS;
        Some(Self(seconds << 32 | fraction))
    }

    /// Nanoseconds since 1958-01-01 TAI, rounded to the nearest.
    pub const fn tai_nanoseconds(self) -> u64 {
        let (seconds, fraction) = (self.0 >> 32, self.0 & 0xFFFF_FFFF);
        seconds * NANOSECONDS + ((fraction * NANOSECONDS + (1 << 31)) >> 32)
    }
}
