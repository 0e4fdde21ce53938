//! How fast frames may follow each other: no faster than the bus carries them, and with a share of its time left to others.
//!
//! A virtual bus takes frames as fast as they are written, and its receivers lose what they cannot read in time, in
//! silence. A real one has a transmit queue that is soon full, and nodes that a sender without pause shuts out.

use skyloop_protocols::can::CanFrame;
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
    /// From the start of this frame to when the next may follow: its bits, stuffed as badly as can be, over the load.
    #[must_use]
    pub fn duration(&self, frame: &CanFrame) -> Duration {
        let bits = frame.worst_bits();
        let bus = Duration::from_nanos(bits.duration_ns(self.bitrate, self.data_bitrate));
        bus.div_f64(self.load)
    }

    /// Time of a whole packet of `length` octets that goes by ISO-TP (ISO 15765-2, 9.6), without the answers of the other
    /// end. Attitudes, short commands and Acks go as plain frames, in less.
    #[must_use]
    pub fn packet_duration(&self, length: usize, fd: bool) -> Duration {
        let (most, single) = if fd { (64, 62) } else { (8, 7) };
        let of = |octets: usize| {
            let octets = if fd {
                skyloop_protocols::can::frame::padded_length(octets)
            } else {
                8
            };
            let frame = CanFrame::new(0, fd, &[0; 64][..octets.max(8)]);
            frame.map_or(Duration::ZERO, |frame| self.duration(&frame))
        };
        if length <= single {
            return of(length + 2);
        }
        // The first frame carries two octets less than a frame has, each of the others one less.
        let rest = length - (most - 2);
        let (whole, last) = (rest / (most - 1), rest % (most - 1));
        let whole = u32::try_from(1 + whole).unwrap_or(u32::MAX);
        of(most) * whole
            + if last > 0 {
                of(last + 1)
            } else {
                Duration::ZERO
            }
    }
}

/// When the next frame may go.
#[derive(Debug)]
pub struct Pace {
    rates: Rates,
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

    /// How long this frame keeps the bus from us.
    #[must_use]
    pub fn duration(&self, frame: &CanFrame) -> Duration {
        self.rates.duration(frame)
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
        // X-Val: Davis et al. 2007, eq. 2: (55 + 10 n) bits for 11-bit identifiers; 135 for n = 8.
        let frame = CanFrame::new(0x123, false, &[0; 8]).unwrap();
        assert_eq!(CLASSIC.duration(&frame), Duration::from_micros(135));
        let half = Rates {
            load: 0.5,
            ..CLASSIC
        };
        assert_eq!(half.duration(&frame), Duration::from_micros(270));
    }

    #[test]
    fn a_packet_takes_its_segments() {
        let single = CLASSIC.packet_duration(7, false);
        assert_eq!(single, Duration::from_micros(135));
        // 1400 octets: 6 in the first frame, 1394 in 200 of seven (the last of them with one octet).
        let long = CLASSIC.packet_duration(1400, false);
        assert_eq!(long, Duration::from_micros(201 * 135));
        // FD: 62, then 21 of 63 and one with 15, in 16 octets: shorter than a whole one.
        let frame = CanFrame::new(0, true, &[0; 64]).unwrap();
        let (fd, whole) = (FD.packet_duration(1400, true), FD.duration(&frame));
        assert!(whole * 22 < fd && fd < whole * 23, "{fd:?} {whole:?}");
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
        assert!((0.133..0.137).contains(&took), "{took}");
        // After a long silence only the credit is used up at once: 8 frames.
        now += Duration::from_secs(5);
        let at_once = (0..100).take_while(|_| {
            let free = pace.until(now).is_none();
            pace.sent(&frame, now);
            free
        });
        assert_eq!(at_once.count(), 8);
    }
}
