//! Spacing of frames: no faster than the bus carries them, with a share of its time left to others.
//!
//! A virtual bus takes frames at any speed, and its receivers silently lose what they cannot read
//! in time. A real one has a small transmit queue, and a sender without pauses blocks other nodes.

use skyloop_protocols::can::CanFrame;
use skyloop_protocols::can::frame::{WireBits, padded_length};
use std::time::{Duration, Instant};

/// How much earlier than its time a frame may go, to make up for sleeping too long before.
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
    /// Time from this frame to the next one: its bits, stuff bits included, over the load.
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
        let (least, most) = (self.time(frame.bits()), self.time(frame.worst_bits()));
        least + most.saturating_sub(least) * 4 / 31
    }

    /// Time of a packet of `length` bytes by ISO-TP (ISO 15765-2, 9.6), without flow control.
    /// Attitudes, short commands and Acks go as plain frames, in less.
    #[must_use]
    pub fn packet_duration(&self, length: usize, fd: bool) -> Duration {
        // FD frames of more than 8 bytes are padded to the next valid length.
        let of = |bytes: usize| self.usual_time(padded_length(bytes), fd);
        let (most, single) = if fd { (64, 62) } else { (8, 7) };
        if length <= single {
            let head = if length <= 7 { 1 } else { 2 };
            return of(head + length);
        }
        // The first frame carries two octets less than a frame has, each of the others one less.
        let rest = length - (most - 2);
        let (whole, last) = (rest / (most - 1), rest % (most - 1));
        let whole = of(most) * u32::try_from(1 + whole).unwrap_or(u32::MAX);
        match last {
            0 => whole,
            last => whole + of(last + 1),
        }
    }
}

/// When the next frame may go.
#[derive(Debug)]
pub struct Pace {
    pub(super) rates: Rates,
    free: Instant,
}

impl Pace {
    /// At once.
    #[must_use]
    pub fn new(rates: Rates) -> Pace {
        Pace {
            rates,
            free: Instant::now(),
        }
    }

    /// When the next frame may go; `None`: now.
    #[must_use]
    pub fn until(&self, now: Instant) -> Option<Instant> {
        (self.free > now).then_some(self.free)
    }

    /// Books a frame that goes now.
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
    fn a_frame_takes_its_bits_over_the_load() {
        // By hand: 111 bits with 8 data octets, intermission included; 0x55 leaves nothing to stuff but in head and CRC.
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
    fn a_packet_takes_its_segments() {
        // 111 bits and of the 24 that Davis et al. 2007, eq. 2, add at worst (135) four in 31: 114.1.
        let single = CLASSIC.packet_duration(7, false);
        assert_eq!(single.as_nanos(), 114_096);
        // 1400 octets: 6 in the first frame, 1394 in 199 of seven and one with one: 8 + 1 octets, 64.5 bits in the same way.
        let last = CLASSIC.usual_time(2, false);
        assert_eq!(last.as_nanos(), 64_548);
        assert_eq!(CLASSIC.packet_duration(1400, false), single * 200 + last);
        // FD: 62, then 21 of 63 and one with 15, in 16 octets: shorter than a whole one.
        let whole = FD.usual_time(64, true);
        let fd = FD.packet_duration(1400, true);
        assert_eq!(fd, whole * 22 + FD.usual_time(16, true));
        // A single frame of up to 7 octets has one octet of head, one of up to 62 two, and is filled up to 64.
        assert_eq!(FD.packet_duration(7, true), FD.usual_time(8, true));
        assert_eq!(FD.packet_duration(62, true), whole);
    }

    #[test]
    fn frames_go_at_the_rate_of_the_bus_and_lost_time_is_made_up_for_to_a_limit() {
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
        // After a long silence only the credit is used up at once: 1 ms.
        now += Duration::from_secs(5);
        let at_once = (0..100).take_while(|_| {
            let free = pace.until(now).is_none();
            pace.sent(&frame, now);
            free
        });
        assert!((8..=9).contains(&at_once.count()));
    }
}
