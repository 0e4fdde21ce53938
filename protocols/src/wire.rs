//! Bounded big-endian reading and writing: only this module accesses bytes by position.

use crate::error::{DecodeError, EncodeError};
use crate::rules;
use crate::time::WireTime;

/// Bytes after the payload.
pub const CRC_LENGTH: usize = 2;

/// Reads fields from `bytes`, which end before the CRC; positions start at the packet.
pub(crate) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    what: &'static str,
}

impl<'a> Reader<'a> {
    /// Reads from byte `at`; `what` names the packet in errors.
    pub fn new(bytes: &'a [u8], at: usize, what: &'static str) -> Self {
        Self { bytes, at, what }
    }

    pub fn named(self, what: &'static str) -> Self {
        Self { what, ..self }
    }

    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        let end = self.at + N;
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let field = rest.first_chunk().ok_or(self.length(end))?;
        self.at = end;
        Ok(*field)
    }

    pub fn u8(&mut self) -> Result<u8, DecodeError> {
        self.array().map(u8::from_be_bytes)
    }

    pub fn u16(&mut self) -> Result<u16, DecodeError> {
        self.array().map(u16::from_be_bytes)
    }

    pub fn u32(&mut self) -> Result<u32, DecodeError> {
        self.array().map(u32::from_be_bytes)
    }

    pub fn u64(&mut self) -> Result<u64, DecodeError> {
        self.array().map(u64::from_be_bytes)
    }

    pub fn f64(&mut self) -> Result<f64, DecodeError> {
        self.array().map(f64::from_be_bytes)
    }

    pub fn f32(&mut self) -> Result<f32, DecodeError> {
        self.array().map(f32::from_be_bytes)
    }

    pub fn time(&mut self) -> Result<WireTime, DecodeError> {
        self.u64().map(WireTime)
    }

    /// Reads a code.
    pub fn code<T>(
        &mut self,
        from_code: fn(u8) -> Option<T>,
        field: &'static str,
        rule: &'static str,
    ) -> Result<T, DecodeError> {
        from_code(self.u8()?).ok_or(DecodeError::BadValue { field, rule })
    }

    /// Reads flags and refuses those that are not in `all`, whose set bits are the lowest.
    pub fn flags(
        &mut self,
        all: u8,
        field: &'static str,
        rule: &'static str,
    ) -> Result<u8, DecodeError> {
        let flags = self.u8()?;
        rules::rule(flags <= all, field, rule)?;
        Ok(flags)
    }

    /// All bytes up to the CRC as UTF-8, at most `max`.
    pub fn text(
        &mut self,
        max: usize,
        field: &'static str,
        rule: &'static str,
    ) -> Result<&'a str, DecodeError> {
        let bytes = self.rest();
        rules::rule(bytes.len() <= max, field, rule)?;
        core::str::from_utf8(bytes).map_err(|_| DecodeError::BadValue {
            field,
            rule: "must be UTF-8",
        })
    }

    pub fn f64s<const N: usize>(&mut self) -> Result<[f64; N], DecodeError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64()?;
        }
        Ok(numbers)
    }

    /// All bytes up to the CRC.
    pub fn rest(&mut self) -> &'a [u8] {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        self.at += rest.len();
        rest
    }

    /// Refuses bytes after the last field.
    pub fn finish(self) -> Result<(), DecodeError> {
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            Err(self.length(self.at))
        }
    }

    /// An error with the lengths of the whole packet, its CRC included.
    fn length(&self, end: usize) -> DecodeError {
        let (found, expected) = (self.bytes.len() + CRC_LENGTH, end + CRC_LENGTH);
        DecodeError::BadLength {
            what: self.what,
            found,
            expected,
        }
    }
}

/// Writes fields into the caller's buffer, never past `limit` bytes.
pub(crate) struct Writer<'b> {
    buffer: &'b mut [u8],
    at: usize,
    limit: usize,
}

impl<'b> Writer<'b> {
    pub fn new(buffer: &'b mut [u8], limit: usize) -> Self {
        Self {
            buffer,
            at: 0,
            limit,
        }
    }

    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), EncodeError> {
        let (end, limit) = (self.at.saturating_add(bytes.len()), self.limit);
        if end > limit {
            let (what, found) = ("packet", end);
            return Err(EncodeError::TooLong { what, found, limit });
        }
        let (needed, available) = (end, self.buffer.len());
        let field = self.buffer.get_mut(self.at..end);
        let field = field.ok_or(EncodeError::BufferTooSmall { needed, available })?;
        field.copy_from_slice(bytes);
        self.at = end;
        Ok(())
    }

    pub fn u8(&mut self, value: u8) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn u16(&mut self, value: u16) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn u32(&mut self, value: u32) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn u64(&mut self, value: u64) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn f64(&mut self, value: f64) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn f32(&mut self, value: f32) -> Result<(), EncodeError> {
        self.bytes(&value.to_be_bytes())
    }

    pub fn f64s(&mut self, values: &[f64]) -> Result<(), EncodeError> {
        values.iter().try_for_each(|value| self.f64(*value))
    }

    /// The bytes written so far.
    pub fn written(self) -> &'b mut [u8] {
        self.buffer.get_mut(..self.at).unwrap_or_default()
    }
}
