//! Client side of credit: frame packets granted, so that no buffer overflows.
//!
//! The grant is cumulative: frame packets sent by the emulator, plus a window. Lost packets count
//! as sent; gaps in their sequence counts reveal them, and after a silence a `Status` does.

use std::time::{Duration, Instant};

use skyloop_protocols::credit::CREDITED_APIDS;
use skyloop_protocols::packet::SEQUENCE_MODULUS;

/// On slow links a grant goes out with the first packet after this time, because the emulator mutes
/// silent clients.
const GRANT_AFTER: Duration = Duration::from_millis(250);

#[derive(Clone, Debug)]
pub(crate) struct Pacing {
    window: u32,
    /// Frame packets sent by the emulator, as known from arrivals and gaps, modulo 2^32.
    sent: u32,
    granted: u32,
    renewed: Instant,
    next: [Option<u16>; CREDITED_APIDS.len()],
    missing: u64,
    /// Losses reported by a `Status` but not yet by sequence counts.
    reported: u32,
}

impl Pacing {
    pub(crate) fn new(window: u32) -> Self {
        let window = window.max(1);
        Self {
            window,
            sent: 0,
            granted: window,
            renewed: Instant::now(),
            next: [None; CREDITED_APIDS.len()],
            missing: 0,
            reported: 0,
        }
    }

    pub(crate) fn missing(&self) -> u64 {
        self.missing
    }

    /// Records an arrival. Returns whether a new grant is due.
    pub(crate) fn arrived(&mut self, apid: u16, sequence_count: u16) -> bool {
        let Some(row) = CREDITED_APIDS.iter().position(|paid| *paid == apid) else {
            return false;
        };
        let next = &mut self.next[row];
        let ahead = next.map_or(0, |next| sequence_count.wrapping_sub(next));
        let ahead = ahead % SEQUENCE_MODULUS;
        if ahead >= SEQUENCE_MODULUS / 2 {
            // Late or repeated: already recorded as a gap or an arrival.
            return false;
        }
        *next = Some((sequence_count + 1) % SEQUENCE_MODULUS);
        // The emulator sends no more than was granted; a larger gap is a restarted counter.
        let unused = self.granted.wrapping_sub(self.sent);
        let ahead = Some(u32::from(ahead));
        let lost = ahead.filter(|lost| *lost < unused.saturating_add(self.reported));
        let lost = lost.unwrap_or(0);
        // Losses reported by a Status are recorded already.
        let already_counted = self.reported.min(lost + 1);
        self.reported -= already_counted;
        if already_counted > lost {
            self.missing = self.missing.saturating_sub(1);
        } else {
            self.missing += u64::from(lost - already_counted);
        }
        self.sent = self.sent.wrapping_add(lost + 1 - already_counted);
        let enough = if self.renewed.elapsed() >= GRANT_AFTER {
            1
        } else {
            (self.window / 4).max(1)
        };
        self.target().wrapping_sub(self.granted) >= enough
    }

    /// Takes the count of sent packets from a `Status`. Packets sent and not received count as
    /// missing. Returns whether this changes the state.
    ///
    /// This frees a link after the loss of a whole window, which leaves no gap.
    pub(crate) fn rebase(&mut self, packets_sent: u32) -> bool {
        let lost = packets_sent.wrapping_sub(self.sent);
        let changes = (1..=self.granted.wrapping_sub(self.sent)).contains(&lost);
        if changes {
            self.missing += u64::from(lost);
            self.sent = packets_sent;
            // Without a known sequence count, no gap will report these packets.
            if self.next.iter().any(Option::is_some) {
                self.reported += lost;
            }
        }
        changes
    }

    /// Drops the state of an incomplete frame: the next `Status` is the new base.
    pub(crate) fn forget(&mut self) {
        self.next = [None; CREDITED_APIDS.len()];
        self.reported = 0;
    }

    /// The cumulative grant to send now; it is recorded as sent.
    pub(crate) fn renew(&mut self) -> u32 {
        (self.granted, self.renewed) = (self.target(), Instant::now());
        self.granted
    }

    fn target(&self) -> u32 {
        let target = self.sent.wrapping_add(self.window);
        // Grants are never withdrawn.
        if (target.wrapping_sub(self.granted) as i32) > 0 {
            target
        } else {
            self.granted
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skyloop_protocols::apid::{PIXEL_BLOCK, STATUS};

    #[test]
    fn the_window_follows_arrivals_and_losses() {
        let mut pacing = Pacing::new(8);
        assert_eq!(pacing.renew(), 8);
        assert!(!pacing.arrived(PIXEL_BLOCK, 16_382));
        assert!(pacing.arrived(PIXEL_BLOCK, 16_383));
        assert_eq!(pacing.renew(), 10);
        // Counts 0 to 2 are missing: five were sent with this one; a late one changes nothing.
        assert!(pacing.arrived(PIXEL_BLOCK, 3));
        assert!(!pacing.arrived(PIXEL_BLOCK, 1));
        assert_eq!((pacing.renew(), pacing.missing()), (14, 3));
        assert!(!pacing.arrived(STATUS, 77));
    }

    #[test]
    fn slow_packets_get_a_grant_each() {
        let mut pacing = Pacing::new(64);
        for packet in 0..3 {
            assert!(!pacing.arrived(PIXEL_BLOCK, 2 * packet), "within 0.25 s");
            pacing.renewed = Instant::now().checked_sub(GRANT_AFTER).unwrap();
            assert!(pacing.arrived(PIXEL_BLOCK, 2 * packet + 1));
            assert_eq!(pacing.renew(), 64 + 2 * u32::from(packet) + 2);
        }
    }

    #[test]
    fn a_status_frees_a_link_that_lost_a_whole_window() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 0);
        pacing.rebase(8);
        assert_eq!((pacing.renew(), pacing.missing()), (16, 7));
        // Recorded losses are no gap.
        pacing.arrived(PIXEL_BLOCK, 8);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 7));
        // Counters beyond the grant, or below the known one, are ignored.
        pacing.rebase(1000);
        pacing.rebase(2);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 7));
    }

    #[test]
    fn resent_packets_count_once() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 0);
        // Seven are lost. Two are requested and arrive: one before a Status reports the loss, one
        // after.
        pacing.arrived(PIXEL_BLOCK, 1);
        assert!(pacing.rebase(8));
        pacing.arrived(PIXEL_BLOCK, 2);
        assert_eq!((pacing.renew(), pacing.missing()), (16, 5));
        // Late, in any order.
        pacing.arrived(PIXEL_BLOCK, 7);
        pacing.arrived(PIXEL_BLOCK, 4);
        assert_eq!((pacing.renew(), pacing.missing()), (16, 4));
        // The first packet of the next window.
        pacing.arrived(PIXEL_BLOCK, 8);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 4));
    }

    #[test]
    fn a_status_after_a_time_out_is_the_new_base() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 0);
        pacing.forget();
        assert!(pacing.rebase(8) && !pacing.rebase(8));
        pacing.arrived(PIXEL_BLOCK, 8);
        pacing.arrived(PIXEL_BLOCK, 9);
        assert_eq!((pacing.renew(), pacing.missing()), (18, 7));
    }

    #[test]
    fn restarted_counters_are_no_loss() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 9_000);
        pacing.arrived(PIXEL_BLOCK, 0);
        assert_eq!((pacing.renew(), pacing.missing()), (10, 0));
    }

    #[test]
    fn the_grant_wraps_around() {
        let mut pacing = Pacing {
            sent: u32::MAX - 1,
            granted: 6,
            ..Pacing::new(8)
        };
        assert!(!pacing.arrived(PIXEL_BLOCK, 0));
        assert!(pacing.arrived(PIXEL_BLOCK, 1));
        assert_eq!(pacing.renew(), 8);
    }
}
