//! A CAN frame, classic or FD (ISO 11898-1:2015), and how long it occupies the bus.

/// Largest number of data bytes of a frame.
pub const MAX_DATA: usize = 64;
/// Largest number of data bytes of a classic frame.
pub const MAX_CLASSIC_DATA: usize = 8;
/// Data bytes by data length code (ISO 11898-1, table of DLC); classic frames: 8 from code 8 on.
pub const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Largest 11-bit identifier.
pub const MAX_BASE_ID: u32 = 0x7FF;
/// Largest 29-bit identifier.
pub const MAX_EXTENDED_ID: u32 = 0x1FFF_FFFF;

/// One frame. The data bytes after the first `len` are 0 in frames made by [`new`](Self::new).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    /// Identifier: 11 bits, or 29 if `extended`. Of an error frame: the kernel's error class bits.
    pub id: u32,
    /// 29-bit identifier.
    pub extended: bool,
    /// CAN FD format: up to 64 data bytes, never remote.
    pub fd: bool,
    /// FD only: data phase at the second bit rate.
    pub brs: bool,
    /// Classic only: requests `len` bytes, carries none.
    pub remote: bool,
    /// Not from the bus: the controller reports an error.
    pub error: bool,
    /// Data bytes in use.
    pub len: u8,
    /// The data bytes.
    pub data: [u8; MAX_DATA],
}

impl CanFrame {
    /// A data frame with an 11-bit identifier: classic, or FD with bit rate switch.
    ///
    /// `None` for an invalid identifier or length; [`padded_length`] gives the lengths of FD.
    pub fn new(id: u32, fd: bool, data: &[u8]) -> Option<Self> {
        let mut frame = Self {
            id,
            extended: false,
            fd,
            brs: fd,
            remote: false,
            error: false,
            len: u8::try_from(data.len()).ok()?,
            data: [0; MAX_DATA],
        };
        frame.data.get_mut(..data.len())?.copy_from_slice(data);
        frame.is_valid().then_some(frame)
    }

    /// Whether identifier, length and flags are valid and consistent.
    pub const fn is_valid(&self) -> bool {
        let max_id = if self.extended {
            MAX_EXTENDED_ID
        } else {
            MAX_BASE_ID
        };
        let length = self.len as usize <= self.max_data() && dlc(self.len as usize).is_some();
        let flags = if self.fd { !self.remote } else { !self.brs };
        (self.id <= max_id || self.error) && length && flags
    }

    /// The data bytes in use; none of a remote frame.
    pub fn payload(&self) -> &[u8] {
        let used = if self.remote { 0 } else { self.len.into() };
        self.data.get(..used).unwrap_or(&self.data)
    }

    /// Bits on the bus without stuff bits, from start of frame to the end of the intermission.
    ///
    /// Classic, 11-bit identifier: 44 + 8 n bits of frame and 3 of intermission (ISO 11898-1, 10.4;
    /// Davis et al., "Controller Area Network (CAN) schedulability analysis", 2007). An error
    /// frame: flag 6, delimiter 8, intermission 3.
    pub const fn bits(&self) -> WireBits {
        let head = self.head_bits();
        if self.error {
            return WireBits::nominal(6 + 8 + INTERMISSION);
        }
        if !self.fd {
            return WireBits::nominal(
                head + 8 * self.carried() + CLASSIC_CRC + TAIL + INTERMISSION,
            );
        }
        let fast = FD_CONTROL + 8 * self.carried() + self.fd_crc_bits() + CRC_DELIMITER;
        self.split(head, fast, TAIL - CRC_DELIMITER + INTERMISSION)
    }

    /// Bits on the bus with the largest number of stuff bits for this format.
    ///
    /// A stuff bit follows five equal bits and can begin the next five: at most one for each four
    /// bits after the first. Classic frames are stuffed up to the CRC, FD frames up to the data:
    /// the CRC of FD has fixed stuff bits.
    pub const fn worst_bits(&self) -> WireBits {
        let (plain, head) = (self.bits(), self.head_bits());
        if self.error {
            // Error flags of several nodes overlap to at most 12 bits.
            return WireBits::nominal(12 + 8 + INTERMISSION);
        }
        if !self.fd {
            let stuffed = head + 8 * self.carried() + CLASSIC_CRC;
            return WireBits::nominal(plain.nominal + (stuffed - 1) / 4);
        }
        let all = (head + FD_CONTROL + 8 * self.carried() - 1) / 4;
        if self.brs {
            let slow = (head - 1) / 4;
            WireBits {
                nominal: plain.nominal + slow,
                data: plain.data + all - slow,
            }
        } else {
            WireBits::nominal(plain.nominal + all)
        }
    }

    const fn max_data(&self) -> usize {
        if self.fd { MAX_DATA } else { MAX_CLASSIC_DATA }
    }

    /// Data bytes on the wire.
    const fn carried(&self) -> u32 {
        if self.remote { 0 } else { self.len as u32 }
    }

    /// Bits from start of frame up to and including the data length code (classic) or the bit rate
    /// switch (FD).
    ///
    /// Base: SOF 1, identifier 11, RTR or RRS 1, IDE 1; extended adds SRR 1 and 18 identifier bits.
    /// Then classic: r0 1 (extended: r1 too), DLC 4; FD: FDF 1, res 1, BRS 1.
    const fn head_bits(&self) -> u32 {
        match (self.extended, self.fd) {
            (false, false) => 14 + 1 + 4,
            (true, false) => 14 + 19 + 2 + 4,
            (false, true) => 14 + 3,
            (true, true) => 14 + 19 + 3,
        }
    }

    /// Stuff count 4 and CRC 17 (above 16 bytes: 21); a fixed stuff bit before each four of these.
    const fn fd_crc_bits(&self) -> u32 {
        let bits: u32 = if self.len <= 16 { 4 + 17 } else { 4 + 21 };
        bits + bits.div_ceil(4)
    }

    const fn split(&self, head: u32, fast: u32, tail: u32) -> WireBits {
        if self.brs {
            WireBits {
                nominal: head + tail,
                data: fast,
            }
        } else {
            WireBits::nominal(head + fast + tail)
        }
    }
}

const CLASSIC_CRC: u32 = 15;
/// ESI 1, DLC 4.
const FD_CONTROL: u32 = 5;
const CRC_DELIMITER: u32 = 1;
/// CRC delimiter 1, acknowledge 1, its delimiter 1, end of frame 7.
const TAIL: u32 = 10;
const INTERMISSION: u32 = 3;

/// Bits at each of the two rates; without bit rate switch, all are at the nominal rate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WireBits {
    /// At the nominal rate.
    pub nominal: u32,
    /// At the rate of the data phase. Bits in which the rate changes (BRS, CRC delimiter) count at
    /// the rate with which they begin.
    pub data: u32,
}

impl WireBits {
    const fn nominal(bits: u32) -> Self {
        Self {
            nominal: bits,
            data: 0,
        }
    }

    /// Time on the bus, ns, rounded up; rates in bit/s. A rate of 0 counts as 1.
    pub const fn duration_ns(self, nominal_bit_s: u32, data_bit_s: u32) -> u64 {
        time_ns(self.nominal, nominal_bit_s) + time_ns(self.data, data_bit_s)
    }
}

const fn time_ns(bits: u32, bit_s: u32) -> u64 {
    let rate = if bit_s == 0 { 1 } else { bit_s as u64 };
    (bits as u64 * 1_000_000_000).div_ceil(rate)
}

/// The data length code of exactly this many bytes.
pub const fn dlc(length: usize) -> Option<u8> {
    let mut code = 0;
    while code < LENGTHS.len() {
        if LENGTHS[code] as usize == length {
            return Some(code as u8);
        }
        code += 1;
    }
    None
}

/// The next length that has a data length code; at most 64.
pub const fn padded_length(length: usize) -> usize {
    let mut code = 0;
    while code < LENGTHS.len() {
        if LENGTHS[code] as usize >= length {
            return LENGTHS[code] as usize;
        }
        code += 1;
    }
    MAX_DATA
}
