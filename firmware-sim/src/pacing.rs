//! Client side of pacing: how many frame packets are granted, so that no buffer overflows.
//!
//! The grant is cumulative: frame packets that have left the emulator, plus a window. Lost packets
//! count too: gaps in their sequence counts show them, and after a silence a `Status` does.

use std::time::{Duration, Instant};

use skyloop_protocols::credit::PAID;
use skyloop_protocols::packet::SEQUENCE_MODULUS;

/// On slow links a grant goes out with the first packet after this time: the emulator mutes clients
/// that stay silent.
const GRANT_AFTER: Duration = Duration::from_millis(250);

/// Credit granted against frame packets seen.
#[derive(Clone, Debug)]
pub(crate) struct Pacing {
    window: u32,
    /// Frame packets that have left the emulator, as far as arrivals and gaps tell, modulo 2^32.
    left: u32,
    granted: u32,
    /// When the last grant went out.
    renewed: Instant,
    /// The next sequence count of each paid APID.
    next: [Option<u16>; PAID.len()],
    /// Packets lost on the way.
    missing: u64,
    /// Packets that a `Status` has told of, and no sequence count yet.
    foretold: u32,
}

impl Pacing {
    pub(crate) fn new(window: u32) -> Self {
        let window = window.max(1);
        Self {
            window,
            left: 0,
            granted: window,
            renewed: Instant::now(),
            next: [None; PAID.len()],
            missing: 0,
            foretold: 0,
        }
    }

    /// Frame packets lost on the way so far.
    pub(crate) fn missing(&self) -> u64 {
        self.missing
    }

    /// Books an arrival; whether a new grant is due.
    pub(crate) fn arrived(&mut self, apid: u16, sequence_count: u16) -> bool {
        let Some(row) = PAID.iter().position(|paid| *paid == apid) else {
            return false;
        };
        let next = &mut self.next[row];
        let ahead = next.map_or(0, |next| sequence_count.wrapping_sub(next));
        let ahead = ahead % SEQUENCE_MODULUS;
        if ahead >= SEQUENCE_MODULUS / 2 {
            // Late or repeated: it was booked as a gap or as an arrival before.
            return false;
        }
        *next = Some((sequence_count + 1) % SEQUENCE_MODULUS);
        // The emulator cannot have sent more than was granted; a larger gap is a restarted count,
        // not a loss.
        let unused = self.granted.wrapping_sub(self.left);
        let ahead = Some(u32::from(ahead));
        let lost = ahead.filter(|lost| *lost < unused.saturating_add(self.foretold));
        let lost = lost.unwrap_or(0);
        // What a Status has told of has been booked, as lost.
        let told = self.foretold.min(lost + 1);
        self.foretold -= told;
        if told > lost {
            self.missing = self.missing.saturating_sub(1);
        } else {
            self.missing += u64::from(lost - told);
        }
        self.left = self.left.wrapping_add(lost + 1 - told);
        let enough = if self.renewed.elapsed() >= GRANT_AFTER {
            1
        } else {
            (self.window / 4).max(1)
        };
        self.target().wrapping_sub(self.granted) >= enough
    }

    /// Takes the emulator's count from a `Status`: packets that left it and have not arrived are
    /// lost, or requested. Whether that is news.
    ///
    /// This frees a link on which a whole window was lost, when no gap can show it.
    pub(crate) fn rebase(&mut self, packets_sent: u32) -> bool {
        let lost = packets_sent.wrapping_sub(self.left);
        let notices = (1..=self.granted.wrapping_sub(self.left)).contains(&lost);
        if notices {
            self.missing += u64::from(lost);
            self.left = packets_sent;
            // Where no count is known, none will tell of these packets.
            if self.next.iter().any(Option::is_some) {
                self.foretold += lost;
            }
        }
        notices
    }

    /// After a frame was given up: its packets will not come, and the next `Status` is the new
    /// base.
    pub(crate) fn forget(&mut self) {
        self.next = [None; PAID.len()];
        self.foretold = 0;
    }

    /// The cumulative grant to send now; it is booked as sent.
    pub(crate) fn renew(&mut self) -> u32 {
        (self.granted, self.renewed) = (self.target(), Instant::now());
        self.granted
    }

    fn target(&self) -> u32 {
        let target = self.left.wrapping_add(self.window);
        // Never back: a grant once given stands.
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
        // Counts 0 to 2 are missing: five have left in all with this one; a late one changes nothing.
        assert!(pacing.arrived(PIXEL_BLOCK, 3));
        assert!(!pacing.arrived(PIXEL_BLOCK, 1));
        assert_eq!((pacing.renew(), pacing.missing()), (14, 3));
        assert!(!pacing.arrived(STATUS, 77));
    }

    #[test]
    fn packets_that_come_slowly_are_granted_for_one_by_one() {
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
        // The losses are booked: they are no gap as well.
        pacing.arrived(PIXEL_BLOCK, 8);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 7));
        // Numbers beyond the grant, or behind, are no account of this exchange.
        pacing.rebase(1000);
        pacing.rebase(2);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 7));
    }

    #[test]
    fn packets_sent_again_are_not_counted_again() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 0);
        // Seven are lost; two of them come, asked for: one before a Status has told of them, one after.
        pacing.arrived(PIXEL_BLOCK, 1);
        assert!(pacing.rebase(8));
        pacing.arrived(PIXEL_BLOCK, 2);
        assert_eq!((pacing.renew(), pacing.missing()), (16, 5));
        // Behind, in whatever order.
        pacing.arrived(PIXEL_BLOCK, 7);
        pacing.arrived(PIXEL_BLOCK, 4);
        assert_eq!((pacing.renew(), pacing.missing()), (16, 4));
        // The next one of the window after.
        pacing.arrived(PIXEL_BLOCK, 8);
        assert_eq!((pacing.renew(), pacing.missing()), (17, 4));
    }

    #[test]
    fn a_frame_given_up_leaves_a_new_base() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 0);
        pacing.forget();
        assert!(pacing.rebase(8) && !pacing.rebase(8));
        pacing.arrived(PIXEL_BLOCK, 8);
        pacing.arrived(PIXEL_BLOCK, 9);
        assert_eq!((pacing.renew(), pacing.missing()), (18, 7));
    }

    #[test]
    fn a_count_that_starts_again_is_no_loss() {
        let mut pacing = Pacing::new(8);
        pacing.arrived(PIXEL_BLOCK, 9_000);
        pacing.arrived(PIXEL_BLOCK, 0);
        assert_eq!((pacing.renew(), pacing.missing()), (10, 0));
    }

    #[test]
    fn the_grant_goes_round_the_circle() {
        let mut pacing = Pacing {
            left: u32::MAX - 1,
            granted: 6,
            ..Pacing::new(8)
        };
        assert!(!pacing.arrived(PIXEL_BLOCK, 0));
        assert!(pacing.arrived(PIXEL_BLOCK, 1));
        assert_eq!(pacing.renew(), 8);
    }
}
