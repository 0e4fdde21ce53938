//! Spacing of frames: at most the rate of the bus, with a share of its time left to other nodes.
//!
//! A virtual bus accepts frames at any speed, and its receivers silently lose what they cannot read
//! in time. A real one has a small transmit queue, and a sender without pauses blocks other nodes.

use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::frame::{WireBits, padded_length};
use std::time::{Duration, Instant};

/// How early a frame may be sent, to make up for an earlier sleep that lasted too long.
const CREDIT: Duration = Duration::from_millis(1);

/// Bit rates of a bus and the share of its time that one sender takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Bit rate, of FD frames in the arbitration phase, bit/s.
    pub bitrate: u32,
    /// Bit rate in the data phase of FD frames, bit/s.
    pub data_bitrate: u32,
    /// Share of the bus time, above 0, at most 1.
    pub load: f64,
}

impl Rates {
    /// Time from this frame to the next one: its time with stuff bits, over the load.
    #[must_use]
    pub fn duration(&self, frame: &CanFrame) -> Duration {
        self.time(frame.exact_bits())
    }

    fn time(&self, bits: WireBits) -> Duration {
        let bus = Duration::from_nanos(bits.duration_ns(self.bitrate, self.data_bitrate));
        bus.div_f64(self.load)
    }

    /// Time of a frame with this many bytes of random data: one stuff bit in 31 bits (at worst, one
    /// in four).
    fn usual_time(&self, bytes: usize, fd: bool) -> Duration {
        let Some(frame) = CanFrame::new(0, fd, &[0; 64][..bytes.min(64)]) else {
            return Duration::ZERO;
        };
        let (min, max) = (self.time(frame.bits()), self.time(frame.worst_bits()));
        min + max.saturating_sub(min) * 4 / 31
    }

    /// Time of a packet of `length` bytes by ISO-TP (ISO 15765-2, 9.6), without flow control.
    /// Attitudes, short commands and Acks are plain frames and take less.
    #[must_use]
    pub fn packet_duration(&self, length: usize, fd: bool) -> Duration {
        // FD frames of more than 8 bytes are padded to the next valid length.
        let of = |bytes: usize| self.usual_time(padded_length(bytes), fd);
        let (max, single) = if fd { (64, 62) } else { (8, 7) };
        if length <= single {
            let head = if length <= 7 { 1 } else { 2 };
            return of(head + length);
        }
        // The first frame carries two bytes less than its capacity, each other one byte less.
        let rest = length - (max - 2);
        let (whole, last) = (rest / (max - 1), rest % (max - 1));
        let whole = of(max) * u32::try_from(1 + whole).unwrap_or(u32::MAX);
        match last {
            0 => whole,
            last => whole + of(last + 1),
        }
    }
}

/// Time of the next frame.
#[derive(Debug)]
pub struct Pace {
    pub(super) rates: Rates,
    free: Instant,
}

impl Pace {
    /// A pace whose first frame may be sent at once.
    #[must_use]
    pub fn new(rates: Rates) -> Pace {
        Pace {
            rates,
            free: Instant::now(),
        }
    }

    /// When the next frame may be sent; `None`: now.
    #[must_use]
    pub fn until(&self, now: Instant) -> Option<Instant> {
        (self.free > now).then_some(self.free)
    }

    /// Records a frame that is sent now.
    pub fn sent(&mut self, frame: &CanFrame, now: Instant) {
        let earliest = now.checked_sub(CREDIT).unwrap_or(now);
        self.free = self.free.max(earliest) + self.rates.duration(frame);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CLASSIC: Rates = Rates {
        bitrate: 1_000_000,
        data_bitrate: 1_000_000,
        load: 1.0,
    };
    const FD: Rates = Rates {
        bitrate: 1_000_000,
        data_bitrate: 8_000_000,
        load: 0.5,
    };

    #[test]
    fn frame_time_is_bits_over_load() {
        // By hand: 111 bits with 8 data bytes and intermission; with 0x55 only header and CRC need
        // stuff bits.
        let frame = CanFrame::new(0x555, false, &[0x55; 8]).unwrap();
        let took = CLASSIC.duration(&frame);
        assert!((111..116).contains(&took.as_micros()), "{took:?}");
        let half = Rates {
            load: 0.5,
            ..CLASSIC
        };
        assert_eq!(half.duration(&frame), 2 * took);
    }

    #[test]
    fn packet_time_is_the_sum_of_its_segments() {
        // Davis et al. 2007, eq. 2: at worst 135 bits, 24 above 111; four in 31 of these: 114.1
        // bits.
        let single = CLASSIC.packet_duration(7, false);
        assert_eq!(single.as_nanos(), 114_096);
        // 1400 bytes: 6 in the first frame, 1394 in 199 of seven and one of one byte (64.5 bits).
        let last = CLASSIC.usual_time(2, false);
        assert_eq!(last.as_nanos(), 64_548);
        assert_eq!(CLASSIC.packet_duration(1400, false), single * 200 + last);
        // FD: 62, then 21 of 63 and one of 15, padded to 16 bytes.
        let whole = FD.usual_time(64, true);
        let fd = FD.packet_duration(1400, true);
        assert_eq!(fd, whole * 22 + FD.usual_time(16, true));
        // A single frame has one byte of header up to 7 bytes, two up to 62, and is padded up to
        // 64.
        assert_eq!(FD.packet_duration(7, true), FD.usual_time(8, true));
        assert_eq!(FD.packet_duration(62, true), whole);
    }

    #[test]
    fn pace_follows_the_bus_rate_and_catches_up_to_a_limit() {
        let frame = CanFrame::new(0x123, false, &[0; 8]).unwrap();
        let mut pace = Pace::new(CLASSIC);
        let begin = Instant::now();
        let mut now = begin;
        for _ in 0..1000 {
            if let Some(free) = pace.until(now) {
                // Every sleep lasts 300 us too long.
                now = free + Duration::from_micros(300);
            }
            pace.sent(&frame, now);
        }
        let took = (now - begin).as_secs_f64();
        let bus = CLASSIC.duration(&frame).as_secs_f64() * 1000.0;
        assert!((took / bus - 1.0).abs() < 0.02, "{took} {bus}");
        // After a long silence only the credit of 1 ms is used at once.
        now += Duration::from_secs(5);
        let at_once = (0..100).take_while(|_| {
            let free = pace.until(now).is_none();
            pace.sent(&frame, now);
            free
        });
        assert!((8..=9).contains(&at_once.count()));
    }
}
