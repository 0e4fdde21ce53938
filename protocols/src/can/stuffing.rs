//! Number of stuff bits of a frame: after five equal bits a transmitter inserts the opposite bit
//! (ISO 11898-1, 10.5).

use crate::can::frame::{CanFrame, WireBits, dlc};

/// Polynomial of the classic CRC (ISO 11898-1, 10.4.2.6):
/// x^15 + x^14 + x^10 + x^8 + x^7 + x^4 + x^3 + 1.
const CRC_15: u16 = 0x4599;

impl CanFrame {
    /// Bits on the bus with the stuff bits of this content. Error frames have none.
    pub fn exact_bits(&self) -> WireBits {
        let mut bits = self.bits();
        if self.error {
            return bits;
        }
        let mut run = Run::default();
        self.put_head(&mut run);
        // FD frames with bit rate switch continue at the second rate.
        let slow = run.stuffed;
        self.put_data(&mut run);
        if !self.fd {
            let crc = run.crc;
            run.put(crc.into(), 15);
        }
        if self.brs {
            bits.nominal += slow;
            bits.data += run.stuffed - slow;
        } else {
            bits.nominal += run.stuffed;
        }
        bits
    }

    /// From the start of frame to the bit rate switch (FD) or the end of r0 (classic).
    fn put_head(&self, run: &mut Run) {
        let rtr = u32::from(self.remote);
        run.put(0, 1);
        if self.extended {
            // SRR and IDE, recessive, between the two parts of the identifier.
            run.put(self.id >> 18, 11);
            run.put(0b11, 2);
            run.put(self.id & 0x3_FFFF, 18);
            run.put(rtr, 1);
        } else {
            run.put(self.id, 11);
            run.put(rtr, 1);
            run.put(0, 1);
        }
        if self.fd {
            // FDF, res, BRS.
            run.put(0b100 | u32::from(self.brs), 3);
        } else {
            run.put(0, if self.extended { 2 } else { 1 });
        }
    }

    fn put_data(&self, run: &mut Run) {
        if self.fd {
            // ESI: error active.
            run.put(0, 1);
        }
        run.put(dlc(self.len.into()).unwrap_or(0).into(), 4);
        for byte in self.payload() {
            run.put((*byte).into(), 8);
        }
    }
}

/// State of the bit stuffing.
#[derive(Default)]
struct Run {
    last: bool,
    /// Successive equal bits, stuff bits included; 0 before the first.
    equal: u32,
    stuffed: u32,
    crc: u16,
}

impl Run {
    /// The low `count` bits of `value`, the highest first.
    fn put(&mut self, value: u32, count: u32) {
        for bit in (0..count).rev() {
            self.put_bit(value >> bit & 1 == 1);
        }
    }

    fn put_bit(&mut self, bit: bool) {
        let feedback = bit != (self.crc >> 14 & 1 == 1);
        self.crc = self.crc << 1 & 0x7FFF;
        if feedback {
            self.crc ^= CRC_15;
        }
        self.equal = if self.equal > 0 && bit == self.last {
            self.equal + 1
        } else {
            1
        };
        self.last = bit;
        if self.equal == 5 {
            self.stuffed += 1;
            (self.last, self.equal) = (!bit, 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(id: u32, fd: bool, data: &[u8]) -> CanFrame {
        CanFrame::new(id, fd, data).unwrap()
    }

    fn run(value: u32, count: u32) -> Run {
        let mut run = Run::default();
        run.put(value, count);
        run
    }

    #[test]
    fn crc_has_the_published_check_value() {
        let mut run = Run::default();
        for byte in b"123456789" {
            run.put((*byte).into(), 8);
        }
        // X-Val: CRC-15/CAN of the CRC catalogue (reveng): check value of "123456789".
        assert_eq!(run.crc, 0x059E);
    }

    #[test]
    fn stuff_bits_are_counted_and_stay_within_the_worst_case() {
        // By hand: of equal bits the first five and then each four are followed by a stuff bit.
        assert_eq!(run(0, 15).stuffed, 3);
        assert_eq!(run(0x5555_5555, 32).stuffed, 0);
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state
        };
        for case in 0..4000 {
            let bytes: [u8; 8] = core::array::from_fn(|_| match random() {
                // Zeros are frequent, so that bits are stuffed.
                state if state >> 30 == 0 => 0,
                state => (state >> 16) as u8,
            });
            let (fd, length) = (case % 2 == 1, [0, 1, 7, 8][case / 2 % 4]);
            let frame = frame(random() >> 21, fd, &bytes[..length]);
            let bits = [frame.bits(), frame.exact_bits(), frame.worst_bits()];
            for bits in [bits.map(|bits| bits.nominal), bits.map(|bits| bits.data)] {
                assert!(bits.is_sorted(), "{frame:?}");
            }
        }
        let zeros = frame(0, false, &[0; 8]);
        // Of 83 bits of head and data, all but one are 0.
        assert!(zeros.exact_bits().nominal > zeros.bits().nominal + 15);
    }
}
